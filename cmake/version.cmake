# Sets shapegcode_version: what scikit-build-core says; else the last tag vX.Y.Z of git; else what stands here, which is for
# archives and for clones without tags. Between two tags the version is that of the last one, so that nothing is built
# anew because of a commit. cmake/shapegcode_version.py reads the same for Python. `cmake -P cmake/version.cmake` prints it.
set(version_without_tags 0.1.0)

set(shapegcode_version)
if(SKBUILD_PROJECT_VERSION)
  set(shapegcode_version ${SKBUILD_PROJECT_VERSION})
elseif(EXISTS ${CMAKE_CURRENT_LIST_DIR}/../.git)
  find_program(git_command git)
  mark_as_advanced(git_command)
  if(git_command)
    execute_process(
      COMMAND ${git_command} describe --tags --abbrev=0 --match v[0-9]*.[0-9]*.[0-9]*
      WORKING_DIRECTORY ${CMAKE_CURRENT_LIST_DIR}
      OUTPUT_VARIABLE tag
      ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
    string(REGEX MATCH "[0-9]+\\.[0-9]+\\.[0-9]+" shapegcode_version "${tag}")
  endif()
endif()
if(NOT shapegcode_version)
  set(shapegcode_version ${version_without_tags})
endif()
if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  execute_process(COMMAND ${CMAKE_COMMAND} -E echo ${shapegcode_version})
endif()
