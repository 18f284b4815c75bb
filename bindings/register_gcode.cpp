#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/gcode/interpreter.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

py::bytes slice(const Program& program, std::size_t begin, std::size_t end) {
  end = std::min(end, program.text.size());
  begin = std::min(begin, end);
  return py::bytes(program.text.data() + begin, end - begin);
}

// The cutting moves of a range of lines as one path (the regions there, put together).
std::shared_ptr<const Path> cutting_path(const Program& program, std::uint32_t first_line, std::uint32_t last_line) {
  std::vector<std::shared_ptr<Region>> inside;
  for (const auto& region : program.regions) {
    if (region->first_line >= first_line && region->last_line <= last_line) {
      inside.push_back(region);
    }
  }
  if (inside.size() == 1) {
    return inside.front()->path;
  }
  std::vector<Segment> segments;
  for (const auto& region : inside) {
    segments.insert(segments.end(), region->path->segments().begin(), region->path->segments().end());
  }
  return std::make_shared<const Path>(std::move(segments));
}

py::list other_moves(const Program& program) {
  py::list moves;
  for (const OtherMove& move : program.other_moves) {
    moves.append(py::make_tuple(move.segment, move.dwell_s));
  }
  return moves;
}

}  // namespace

void register_gcode(py::module_& module) {
  py::class_<ModalState>(module, "ModalState", "Modal state of the controller, as G numbers.")
      .def(py::init<>())
      .def_readwrite("motion", &ModalState::motion, "Group 01: 0, 1, 2, 3.")
      .def_readwrite("plane", &ModalState::plane, "Group 02: 17, 18, 19.")
      .def_readwrite("distance", &ModalState::distance, "Group 03: 90, 91.")
      .def_readwrite("feed_mode", &ModalState::feed_mode, "Group 05: 93, 94, 95.")
      .def_readwrite("units", &ModalState::units, "Group 06: 20, 21.")
      .def_readwrite("compensation", &ModalState::compensation, "Group 07: 40, 41, 42.")
      .def_readwrite("length_offset", &ModalState::length_offset, "Group 08: 43, 44, 49.")
      .def_readwrite("length_number", &ModalState::length_number, "H.")
      .def_readwrite("cycle", &ModalState::cycle, "Group 09: 73 ... 89, 80 = none.")
      .def_readwrite("cycle_return", &ModalState::cycle_return, "Group 10: 98, 99.")
      .def_readwrite("coordinate_system", &ModalState::coordinate_system, "Group 14: 54 ... 59; 541 for G54.1.")
      .def_readwrite("exact_stop", &ModalState::exact_stop, "Group 15: 61 ... 64.")
      .def_readwrite("feed", &ModalState::feed, "F as programmed; 0 before the first.")
      .def_readonly("position_mm", &ModalState::position_mm, "Position in the active work coordinates, shape (3,), mm.")
      .def_readonly("known", &ModalState::known, "Whether each axis' position is known.");

  py::class_<ReaderOptions>(module, "ReaderOptions", "The controller's settings that change how a text is read.")
      .def(py::init<>())
      .def_readwrite("calculator_decimal_point", &ReaderOptions::calculator_decimal_point,
                     "True: X10 is 10 mm; False: 10 least increments (parameter 3401#0).")
      .def_readwrite("absolute_arc_centres", &ReaderOptions::absolute_arc_centres, "I J K are positions (not FANUC).")
      .def_readwrite("least_increment_mm", &ReaderOptions::least_increment_mm, "Metric least increment, mm.")
      .def_readwrite("least_increment_inch", &ReaderOptions::least_increment_inch, "Inch least increment, inch.")
      .def_readwrite("arc_tolerance_mm", &ReaderOptions::arc_tolerance_mm,
                     "Largest difference of an arc's radii, mm (parameter 3410).")
      .def_readwrite("max_line_length", &ReaderOptions::max_line_length, "Characters.")
      .def_readwrite("unknown_after_tool_change", &ReaderOptions::unknown_after_tool_change,
                     "Axes whose position is not known after M06.")
      .def_readwrite("work_offsets_mm", &ReaderOptions::work_offsets_mm, "G54 ... G59, mm; empty: not known.")
      .def_readwrite("power_on", &ReaderOptions::power_on, "Modal state before the first block.")
      .def_readwrite("probe_lines", &ReaderOptions::probe_lines, "Ascending lines behind which the state is kept.");

  py::class_<RegionNote>(module, "RegionNote", "An N word or a comment inside a region.")
      .def_readonly("segment", &RegionNote::segment, "Index of the segment before which it stood.")
      .def_readonly("n_number", &RegionNote::n_number, "-1: none.")
      .def_readonly("comment_offset", &RegionNote::comment_offset, "Byte offset of its comment in the text.")
      .def_readonly("comment_length", &RegionNote::comment_length, "Bytes; 0: no comment.");

  py::class_<Region, std::shared_ptr<Region>>(module, "Region", "A run of cutting moves between two stops.")
      .def_readonly("first_line", &Region::first_line, "From 1.")
      .def_readonly("last_line", &Region::last_line, "From 1, inclusive.")
      .def_readonly("text_begin", &Region::text_begin, "Byte offset of its first line.")
      .def_readonly("text_end", &Region::text_end, "Byte offset behind its last line.")
      .def_property_readonly(
          "path", [](const Region& self) { return std::const_pointer_cast<Path>(self.path); }, "Its moves.")
      .def_property_readonly(
          "notes", [](const Region& self) { return self.notes; }, "N words and comments in order.")
      .def_readonly("entry", &Region::entry, "Modal state before it.")
      .def_readonly("exit", &Region::exit, "Modal state after it.")
      .def_readonly("incremental", &Region::incremental, "Moves an axis of unknown position: its origin is arbitrary.")
      .def_readonly("exact_stop_at_end", &Region::exact_stop_at_end, "Ends with G09 or in G61.")
      .def_readonly("look_ahead_mode", &Region::look_ahead_mode,
                    "The program switched a look-ahead mode on before it (G05.1 Q1, G08 P1, G05 P10000).")
      .def_readonly("blocks", &Region::blocks, "Source blocks with a cutting move.");

  py::class_<Program, std::shared_ptr<Program>>(module, "ProgramText",
                                                "A program read: its text to the letter and its regions.")
      .def_property_readonly(
          "text", [](const Program& self) { return py::bytes(self.text); }, "The whole text.")
      .def("slice", &slice, py::arg("begin"), py::arg("end"), "Bytes of the text between two offsets.")
      .def_property_readonly(
          "size", [](const Program& self) { return self.text.size(); }, "Bytes.")
      .def_readonly("line_end", &Program::line_end, "Line end of the text.")
      .def_readonly("line_count", &Program::line_count, "Lines.")
      .def_readonly("block_count", &Program::block_count, "Lines with at least one word.")
      .def_readonly("header_offset", &Program::header_offset, "Byte offset at which a header comment may stand.")
      .def_readonly("program_number", &Program::program_number, "O number; -1: none.")
      .def_property_readonly(
          "regions", [](const Program& self) { return self.regions; }, "Runs of cutting moves in order.")
      .def_property_readonly("other_moves", &other_moves,
                             "Rapids, cycles and kept moves as (Segment, dwell_s) pairs, for the clock.")
      .def_property_readonly(
          "warnings",
          [](const Program& self) {
            py::list list;
            for (const Finding& finding : self.warnings) {
              list.append(py::make_tuple(finding.line, finding.message));
            }
            return list;
          },
          "(line, message) pairs.")
      .def_readonly("final_state", &Program::final_state, "Modal state at the end.")
      .def_property_readonly(
          "probed", [](const Program& self) { return self.probed; },
          "Modal state behind each of ReaderOptions.probe_lines.")
      .def(
          "cutting_path",
          [](const Program& self, std::uint32_t first, std::uint32_t last) {
            return std::const_pointer_cast<Path>(cutting_path(self, first, last));
          },
          py::arg("first_line"), py::arg("last_line"),
          "The cutting moves of the regions within a range of lines, as one path.");

  module.def(
      "read_program",
      [](const py::bytes& bytes, const ReaderOptions& options) {
        auto text = static_cast<std::string>(bytes);
        const py::gil_scoped_release release;
        return std::make_shared<Program>(read_program(std::move(text), options));
      },
      py::arg("text"), py::arg("options") = ReaderOptions(),
      "Read a program text (bytes). Raises ProgramError with line and column.");
}

}  // namespace shapegcode::bindings
