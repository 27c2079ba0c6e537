"""A few changed inputs of each kind, as the command fuzz_inputs.py has them by the thousand; and what such trials have found."""
import os
import shutil
import sys
import unittest

import h5py
import numpy as np

from gravier_runs import PROGRAMS, SOURCE, RunTestCase, alone, write

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import fuzz_inputs  # noqa: E402
from gravier import ResultsError, Run, checksum, read_table  # noqa: E402

GRAVIER = os.path.join(PROGRAMS, "gravier")


class FuzzInputs(RunTestCase):

    def test_all_kinds(self):
        figures = fuzz_inputs.fuzz(1, 100, self.here("fuzz"), keep=self.here("findings"))
        for figure in figures:
            print(figure, file=sys.stderr)
            self.assertGreater(figure.trials, 0)
            self.assertEqual(figure.wrong, [])
        self.assertEqual({figure.name for figure in figures}, {f"fuzz, {kind}" for kind in fuzz_inputs.SHARES})


class Found(RunTestCase):
    """Damages that were found by trial, each with the words that refuse it."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.kinds = fuzz_inputs.Kinds(cls.here(cls, "source"))

    def refuse(self, name, damage, *words, arguments=("--restart", "on.nml")):
        """A run goes on from files of which one is damaged: one line that names it and status 2, soon, and the file as it was."""
        with self.subTest(name, words=words):
            place = self.here("trial")
            shutil.rmtree(place, ignore_errors=True)
            self.kinds.fill(place, "run")
            path = os.path.join(place, "results", name)
            if name.endswith(".csv"):
                with open(path, encoding="ascii") as file:
                    text = file.read()
                write(path, damage(text))
            else:
                with h5py.File(path, "r+") as file:
                    damage(file)
            before = fuzz_inputs.read(path)
            said = alone([GRAVIER, *arguments], place)
            self.assertEqual(said.status, 2, said.stderr)
            self.assertEqual(said.stderr.count("\n"), 1, said.stderr)
            self.assertTrue(said.stderr.startswith(f"gravier: error: results/{name}: "), said.stderr)
            for word in words:
                self.assertIn(word, said.stderr)
            self.assertEqual(fuzz_inputs.read(path), before)

    def test_pictures(self):
        """Tables that are to grow are looked at before the file is opened for writing, where HDF5 makes room for all rows they say they have."""
        def replaced(name, **how):
            def damage(file):
                del file[name]
                file.create_dataset(name, **how)
            return damage
        lines = "VTKHDF/Lines/NumberOfCells"
        self.refuse("bodies.vtkhdf", replaced(lines, data=np.zeros(3, int)), "a table of a fixed length, but one that grows was expected")
        self.refuse("bodies.vtkhdf", replaced(lines, shape=(3,), maxshape=(None,), chunks=(4,), dtype="f8"), "not made of integers")
        self.refuse("bodies.vtkhdf", replaced(lines, shape=(1,), maxshape=(None,), chunks=(4,), dtype="i8"), "1 rows, but at least")
        self.refuse("bodies.vtkhdf", replaced(lines, shape=(2**58,), maxshape=(None,), chunks=(1024,), dtype="i8"), "more than the file has room for")
        self.refuse("contacts.vtkhdf", replaced("VTKHDF/Vertices/Offsets", shape=(2**58,), chunks=(1024,), dtype="i8"), "Offsets")
        self.refuse("bodies.vtkhdf", lambda file: file["VTKHDF/Steps"].attrs.modify("NSteps", 2**32), "rows, but at least 4294967296")

    def test_lost_chunk(self):
        """A table whose rows cannot be read is refused before the first step, not when the step after the restart is written there."""
        def lost(name):
            def damage(file):
                address = file[name].id.get_chunk_info(0).byte_offset
                path = file.filename
                file.close()
                whole = fuzz_inputs.read(path)
                self.assertEqual(whole.count(address.to_bytes(8, "little")), 1)
                write(path, whole.replace(address.to_bytes(8, "little"), (2**32 + address).to_bytes(8, "little")))
            return damage
        for name in ("Steps/ConnectivityIdOffsets", "Points", "Steps/Values", "PointData/radius"):
            self.refuse("bodies.vtkhdf", lost("VTKHDF/" + name), f"/VTKHDF/{name}: ", "cannot read this table: the file is damaged")

    def test_states(self):
        def no_group(file):
            del file["steps"]
            file["steps"] = 1.0
        self.refuse("results.h5", no_group, "/steps: damaged or no group")

    def test_tables(self):
        def cell(text):
            head, first, *rest = text.splitlines(keepends=True)
            return head + first.replace(",", ",0*1,", 1).replace(",0*1,", ",0*1", 1) + "".join(rest)
        self.refuse("history.csv", cell, 'line 2: "0*1', "but a number was expected")
        self.refuse("history.csv", lambda text: text.replace(",", ",1,", 200), "line 1:")
        self.refuse("trace.csv", lambda text: "\n".join(row + ",1" * (k == 1) for k, row in enumerate(text.split("\n"))), "line 2: 6 cells, but the header has 5")

    def test_checkpoints(self):
        """What a checkpoint holds is looked at even where its checksums are right."""
        def changed(name, place, value):
            def damage(file):
                values = file[name][()]
                values[place] = value
                file[name][...] = values
                file[name].attrs["checksum"] = np.int64(checksum.checksum(values))
            return damage
        nan = np.array(np.nan).view("i8")
        self.refuse("checkpoint.h5", changed("arrays/partition", 4, 2**31), "partition does not fit this scene in 2 subdomains")
        self.refuse("checkpoint.h5", changed("arrays/partition", 7, 2**31 - 1), "partition does not fit this scene in 2 subdomains")
        self.refuse("checkpoint.h5", changed("arrays/partition", 12, nan), "partition does not fit this scene")
        self.refuse("checkpoint.h5", changed("arrays/boundaries", 3, nan), "the array boundaries: a number of at most 1e30", " was expected: the file is damaged")
        self.refuse("checkpoint.h5", changed("tables/grains/records", (0, 3), 99), "table grains: grain")
        self.refuse("checkpoint.h5", changed("tables/grains/records", (0, 6), nan), "table grains: grain", "a value of position that no grain has", "the file is damaged")
        self.refuse("checkpoint.h5", lambda file: file["scalars"].attrs.modify("law_row", 2**40), "law_row: 1099511627776")

    def test_python(self):
        """What the Python module cannot read is a ResultsError."""
        def checksums(file):
            file["steps/2/bodies/radius"].attrs["checksum"] = np.arange(3)

        def texts(file):
            del file["steps/2/bodies/velocity"]
            file["steps/2/bodies/velocity"] = b"text"

        def never_written(file):
            del file["steps/2/bodies/radius"]
            file.create_dataset("steps/2/bodies/radius", shape=(2**40,), chunks=(1024,), dtype="f8")

        def fewer(file):
            values = file["steps/2/bodies/radius"][:-1]
            del file["steps/2/bodies/radius"]
            file["steps/2/bodies/radius"] = values

        def missing(file):
            del file["steps/2/bodies/radius"]
        for damage in (checksums, texts, never_written, fewer, missing):
            with self.subTest(damage.__name__):
                place = self.here("python")
                shutil.rmtree(place, ignore_errors=True)
                self.kinds.fill(place, "run")
                with h5py.File(os.path.join(place, "results/results.h5"), "r+") as file:
                    damage(file)
                with self.assertRaises(ResultsError) as caught:
                    Run(os.path.join(place, "results")).bodies(2)
                self.assertNotIn("\n", str(caught.exception))

        write(self.here("table.csv"), b"step,time\n1,\xff\n")
        with self.assertRaises(ResultsError):
            read_table(self.here("table.csv"))
        write(self.here("table.csv"), "step,time\n1,2\n")
        with self.assertRaisesRegex(ResultsError, "no column iteration"):
            read_table(self.here("table.csv"), ("step", "iteration"))

    def test_messages(self):
        """What a message quotes does not steer a terminal."""
        write(self.here("case.nml"), "&scene bodies = 'file', bodies_file = 'bodies.csv' /\n&time step = 1, steps = 1 /\n")
        write(self.here("bodies.csv"), "id,x,y,radius\n1,\x1b[2J,0,1\n")
        said = alone([GRAVIER, "--check", "case.nml"], self.scratch)
        self.assertEqual(said.status, 2)
        self.assertIn('column x: "?[2J"', said.stderr)
        self.assertNotIn("\x1b", said.stderr)

    def test_usage(self):
        """Scripts say what is wrong with a command line in one line, too."""
        for script, arguments in (("gravier_plot", ["nothing"]), ("gravier_plot", []), ("gravier_import", ["--step", "x", "DATBOX"])):
            said = alone([sys.executable, os.path.join(SOURCE, fuzz_inputs.SCRIPTS[script]), *arguments], self.scratch)
            self.assertEqual((said.status, said.stderr.count("\n")), (2, 1), said.stderr)
            self.assertTrue(said.stderr.startswith(f"{script}: error: "), said.stderr)
        said = alone(["sh", os.path.join(SOURCE, "drivers/jobs/gravier_job"), "a\nb\x1b.nml"], self.scratch)
        self.assertEqual((said.status, said.stderr), (2, "gravier_job: error: a?b?.nml: cannot read this file; expected a case\n"))


if __name__ == "__main__":
    unittest.main()
