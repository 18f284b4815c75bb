#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/command.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/write.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

struct FittedBlocks {
  std::vector<FittedBlock> blocks;
  std::uint32_t left_periods = 0;
};

}  // namespace

void register_emission(py::module_& module) {
  py::class_<FitOptions>(module, "FitOptions", "Grid on which blocks are fitted.")
      .def(py::init<>())
      .def_readwrite("increment_mm", &FitOptions::increment_mm, "Least increment of the words, mm.")
      .def_readwrite("block_period_s", &FitOptions::block_period_s, "s.")
      .def_readwrite("interpolation_period_s", &FitOptions::interpolation_period_s, "s.")
      .def_readwrite("feed_unit_mm_per_s", &FitOptions::feed_unit_mm_per_s, "One step of the last F digit, mm/s.")
      .def_readwrite("minimum_feed", &FitOptions::minimum_feed, "In feed units.")
      .def_readwrite("merge_tolerance_increments", &FitOptions::merge_tolerance_increments,
                     "Permitted deviation of merged blocks from the shaped command, per axis, least increments.")
      .def_readwrite("most_periods", &FitOptions::most_periods,
                     "Longest block, block periods. 1: all blocks have the same duration, for other feed overrides.")
      .def_readwrite("equal_above_increments", &FitOptions::equal_above_increments,
                     "Blocks may be longer if the command moves no further per interpolation period, increments.")
      .def_readwrite("equal_periods", &FitOptions::equal_periods,
                     "Likewise blocks this far from both ends of a section at constant velocity; 0: none.")
      .def_readwrite("lent_periods", &FitOptions::lent_periods, "Periods by which the blocks before were too short.")
      .def_readwrite("modes", &FitOptions::modes,
                     "Modes of X, Y, Z, which the rounding of block ends leaves at rest; none: ends are rounded to the "
                     "nearest increment.")
      .def(
          "end_with_arc",
          [](FitOptions& self, bool clockwise, int normal, double radius_mm) {
            self.last_kind = clockwise ? FittedKind::clockwise : FittedKind::counter_clockwise;
            self.last_normal = static_cast<std::uint8_t>(normal);
            self.last_radius_mm = radius_mm;
          },
          py::arg("clockwise"), py::arg("normal"), py::arg("radius_mm"),
          "The last block must be an arc, so that the modal motion code after it is G02 or G03.")
      .def_readwrite("smooth_arcs_mm", &FitOptions::smooth_arcs_mm,
                     "Distance by which the middle of an arc may be moved to reduce the angle to its neighbours, mm.")
      .def_readwrite("arc_min_chord_mm", &FitOptions::arc_min_chord_mm, "Arcs with a shorter chord are lines, mm.");

  py::class_<FittedBlocks, std::shared_ptr<FittedBlocks>>(module, "FittedBlocks", "Blocks ready to be written.")
      .def("__len__", [](const FittedBlocks& self) { return self.blocks.size(); })
      .def_readonly("left_periods", &FittedBlocks::left_periods,
                    "Periods by which the blocks are too short: `FitOptions.lent_periods` of the next piece.")
      .def_property_readonly(
          "periods",
          [](const FittedBlocks& self) {
            py::array_t<std::uint32_t> out(static_cast<py::ssize_t>(self.blocks.size()));
            auto* to = out.mutable_data();
            for (const FittedBlock& block : self.blocks) {
              *to++ = block.periods;
            }
            return out;
          },
          "Whole block periods that each lasts, (n,).")
      .def_property_readonly(
          "first_periods",
          [](const FittedBlocks& self) {
            py::array_t<std::uint32_t> out(static_cast<py::ssize_t>(self.blocks.size()));
            auto* to = out.mutable_data();
            for (const FittedBlock& block : self.blocks) {
              *to++ = block.first_period;
            }
            return out;
          },
          "Block period of the command in which each begins, (n,).")
      .def_property_readonly(
          "ends",
          [](const FittedBlocks& self) {
            py::array_t<std::int64_t> out({static_cast<py::ssize_t>(self.blocks.size()), py::ssize_t{axis_count}});
            auto* to = out.mutable_data();
            for (const FittedBlock& block : self.blocks) {
              to = std::copy(block.end.begin(), block.end.end(), to);
            }
            return out;
          },
          "Absolute end positions in least increments, (n, 3).");

  module.def(
      "fit_blocks",
      [](const ShapedCommand& command, const std::vector<std::uint32_t>& breaks, const FitOptions& options) {
        const py::gil_scoped_release release;
        auto fitted = std::make_shared<FittedBlocks>();
        fitted->blocks = fit_blocks(command.grid_mm, command.middle_mm, command.arc_normal, {breaks, command.run_ends},
                                    options, &fitted->left_periods);
        return fitted;
      },
      py::arg("command"), py::arg("breaks"), py::arg("options"),
      "Blocks that each last a whole number of block periods; `breaks`: ascending periods at which a block must end. "
      "Raises ArgumentError on a position outside +-99999.999 mm.");

  py::class_<BlockMark>(module, "BlockMark",
                        "An N word and a comment, written before the first block that begins at `period` or later.")
      .def(py::init([](std::uint32_t period, std::int32_t n_number, const py::bytes& comment, std::uint32_t n_digits) {
             return BlockMark{period, n_number, static_cast<std::string>(comment), n_digits};
           }),
           py::arg("period"), py::arg("n_number") = -1, py::arg("comment") = py::bytes(), py::arg("n_digits") = 0);

  py::class_<WriterOptions>(module, "WriterOptions", "How fitted blocks are written.")
      .def(py::init<>())
      .def_readwrite("position_decimals", &WriterOptions::position_decimals, "Decimals of a position word.")
      .def_readwrite("feed_decimals", &WriterOptions::feed_decimals, "Decimals of F.")
      .def_readwrite("incremental", &WriterOptions::incremental, "G91 words.")
      .def_readwrite("motion", &WriterOptions::motion, "Motion code active before the first block.")
      .def_readwrite("plane", &WriterOptions::plane, "Plane active before the first block.")
      .def_readwrite("exact_stop_at_end", &WriterOptions::exact_stop_at_end, "G09 on the last block.")
      .def_readwrite("line_end", &WriterOptions::line_end, "Line end.");

  module.def(
      "write_blocks",
      [](const FittedBlocks& fitted, const std::array<std::int64_t, axis_count>& start,
         const std::vector<BlockMark>& marks, const WriterOptions& options) {
        WrittenBlocks written;
        {
          const py::gil_scoped_release release;
          written = write_blocks(fitted.blocks, start, marks, options);
        }
        return std::make_tuple(py::bytes(written.text), written.motion, written.plane);
      },
      py::arg("blocks").none(false), py::arg("start"), py::arg("marks"), py::arg("options"),
      "Text of fitted blocks: (bytes, modal motion code after it, modal plane after it); `start` in increments.");

  module.def(
      "busiest_per_s",
      [](const VectorArray& durations_s, const std::optional<VectorArray>& amounts, double stretch_s) {
        const std::span<const double> durations(durations_s.data(), static_cast<std::size_t>(durations_s.size()));
        std::span<const double> given;
        if (amounts) given = {amounts->data(), static_cast<std::size_t>(amounts->size())};
        if (amounts && given.size() != durations.size()) {
          throw Error(ErrorKind::argument,
                      fmt::format("{} durations and {} amounts: must be as many", durations.size(), given.size()));
        }
        const py::gil_scoped_release release;
        return busiest_per_s(durations, given, stretch_s);
      },
      py::arg("durations_s"), py::arg("amounts"), py::arg("stretch_s"),
      "Largest amount per second in any time window; each block's amount is spread evenly over its "
      "duration.\n\n`durations_s`: of the blocks, s, (n,); `amounts`: of each block, such as its characters, (n,); "
      "None: one each; `stretch_s`: duration of the window, s; all blocks together if they are shorter.");
}

}  // namespace shapegcode::bindings
