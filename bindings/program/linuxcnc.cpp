#include <pybind11/stl.h>

#include <array>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "program/source_loader.hpp"
#include "register.hpp"
#include "shapegcode/linuxcnc_program.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

LinuxcncToolTable tool_table(std::string file, std::string unit, double unit_mm,
                             const std::map<std::int64_t, std::pair<std::array<double, 3>, double>>& tools) {
  LinuxcncToolTable table{.tools = {}, .file = std::move(file), .unit = std::move(unit), .unit_mm = unit_mm};
  for (const auto& [number, tool] : tools) table.tools[number] = {tool.first, tool.second};
  return table;
}

void define_options(py::module_& module) {
  py::class_<LinuxcncToolTable>(module, "LinuxcncToolTable", "LinuxCNC's tool table: the tools by number.")
      .def(py::init(&tool_table), py::arg("file"), py::arg("unit"), py::arg("unit_mm"), py::arg("tools"),
           "`tools`: by number the offsets of X, Y, Z and the diameter, mm.");
  py::class_<LinuxcncOptions>(module, "LinuxcncOptions", "Settings of the machine for reading a LinuxCNC program.")
      .def(py::init<>())
      .def_readwrite("file", &LinuxcncOptions::file, "Name of the program in messages.")
      .def_readwrite("first_codes", &LinuxcncOptions::first_codes,
                     "Codes to be put before the program: LinuxCNC's initial modes where the machine's differ.")
      .def_readwrite("inch", &LinuxcncOptions::inch, "Whether inch is the unit at the first line.")
      .def_readwrite("work_offset", &LinuxcncOptions::work_offset,
                     "Work offset at the first line, 1 ... 9: G54 ... G59.3.")
      .def_readwrite("work_offsets_mm", &LinuxcncOptions::work_offsets_mm, "By work offset, 1 ... 9.")
      .def_readwrite("tool_table", &LinuxcncOptions::tool_table, "The tool table; None: there is none.")
      .def_readwrite("tool_length_mm", &LinuxcncOptions::tool_length_mm, "By H number; they override the table.")
      .def_readwrite("machine_unit_mm", &LinuxcncOptions::machine_unit_mm, "Length of the machine's own unit.")
      .def_readwrite("adds_points", &LinuxcncOptions::adds_points,
                     "Whether whole numbers need a decimal point in the expanded program.")
      .def_readwrite("block_skip", &LinuxcncOptions::block_skip, "Switch of /: on, off; None: not known, taken as off.")
      .def_readwrite("max_steps", &LinuxcncOptions::max_steps, "Lines executed at most, beyond one for each line.")
      .def_readwrite("max_expansion_bytes", &LinuxcncOptions::max_expansion_bytes,
                     "Bytes by which the expanded program may be larger than the program.")
      .def_property(
          "find_subroutine", [](const LinuxcncOptions& self) { return static_cast<bool>(self.find_subroutine); },
          [](LinuxcncOptions& self, py::object find) {
            self.find_subroutine = source_loader<std::string>(std::move(find));
          },
          "Called with the name of a subroutine that the program does not contain; returns (name, bytes) or None.");
}

}  // namespace

void register_linuxcnc(py::module_& module) {
  define_options(module);
  py::class_<LinuxcncProgram>(module, "LinuxcncProgram", "A LinuxCNC program in FANUC's words.")
      .def_readonly("expanded", &LinuxcncProgram::expanded, "The program in FANUC's words.")
      .def_property_readonly(
          "path_tolerance_mm",
          [](const LinuxcncProgram& self) -> std::optional<std::pair<std::optional<double>, std::optional<double>>> {
            if (!self.path_tolerance) return std::nullopt;
            return std::pair(self.path_tolerance->p_mm, self.path_tolerance->q_mm);
          },
          "P and Q common to all its G64, mm, None for a word that is left out; None: there are several, or no G64.");
  module.attr("linuxcnc_peck_clearance_mm") = linuxcnc_peck_clearance_mm;
  module.def(
      "read_linuxcnc",
      [](const py::bytes& text, const LinuxcncOptions& options) {
        const auto view = static_cast<std::string_view>(text);
        const py::gil_scoped_release release;
        return read_linuxcnc(view, options);
      },
      py::arg("text"), py::arg("options"),
      "Executes a LinuxCNC program as its interpreter does, and returns what it executes in FANUC's words. Raises "
      "ProgramError with the file (empty: the program itself), line and column of a word that is not supported.");
}

}  // namespace shapegcode::bindings
