"""What tools read in the directory of a run: names in any letters, and files that an older run has left there."""
import os
import unittest

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, gravier, write

from gravier import Run, read_table, write_table

CASE = """&scene bodies = 'file', bodies_file = 'bodies.csv', friction = 0.3, alert_distance = 0.001 /
&boundary name = 'côté λ', shape = 'plane', point = 0.0, 0.0, normal = 1.0, 0.0 /
&boundary name = 'right', shape = 'plane', point = 0.06, 0.0, normal = -1.0, 0.0 /
&boundary name = 'floor', shape = 'plane', point = 0.0, 0.0, normal = 0.0, 1.0 /
&boundary name = 'Kolben ö', shape = 'plane', point = 0.0, 0.06, normal = 0.0, -1.0, velocity = 0.0, -0.1 /
&time step = 1.0e-3, steps = 30 /
&output directory = 'out', every = 10, boundary_forces = .true., trace = .true. /
"""


class FilesOfRuns(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        write(cls.here(cls, "bodies.csv"), "id,x,y,radius\n" + "".join(f"{5 * k + j + 1},{0.006 + 0.0115 * j},{0.006 + 0.0115 * k},{0.005 + 0.0001 * j}\n"
                                                                          for k in range(4) for j in range(5)))

    def run_text(self, text, *options, encoding="utf-8", name="case.nml", status=0):
        with open(self.here(name), "wb") as file:
            file.write(text.encode(encoding))
        run = gravier(*options, name, directory=self.scratch)
        self.assert_status(run, status)
        return run

    def tool(self, name, *arguments):
        done = script(os.path.join(SOURCE, "drivers", name.removeprefix("gravier_"), f"{name}.py"), *arguments, directory=self.scratch, environment=ENVIRONMENT)
        return done.returncode, done.stdout, done.stderr

    def test_names_in_any_letters(self):
        """Names of boundaries that are not of ASCII, in UTF-8 and in Latin-1: all tools read what such a run leaves, and write it."""
        for encoding, names in (("utf-8", ("côté λ", "Kolben ö")), ("latin-1", ("c\ufffdt\ufffd l", "Kolben \ufffd"))):
            with self.subTest(encoding=encoding):
                self.run_text(CASE if encoding == "utf-8" else CASE.replace("λ", "l"), encoding=encoding)
                run = Run(self.here("out"))
                self.assertEqual([name for name in run.boundaries().name if not name.startswith("wall")], [names[0], "right", "floor", names[1]])
                self.assertIn(f"force_y:{names[1]}", run.history())
                self.assertEqual(len(run.trace().step) > 0, True)
                for tool, *arguments in (("gravier_measure", "walls"), ("gravier_measure", "heap"), ("gravier_plot", "history", "--columns", f"force_x:{names[0]}"),
                                         ("gravier_plot", "packing"), ("gravier_plot", "convergence"), ("gravier_report",)):
                    status, _, said = self.tool(tool, *arguments, "out")
                    self.assertEqual((status, said), (0, ""), (tool, arguments))
                write_table(self.here("copy.csv"), run.history())
                self.assertEqual(list(read_table(self.here("copy.csv"))), list(run.history()))


if __name__ == "__main__":
    unittest.main()
