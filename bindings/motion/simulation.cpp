#include <pybind11/stl.h>

#include <memory>
#include <utility>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/simulation.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

py::array recorded(const Samples& samples) { return take(Eigen::MatrixXd(samples.positions_mm)); }

}  // namespace

void register_simulation(py::module_& module) {
  py::enum_<BlockEnd>(module, "BlockEnd", "When a block's successor starts.")
      .value("ceil", BlockEnd::ceil, "At the next interpolation period (paper 004).")
      .value("carry", BlockEnd::carry, "At once: the remainder of a period is carried over.");

  py::class_<DeviationStats>(module, "DeviationStats", "Statistics of a signed deviation.")
      .def_readonly("max_abs_mm", &DeviationStats::max_abs_mm, "Largest magnitude, mm.")
      .def_readonly("most_positive_mm", &DeviationStats::most_positive_mm, "Left of the path or above, mm.")
      .def_readonly("most_negative_mm", &DeviationStats::most_negative_mm, "Right of the path or below, mm.")
      .def_readonly("sum_of_squares_mm2", &DeviationStats::sum_of_squares_mm2, "mm^2.")
      .def_readonly("count", &DeviationStats::count, "Samples.")
      .def_property_readonly("rms_mm", &DeviationStats::rms_mm, "mm.");

  py::class_<ContourTracker, std::shared_ptr<ContourTracker>>(module, "ContourTracker",
                                                              "Tracks the distance of a moving point from a path.")
      .def(py::init([](const std::shared_ptr<Path>& path) { return ContourTracker(*path); }),
           py::arg("path").none(false), "Raises ArgumentError on a path without segments.");

  py::class_<SimulationOptions>(module, "SimulationOptions", "Options of a simulation and of its measurements.")
      .def(py::init<>())
      .def_readwrite("period_s", &SimulationOptions::period_s, "Interpolation period, s.")
      .def_readwrite("axis_filters", &SimulationOptions::axis_filters, "Filters after the set-points, in order.")
      .def_property(
          "tracker",
          [](const SimulationOptions& self) { return std::const_pointer_cast<ContourTracker>(self.tracker); },
          [](SimulationOptions& self, std::shared_ptr<ContourTracker> tracker) { self.tracker = std::move(tracker); },
          "Tracker of the path, whose geometry several simulations share; None: each makes its own.")
      .def_readwrite("modes", &SimulationOptions::modes, "Modes of X, Y and Z.")
      .def_readwrite("mode_tables", &SimulationOptions::mode_tables,
                     "How the modes of X, Y and Z vary with position, one table per mode; none: constant modes.")
      .def_readwrite("drives", &SimulationOptions::drives,
                     "Feed drives of X, Y and Z in place of the modes; none: modes alone.")
      .def_readwrite("settling_band_mm", &SimulationOptions::settling_band_mm,
                     "Band of the settling time, mm; 0: not measured.")
      .def_readwrite("arrived_mm", &SimulationOptions::arrived_mm,
                     "Drives: the residual is the vibration of the table relative to its motor once the motor is "
                     "within this distance of the command, mm; 0: |response - command| from the stop on.")
      .def_readwrite("settling_limit_s", &SimulationOptions::settling_limit_s,
                     "Time after the stop in which the settling time is determined; with drives also the residual, s.")
      .def_readwrite("measure_contour", &SimulationOptions::measure_contour,
                     "Whether deviations and orbit errors are measured.")
      .def_readwrite("measure_response", &SimulationOptions::measure_response,
                     "False: the command alone; no figures of the response.")
      .def_readwrite("measure_command", &SimulationOptions::measure_command,
                     "False: the deviation of the response alone, no orbit errors.")
      .def_readwrite("feed_window_s", &SimulationOptions::feed_window_s,
                     "Averaging time of the speed for its largest ratio to the programmed feed, s; four and sixteen "
                     "times it are used, too; 0: not measured.")
      .def_readwrite("feed_slack_mm", &SimulationOptions::feed_slack_mm,
                     "Distance that rounding may add within `feed_window_s`, mm.")
      .def_readwrite("last_seconds", &SimulationOptions::last_seconds,
                     "Blocks only: simulate only this time before the end, s; 0: all.")
      .def_readwrite("starved_blocks", &SimulationOptions::starved_blocks,
                     "Blocks only: also simulate a buffer underrun after each of these (ascending), one at a time.")
      .def_readwrite("measure_response_orbit", &SimulationOptions::measure_response_orbit,
                     "Also orbit errors of the response, if the contour is measured.")
      .def_readwrite("starved_s", &SimulationOptions::starved_s, "Duration of the wait in a buffer underrun, s.")
      .def_readwrite("starved_memory_s", &SimulationOptions::starved_memory_s,
                     "Time simulated after such a wait, s; 0: all.")
      .def_readwrite("other_overrides", &SimulationOptions::other_overrides,
                     "Blocks only: also compute the largest deviations at these feed overrides.")
      .def_readwrite("record_samples", &SimulationOptions::record_samples,
                     "Maximum number of stored samples; 0: none.");

  py::class_<FeedExcess>(module, "FeedExcess",
                         "The largest ratio of the speed to the programmed feed at the same position.")
      .def_readonly("speed_mm_per_s", &FeedExcess::speed_mm_per_s, "Speed there, mm/s.")
      .def_readonly("programmed_mm_per_s", &FeedExcess::programmed_mm_per_s, "Feed programmed there, mm/s.")
      .def_readonly("line", &FeedExcess::line, "Line of the segment that is programmed there.")
      .def_property_readonly("ratio", &FeedExcess::ratio, "Speed over feed; 0 where nothing was measured.");

  py::class_<StarvedFigures>(module, "StarvedFigures", "Effect of a buffer underrun.")
      .def_readonly("block", &StarvedFigures::block, "Index of the block after which the set-points wait.")
      .def_readonly("residual_mm", &StarvedFigures::residual_mm,
                    "Largest |response - command| while the set-points rest, during the wait and at the end, (3,), mm.")
      .def_readonly("command", &StarvedFigures::command, "Deviation of the command from the path.")
      .def_readonly("response", &StarvedFigures::response, "Deviation of the response from the path.");

  py::class_<OverrideFigures>(module, "OverrideFigures", "The largest deviations at another feed override.")
      .def_readonly("override_ratio", &OverrideFigures::override_ratio, "1 = 100 %.")
      .def_readonly("command_mm", &OverrideFigures::command_mm, "Of the command from the path, mm.")
      .def_readonly("response_mm", &OverrideFigures::response_mm, "Of the response from the path, mm.");

  py::class_<SimulationFigures, std::shared_ptr<SimulationFigures>>(module, "SimulationFigures",
                                                                    "Figures of one motion from rest to rest.")
      .def_readonly("duration_s", &SimulationFigures::duration_s, "Time until the set-points rest, s.")
      .def_readonly("residual_mm", &SimulationFigures::residual_mm,
                    "Largest |response - command| from the instant at which the set-points rest, (3,), mm.")
      .def_readonly("settling_s", &SimulationFigures::settling_s,
                    "Time from the rest of the set-points until |response - command| stays within the band, (3,), s; "
                    "inf: it leaves the band in the last fifth of `settling_limit_s`.")
      .def_readonly("peak_mm", &SimulationFigures::peak_mm, "Largest |response - command| in motion, (3,), mm.")
      .def_readonly("peak_acceleration_mm_per_s2", &SimulationFigures::peak_acceleration_mm_per_s2,
                    "Of the command, (3,), mm/s^2.")
      .def_readonly("command", &SimulationFigures::command, "Deviation of the command from the path.")
      .def_readonly("response", &SimulationFigures::response, "Deviation of the response from the path.")
      .def_readonly("orbit_error_percent", &SimulationFigures::orbit_error_percent,
                    "Orbit error of the command per arc of the path, in percent.")
      .def_readonly("response_orbit_error_percent", &SimulationFigures::response_orbit_error_percent,
                    "Orbit error of the response per arc of the path, in percent, if requested.")
      .def_readonly("feed_excess", &SimulationFigures::feed_excess, "Of the command, if requested.")
      .def_readonly("end_mm", &SimulationFigures::end_mm, "Last set-point, (3,), mm.")
      .def_readonly("starved", &SimulationFigures::starved, "One per SimulationOptions.starved_blocks.")
      .def_readonly("other_overrides", &SimulationFigures::other_overrides,
                    "One per SimulationOptions.other_overrides.")
      .def_property_readonly(
          "recorded_command", [](const SimulationFigures& self) { return recorded(self.recorded_command); },
          "(n, 3), mm.")
      .def_property_readonly(
          "recorded_response", [](const SimulationFigures& self) { return recorded(self.recorded_response); },
          "(n, 3), mm.");

  module.def(
      "simulate_path",
      [](std::shared_ptr<Path> path, std::shared_ptr<SpeedProfile> profile, const SimulationOptions& options,
         const std::shared_ptr<Path>& programmed) {
        const py::gil_scoped_release release;
        return std::make_shared<SimulationFigures>(
            programmed ? simulate_path(std::move(path), std::move(profile), *programmed, options)
                       : simulate_path(std::move(path), std::move(profile), options));
      },
      py::arg("path").none(false), py::arg("profile").none(false), py::arg("options"),
      py::arg("programmed") = py::none(),
      "Simulate a path under a speed profile (a controller with look-ahead) through filters and plant, measured "
      "against "
      "the programmed path (None: the path itself).");

  module.def(
      "simulate_planned",
      [](const std::shared_ptr<Path>& path, const MotionLimits& limits, const SimulationOptions& options,
         const std::shared_ptr<Path>& programmed) {
        const py::gil_scoped_release release;
        return std::make_shared<SimulationFigures>(simulate_planned(path, limits, *programmed, options));
      },
      py::arg("path").none(false), py::arg("limits"), py::arg("options"), py::arg("programmed").none(false),
      "simulate_path with the profile of plan_speed under the limits, without storing the profile if possible.");

  module.def(
      "simulate_blocks",
      [](const std::shared_ptr<Path>& blocks, const std::shared_ptr<Path>& path, BlockEnd block_end,
         double override_ratio, const SimulationOptions& options) {
        const py::gil_scoped_release release;
        return std::make_shared<SimulationFigures>(
            simulate_blocks(blocks->segments(), *path, block_end, override_ratio, options));
      },
      py::arg("blocks").none(false), py::arg("path").none(false), py::arg("block_end"), py::arg("override_ratio"),
      py::arg("options"),
      "Simulate blocks at their feed (a controller without look-ahead), measured against the programmed path.");

  module.def(
      "simulate_samples",
      [](const MatrixArray& positions_mm, const std::shared_ptr<Path>& path, const SimulationOptions& options) {
        const Samples samples = samples_from(positions_mm, options.period_s);
        const py::gil_scoped_release release;
        return std::make_shared<SimulationFigures>(simulate_samples(samples, *path, options));
      },
      py::arg("positions_mm"), py::arg("path").none(false), py::arg("options"),
      "Simulate set-points (n, 3), measured against the programmed path. Raises ArgumentError on another shape.");

  module.def(
      "simulated_duration_s",
      [](const std::shared_ptr<Path>& blocks, double period_s, BlockEnd block_end, double override_ratio) {
        const py::gil_scoped_release release;
        return blocks_duration_s(blocks->segments(), period_s, block_end, override_ratio);
      },
      py::arg("blocks").none(false), py::arg("period_s"), py::arg("block_end"), py::arg("override_ratio") = 1.0,
      "Sum of block durations, s.");

  module.def(
      "fastest_block_ends", [](const std::shared_ptr<Path>& blocks) { return fastest_block_ends(blocks->segments()); },
      py::arg("blocks").none(false),
      "Indices of the blocks after which a stop excites most: for each axis the block with the highest speed at its "
      "end, except the last block; ascending, without repetition.");

  module.def(
      "count_slowed_blocks",
      [](const std::shared_ptr<Path>& blocks, const Vector3& corner_speed_difference, const Vector3& max_feed) {
        const py::gil_scoped_release release;
        return count_slowed_blocks(blocks->segments(), {corner_speed_difference, max_feed});
      },
      py::arg("blocks").none(false), py::arg("corner_speed_difference_mm_per_s"), py::arg("max_feed_mm_per_s"),
      "Number of blocks that a controller with look-ahead would run slower than programmed.");
}

}  // namespace shapegcode::bindings
