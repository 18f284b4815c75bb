#include "register.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_milling(py::module_& /*module*/) {}

}  // namespace shapegcode::bindings
