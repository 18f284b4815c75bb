#include <pybind11/stl.h>

#include <string>
#include <tuple>
#include <vector>

#include "register.hpp"
#include "shapegcode/expanded_program.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_expanded_program(py::module_& module) {
  py::class_<ExpandedProgram>(module, "ExpandedProgram", "A program for another control, in FANUC's words.")
      .def_property_readonly(
          "text", [](const ExpandedProgram& self) { return py::bytes(self.text); }, "The program between lines `%`.")
      .def_readonly("lines", &ExpandedProgram::lines, "For each line of the text the line of the source, from 1.")
      .def_readonly("files", &ExpandedProgram::files, "Names of other files whose lines are in it.")
      .def_readonly("line_files", &ExpandedProgram::line_files,
                    "For each line its file: 0 the source, n the n-th of `files`; empty: all of the source.")
      .def_property_readonly(
          "notes",
          [](const ExpandedProgram& self) {
            std::vector<std::tuple<std::uint32_t, std::string>> notes;
            for (const SourceNote& note : self.notes) notes.emplace_back(note.line, note.text);
            return notes;
          },
          "Line of the source and text of each note, ascending by line.");
}

}  // namespace shapegcode::bindings
