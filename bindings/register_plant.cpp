#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <utility>
#include <vector>

#include "register.hpp"
#include "shapegcode/plant/mode_table.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

ModeTable checked_table(int axis, std::vector<double> position_mm, std::vector<double> frequency_hz,
                        std::vector<double> damping_ratio) {
  ModeTable table{axis, std::move(position_mm), std::move(frequency_hz), std::move(damping_ratio)};
  check_table(table);
  return table;
}

}  // namespace

void register_plant(py::module_& module) {
  py::class_<ModeTable>(module, "ModeTable", R"(How a mode depends on where an axis stands. Immutable.

Linear in frequency and damping ratio between the rows, constant beyond the ends; without rows the mode stays as it is.

Args:
    axis: Whose position counts: 0, 1, 2 for X, Y, Z.
    position_mm: Strictly ascending positions in mm, shape (n,).
    frequency_hz: Undamped natural frequencies in Hz, one per position, above 0.
    damping_ratio: Damping ratios (no unit), one per position, 0 <= zeta < 1; none: that of the mode.

Raises:
    ArgumentError: Unequal lengths, positions that do not ascend, or a value outside its range.)")
      .def(py::init(&checked_table), py::arg("axis") = 0, py::arg("position_mm") = std::vector<double>{},
           py::arg("frequency_hz") = std::vector<double>{}, py::arg("damping_ratio") = std::vector<double>{},
           "Make a table; ArgumentError if it is not what the class asks for.")
      .def_readonly("axis", &ModeTable::axis, "Axis whose position counts.")
      .def_readonly("position_mm", &ModeTable::position_mm, "Positions in mm.")
      .def_readonly("frequency_hz", &ModeTable::frequency_hz, "Frequencies in Hz.")
      .def_readonly("damping_ratio", &ModeTable::damping_ratio, "Damping ratios, or none.")
      .def(
          "mode_at",
          [](const ModeTable& self, const Mode& mode, double position_mm) { return mode_at(mode, self, position_mm); },
          py::arg("mode"), py::arg("position_mm"), "The mode at a position (mm) of the axis; its participation stays.");
}

}  // namespace shapegcode::bindings
