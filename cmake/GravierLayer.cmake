# gravier_compile_options(TARGET [OPTIMISE LEVEL]): the language standard, the warnings and the flags of each build type. LEVEL is that of
# Release builds, 3 unless told. Level 0 holds for Debug builds too, in place of -Og, and is code for any processor: without optimisation the
# compiler leaves the upper halves of vector registers in use, with which calls of the C library take ten times as long.
function(gravier_compile_options target)
  cmake_parse_arguments(OPTIONS "" "OPTIMISE" "" ${ARGN})
  if(NOT DEFINED OPTIONS_OPTIMISE)
    set(OPTIONS_OPTIMISE 3)
  endif()
  set(debug_level $<IF:$<EQUAL:${OPTIONS_OPTIMISE},0>,0,g>)
  set(arch "")
  if(GRAVIER_ARCH AND OPTIONS_OPTIMISE GREATER 0)
    set(arch $<$<CONFIG:Release>:-march=${GRAVIER_ARCH}>)
  endif()
  target_compile_options(${target} PRIVATE
    -std=f2008 -Wall -Wextra -Wimplicit-interface -Warray-temporaries
    $<$<BOOL:${GRAVIER_WERROR}>:-Werror>
    $<$<CONFIG:Release>:-O${OPTIONS_OPTIMISE} -fno-backtrace -fno-semantic-interposition> ${arch}
    $<$<CONFIG:Debug>:-O${debug_level} -g${GRAVIER_DEBUG_LEVEL} -fbacktrace -fcheck=all -finit-real=snan -ffpe-trap=invalid,zero,overflow>
    $<$<CONFIG:Sanitize>:-O1 -g -fbacktrace -fsanitize=address,undefined -fno-omit-frame-pointer>)
  target_link_options(${target} PRIVATE $<$<CONFIG:Sanitize>:-fsanitize=address,undefined>)
endfunction()

set(GRAVIER_ARCH native CACHE STRING "value of -march in Release builds; empty: none")
set(GRAVIER_DEBUG_LEVEL 2 CACHE STRING "what Debug builds tell debuggers: 2 of lines and variables, 1 of lines alone, for backtraces")

# gravier_expand(VARIABLE TEMPLATE...): the list of the Fortran files that fypp makes of templates, NAME.f90 of NAME.fypp. Messages of
# the compiler name the lines of the template. Templates include NAME.fypi, from beside them or by its path below modules/.
find_program(FYPP_EXECUTABLE fypp REQUIRED)
function(gravier_expand variable)
  set(expanded)
  file(GLOB_RECURSE included CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/modules/*.fypi)
  foreach(template ${ARGN})
    file(RELATIVE_PATH name ${PROJECT_SOURCE_DIR} ${template})
    string(REGEX REPLACE "\\.fypp$" ".f90" name ${name})
    set(output ${PROJECT_BINARY_DIR}/expanded/${name})
    add_custom_command(OUTPUT ${output} VERBATIM DEPENDS ${template} ${included}
      COMMAND ${FYPP_EXECUTABLE} --line-numbering --create-parents -I ${PROJECT_SOURCE_DIR}/modules ${template} ${output})
    list(APPEND expanded ${output})
  endforeach()
  set(${variable} ${expanded} PARENT_SCOPE)
endfunction()

# gravier_layer(NAME [USES LOWER] [LIBRARIES ...]): the static library gravier_NAME of all sources in modules/NAME and its rooms, the
# folders in it, with a module directory of its own. USES names the next layer below, whose modules and those beneath it are seen.
function(gravier_layer name)
  cmake_parse_arguments(LAYER "" "USES" "LIBRARIES" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/modules/${name}/*.f90 ${PROJECT_SOURCE_DIR}/modules/${name}/*.F90)
  file(GLOB_RECURSE templates CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/modules/${name}/*.fypp)
  gravier_expand(expanded ${templates})
  set(target gravier_${name})
  add_library(${target} STATIC ${sources} ${expanded})
  add_library(gravier::${name} ALIAS ${target})
  set(mod_dir ${PROJECT_BINARY_DIR}/mod/${name})
  set_target_properties(${target} PROPERTIES Fortran_MODULE_DIRECTORY ${mod_dir} EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${mod_dir}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/gravier/${name}>)
  gravier_compile_options(${target})
  if(LAYER_USES)
    target_link_libraries(${target} PUBLIC gravier_${LAYER_USES})
  endif()
  target_link_libraries(${target} PUBLIC ${LAYER_LIBRARIES})
  set_property(GLOBAL APPEND PROPERTY GRAVIER_LAYERS ${target})
endfunction()
