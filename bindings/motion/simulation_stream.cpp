#include <pybind11/stl.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/simulation_stream.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

// Copies: a chunk is read once.
py::array lines_of(const SimulationChunk& chunk) {
  return py::array_t<std::uint32_t>(static_cast<py::ssize_t>(chunk.size()), chunk.line.data());
}

py::array kinds_of(const SimulationChunk& chunk) {
  static_assert(sizeof(BlockKind) == sizeof(std::uint8_t));
  py::array_t<std::uint8_t> kinds(static_cast<py::ssize_t>(chunk.size()));
  std::transform(chunk.kind.begin(), chunk.kind.end(), kinds.mutable_data(),
                 [](BlockKind kind) { return static_cast<std::uint8_t>(kind); });
  return kinds;
}

}  // namespace

void register_simulation_stream(py::module_& module) {
  py::class_<SimulationChunk, std::shared_ptr<SimulationChunk>>(module, "SimulationChunk",
                                                                "A section of a simulated motion, one row per period.")
      .def("__len__", &SimulationChunk::size)
      .def_readonly("first_sample", &SimulationChunk::first_sample,
                    "Number of its first sample; time is number * period.")
      .def_property_readonly(
          "command_mm", [](SimulationChunk& self) { return view(self.command_mm, py::cast(&self)); },
          "Set-points after every filter, (k, 3), mm.")
      .def_property_readonly(
          "response_mm", [](SimulationChunk& self) { return view(self.response_mm, py::cast(&self)); }, "(k, 3), mm.")
      .def_property_readonly(
          "velocity_mm_per_s", [](SimulationChunk& self) { return view(self.velocity_mm_per_s, py::cast(&self)); },
          "Of the command over the period that ends with the row, without the jumps of coordinates, (k, 3), mm/s.")
      .def_property_readonly(
          "motor_mm", [](SimulationChunk& self) { return view(self.motor_mm, py::cast(&self)); },
          "Feed drives: motor as travel of the table, (k, 3), mm; without drives: (0, 0).")
      .def_property_readonly(
          "motor_force_n", [](SimulationChunk& self) { return view(self.motor_force_n, py::cast(&self)); },
          "Feed drives: force of the motor, (k, 3), N; without drives: (0, 0).")
      .def_property_readonly(
          "friction_force_n", [](SimulationChunk& self) { return view(self.friction_force_n, py::cast(&self)); },
          "Feed drives: friction of the table, against its motion, (k, 3), N; without drives: (0, 0).")
      .def_property_readonly("line", &lines_of, "Line of the present block, (k,).")
      .def_property_readonly("kind", &kinds_of, "Value of its BlockKind, (k,).");

  py::class_<SimulationStream>(module, "SimulationStream",
                               "Simulates a motion through filters and plant and returns it in pieces.")
      .def_static(
          "of_path",
          [](const std::shared_ptr<Path>& path, const std::shared_ptr<SpeedProfile>& profile,
             const SimulationOptions& options,
             double rest_s) { return SimulationStream(path, profile, options, rest_s); },
          py::arg("path").none(false), py::arg("profile").none(false), py::arg("options"), py::arg("rest_s") = 0.0,
          "A path under a speed profile; after its end the set-points rest for `rest_s`.")
      .def_static(
          "of_blocks",
          [](const std::shared_ptr<Path>& blocks, BlockEnd block_end, double override_ratio,
             const SimulationOptions& options,
             double rest_s) { return SimulationStream(blocks, block_end, override_ratio, options, rest_s); },
          py::arg("blocks").none(false), py::arg("block_end"), py::arg("override_ratio"), py::arg("options"),
          py::arg("rest_s") = 0.0, "Blocks at their feed; after their end the set-points rest for `rest_s`.")
      .def_static(
          "of_program",
          [](const std::shared_ptr<Program>& program, const FanucModel& model, const SimulationOptions& options,
             const std::vector<Vector3>& region_offsets_mm,
             double rest_s) { return SimulationStream(program, model, options, region_offsets_mm, rest_s); },
          py::arg("program").none(false), py::arg("model"), py::arg("options"),
          py::arg("region_offsets_mm") = std::vector<Vector3>{}, py::arg("rest_s") = 0.0,
          "A whole program on one time axis. `region_offsets_mm`: from the positions of each region to machine "
          "positions, for modes that vary with them. Raises ArgumentError on an invalid model, options with another "
          "period, or not one offset per region.")
      .def(
          "read",
          [](SimulationStream& self, std::size_t most) {
            const py::gil_scoped_release release;
            return std::make_shared<SimulationChunk>(self.read(most));
          },
          py::arg("most"), "Returns the next rows, at most `most`; none after the end.");

  module.def(
      "csv_rows",
      [](const py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>& word,
         const std::vector<std::string>& words, const Eigen::Ref<const Eigen::MatrixXd>& table) {
        const std::span<const std::uint8_t> numbers(word.data(), static_cast<std::size_t>(word.size()));
        std::string text;
        {
          const py::gil_scoped_release release;
          text = csv_rows(numbers, words, table);
        }
        return py::bytes(text);
      },
      py::arg("word"), py::arg("words"), py::arg("table"),
      "Rows of a CSV file: a word and the numbers of a row of the table, (k, c), each as the shortest text that reads "
      "back as the same number. `word`: index of each row's word in `words`, (k,). Raises ArgumentError on unequal "
      "lengths or an index without a word.");
}

}  // namespace shapegcode::bindings
