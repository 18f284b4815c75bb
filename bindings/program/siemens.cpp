#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <string>
#include <utility>

#include "program/source_loader.hpp"
#include "register.hpp"
#include "shapegcode/siemens_program.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
void register_siemens(py::module_& module) {
  py::class_<SiemensOptions>(module, "SiemensOptions", "Settings for reading a SINUMERIK program.")
      .def(py::init<>())
      .def_readwrite("file", &SiemensOptions::file, "Name of the program's file in messages.")
      .def_readwrite("name", &SiemensOptions::name, "Name of a program without a header %_N_NAME_MPF, in capitals.")
      .def_readwrite("least_increment_mm", &SiemensOptions::least_increment_mm, "Of the expanded program, mm.")
      .def_readwrite("arc_radius_tolerance_mm", &SiemensOptions::arc_radius_tolerance_mm,
                     "Permitted difference of start and end radius of an arc, mm.")
      .def_readwrite("max_program_steps", &SiemensOptions::max_program_steps,
                     "Maximum number of blocks executed, beyond one for each line.")
      .def_readwrite("max_expansion_moves", &SiemensOptions::max_expansion_moves, "Maximum number of moves, likewise.")
      .def_readwrite("block_skip", &SiemensOptions::block_skip, "Whether `/` blocks are skipped; None: refused.")
      .def_readwrite("tool_change_unknown_axes", &SiemensOptions::tool_change_unknown_axes,
                     "Axes of \"XYZ\" whose position is not known after M6.")
      .def_readwrite("work_offsets", &SiemensOptions::work_offsets, "By name (\"G54\", \"G54.1P5\"), mm.")
      .def_readwrite("left_out", &SiemensOptions::left_out, "Words that are left out, each with its note.")
      .def_readwrite("left_out_addresses", &SiemensOptions::left_out_addresses, "Addresses, likewise.")
      .def_readwrite("refused", &SiemensOptions::refused,
                     "Called with a word; returns why it is refused, empty if not known.")
      .def_property(
          "called", [](const SiemensOptions& self) { return static_cast<bool>(self.called); },
          [](SiemensOptions& self, py::object find) { self.called = source_loader<std::string>(std::move(find)); },
          "Called with the name of a program in capitals; returns (name, bytes in UTF-8) or None.");
  py::class_<SiemensProgram>(module, "SiemensProgram", "A SINUMERIK program in FANUC's words.")
      .def_readonly("expanded", &SiemensProgram::expanded, "The program in FANUC's words.")
      .def_readonly("names", &SiemensProgram::names, "Pairs of a word and the word of the source that it replaces.");
  module.def(
      "read_siemens",
      [](const std::string& text, const SiemensOptions& options) {
        const py::gil_scoped_release release;
        return read_siemens(text, options);
      },
      py::arg("text"), py::arg("options"),
      "Executes a SINUMERIK program in DIN words as the control does, and returns what it executes in FANUC's words. "
      "Raises ProgramError with file, line and column of a word that is not supported.");
}

}  // namespace shapegcode::bindings
