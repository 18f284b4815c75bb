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
  py::class_<SiemensOptions>(module, "SiemensOptions", "What a SINUMERIK program does not say of itself.")
      .def(py::init<>())
      .def_readwrite("file", &SiemensOptions::file, "Name of the program's file, as errors name it.")
      .def_readwrite("name", &SiemensOptions::name, "Of a program without a head %_N_NAME_MPF, in capitals.")
      .def_readwrite("least_increment_mm", &SiemensOptions::least_increment_mm, "Of the expanded program.")
      .def_readwrite("arc_radius_tolerance_mm", &SiemensOptions::arc_radius_tolerance_mm,
                     "By which start and end radius of an arc may differ.")
      .def_readwrite("max_program_steps", &SiemensOptions::max_program_steps,
                     "Blocks that are executed, beside those of the text.")
      .def_readwrite("max_expansion_moves", &SiemensOptions::max_expansion_moves, "Moves, likewise.")
      .def_readwrite("block_skip", &SiemensOptions::block_skip, "Whether `/` blocks are skipped; None: not known.")
      .def_readwrite("tool_change_unknown_axes", &SiemensOptions::tool_change_unknown_axes,
                     "Axes whose position is not known behind M6.")
      .def_readwrite("work_offsets", &SiemensOptions::work_offsets, "By name, mm.")
      .def_readwrite("left_out", &SiemensOptions::left_out, "Words that are left out, with what is told of them.")
      .def_readwrite("left_out_addresses", &SiemensOptions::left_out_addresses, "Addresses likewise.")
      .def_readwrite("refused", &SiemensOptions::refused, "Called with a word: why it is refused; empty: not known.")
      .def_property(
          "called", [](const SiemensOptions& self) { return static_cast<bool>(self.called); },
          [](SiemensOptions& self, py::object find) { self.called = source_loader<std::string>(std::move(find)); },
          "Called with the name of a program in capitals; gives (name, bytes in UTF-8) or None.");
  py::class_<SiemensProgram>(module, "SiemensProgram", "A SINUMERIK program in FANUC's words.")
      .def_readonly("expanded", &SiemensProgram::expanded, "The program in FANUC's words.")
      .def_readonly("names", &SiemensProgram::names, "Words that stand for others of the source, each with that one.");
  module.def(
      "read_siemens",
      [](const std::string& text, const SiemensOptions& options) {
        const py::gil_scoped_release release;
        return read_siemens(text, options);
      },
      py::arg("text"), py::arg("options"),
      "Executes a SINUMERIK program in DIN words as the control does, and writes what it executes in FANUC's words. "
      "Raises ProgramError with file, line and column of what is not read.");
}

}  // namespace shapegcode::bindings
