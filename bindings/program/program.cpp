#include <pybind11/stl.h>

#include <pybind11/functional.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "arrays.hpp"
#include "program/source_loader.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

py::bytes slice(const Program& program, std::size_t begin, std::size_t end) {
  end = std::min(end, program.text.size());
  begin = std::min(begin, end);
  return py::bytes(program.text.data() + begin, end - begin);
}

std::int64_t find(const Program& program, const py::bytes& what, std::size_t begin) {
  const std::size_t at = program.text.find(static_cast<std::string_view>(what), begin);
  return at == std::string::npos ? -1 : static_cast<std::int64_t>(at);
}

void overwrite(Program& program, std::size_t begin, const py::bytes& with) {
  const auto text = static_cast<std::string_view>(with);
  if (begin > program.text.size() || text.size() > program.text.size() - begin) {
    throw Error(ErrorKind::argument, "a text is not overwritten beyond its end");
  }
  std::ranges::copy(text, program.text.begin() + static_cast<std::ptrdiff_t>(begin));
}

// One text of parts that are given up one by one, so that it stands in memory once.
std::string joined(const py::list& parts) {
  std::size_t size = 0;
  for (const py::handle part : parts)
    size += py::reinterpret_borrow<py::bytes>(part).operator std::string_view().size();
  std::string text;
  text.reserve(size);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    text += static_cast<std::string_view>(py::bytes(parts[i]));
    parts[i] = py::none();
  }
  parts.attr("clear")();
  return text;
}

// The cutting moves of a range of lines of the source as one path (the regions there, put together).
std::shared_ptr<const Path> cutting_path(const Program& program, std::uint32_t first_line, std::uint32_t last_line) {
  const auto source_line = [&program](std::uint32_t line) {
    return program.expanded ? program.origins[line - 1].line : line;
  };
  std::vector<std::shared_ptr<Region>> inside;
  // Regions lie in the order of their lines, of an expanded text not in that of the source's. Asked of every region of
  // a long program, a look at all of them would be too much.
  const auto first = program.expanded ? program.regions.begin()
                                      : std::ranges::lower_bound(program.regions, first_line, {}, &Region::first_line);
  for (auto at = first; at != program.regions.end() && (program.expanded || (*at)->first_line <= last_line); ++at) {
    if (source_line((*at)->first_line) >= first_line && source_line((*at)->last_line) <= last_line) {
      inside.push_back(*at);
    }
  }
  if (inside.size() == 1) {
    return inside.front()->path;
  }
  PathBuilder joined;
  for (const auto& region : inside) {
    for (const Segment& segment : region->path->segments()) joined.add(segment);
  }
  return std::make_shared<const Path>(joined.path());
}

std::shared_ptr<Region> one_line_region(const std::shared_ptr<Path>& path, const ModalState& entry,
                                        const ModalState& exit, std::uint32_t line, std::size_t text_begin,
                                        std::size_t text_end) {
  auto region = std::make_shared<Region>();
  region->first_line = region->last_line = line;
  region->text_begin = text_begin;
  region->text_end = text_end;
  region->path = path;
  region->entry = entry;
  region->exit = exit;
  region->exact_stop_at_end = true;
  region->blocks = 1;
  return region;
}

char one_letter(const std::string& text, const char* allowed) {
  if (text.size() != 1 || std::string(allowed).find(text) == std::string::npos) {
    throw Error(ErrorKind::argument, "'" + text + "' must be one of the letters " + allowed);
  }
  return text.front();
}

// Text of a program as Python's; any byte is a character.
py::str latin1(const std::string& text) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeLatin1(text.data(), static_cast<Py_ssize_t>(text.size()), nullptr));
}

py::list findings(const std::vector<Finding>& all) {
  py::list list;
  for (const Finding& finding : all) {
    list.append(py::make_tuple(finding.line, finding.column, finding.alarm, finding.message, finding.file));
  }
  return list;
}

py::list steps(const Program& program) {
  py::list list;
  for (const ProgramStep& step : program.steps) {
    list.append(py::make_tuple(step.kind, step.index, step.line));
  }
  return list;
}

py::list functions(const Program& program) {
  py::list list;
  for (const MachineFunction& function : program.functions) {
    const std::vector<int> m_codes(function.m_codes.begin(), function.m_codes.begin() + function.m_count);
    list.append(py::make_tuple(m_codes, function.tool, function.spindle_rev_per_min));
  }
  return list;
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
      .def_readwrite("coordinate_number", &ModalState::coordinate_number, "P of G54.1.")
      .def_readwrite("exact_stop", &ModalState::exact_stop, "Group 15: 61 ... 64.")
      .def_readwrite("feed", &ModalState::feed, "F as programmed; 0 before the first.")
      .def_readwrite("spindle_rev_per_min", &ModalState::spindle_rev_per_min, "S; 0 before the first.")
      .def_readonly("position_mm", &ModalState::position_mm, "Position in the active work coordinates, shape (3,), mm.")
      .def_readonly("known", &ModalState::known, "Whether each axis' position is known.")
      .def_property_readonly(
          "uncertain", [](const ModalState& self) { return self.uncertain_groups != 0; },
          "Whether a modal code depends on the block-skip switch.");

  py::enum_<StepKind>(module, "StepKind", "What a step of a program is.")
      .value("region", StepKind::region)
      .value("move", StepKind::move)
      .value("function", StepKind::function);

  py::class_<ToolOffset>(module, "ToolOffset", "Offsets of one tool, mm; None: not known.")
      .def(py::init<>())
      .def_readwrite("length_mm", &ToolOffset::length_mm, "Geometry of H.")
      .def_readwrite("length_wear_mm", &ToolOffset::length_wear_mm, "Wear of H.")
      .def_readwrite("radius_mm", &ToolOffset::radius_mm, "Geometry of D.")
      .def_readwrite("radius_wear_mm", &ToolOffset::radius_wear_mm, "Wear of D.");

  py::class_<CodeBindings>(module, "CodeBindings", "Codes that the machine builder bound to programs.")
      .def(py::init<>())
      .def_readwrite("g_macros", &CodeBindings::g_macros, "G code in tenths to program, called like G65.")
      .def_readwrite("m_macros", &CodeBindings::m_macros, "M code to program, called like G65.")
      .def_readwrite("m_subprograms", &CodeBindings::m_subprograms, "M code to program, called like M98.")
      .def_readwrite("tool_program", &CodeBindings::tool_program, "T calls it with T in #149; -1: none.");

  py::class_<WorkLimits>(module, "WorkLimits", "Limits of the work that a program may cause, checked while it is read.")
      .def(py::init<>())
      .def_readwrite("steps", &WorkLimits::steps, "Lines executed, not counting the first time of each.")
      .def_readwrite("moves", &WorkLimits::moves, "Moves, dwells, and blocks with machine functions.")
      .def_readwrite("bytes", &WorkLimits::bytes, "Bytes of program texts read.")
      .def_readwrite("expansion_moves", &WorkLimits::expansion_moves, "Moves beyond one for each line of the texts.")
      .def_readwrite("expansion_bytes", &WorkLimits::expansion_bytes, "Bytes by which the expanded program is longer.")
      .def_readwrite("seconds", &WorkLimits::seconds,
                     "Minimum time: moves at their feed, dwells, tool changes and M codes, s.")
      .def_readwrite("feed_mm_per_s", &WorkLimits::feed_mm_per_s, "Highest speed of each axis while cutting, mm/s.")
      .def_readwrite("rapid_mm_per_s", &WorkLimits::rapid_mm_per_s, "Highest speed of each axis in a rapid, mm/s.")
      .def_readwrite("tool_change_s", &WorkLimits::tool_change_s, "Time of an M06, s.")
      .def_readwrite("m_function_s", &WorkLimits::m_function_s, "Time of any other M code, s.");

  py::class_<ReaderOptions>(module, "ReaderOptions", "Settings of the control that change the meaning of a program.")
      .def(py::init<>())
      .def_readwrite("calculator_decimal_point", &ReaderOptions::calculator_decimal_point,
                     "True: X10 is 10 mm; False: 10 least increments (parameter 3401#0).")
      .def_readwrite("absolute_arc_centres", &ReaderOptions::absolute_arc_centres, "I J K are positions (not FANUC).")
      .def_readwrite("least_increment_mm", &ReaderOptions::least_increment_mm, "Metric least increment, mm.")
      .def_readwrite("least_increment_inch", &ReaderOptions::least_increment_inch, "Inch least increment, inch.")
      .def_readwrite("arc_tolerance_mm", &ReaderOptions::arc_tolerance_mm,
                     "Largest difference of an arc's radii, mm (parameter 3410).")
      .def_readwrite("arc_without_centre_is_line", &ReaderOptions::arc_without_centre_is_line,
                     "G02, G03 without R, I, J, K are lines (parameter 3403#5 = 0); False: alarm 0022.")
      .def_readwrite("max_line_length", &ReaderOptions::max_line_length, "Maximum length of a line in characters.")
      .def_readwrite("unknown_after_tool_change", &ReaderOptions::unknown_after_tool_change,
                     "Axes whose position is not known after M06.")
      .def_readwrite("work_offsets_mm", &ReaderOptions::work_offsets_mm, "G54 ... G59, mm; empty: not known.")
      .def_readwrite("extra_work_offsets_mm", &ReaderOptions::extra_work_offsets_mm, "G54.1 P number to offsets, mm.")
      .def_readwrite("tool_offsets", &ReaderOptions::tool_offsets, "H or D number to ToolOffset.")
      .def_property(
          "offset_memory", [](const ReaderOptions& self) { return std::string(1, self.offset_memory); },
          [](ReaderOptions& self, const std::string& memory) { self.offset_memory = one_letter(memory, "ABC"); },
          "Offset memory A, B or C.")
      .def_readwrite("retained_variables", &ReaderOptions::retained_variables, "#500 ... #999.")
      .def_readwrite("bindings", &ReaderOptions::bindings, "Codes bound to programs.")
      .def_readwrite("program", &ReaderOptions::program, "O number of the program to read; -1: the first.")
      .def_readwrite(
          "program_index", &ReaderOptions::program_index,
          "Index in `list_programs` of the program to read, of which alone `text` then consists; -1: by number.")
      .def_property(
          "load_program", [](const ReaderOptions& self) { return static_cast<bool>(self.load_program); },
          [](ReaderOptions& self, py::object loader) {
            self.load_program = source_loader<std::int64_t>(std::move(loader));
          },
          "Called with an O number that the file does not contain; returns (name, bytes) or None.")
      .def_readwrite("opaque_programs", &ReaderOptions::opaque_programs,
                     "First and last number of the programs whose calls are left unchanged if they are not found.")
      .def_readwrite("subprogram_nesting", &ReaderOptions::subprogram_nesting, "Deepest nesting of M98.")
      .def_readwrite("limits", &ReaderOptions::limits, "Limits of the work that a program may cause.")
      .def_readwrite("block_skip", &ReaderOptions::block_skip, "Switch of / ... /9: on, off, or None: not known.")
      .def_readwrite("expand_compensation", &ReaderOptions::expand_compensation,
                     "G41/G42 become simple moves; False: left unchanged.")
      .def_property(
          "compensation_start_up", [](const ReaderOptions& self) { return std::string(1, self.compensation_start_up); },
          [](ReaderOptions& self, const std::string& type) { self.compensation_start_up = one_letter(type, "AB"); },
          "Start-up of cutter compensation, A or B (parameter 5003).")
      .def_readwrite("scale_unit", &ReaderOptions::scale_unit, "Unit of the factors of G51 without a decimal point.")
      .def_readwrite("peck_clearance_mm", &ReaderOptions::peck_clearance_mm,
                     "Clearance to which a peck of G73 and G83 returns, mm (parameters 5114, 5115).")
      .def_readwrite("collect_alarms", &ReaderOptions::collect_alarms,
                     "Continue after an alarm, and store all in ProgramText.alarms.")
      .def_readwrite("power_on", &ReaderOptions::power_on, "Modal state before the first block.")
      .def_readwrite("probe_lines", &ReaderOptions::probe_lines,
                     "Ascending lines of the source after which the modal state is stored (ProgramText.probed).");

  py::class_<RegionNote>(module, "RegionNote", "An N word or a comment inside a region.")
      .def_readonly("segment", &RegionNote::segment, "Index of the segment that follows it.")
      .def_readonly("n_number", &RegionNote::n_number, "-1: none.")
      .def_readonly("n_digits", &RegionNote::n_digits, "Digits of it as written: N0010 has four.")
      .def_readonly("comment_offset", &RegionNote::comment_offset, "Byte offset of its comment in the text.")
      .def_readonly("comment_length", &RegionNote::comment_length, "Bytes; 0: no comment.");

  py::class_<Region, std::shared_ptr<Region>>(module, "Region", "Cutting moves between two stops.")
      .def(py::init(&one_line_region), py::kw_only(), py::arg("path").none(false), py::arg("entry"), py::arg("exit"),
           py::arg("line"), py::arg("text_begin"), py::arg("text_end"),
           "One line of a text as a region that ends with an exact stop: cutting moves instead of a rapid. `path`: its "
           "move; `entry`, `exit`: modal state before and after it; `text_begin`, `text_end`: its bytes.")
      .def_readonly("first_line", &Region::first_line, "From 1.")
      .def_readonly("last_line", &Region::last_line, "From 1, inclusive.")
      .def_readonly("text_begin", &Region::text_begin, "Byte offset of its first line.")
      .def_readonly("text_end", &Region::text_end, "Byte offset after its last line.")
      .def_property_readonly(
          "path", [](const Region& self) { return std::const_pointer_cast<Path>(self.path); }, "Its moves.")
      .def_property_readonly(
          "notes", [](const Region& self) { return self.notes; }, "N words and comments in order.")
      .def_readonly("entry", &Region::entry, "Modal state before it.")
      .def_readonly("exit", &Region::exit, "Modal state after it.")
      .def_readonly("incremental", &Region::incremental, "Moves an axis of unknown position: its origin is arbitrary.")
      .def_readonly("exact_stop_at_end", &Region::exact_stop_at_end, "Whether its last block has G09 or is in G61.")
      .def_readonly("shaped", &Region::shaped, "Whether the program marks it as shaped blocks.")
      .def_readonly("was_rapid", &Region::was_rapid, "Whether its shaped blocks replace a rapid.")
      .def_readonly("look_ahead_mode", &Region::look_ahead_mode,
                    "The program switched a look-ahead mode on before it (G05.1 Q1, G08 P1, G05 P10000).")
      .def_readonly("blocks", &Region::blocks, "Source blocks with a cutting move.");

  py::class_<Program, std::shared_ptr<Program>>(module, "ProgramText", py::buffer_protocol(),
                                                "A program after reading: its exact text and its regions.")
      .def_buffer([](Program& self) {
        return py::buffer_info(reinterpret_cast<unsigned char*>(self.text.data()),  // NOLINT: bytes
                               static_cast<py::ssize_t>(self.text.size()), true);
      })
      .def(
          "view", [](const py::object& self) { return py::memoryview(self); }, "The text without a copy.")
      .def_property_readonly(
          "unexpanded", [](const Program& self) { return py::bytes(self.unexpanded); },
          "The original text, if `text` is the expanded program; else empty.")
      .def("find", &find, py::arg("what"), py::arg("begin") = 0,
           "Index of the first occurrence of bytes in the text from `begin` on, or -1.")
      .def("overwrite", &overwrite, py::arg("begin"), py::arg("what"),
           "Overwrites the text from `begin` on with the bytes `what`. Raises ArgumentError beyond the text's end.")
      .def_property_readonly(
          "text", [](const Program& self) { return py::bytes(self.text); }, "The whole text.")
      .def("slice", &slice, py::arg("begin"), py::arg("end"), "Bytes of the text between two offsets.")
      .def_property_readonly(
          "size", [](const Program& self) { return self.text.size(); }, "Bytes.")
      .def_readonly("line_end", &Program::line_end, "Line end of the text.")
      .def_readonly("line_count", &Program::line_count, "Lines.")
      .def_readonly("block_count", &Program::block_count, "Lines with at least one word.")
      .def_readonly("move_count", &Program::move_count, "Moves, dwells, and blocks with machine functions.")
      .def_readonly("least_time_s", &Program::least_time_s,
                    "Minimum time: moves at their feed within the axis limits, without acceleration; dwells, tool "
                    "changes and M codes, s.")
      .def_readonly("header_offset", &Program::header_offset, "Byte offset at which a header comment may be inserted.")
      .def_readonly("program_number", &Program::program_number, "O number; -1: none.")
      .def_property_readonly(
          "regions", [](const Program& self) { return self.regions; }, "Regions in order.")
      .def_property_readonly("other_moves", &other_moves,
                             "Moves and waits outside of the regions as (Segment, dwell_s) pairs, for the cycle time.")
      .def_property_readonly("steps", &steps,
                             "(StepKind, index into regions, other_moves or functions, line) in program order.")
      .def_property_readonly("functions", &functions, "(M codes, T or -1, S or -1) of blocks with M, S or T words.")
      .def_property_readonly(
          "warnings", [](const Program& self) { return findings(self.warnings); },
          "(line, column, alarm, message, file) each; alarm 0: none; file empty: the program's own.")
      .def_property_readonly(
          "alarms", [](const Program& self) { return findings(self.alarms); },
          "What a control would refuse, as `warnings`; only with ReaderOptions.collect_alarms.")
      .def_readonly("expanded", &Program::expanded,
                    "Whether `text` is the expanded program, with calls, macros and coordinate modes resolved.")
      .def(
          "origin",
          [](const Program& self, std::uint32_t line) -> py::tuple {
            if (self.origins.empty() || line == 0 || line > self.origins.size()) {
              return py::make_tuple(line, std::string());
            }
            const LineOrigin& origin = self.origins[line - 1];
            return py::make_tuple(origin.line, self.files[origin.file]);
          },
          py::arg("line"), "(line, file) of the source from which a line of `text` comes.")
      .def(
          "lead_back",
          [](Program& self, const py::bytes& source, const std::vector<std::uint32_t>& lines,
             const std::vector<std::uint32_t>& line_files, const std::vector<std::string>& files,
             const std::vector<std::pair<std::uint32_t, std::string>>& notes) {
            if (!line_files.empty() && line_files.size() != lines.size()) {
              throw Error(ErrorKind::argument, "line_files has another size than lines");
            }
            std::vector<LineOrigin> origins;
            origins.reserve(lines.size());
            for (std::size_t i = 0; i < lines.size(); ++i) {
              origins.push_back({lines[i], line_files.empty() ? 0U : line_files[i]});
            }
            std::vector<Finding> findings;
            for (const auto& [line, message] : notes) {
              findings.push_back({line, message, 0, 0, ""});
            }
            lead_back(self, static_cast<std::string>(source), origins, files, std::move(findings));
          },
          py::arg("source"), py::arg("lines"), py::arg("line_files"), py::arg("files"), py::arg("notes"),
          "Relates the program to `source`, the text (bytes) in another control's dialect from which it was "
          "translated. `lines`: for each line of the program's original text the line of the source; `line_files`: its "
          "file, 0 the source, n the n-th of `files`; empty: all of the source; `notes`: (line of the source, "
          "message), added to the warnings. Raises ArgumentError if lines are missing.")
      .def_readonly("called", &Program::called,
                    "Indices in `list_programs` of programs of the file that others called.")
      .def_readonly("program_numbers", &Program::program_numbers, "All O numbers in the file.")
      .def_readonly("expanded_radii_mm", &Program::expanded_radii_mm,
                    "D number to radius, mm, where cutter compensation was expanded.")
      .def_readonly("compensated_moves", &Program::compensated_moves, "Cutting moves under G41 or G42, expanded.")
      .def_readonly("kept_compensated_moves", &Program::kept_compensated_moves,
                    "Cutting moves under G41 or G42, left unchanged.")
      .def_readonly("final_state", &Program::final_state, "Modal state at the end.")
      .def_property_readonly(
          "probed", [](const Program& self) { return self.probed; },
          "Modal state after each of ReaderOptions.probe_lines.")
      .def(
          "cutting_path",
          [](const Program& self, std::uint32_t first, std::uint32_t last) {
            return std::const_pointer_cast<Path>(cutting_path(self, first, last));
          },
          py::arg("first_line"), py::arg("last_line"),
          "The cutting moves of the regions within a range of lines of the source, as one path.");

  py::class_<ProgramEntry>(module, "ProgramEntry", "A program of a file that may contain several.")
      .def_readonly("number", &ProgramEntry::number, "O number; -1: it has none.")
      .def_property_readonly(
          "name", [](const ProgramEntry& self) { return latin1(self.name); },
          "Name in a line <NAME> or O<NAME>, with its brackets; empty: none.")
      .def_property_readonly(
          "folder", [](const ProgramEntry& self) { return latin1(self.folder); },
          "Folder in the &F= line before it, as written; empty: none.")
      .def_readonly("first_line", &ProgramEntry::first_line, "From 1.")
      .def_readonly("text_begin", &ProgramEntry::text_begin, "Byte offset of its first line.")
      .def_readonly("text_end", &ProgramEntry::text_end, "Byte offset after its last line.");

  module.def(
      "list_programs",
      [](const py::bytes& bytes) {
        const auto text = static_cast<std::string>(bytes);
        const py::gil_scoped_release release;
        return list_programs(text);
      },
      py::arg("text"),
      "The programs of a text (bytes) in order. Raises ProgramError if its '%' lines or its O numbers cannot be read.");

  module.def(
      "read_program",
      [](const py::bytes& bytes, const ReaderOptions& options) {
        auto text = static_cast<std::string>(bytes);
        const py::gil_scoped_release release;
        return std::make_shared<Program>(read_program(std::move(text), options));
      },
      py::arg("text"), py::arg("options") = ReaderOptions(),
      "Read a program text (bytes). Raises ProgramError with line and column.");

  module.def(
      "read_parts",
      [](const py::list& parts, const ReaderOptions& options) {
        std::string text = joined(parts);
        const py::gil_scoped_release release;
        return std::make_shared<Program>(read_program(std::move(text), options));
      },
      py::arg("parts"), py::arg("options"),
      "Reads a program text in parts (a list of bytes). The list is emptied meanwhile, so that the text is in memory "
      "only once.");
}

}  // namespace shapegcode::bindings
