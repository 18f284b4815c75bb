# Installs the built library into empty prefixes, all of it and what a control embeds alone, then builds and runs the
# examples against those prefixes: through CMake, the C program once more through pkg-config, as a project without CMake
# would.
#   cmake -D BUILD_DIR= -D BUILD_TYPE= -D CXX_COMPILER= -D C_COMPILER= -D SOURCE_DIR= -D NM= -D WORK_DIR=
#         -P test_install_tree.cmake
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${WORK_DIR})
set(examples_dir ${SOURCE_DIR}/cpp/examples)
# Neither {fmt} nor SUNDIALS is found, as on a control where they are not installed.
set(without_others -D CMAKE_DISABLE_FIND_PACKAGE_fmt=ON -D CMAKE_DISABLE_FIND_PACKAGE_SUNDIALS=ON)

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY COMMAND_ECHO STDOUT)
endfunction()

# Further arguments go to CMake.
function(build_example folder prefix)
  run(${CMAKE_COMMAND} -S ${examples_dir}/${folder} -B ${WORK_DIR}/${folder} -D CMAKE_BUILD_TYPE=${BUILD_TYPE}
      -D CMAKE_CXX_COMPILER=${CXX_COMPILER} -D CMAKE_C_COMPILER=${C_COMPILER}
      -D CMAKE_PREFIX_PATH=${prefix} --no-warn-unused-cli ${ARGN})
  run(${CMAKE_COMMAND} --build ${WORK_DIR}/${folder} --config ${BUILD_TYPE})
endfunction()

# What pkg-config says about an installed library, as a list.
function(ask_pkg_config result prefix library)
  file(GLOB_RECURSE pc_file ${prefix}/*/${library}.pc)
  cmake_path(GET pc_file PARENT_PATH pc_folder)
  execute_process(COMMAND ${CMAKE_COMMAND} -E env PKG_CONFIG_PATH=${pc_folder} pkg-config ${ARGN} ${library}
                  COMMAND_ERROR_IS_FATAL ANY OUTPUT_VARIABLE said OUTPUT_STRIP_TRAILING_WHITESPACE)
  separate_arguments(said UNIX_COMMAND "${said}")
  set(${result} ${said} PARENT_SCOPE)
endfunction()

function(run_moving_of_pkg_config prefix library)
  ask_pkg_config(flags ${prefix} ${library} --cflags --libs)
  set(program ${WORK_DIR}/moving_${library})
  run(${C_COMPILER} -std=c99 -pedantic -Wall -Wextra -Werror ${examples_dir}/motion_controller/moving.c -o ${program}
      ${flags})
  # Libraries that are not installed in the system are not found by themselves.
  ask_pkg_config(folders ${prefix} ${library} --libs-only-L)
  list(TRANSFORM folders REPLACE "^-L" "")
  list(JOIN folders ":" folders)
  run(${CMAKE_COMMAND} -E env LD_LIBRARY_PATH=${folders} ${program})
endfunction()

# Whether {fmt}, CVODE or what reads programs is in a program or library, or asked for by it.
function(ask_symbols result file)
  execute_process(COMMAND ${NM} -C ${file} COMMAND_ERROR_IS_FATAL ANY OUTPUT_VARIABLE symbols)
  string(REGEX MATCH "fmt::v[0-9]+|CVode[A-Z]|N_V[A-Z]|SUN[A-Z][a-z]+|read_program" found "${symbols}")
  set(${result} "${found}" PARENT_SCOPE)
endfunction()

# --- All of it ----------------------------------------------------------------------------------------------------------
set(prefix ${WORK_DIR}/prefix)
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --config ${BUILD_TYPE} --prefix ${prefix})
build_example(controller_prototype ${prefix})
foreach(program IN ITEMS first_motion controller_prototype)
  run(${WORK_DIR}/controller_prototype/${program})
endforeach()
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
run_moving_of_pkg_config(${prefix} shapegcode)

# --- What a control embeds, alone ---------------------------------------------------------------------------------------
set(rt_prefix ${WORK_DIR}/rt_prefix)
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --config ${BUILD_TYPE} --prefix ${rt_prefix} --component rt)
build_example(motion_controller ${rt_prefix} ${without_others})
run_moving_of_pkg_config(${rt_prefix} shapegcode_rt)
file(GLOB_RECURSE rt_library ${rt_prefix}/*/libshapegcode_rt.*)
set(programs ${WORK_DIR}/motion_controller/moving ${WORK_DIR}/motion_controller/moving_c)
foreach(program IN LISTS programs)
  run(${program})
endforeach()
foreach(file IN LISTS rt_library programs ITEMS ${WORK_DIR}/moving_shapegcode_rt)
  ask_symbols(found ${file})
  if(found)
    message(FATAL_ERROR "${file} has ${found}")
  endif()
endforeach()
# The question itself: of the whole library the answer is another one.
file(GLOB_RECURSE library ${prefix}/*/libshapegcode.*)
ask_symbols(found ${library})
if(NOT rt_library OR NOT found)
  message(FATAL_ERROR "symbols of ${rt_library} and ${library} were not looked at: ${found}")
endif()
# Who asks for all of it there is told so.
execute_process(
  COMMAND ${CMAKE_COMMAND} -S ${examples_dir}/controller_prototype -B ${WORK_DIR}/not_installed
          -D CMAKE_PREFIX_PATH=${rt_prefix} -D CMAKE_CXX_COMPILER=${CXX_COMPILER}
  OUTPUT_QUIET ERROR_VARIABLE said RESULT_VARIABLE failed)
if(NOT failed OR NOT said MATCHES "only[ \n]+the[ \n]+component[ \n]+rt")
  message(FATAL_ERROR "${said}")
endif()
# And its sources are configured where there is nothing else.
run(${CMAKE_COMMAND} -S ${SOURCE_DIR} -B ${WORK_DIR}/only_rt -D SHAPEGCODE_ONLY_RT=ON ${without_others}
    -D CMAKE_CXX_COMPILER=${CXX_COMPILER})
