#include "register.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_feed_schedule(py::module_& /*module*/) {}

}  // namespace shapegcode::bindings
