# Installs the built library into an empty prefix, then builds and runs the examples against that prefix alone: all of
# them through CMake, the C program once more through pkg-config, as a project without CMake would.
#   cmake -D BUILD_DIR= -D BUILD_TYPE= -D CXX_COMPILER= -D C_COMPILER= -D EXAMPLES_DIR= -D WORK_DIR=
#         -P test_install_tree.cmake
file(REMOVE_RECURSE ${WORK_DIR})

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY COMMAND_ECHO STDOUT)
endfunction()

function(run_example folder)
  run(${CMAKE_COMMAND} -S ${EXAMPLES_DIR}/${folder} -B ${WORK_DIR}/${folder} -D CMAKE_BUILD_TYPE=${BUILD_TYPE}
      -D CMAKE_CXX_COMPILER=${CXX_COMPILER} -D CMAKE_C_COMPILER=${C_COMPILER}
      -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix --no-warn-unused-cli)
  run(${CMAKE_COMMAND} --build ${WORK_DIR}/${folder} --config ${BUILD_TYPE})
  foreach(program IN LISTS ARGN)
    run(${WORK_DIR}/${folder}/${program})
  endforeach()
endfunction()

# What pkg-config says about the installed library, as a list.
function(ask_pkg_config result)
  execute_process(COMMAND ${CMAKE_COMMAND} -E env PKG_CONFIG_PATH=${pc_folder} pkg-config ${ARGN} shapegcode
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_VARIABLE said OUTPUT_STRIP_TRAILING_WHITESPACE)
  separate_arguments(said UNIX_COMMAND "${said}")
  set(${result} ${said} PARENT_SCOPE)
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD_DIR} --config ${BUILD_TYPE} --prefix ${WORK_DIR}/prefix)
run_example(controller_prototype first_motion controller_prototype)
run(${WORK_DIR}/controller_prototype/closed_loop --csv ${WORK_DIR}/closed_loop.csv)
# Of both drives, with and without shaper, at least a second each.
file(STRINGS ${WORK_DIR}/closed_loop.csv rows)
foreach(case "ideal,plain" "ideal,shaped" "with friction,plain" "with friction,shaped")
  set(of_case ${rows})
  list(FILTER of_case INCLUDE REGEX "^${case},[0-9.]+(,-?[0-9.]+)+$")
  list(LENGTH of_case number)
  if(number LESS 1000)
    message(FATAL_ERROR "closed_loop.csv has ${number} rows of ${case}")
  endif()
endforeach()
run_example(motion_controller moving moving_c)

file(GLOB_RECURSE pc_file ${WORK_DIR}/prefix/*/shapegcode.pc)
cmake_path(GET pc_file PARENT_PATH pc_folder)
ask_pkg_config(flags --cflags --libs)
run(${C_COMPILER} -std=c99 -pedantic -Wall -Wextra -Werror ${EXAMPLES_DIR}/motion_controller/moving.c
    -o ${WORK_DIR}/moving_pkg_config ${flags})
# Libraries that are not installed in the system are not found by themselves.
ask_pkg_config(folders --libs-only-L)
list(TRANSFORM folders REPLACE "^-L" "")
list(JOIN folders ":" folders)
run(${CMAKE_COMMAND} -E env LD_LIBRARY_PATH=${folders} ${WORK_DIR}/moving_pkg_config)
