# Run by cpack on what it has installed, before it makes the package.
set(root ${CPACK_TEMPORARY_INSTALL_DIRECTORY})
get_filename_component(source ${CMAKE_CURRENT_LIST_DIR}/../.. ABSOLUTE)
file(MAKE_DIRECTORY ${root}/usr/share/doc/gravier ${root}/usr/lib/python3/dist-packages)
configure_file(${source}/LICENSE ${root}/usr/share/doc/gravier/copyright COPYONLY)
configure_file(${source}/CITATION.cff ${root}/usr/share/doc/gravier/CITATION.cff COPYONLY)
execute_process(COMMAND gzip -9 -n -c ${source}/CHANGELOG.md OUTPUT_FILE ${root}/usr/share/doc/gravier/changelog.gz COMMAND_ERROR_IS_FATAL ANY)
# `import gravier` finds the package where its scripts are
file(WRITE ${root}/usr/lib/python3/dist-packages/gravier.pth "/usr/share/gravier/python\n")
