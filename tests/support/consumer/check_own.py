"""What a shape, a law, a method and a diagnostic of one's own do in a run: check_own.py PROGRAM, in an empty directory."""
import csv
import subprocess
import sys

#: a disk of radius 0.1 falls on the middle of a capsule whose surface is 0.05 above its segment
CASE = """&scene
  dimension = 2, gravity = 0.0, -10.0, bodies = 'file', bodies_file = 'disk.csv'
/
&boundary shape = 'capsule', name = 'bar', point = -1.0, 0.0, end = 1.0, 0.0, half_thickness = {thickness} /
&time step = 1e-3, steps = 200 /
&solver method = 'two_sweeps' /
&output directory = 'out', boundary_forces = .true., fastest = .true. /
"""
#: a law of one's own between the disk and the capsule: at 1 m/s its friction is a quarter
LAW = """&material name = 'glass' /
&law materials = 'glass', kind = 'saturated', friction = 0.5, reference_speed = 1.0 /
"""


def run(thickness, law="", disk="1,0.3,0.1501,0.1,2.0,0.0"):
    """Status and words of a run."""
    with open("case.nml", "w", encoding="utf-8") as case:
        case.write(CASE.format(thickness=thickness).replace("bodies_file", "wall_material = 'glass', bodies_file" if law else "bodies_file")
                   + law)
    with open("disk.csv", "w", encoding="utf-8") as bodies:
        bodies.write("id,x,y,radius,mass,vx\n" + disk + "\n")
    done = subprocess.run([sys.argv[1], "case.nml"], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def main():
    keys = subprocess.run([sys.argv[1], "--keys"], capture_output=True, text=True, check=True).stdout
    assert "'two_sweeps'" in keys and "`half_thickness`" in keys and "'capsule'" in keys and "`fastest`" in keys, "keys of one's own are listed"
    status, words = run(0.05)
    assert status == 0, words
    with open("out/history.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    last = rows[-1]
    assert abs(float(last["force_y:bar"]) + 20.0) < 1e-9, f"the capsule carries the weight: {last['force_y:bar']} N"
    speeds = [float(row["fastest_grain"]) for row in rows]
    energies = [float(row["kinetic_energy"]) for row in rows]
    assert max(speeds) > 0.0 and all(abs(speed**2 - energy) < 1e-12 for speed, energy in zip(speeds, energies)), \
        "the diagnostic of one's own has the speed of the disk of 2 kg, which does not turn"
    assert sum(int(row["iterations"]) for row in rows) > 0, "the method of one's own solved the impact"
    assert float(last["kinetic_energy"]) < 1e-12, f"the disk rests: {last['kinetic_energy']} J"
    status, words = run(0.05, LAW, "1,0.3,0.15,0.1,2.0,1.0")
    assert status == 0, words
    with open("out/history.csv", encoding="utf-8") as file:
        first = next(csv.DictReader(file))
    assert abs(float(first["force_x:bar"]) / 20.0 - 0.25) < 1e-9, f"friction of one's own law: {first['force_x:bar']} N of 20 N"
    status, words = run(-0.05)
    assert status == 2 and "half_thickness" in words and "Backtrace" not in words, words
    print("own extensions: done")


if __name__ == "__main__":
    main()
