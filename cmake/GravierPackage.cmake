# What `cpack` makes of an installation in /usr: a Debian package, whose dependencies on libraries dpkg-shlibdeps finds.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME gravier)
set(CPACK_PACKAGE_VENDOR "The Gravier developers")
# who makes the package: cpack -D CPACK_PACKAGE_CONTACT="NAME <ADDRESS>"
set(CPACK_PACKAGE_CONTACT "The Gravier developers <root@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "dense granular matter by nonsmooth contact dynamics")
set(CPACK_PACKAGE_DESCRIPTION "Disks, spheres and bodies of other shapes under contact, friction,
rolling resistance and cohesion, by Moreau-Jean time stepping and nonsmooth
contact dynamics in parallel, with domain decomposition by NSCDD, NSCDD-EP,
Schwarz-NSCD and Schwarz-NSCD-EC. Programs, their libraries for other
programs, and a Python package.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_VERBATIM_VARIABLES ON)
# licence and path of the Python package where Debian wants them, in the package alone
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/packaging/debian_files.cmake)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "openmpi-bin, python3, python3-h5py, python3-numpy")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3-matplotlib")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "ffmpeg, python3-scipy")
include(CPack)
