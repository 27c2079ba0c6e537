# Declaring tests: gravier_test for Fortran programs under MPI, gravier_python_test for unittest scripts.

# The python3 that has what scripts and tests import; the first in PATH need not be the one.
if(NOT GRAVIER_PYTHON)
  foreach(python $ENV{GRAVIER_PYTHON} python3 /usr/bin/python3)
    execute_process(COMMAND ${python} -c "import h5py, numpy, matplotlib" RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
    if(status EQUAL 0)
      set(GRAVIER_PYTHON ${python} CACHE STRING "python3 with h5py, numpy and matplotlib")
      break()
    endif()
  endforeach()
endif()
if(NOT GRAVIER_PYTHON)
  message(WARNING "no python3 with h5py, numpy and matplotlib: the tests written in Python are left out")
endif()

set(gravier_test_environment
  OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
  # tests run side by side, some on more ranks than there are cores
  OMPI_MCA_rmaps_base_oversubscribe=1 PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe
  OMPI_MCA_hwloc_base_binding_policy=none OMPI_MCA_mpi_yield_when_idle=1
  OMPI_MCA_btl_vader_single_copy_mechanism=none
  # messages within one machine; a search for networks would take longer than most tests
  OMPI_MCA_pml=ob1 OMPI_MCA_btl=vader,self
  # ranks are not bound to processors, whose caches and distances would take half of the start of a program to find out
  HWLOC_COMPONENTS=no_os,stop
  # nor are displays and accelerators looked for, whose libraries (OpenCL, X11) each start of MPI would load
  HWLOC_PLUGINS_PATH=/nowhere
  OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
  # what Python compiles is kept here, for the next start of the same script, and nothing in the sources
  MPLBACKEND=Agg PYTHONDONTWRITEBYTECODE= PYTHONPYCACHEPREFIX=${PROJECT_BINARY_DIR}/tests/pycache PYTHONPATH=${PROJECT_SOURCE_DIR}/tests/support
  ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1
  GRAVIER_PYTHON=${GRAVIER_PYTHON} GRAVIER_BIN_DIR=${PROJECT_BINARY_DIR}/bin GRAVIER_SOURCE_DIR=${PROJECT_SOURCE_DIR}
  MPIEXEC=${MPIEXEC_EXECUTABLE})

# the programs of the tests that a debug build runs
add_custom_target(debug_tests)
# a hundred programs are linked with the same libraries, by this linker in a quarter of the time
include(CheckLinkerFlag)
check_linker_flag(Fortran -fuse-ld=gold GRAVIER_LINKER_GOLD)

# gravier_test(NAME SOURCES ... [OPTIMISED] [RANKS 1 2 4] [DEBUG_RANKS 1 2] [RELEASE_RANKS 1 2] [LIBRARIES ...] [LABELS ...] [TIMEOUT seconds]
#              [EXPECT text])
# One test for each number of ranks, NAME or NAME_npN when on several, each in a directory of its own. One rank runs without the launcher,
# in half the time. Numbers of ranks that are not among DEBUG_RANKS have the label long in place of debug in a debug build, and those that are not
# among RELEASE_RANKS have it in place of quick in a release build.
# LIBRARIES defaults to the application (the top layer while there is none). With EXPECT the program must fail
# and print the text. Called again with the same NAME and SOURCES it adds tests of the same program. A program is compiled without
# optimisation: it runs for moments, and to optimise it would take five times as long as to compile it. OPTIMISED is for one that computes
# much, or compares with formulas that have to round as the library does.
function(gravier_test name)
  cmake_parse_arguments(TEST "OPTIMISED" "TIMEOUT;EXPECT" "SOURCES;RANKS;DEBUG_RANKS;RELEASE_RANKS;LIBRARIES;LABELS" ${ARGN})
  if(NOT TEST_LIBRARIES)
    set(TEST_LIBRARIES $<IF:$<TARGET_EXISTS:gravier_app>,gravier_app,gravier_step>)
  endif()
  if(NOT TEST_RANKS)
    set(TEST_RANKS 1)
  endif()
  if(NOT TEST_TIMEOUT)
    set(TEST_TIMEOUT 900)
  endif()
  set(target test_${name})
  if(NOT TARGET ${target})
    add_executable(${target} ${TEST_SOURCES})
    set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests/bin
      Fortran_MODULE_DIRECTORY ${PROJECT_BINARY_DIR}/mod/tests/${name})
    target_link_libraries(${target} PRIVATE gravier_test_support ${TEST_LIBRARIES})
    if(TEST_OPTIMISED)
      gravier_compile_options(${target})
    else()
      gravier_compile_options(${target} OPTIMISE 0)
      # without optimisation the compiler warns falsely of descriptors that an allocation sets; checks of the debug build find those that are never
      # set when they are used
      target_compile_options(${target} PRIVATE $<$<NOT:$<CONFIG:Sanitize>>:-Wno-maybe-uninitialized>)
    endif()
    if(GRAVIER_LINKER_GOLD)
      target_link_options(${target} PRIVATE $<$<NOT:$<CONFIG:Sanitize>>:-fuse-ld=gold>)
    endif()
    if(debug IN_LIST TEST_LABELS)
      add_dependencies(debug_tests ${target})
    endif()
  endif()
  foreach(ranks ${TEST_RANKS})
    set(test ${name})
    if(NOT TEST_RANKS STREQUAL "1")
      set(test ${name}_np${ranks})
    endif()
    set(command ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks} ${MPIEXEC_PREFLAGS} $<TARGET_FILE:${target}>
      ${MPIEXEC_POSTFLAGS})
    if(ranks EQUAL 1 AND NOT TEST_EXPECT)
      set(command $<TARGET_FILE:${target}>)
    endif()
    if(TEST_EXPECT)
      string(REPLACE ";" "|" command "${command}")
      set(command ${CMAKE_COMMAND} "-DCOMMAND=${command}" "-DEXPECT=${TEST_EXPECT}"
        -P ${PROJECT_SOURCE_DIR}/tests/support/expect_failure.cmake)
    endif()
    set(labels ${TEST_LABELS})
    if(CMAKE_BUILD_TYPE STREQUAL Debug AND TEST_DEBUG_RANKS AND NOT ranks IN_LIST TEST_DEBUG_RANKS)
      list(TRANSFORM labels REPLACE "^debug$" long)
    endif()
    if(CMAKE_BUILD_TYPE STREQUAL Release AND TEST_RELEASE_RANKS AND NOT ranks IN_LIST TEST_RELEASE_RANKS)
      list(REMOVE_ITEM labels quick)
      list(APPEND labels long)
    endif()
    gravier_add_test(${test} ${TEST_TIMEOUT} "${labels}" "${command}")
    if(ranks EQUAL 1)
      # it has no rank to wait for, and would give up its processor at each message to itself. Without a launcher Open MPI starts no daemon
      # and only what one rank needs; tests that run at once each have a session directory of their own
      set_property(TEST ${test} APPEND PROPERTY ENVIRONMENT OMPI_MCA_mpi_yield_when_idle=0)
      if(NOT TEST_EXPECT)
        set_property(TEST ${test} APPEND PROPERTY ENVIRONMENT OMPI_MCA_ess_singleton_isolated=1 OMPI_MCA_btl=self
          OMPI_MCA_coll=basic,libnbc,self OMPI_MCA_orte_tmpdir_base=${PROJECT_BINARY_DIR}/tests/work/${test})
      endif()
    endif()
  endforeach()
endfunction()

# gravier_python_test(NAME FILE [APART] [LABELS ...] [TIMEOUT seconds])
# A unittest script. Its environment names GRAVIER_BIN_DIR, GRAVIER_SOURCE_DIR and MPIEXEC; tests/support is on its path. With APART
# each of its methods test_X is a test by itself, NAME_X. A script that imports LONG, SOME_RANKS or only_long of gravier_runs is also the test
# long_NAME of the label long, where LONG is true: all variants of what the suite shows by a few.
function(gravier_python_test name file)
  cmake_parse_arguments(TEST "APART" "TIMEOUT" "LABELS" ${ARGN})
  if(NOT GRAVIER_PYTHON)
    return()
  endif()
  if(NOT TEST_TIMEOUT)
    set(TEST_TIMEOUT 1800)
  endif()
  get_filename_component(directory ${file} DIRECTORY)
  get_filename_component(script ${file} NAME)
  set(command "${GRAVIER_PYTHON};-m;unittest;discover;-v;-s;${directory};-p;${script}")
  set(methods "")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(STRINGS ${file} long REGEX "^from gravier_runs import .*(LONG|SOME_RANKS|only_long)" LIMIT_COUNT 1)
  if(long AND CMAKE_BUILD_TYPE STREQUAL Release)
    gravier_add_test(long_${name} 7200 long "${command}")
    set_property(TEST long_${name} APPEND PROPERTY ENVIRONMENT GRAVIER_LONG=1)
  endif()
  if(TEST_APART)
    file(STRINGS ${file} lines REGEX "^    def test_[a-z0-9_]+\\(self")
    foreach(line ${lines})
      string(REGEX REPLACE "^    def test_([a-z0-9_]+).*" "\\1" method ${line})
      list(APPEND methods ${method})
    endforeach()
  endif()
  foreach(method IN LISTS methods)
    gravier_add_test(${name}_${method} ${TEST_TIMEOUT} "${TEST_LABELS}" "${command};-k;*.test_${method}")
    set_tests_properties(${name}_${method} PROPERTIES COST 50)
  endforeach()
  if(NOT methods)
    gravier_add_test(${name} ${TEST_TIMEOUT} "${TEST_LABELS}" "${command}")
    # most of their runs are on one rank; the longest tests start first
    set_tests_properties(${name} PROPERTIES COST 100)
  endif()
endfunction()

# gravier_add_test(NAME TIMEOUT LABELS COMMAND): in a directory of its own, with the environment of tests
function(gravier_add_test name timeout labels command)
  set(directory ${PROJECT_BINARY_DIR}/tests/work/${name})
  file(MAKE_DIRECTORY ${directory})
  add_test(NAME ${name} COMMAND ${command} WORKING_DIRECTORY ${directory})
  # a test of several ranks counts for one processor as well: it runs for moments, most of them a start in which ranks wait, and ranks that wait
  # give up their processor. Two at once take the processor time of one after the other, in half the time
  set_tests_properties(${name} PROPERTIES TIMEOUT ${timeout} LABELS "${labels}" ENVIRONMENT "${gravier_test_environment}")
endfunction()
