"""A scene in which nearly everything moves, for comparisons bit by bit."""
import os
import random

from gravier_runs import write

# what moves grains in every way: periods, a belt, a lid moved by a force, an outlet, a boundary that goes, tables, glued
# grains that turn, METIS by schedule and by imbalance
DRUM = {
    "scene": {"dimension": 2, "bodies": "file", "bodies_file": "grains.csv", "friction": 0.3, "period": [0.504, 0.0, 0.0],
              # the paddle stands in the grains
              "gravity_table": "gravity.csv", "skin": 0.008, "list_steps": 5.0, "start_overlap": 1.0},
    "boundary": [
        {"shape": "plane", "name": "belt", "point": [0.0, -0.01], "normal": [0.0, 1.0], "velocity": [0.3, 0.0]},
        {"shape": "plane", "name": "lid", "point": [0.0, 0.31], "normal": [0.0, -1.0], "free": [False, True], "mass": 2.0,
         "force": [0.0, -50.0]},
        {"shape": "segment", "name": "paddle", "point": [0.46, 0.18], "end": [0.54, 0.2], "table": "drive.csv"},
        {"shape": "segment", "name": "blade", "point": [0.1, 0.05], "end": [0.15, 0.12], "remove_at": 0.065},
        {"shape": "grains", "name": "stirrer", "group": 1, "rotation": [3.0], "pivot": [0.3, 0.1]},
        {"shape": "outlet", "name": "hole", "point": [0.0, 0.27], "normal": [0.0, -1.0]},
    ],
    "time": {"step": 2e-3, "steps": 60},
    "solver": {"criterion": "residual", "tolerance": 2e-2, "method": "nscdd", "max_iterations": 1000},
    "decomposition": {"partition": "metis", "subdomains": 6, "repartition_every": 13, "repartition_imbalance": 1.3},
    "output": {"every": 6, "trace": True, "checkpoint_every": 1},
}


def write_drum(directory):
    """The files that DRUM reads: 200 grains, of which five are glued."""
    os.makedirs(directory, exist_ok=True)
    # with other numbers (1, 3) the grains jam the belt, and a solve does not converge
    draw = random.Random(5)
    rows = []
    for k in range(200):
        i, j = k % 20, k // 20
        glued = 1 if j == 3 and 8 <= i < 13 else 0
        rows.append(f"{k + 1},{0.012 + 0.0252 * i:.6f},{0.012 + 0.0252 * j:.6f},{draw.uniform(0.011, 0.0125):.6f},{glued},"
                    f"{draw.uniform(-0.5, 0.5):.6f},{1.5 * (j - 4.5) / 4.5:.6f},0")
    write(os.path.join(directory, "grains.csv"), "id,x,y,radius,group,vx,vy,omega\n" + "\n".join(rows) + "\n")
    write(os.path.join(directory, "drive.csv"), "time,vx,omega\n0,0,0\n0.05,0.2,1\n0.12,-0.2,2\n")
    write(os.path.join(directory, "gravity.csv"), "time,gx,gy\n0,0,-9.81\n0.06,2,-9\n0.12,-2,-9.81\n")
