"""The Debian package that cpack makes of the build: what it depends on, what it holds, and programs that run from where it is unpacked.

Without the programs dpkg-deb and dpkg-shlibdeps (apt install dpkg-dev) it says so and is skipped."""
import os
import re
import shutil
import subprocess
import unittest
from pathlib import Path

from gravier_runs import PROGRAMS, SOURCE, RunTestCase, only_long

BUILD = Path(PROGRAMS).parent
CPACK = shutil.which("cpack")


@unittest.skipUnless(CPACK and shutil.which("dpkg-deb") and shutil.which("dpkg-shlibdeps"), "NO DPKG: no cpack, dpkg-deb and dpkg-shlibdeps")
class Package(RunTestCase):

    def call(self, *command, **options):
        done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
        self.assertEqual(done.returncode, 0, f"{command}\n{done.stdout}{done.stderr}")
        return done.stdout

    @only_long
    def test_package(self):
        self.call(CPACK, "--config", str(BUILD / "CPackConfig.cmake"), "-B", self.scratch, "-D", "CPACK_DEBIAN_COMPRESSION_TYPE=gzip", cwd=self.scratch)
        packages = [name for name in os.listdir(self.scratch) if name.endswith(".deb")]
        version = re.search(r"project\(gravier VERSION ([\d.]+)", (Path(SOURCE) / "CMakeLists.txt").read_text(encoding="utf-8"))[1]
        self.assertEqual(len(packages), 1)
        self.assertRegex(packages[0], rf"^gravier_{re.escape(version)}_\w+\.deb$")
        path = self.here(packages[0])
        fields = dict(re.findall(r"^([\w-]+): (.*)$", self.call("dpkg-deb", "--field", path), re.M))
        depends = {one.strip().split(" ")[0] for one in fields["Depends"].split(",")}
        self.assertLessEqual({"openmpi-bin", "python3-h5py", "python3-numpy", "libc6", "libgfortran5", "libmetis5"}, depends)
        for library in ("libopenmpi", "libhdf5-openmpi", "libmumps"):
            self.assertTrue(any(name.startswith(library) for name in depends), f"no {library} in {depends}")
        self.assertEqual(fields["Recommends"], "python3-matplotlib")
        self.call("dpkg-deb", "--extract", path, self.here("root"))
        root = Path(self.here("root"))
        self.assertEqual(sorted(os.listdir(root)), ["usr"])
        for name in ("bin/gravier", "bin/gravier_plot", "bin/gravier_report", "bin/gravier_job", "share/gravier/python/gravier/__init__.py",
                     "share/doc/gravier/copyright", "share/doc/gravier/changelog.gz", "lib/python3/dist-packages/gravier.pth"):
            self.assertTrue((root / "usr" / name).exists(), f"no {name}, or a link that leads nowhere")
        self.assertEqual((root / "usr/lib/python3/dist-packages/gravier.pth").read_text(encoding="ascii"), "/usr/share/gravier/python\n")
        self.assertIn(f"Gravier {version}", self.call(str(root / "usr/bin/gravier"), "--version"))


if __name__ == "__main__":
    unittest.main()
