"""What tools read in the directory of a run: names in any letters, and files that an older run has left there."""
import os
import unittest

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, gravier, write

from gravier import ResultsError, Run, read_table, write_table
from gravier.measured import read_measured

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

    def test_tables_of_an_older_run(self):
        """Tables of gravier_measure are drawn of the run that they were measured from, also after it has gone on, and of no other run in the same directory:
        states tell it apart, and history.csv where the last row is before the next state."""
        for kind, every, *options in (("heap", 10), ("walls", 0, "--mean", "20")):
            with self.subTest(kind=kind):
                text = CASE.replace("trace = .true.", "checkpoint_every = 30").replace("every = 10", f"every = {every}")
                words = f"out/{kind}.csv: measured from another run than the one whose results are in .*out; expected a table of this run, which gravier_measure makes anew"
                self.run_text(text)
                self.assertEqual(self.tool("gravier_measure", kind, "out", *options)[0], 0)
                table = read_table(self.here("out", f"{kind}.csv"))
                self.assertEqual(list(read_measured(Run(self.here("out")), f"{kind}.csv")), [name for name in table if name != "run_checksum"])
                # the run goes on: the table is of its first part
                self.run_text(text.replace("steps = 30", "steps = 50"), "--restart")
                self.assertEqual(len(read_measured(Run(self.here("out")), f"{kind}.csv")), len(table))
                # another speed of the piston: the first state is the same, and so are names and times
                self.run_text(text.replace("velocity = 0.0, -0.1", "velocity = 0.0, -0.12"))
                with self.assertRaisesRegex(ResultsError, words):
                    read_measured(Run(self.here("out")), f"{kind}.csv")
                status, said, error = self.tool("gravier_plot", "history", "out", "--table", f"{kind}.csv")
                self.assertEqual((status, said), (2, ""))
                self.assertRegex(error, f"^gravier_plot: {words}\n$")
                self.assertEqual(self.tool("gravier_measure", kind, "out", *options)[0], 0)
                self.assertEqual(self.tool("gravier_plot", "history", "out", "--table", f"{kind}.csv"), (0, f"out/{kind}.png\n", ""))
        # a table of another origin is taken as it is
        write(self.here("out", "mine.csv"), "time,value\n0,1\n1,2\n")
        self.assertEqual(list(read_measured(Run(self.here("out")), "mine.csv")), ["time", "value"])

    def test_outputs_of_an_older_run(self):
        """trace.csv and bodies.vtkhdf of an older run are not those of a new one that does not write them; those that one start of a run has written are its own."""
        text = CASE.replace("trace = .true.", "trace = .true., vtk = .true., checkpoint_every = 30")
        self.run_text(text)
        self.run_text(text.replace("trace = .true., vtk = .true., ", "").replace("steps = 30", "steps = 50"), "--restart")
        run = Run(self.here("out"))
        self.assertEqual((len(run.starts), run.trace().step.max(), len(run.subdomain(30))), (2, 30, 20))
        self.run_text(text.replace("trace = .true., vtk = .true., ", ""))
        for read, name, key in ((Run(self.here("out")).trace, "trace.csv", "trace"), (Run(self.here("out")).subdomain, "bodies.vtkhdf", "vtk")):
            with self.assertRaisesRegex(ResultsError, f"out/{name}: of an older run in this directory, since this one has no &output {key} = .true.; expected a run that writes it"):
                read()
        status, _, error = self.tool("gravier_plot", "convergence", "out")
        self.assertEqual(status, 2)
        self.assertRegex(error, r"^gravier_plot: out/trace.csv: of an older run in this directory, .*\n$")


if __name__ == "__main__":
    unittest.main()
