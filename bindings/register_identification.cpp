#include <pybind11/pybind11.h>

#include "register.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_identification(py::module_& module) { static_cast<void>(module); }

}  // namespace shapegcode::bindings
