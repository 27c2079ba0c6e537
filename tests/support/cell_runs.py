"""Runs in periodic cells that deform."""
import os

from gravier_runs import RunTestCase, merged, run_case, write
from small_scenes import bodies_csv

STEP = 0.01
#: a loose lattice that comes together under a pressure
LATTICE = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.4, "radius_max": 0.6, "friction": 0.4,
                     "density": 1.0, "gravity": [0.0, 0.0], "period": [7.6, 7.6], "cell_shear_rate": [0.2], "cell_pressure": [0.0, 1.0]},
           "time": {"step": 0.1, "steps": 60},
           "output": {"directory": "results", "every": 20, "stress": True, "energy": True}}
EXACT = {"criterion": "residual", "tolerance": 1e-11, "max_iterations": 50000}


class CellTestCase(RunTestCase):

    def grains(self, name, grains, scene, steps=1, every=1, **groups):
        """Run a few grains without gravity."""
        here = self.here(name)
        os.makedirs(here)
        write(os.path.join(here, "grains.csv"), bodies_csv(grains))
        dimension = len(grains[0].place)
        run = run_case(merged({"scene": {"dimension": dimension, "bodies": "file", "bodies_file": "grains.csv", "gravity": [0.0] * 3, **scene},
                               "time": {"step": STEP, "steps": steps}, "solver": EXACT,
                               "output": {"directory": "results", "every": every, "stress": True, "energy": True}}, groups), directory=here)
        self.assert_status(run, 0)
        return run.results()

    def lattice(self, name, groups, ranks=1):
        here = self.here(name)
        os.makedirs(here)
        run = run_case(merged(LATTICE, groups), ranks=ranks, directory=here)
        self.assert_status(run, 0)
        return run
