# CVODE with its serial vectors and dense matrices, found as headers and libraries rather than by SUNDIALS' own package
# file: Debian's stands for every part of SUNDIALS, with MPI and PETSc, and refuses where one of them is not installed.
#
# Result: SUNDIALS_FOUND, SUNDIALS_VERSION, and the targets SUNDIALS::cvode, SUNDIALS::nvecserial,
# SUNDIALS::sunmatrixdense, SUNDIALS::sunlinsoldense. SUNDIALS_ROOT names a prefix to look in first.

find_path(SUNDIALS_INCLUDE_DIR cvode/cvode.h)
mark_as_advanced(SUNDIALS_INCLUDE_DIR)
set(sundials_parts cvode nvecserial sunmatrixdense sunlinsoldense)
set(sundials_required SUNDIALS_INCLUDE_DIR)
foreach(part IN LISTS sundials_parts)
  find_library(SUNDIALS_${part}_LIBRARY sundials_${part})
  mark_as_advanced(SUNDIALS_${part}_LIBRARY)
  list(APPEND sundials_required SUNDIALS_${part}_LIBRARY)
endforeach()

unset(SUNDIALS_VERSION)
if(SUNDIALS_INCLUDE_DIR)
  file(STRINGS ${SUNDIALS_INCLUDE_DIR}/sundials/sundials_config.h version_line REGEX "define SUNDIALS_VERSION ")
  string(REGEX REPLACE ".*\"(.*)\".*" "\\1" SUNDIALS_VERSION "${version_line}")
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  SUNDIALS
  REQUIRED_VARS ${sundials_required}
  VERSION_VAR SUNDIALS_VERSION)

if(SUNDIALS_FOUND)
  foreach(part IN LISTS sundials_parts)
    if(NOT TARGET SUNDIALS::${part})
      add_library(SUNDIALS::${part} UNKNOWN IMPORTED)
      set_target_properties(SUNDIALS::${part} PROPERTIES IMPORTED_LOCATION ${SUNDIALS_${part}_LIBRARY}
                                                         INTERFACE_INCLUDE_DIRECTORIES ${SUNDIALS_INCLUDE_DIR})
    endif()
  endforeach()
  # Each stands on the matrix; the static libraries say so nowhere.
  set_property(TARGET SUNDIALS::sunlinsoldense APPEND PROPERTY INTERFACE_LINK_LIBRARIES SUNDIALS::sunmatrixdense)
  set_property(
    TARGET SUNDIALS::cvode
    APPEND
    PROPERTY INTERFACE_LINK_LIBRARIES SUNDIALS::sunlinsoldense SUNDIALS::nvecserial)
endif()
