"""The files of an imported case, whole or not at all."""
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from datbox_text import Refused
from gravier.case import namelist
from one_line import plain

from whole_file import Misplaced, check_place, give_names, hdf5_file

#: what its bodies files say of their origin, and the first words of its text files after the mark of a comment
PROGRAM = "gravier_import"
MADE = f"made by {PROGRAM} from"
#: first line of the table of contacts, which has no comment since other programs read it
CONTACTS = "candidate,contactor,antagonist,other,status,gap,force_n,force_t,force_s,nx,ny,nz,fx,fy,fz\n"


def write_bodies(case, path):
    """The bodies file; grains without a number get one."""
    d = case.dimension
    taken = {grain.identifier for grain in case.grains}
    later = max(len(case.bodies), *(i for i in taken if i)) + 1
    for grain in case.grains:
        if grain.identifier is None:
            grain.identifier, later = later, later + 1
    spins, names = 3 * d - 3, list(case.shapes.values())
    with hdf5_file(path, PROGRAM) as file:
        file["bodies/id"] = np.array([grain.identifier for grain in case.grains], dtype=np.int64)
        file["bodies/position"] = np.array([grain.position for grain in case.grains])
        file["bodies/radius"] = np.array([grain.radius for grain in case.grains])
        file["bodies/mass"] = np.array([grain.mass for grain in case.grains])
        file["bodies/velocity"] = np.array([np.zeros(spins) if grain.velocity is None else grain.velocity for grain in case.grains])
        file["bodies/material"] = np.array([1 + case.laws.materials.index(grain.material) for grain in case.grains], dtype=np.int64)
        if case.shapes:
            file["bodies/shape"] = np.array([1 + names.index(grain.shape) if grain.shape else 0 for grain in case.grains], dtype=np.int64)
            file["bodies/shape"].attrs["names"] = np.bytes_(",".join(names))
            plain_turn = [0.0] if d == 2 else [1.0, 0.0, 0.0, 0.0]
            file["bodies/orientation"] = np.array([plain_turn if grain.orientation is None else grain.orientation for grain in case.grains])
        if any(grain.group for grain in case.grains):
            file["bodies/group"] = np.array([grain.group for grain in case.grains], dtype=np.int64)
        if case.start:
            case.start.write(file)


def texts_of(case, stem, options, contacts):
    """The text files as {ending of the name: text}, with names that begin with `stem` in the case."""
    d, made, origin = case.dimension, {}, f"{MADE} {plain(options.datbox)}\n"
    scene = {"title": f"imported from {options.datbox}", "dimension": d, "gravity": list(case.gravity[:d]), "bodies": "file",
             "bodies_file": stem + ".h5", "alert_distance": max(case.laws.used)}
    if case.shapes:
        scene["shapes"] = stem + ".shapes"
        made[".shapes"] = f"# {origin}" + "".join(f"shape {name}\n{text}" for text, name in case.shapes.items())
    if options.period:
        scene["period"] = options.period
    parts = [namelist({"scene": scene}), *(namelist({"material": {"name": name}}) for name in case.laws.materials),
             *(namelist({"law": {"materials": names, **keys}}) for names, keys in case.laws.met.items())]
    tables = {}
    for keys, columns in case.boundaries:
        if columns:
            times = np.unique(np.concatenate([function.table[:, 0] for function in columns.values()]))
            text = "time," + ",".join(columns) + "\n" + "".join(
                ",".join(repr(float(x)) for x in row) + "\n"
                for row in np.stack([times, *(function.at(times) for function in columns.values())], axis=1))
            ending = tables.setdefault(text, f"_drive_{len(tables) + 1}.csv")
            made[ending] = f"# {origin}{text}"
            keys = {**keys, "table": stem + ending}
        parts.append(namelist({"boundary": keys}))
    parts.append(namelist({"time": {"step": options.step, "steps": options.steps},
                           "output": {"directory": stem + "_results", "every": max(1, options.steps // 10)}}))
    made[".nml"] = f"! {origin}" + "\n".join(parts)
    if contacts is not None:
        made["_contacts.csv"] = CONTACTS + "".join(
            ",".join(str(cell) for cell in contact.row()) + "\n" for contact in contacts)
    return made


def own_beginning(ending):
    """What check_place looks for in a file of this program whose name ends so."""
    return PROGRAM if ending == ".h5" else CONTACTS.encode() if ending == "_contacts.csv" else f"[!#] {MADE} ".encode()


def write_files(case, stem, options, contacts):
    """Write everything into a directory beside the final names, let `gravier --check` read it there, and then give the files their names:
    what is there is whole, and is a case. Returns the names. Files that are there are replaced where this program has made them."""
    try:
        for ending in (".h5", *texts_of(case, stem, options, contacts)):
            check_place(stem + ending, {Path(stem + ending).suffix: own_beginning(ending)})
    except Misplaced as refused:
        raise Refused(f"--out {stem}: {refused}") from None
    folder, name = os.path.split(stem)
    with tempfile.TemporaryDirectory(prefix=".gravier_import-", dir=folder or ".") as draft:
        write_bodies(case, os.path.join(draft, name + ".h5"))
        for ending, text in texts_of(case, name, options, contacts).items():
            Path(draft, name + ending).write_text(text, encoding="utf-8")
        check(case, draft, name + ".nml", stem + ".nml")
        made = texts_of(case, stem, options, contacts)
        Path(draft, name + ".nml").write_text(made[".nml"], encoding="utf-8")
        made = [".h5", *made]
        # the case comes last: where it is there, so is what it names
        give_names({stem + ending: os.path.join(draft, name + ending) for ending in sorted(made, key=".nml".__eq__)})
    return [stem + ending for ending in made]


def find_program():
    """The program that reads cases: that of the environment, or the one beside this script or in PATH; None where there is none."""
    beside = [os.path.dirname(path) for path in (os.path.abspath(__file__), os.path.realpath(__file__), os.path.abspath(sys.argv[0]))]
    wanted = os.environ.get("GRAVIER_PROGRAM")
    return shutil.which(wanted) if wanted else next(filter(None, (shutil.which("gravier", path=folder) for folder in [*beside, None])), None)


def check(case, folder, name, final):
    """Refuse a case that the program refuses, or that it cannot check; without a program say so."""
    program = find_program()
    if program is None:
        case.remarks.append(f"there is no program gravier beside this script or in PATH: {final} is not checked; see gravier --check {final}")
        return
    # the program runs by itself, whatever launcher has started this script
    done = subprocess.run([program, "--check", name], cwd=folder, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode != 0:
        said = next((line for line in done.stderr.splitlines() if "gravier: error: " in line), None)
        if said is not None:
            raise Refused(f"{final}: gravier --check refuses the case that was made: {said.removeprefix('gravier: error: ')}")
        # what a launcher or a library says, or nothing
        for line in done.stderr.splitlines():
            print(plain(line), file=sys.stderr)
        raise Refused(f"{final}: {program} --check ended with status {done.returncode}, without a word on the case that was made; expected a program gravier that runs, or none "
                      "in the place of this one, with which the case is not checked")
