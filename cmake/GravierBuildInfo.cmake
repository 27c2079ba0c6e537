# The library gravier_build_info: one generated module saying what was built, from what, with what.
set(revision unknown)
if(EXISTS ${PROJECT_SOURCE_DIR}/.git)
  find_package(Git QUIET)
  if(GIT_FOUND)
    execute_process(COMMAND ${GIT_EXECUTABLE} describe --always --dirty --abbrev=12
      WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE description RESULT_VARIABLE status
      OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(status EQUAL 0)
      set(revision ${description})
    endif()
  endif()
  if(EXISTS ${PROJECT_SOURCE_DIR}/.git/logs/HEAD) # configure again after a commit
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/.git/logs/HEAD)
  endif()
endif()

include(FortranText)
fortran_text(INFO_VERSION "${PROJECT_VERSION}")
fortran_text(INFO_REVISION "${revision}")
fortran_text(INFO_COMPILER "${CMAKE_Fortran_COMPILER_ID} ${CMAKE_Fortran_COMPILER_VERSION}")
fortran_text(INFO_BUILD_TYPE "${CMAKE_BUILD_TYPE}")
fortran_text(INFO_MPI "${MPI_Fortran_VERSION}")
fortran_text(INFO_HDF5 "${HDF5_VERSION}")
fortran_text(INFO_MUMPS "${MUMPS_VERSION}")
fortran_text(INFO_METIS "${METIS_VERSION}")
fortran_text(INFO_DRIVERS "${PROJECT_SOURCE_DIR}/drivers")
file(RELATIVE_PATH share ${CMAKE_INSTALL_FULL_BINDIR} ${CMAKE_INSTALL_FULL_DATADIR}/gravier)
fortran_text(INFO_SHARE "${share}")
configure_file(${PROJECT_SOURCE_DIR}/cmake/build_info.f90.in ${PROJECT_BINARY_DIR}/generated/build_info.f90 @ONLY)

add_library(gravier_build_info STATIC ${PROJECT_BINARY_DIR}/generated/build_info.f90)
set_target_properties(gravier_build_info PROPERTIES EXPORT_NAME build_info POSITION_INDEPENDENT_CODE ON
  Fortran_MODULE_DIRECTORY ${PROJECT_BINARY_DIR}/mod/build_info)
target_include_directories(gravier_build_info PUBLIC $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/mod/build_info>)
gravier_compile_options(gravier_build_info)
