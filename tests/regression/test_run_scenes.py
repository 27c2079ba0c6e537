"""The scenes of data/scenes: each passes --check as it is shipped, and starts: a few of its steps run and move something."""
import glob
import os
import re
import shutil
import unittest

import numpy as np

from gravier_runs import SOURCE, RunTestCase, each, gravier, steps_of, write

SCENES = sorted(glob.glob(os.path.join(SOURCE, "data/scenes/*.nml")))
STEPS = 5


def shortened(text):
    """A scene with few steps and loose solves, every step written; boundaries that leave do so in the third step."""
    step = float(re.search(r"^ *step = (\S+)", text, re.M).group(1))
    for pattern, value in ((r"^( *steps = )\d+", str(STEPS)), (r"^( *max_iterations = )\d+", "50"),
                           (r"^( *every = )\d+", "1"), (r"^( *directory = )\S+", "'out'"),
                           (r"(remove_at = )[0-9.e-]+", repr(2.0 * step))):
        text = re.sub(pattern, lambda match: match.group(1) + value, text, flags=re.M)
    return text


class Scenes(RunTestCase):
    """Run where data/ is, as from a clean clone."""

    def test_shipped_scenes(self):
        shutil.copytree(os.path.join(SOURCE, "data"), self.here("data"))
        self.assertGreaterEqual(len(SCENES), 8)
        names = [os.path.basename(path)[:-4] for path in SCENES]
        for path, checked, ran in zip(SCENES, each(self.check, [(name,) for name in names]),
                                      each(self.start, [(name,) for name in names])):
            with self.subTest(scene=path):
                self.assert_status(checked, 0)
                self.assertIn(ran.status, (0, 3), str(ran))
                results = ran.results("out")
                self.assert_finite(results)
                self.assertEqual(steps_of(results), list(range(STEPS + 1)))
                before, after = (results[f"/steps/{step}/bodies/position"] for step in (STEPS - 1, STEPS))
                # grains may enter
                self.assertGreater(np.abs(after[:len(before)] - before).max(), 0.0)
                # what is shipped begins without overlaps worth the name
                radius = results[f"/steps/{STEPS}/bodies/radius"].mean()
                self.assertLess(ran.history("out")["max_overlap"].max(), 0.02 * radius)

    def check(self, name):
        return gravier("--check", f"data/scenes/{name}.nml", directory=self.scratch)

    def start(self, name):
        directory = self.here(name)
        os.makedirs(directory)
        os.symlink(self.here("data"), os.path.join(directory, "data"))
        with open(self.here("data/scenes", f"{name}.nml"), encoding="ascii") as file:
            write(os.path.join(directory, "case.nml"), shortened(file.read()))
        return gravier("case.nml", directory=directory)

    def test_table_of_the_scenes(self):
        """README.md of the scenes names each of them."""
        with open(os.path.join(SOURCE, "data/scenes/README.md"), encoding="utf-8") as file:
            text = file.read()
        for path in SCENES:
            self.assertIn(os.path.basename(path), text)


if __name__ == "__main__":
    unittest.main()
