#include <pybind11/stl.h>

#include <vector>

#include "register.hpp"
#include "shapegcode/milling/end_mill.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_engagement(py::module_& module) {
  py::enum_<SpindleSense>(module, "SpindleSense", "Sense in which the spindle turns, seen towards the work piece.")
      .value("clockwise", SpindleSense::clockwise, "M03.")
      .value("counter_clockwise", SpindleSense::counter_clockwise, "M04.");

  py::class_<EndMill>(module, "EndMill", "A cylindrical end mill with a flat end.")
      .def(
          py::init([](double diameter_mm, int flutes, double helix_rad, std::vector<double> runout_mm) {
            EndMill tool{diameter_mm, flutes, helix_rad, std::move(runout_mm)};
            check(tool);
            return tool;
          }),
          py::arg("diameter_mm"), py::arg("flutes"), py::arg("helix_rad") = 0.0,
          py::arg("runout_mm") = std::vector<double>{},
          "Helix of a right-hand cutter, rad; runout: how far each flute stands out beyond the mean radius, mm, in the "
          "order in which they cut. Raises ArgumentError on a value that no tool can have.")
      .def_readonly("diameter_mm", &EndMill::diameter_mm, "mm.")
      .def_readonly("flutes", &EndMill::flutes, "Their number.")
      .def_readonly("helix_rad", &EndMill::helix_rad, "rad.")
      .def_readonly("runout_mm", &EndMill::runout_mm, "One per flute, or none, mm.")
      .def_property_readonly("radius_mm", &EndMill::radius_mm, "mm.");
}

}  // namespace shapegcode::bindings
