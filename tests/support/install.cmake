# Installs the build BUILD under WORK, builds the project CONSUMER against the installation and runs its
# programs: one on the libraries, and one that extends gravier.
function(run)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    string(REPLACE ";" " " command "${ARGN}")
    message(FATAL_ERROR "status ${status}: ${command}\n${output}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} -S ${CONSUMER} -B ${WORK}/build -G ${GENERATOR} -DCMAKE_PREFIX_PATH=${WORK}/prefix
  -DCMAKE_Fortran_COMPILER=${COMPILER} -DCMAKE_BUILD_TYPE=Release)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/consumer)
run(${PYTHON} ${CONSUMER}/check_own.py ${WORK}/build/own_gravier)
if(PROGRAM)
  run(${WORK}/prefix/bin/gravier --version)
  # the library and the class of the installation, which find each other
  file(WRITE ${WORK}/find.py
    "from gravier.library import find_library, load\nload()\nwith open('library', 'w') as file:\n    file.write(find_library())\n")
  run(${CMAKE_COMMAND} -E env --unset=GRAVIER_BIN_DIR PYTHONPATH=${WORK}/prefix/share/gravier/python ${PYTHON} ${WORK}/find.py)
  file(READ ${WORK}/library library)
  file(REAL_PATH ${WORK}/prefix prefix)
  if(NOT library MATCHES "^${prefix}/lib.*/libgravier\\.so$" OR NOT EXISTS ${WORK}/prefix/include/gravier.h)
    message(FATAL_ERROR "the Python class of the installation uses '${library}'; expected a library in ${prefix} and gravier.h")
  endif()
  # a Python that says what it is to draw with: the script of the installation
  file(WRITE ${WORK}/python "#!/bin/sh\n[ \"$1\" = -c ] || realpath \"$1\" >${WORK}/script\n")
  file(CHMOD ${WORK}/python PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
  run(${CMAKE_COMMAND} -E env GRAVIER_PYTHON=${WORK}/python ${WORK}/prefix/bin/gravier_columns --count 4 --subdomains 2)
  file(REAL_PATH ${WORK}/prefix/share/gravier/columns/plot_columns.py expected)
  file(STRINGS ${WORK}/script script)
  if(NOT script STREQUAL expected)
    message(FATAL_ERROR "the installation draws with ${script}; expected ${expected}")
  endif()
endif()
