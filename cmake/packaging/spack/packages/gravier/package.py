import pathlib

from spack_repo.builtin.build_systems.cmake import CMakePackage

from spack.package import *


class Gravier(CMakePackage):
    """Dense granular matter by nonsmooth contact dynamics, with domain decomposition: rigid bodies
    under unilateral contact and friction, in Fortran 2008 and MPI."""

    # the clone that has this recipe
    git = pathlib.Path(__file__).resolve().parents[5].as_uri()

    license("BSD-3-Clause")

    version("develop", branch="main")

    variant("tests", default=False, description="build the tests")
    variant("python", default=True, description="scripts: importer, studies, figures")

    depends_on("c", type="build")
    depends_on("fortran", type="build")
    depends_on("cmake@3.20:", type="build")
    depends_on("py-fypp@3.1:", type="build")
    depends_on("mpi")
    depends_on("hdf5+mpi+fortran")
    depends_on("mumps+mpi+double~int64")
    depends_on("scalapack")
    depends_on("lapack")
    depends_on("metis@5: ~int64")
    depends_on("python@3.8:", type="run", when="+python")
    depends_on("py-h5py", type="run", when="+python")
    depends_on("py-numpy", type="run", when="+python")
    depends_on("py-matplotlib", type="run", when="+python")

    def cmake_args(self):
        return [
            self.define_from_variant("GRAVIER_TESTS", "tests"),
            # spack chooses the processor by its own flags
            self.define("GRAVIER_ARCH", ""),
            self.define("MUMPS_ROOT", self.spec["mumps"].prefix),
            self.define("METIS_ROOT", self.spec["metis"].prefix),
            self.define("SCALAPACK_ROOT", self.spec["scalapack"].prefix),
        ]
