# What `cmake --install` puts where: libraries, module files layer by layer, and a package for find_package(gravier).
include(CMakePackageConfigHelpers)

get_property(layers GLOBAL PROPERTY GRAVIER_LAYERS)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/gravier)
install(TARGETS ${layers} EXPORT gravierTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
foreach(layer ${layers})
  string(REPLACE gravier_ "" name ${layer})
  install(DIRECTORY $<TARGET_PROPERTY:${layer},Fortran_MODULE_DIRECTORY>/
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/gravier/${name} FILES_MATCHING PATTERN "*.mod" PATTERN "*.smod")
endforeach()

install(EXPORT gravierTargets NAMESPACE gravier:: DESTINATION ${package_dir})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/gravierConfig.cmake.in ${PROJECT_BINARY_DIR}/generated/gravierConfig.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/generated/gravierConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/generated/gravierConfig.cmake ${PROJECT_BINARY_DIR}/generated/gravierConfigVersion.cmake
  ${PROJECT_SOURCE_DIR}/cmake/GravierHDF5.cmake ${PROJECT_SOURCE_DIR}/cmake/FindMUMPS.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindMETIS.cmake DESTINATION ${package_dir})
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/gravier)
# cases to begin with, which are run beside a copy of this directory
install(DIRECTORY ${PROJECT_SOURCE_DIR}/data DESTINATION ${CMAKE_INSTALL_DATADIR}/gravier PATTERN studies EXCLUDE)

# gravier_program(NAME SOURCE): a program on the application library, in bin/ of the build and of the installation
function(gravier_program name source)
  add_executable(${name} ${source})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin
    Fortran_MODULE_DIRECTORY ${PROJECT_BINARY_DIR}/mod/programs/${name})
  target_link_libraries(${name} PRIVATE gravier_app)
  gravier_compile_options(${name})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()
