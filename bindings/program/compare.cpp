#include "shapegcode/compare.hpp"

#include <pybind11/stl.h>

#include <string>

#include "register.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

void define_kinds(py::module_& module) {
  py::enum_<ComparedKind>(module, "ComparedKind", "Kinds of program contents compared, and of differences.")
      .value("cuts", ComparedKind::cuts)
      .value("rapids", ComparedKind::rapids)
      .value("tools", ComparedKind::tools)
      .value("spindle", ComparedKind::spindle)
      .value("coolant", ComparedKind::coolant)
      .value("offsets", ComparedKind::offsets)
      .value("cycles", ComparedKind::cycles)
      .value("calls", ComparedKind::calls)
      .value("functions", ComparedKind::functions)
      .value("dwells", ComparedKind::dwells)
      .value("stops", ComparedKind::stops)
      .value("modal", ComparedKind::modal)
      .value("feeds", ComparedKind::feeds)
      .value("blocks", ComparedKind::blocks)
      .value("path", ComparedKind::path)
      .value("order", ComparedKind::order)
      .value("shaped_rapids", ComparedKind::shaped_rapids)
      .value("emission", ComparedKind::emission)
      .value("units", ComparedKind::units)
      .value("end", ComparedKind::end);
}

}  // namespace

void register_compare(py::module_& module) {
  define_kinds(module);
  py::class_<ProgramComparison>(module, "ProgramComparison", "What differs between two programs.")
      .def_property_readonly(
          "counts",
          [](const ProgramComparison& self) {
            py::list counts;
            for (std::size_t i = 0; i < compared_kinds; ++i) {
              const KindCount& count = self.counts[i];
              counts.append(
                  py::make_tuple(static_cast<ComparedKind>(i), count.original, count.emitted, count.unchanged));
            }
            return counts;
          },
          "For each kind: (ComparedKind, number in the original, in the emitted program, unchanged).")
      .def_readonly("path_mm", &ProgramComparison::path_mm,
                    "Largest distance between the paths of a cut in both programs, in either direction, mm.")
      .def_property_readonly(
          "differences",
          [](const ProgramComparison& self) {
            py::list differences;
            for (const ProgramDifference& each : self.differences) {
              differences.append(py::make_tuple(each.kind, each.original_line, each.emitted_line, each.original,
                                                each.emitted, each.distance_mm));
            }
            return differences;
          },
          "For each difference: (ComparedKind, line of the original, line of the emitted program, contents of the "
          "original, of the emitted program, distance of the paths in mm); line 0: the program has nothing there.");

  module.def(
      "compare_programs",
      [](const Program& original, const Program& emitted, const ReaderOptions& reader,
         const std::vector<std::string>& emission_lines, double joint_path_mm) {
        ComparisonOptions options;
        options.reader = reader;
        options.reader.load_program = nullptr;  // Python's, which is not called without its lock
        options.emission_lines = emission_lines;
        options.joint_path_mm = joint_path_mm;
        const py::gil_scoped_release release;
        return compare_programs(original, emitted, options);
      },
      py::arg("original").none(false), py::arg("emitted").none(false), py::arg("reader"), py::arg("emission_lines"),
      py::arg("joint_path_mm") = 0.0,
      "Compares two programs read with these options. `emission_lines`: capitals without blanks, lines that do not end "
      "a cut; `joint_path_mm`: cuts of different lengths are the same if their paths, followed in parallel, stay "
      "within it.");
}

}  // namespace shapegcode::bindings
