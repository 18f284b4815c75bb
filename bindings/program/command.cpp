#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/command.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

using Column = py::array_t<double, py::array::c_style | py::array::forcecast>;

}  // namespace

void register_shaped_command(py::module_& module) {
  py::enum_<ContourTarget>(module, "ContourTarget", "Which motion is to follow the programmed path.")
      .value("none", ContourTarget::none, "None: shaping without contour compensation.")
      .value("command", ContourTarget::command, "The shaped command.")
      .value("response", ContourTarget::response, "The plant's response to it: the part.");

  py::enum_<CommandPlanner>(module, "CommandPlanner", "What plans the command of a motion before it is shaped.")
      .value("look_ahead", CommandPlanner::look_ahead, "Ramps along the path, corners passed slowly.")
      .value("time_optimal", CommandPlanner::time_optimal,
             "Corners rounded within the contour tolerance, jerk of every axis limited.");

  py::class_<ShapingOptions>(module, "ShapingOptions",
                             "How a region is turned into a shaped command on the block grid.")
      .def(py::init<>())
      .def_readwrite("limits", &ShapingOptions::limits, "Limits of the look-ahead.")
      .def_readwrite(
          "planner", &ShapingOptions::planner,
          "What plans the command; `time_optimal` needs feed, acceleration and jerk of every axis in `limits`.")
      .def_readwrite("tolerance", &ShapingOptions::tolerance, "Tolerance for the shaper and the filters after it.")
      .def_readwrite("block_period_s", &ShapingOptions::block_period_s, "s.")
      .def_readwrite("interpolation_period_s", &ShapingOptions::interpolation_period_s, "s.")
      .def_readwrite("plunge_axis_angle_rad", &ShapingOptions::plunge_axis_angle_rad,
                     "Largest angle from the tool axis Z that still counts as a plunge, rad.")
      .def_readwrite("plunge_corner_angle_rad", &ShapingOptions::plunge_corner_angle_rad,
                     "Smallest change of direction of a corner with a plunge that is a forced stop, rad.")
      .def_readwrite("further_stops", &ShapingOptions::further_stops,
                     "Ascending indices of segments before which the command also stops.")
      .def_readwrite("rest_at_stop_s", &ShapingOptions::rest_at_stop_s, "Pause at a forced stop, s.")
      .def_readwrite("target", &ShapingOptions::target,
                     "Motion that contour compensation brings back to the path, within the contour tolerance.")
      .def_readwrite("modes", &ShapingOptions::modes, "Modes of X, Y and Z, for the response as target.")
      .def_readwrite("following", &ShapingOptions::following,
                     "Shapers along an axis instead of the one shaper, taps in whole block periods; None: none.")
      .def_readwrite("mode_tables", &ShapingOptions::mode_tables,
                     "How the modes vary with the position of the axis of `following`, for the response as target.")
      .def_readwrite("axis_shapers", &ShapingOptions::axis_shapers,
                     "A shaper for each of X, Y and Z, of one mean delay, instead of the common one; empty: none.")
      .def_readwrite("feed_excess_ratio", &ShapingOptions::feed_excess_ratio,
                     "Ratio by which the shaped command may exceed the programmed feed along the path.")
      .def_readwrite("least_feed_mm_per_s", &ShapingOptions::least_feed_mm_per_s,
                     "Lowest feed of the controller: no motion is slowed below it for the tolerance, mm/s.")
      .def_readwrite("contour_smoothness", &ShapingOptions::contour_smoothness,
                     "Weight of the correction's second differences.");

  py::class_<ShapedCommand, std::shared_ptr<ShapedCommand>>(module, "ShapedCommand",
                                                            "A shaped command on the block grid.")
      .def_readonly("first_period", &ShapedCommand::first_period, "Periods of the region before this part.")
      .def_property_readonly(
          "grid_mm", [](const std::shared_ptr<ShapedCommand>& self) { return view(self->grid_mm, py::cast(self)); },
          "(n+1, 3) positions at multiples of the block period, mm, read-only view.")
      .def_property_readonly(
          "middle_mm", [](const std::shared_ptr<ShapedCommand>& self) { return view(self->middle_mm, py::cast(self)); },
          "(n, 3) positions half a period later, mm, read-only view.")
      .def_property_readonly(
          "arc_normal", [](const ShapedCommand& self) { return self.arc_normal; },
          "Per period the axis perpendicular to the plane of an arc, or -1.")
      .def_readonly("run_ends", &ShapedCommand::run_ends, "Periods of this part at which the command is at rest.")
      .def_readonly("segment_periods", &ShapedCommand::segment_periods,
                    "Per marked segment the period of the region in which its start is reached.");

  module.def(
      "shape_path",
      [](const std::shared_ptr<Path>& path, const Fir& shaper, const std::vector<std::uint32_t>& marked,
         const ShapingOptions& options) {
        const py::gil_scoped_release release;
        return std::make_shared<ShapedCommand>(shape_path(path, shaper, marked, options));
      },
      py::arg("path").none(false), py::arg("shaper"), py::arg("marked_segments"), py::arg("options"),
      "The shaped command of a whole region: the path is split at forced stops, planned, sampled at half the block "
      "period and shaped. `shaper` has its taps in whole block periods. Raises ArgumentError if the block period is no "
      "multiple of the interpolation period.");

  py::class_<RegionShaper>(module, "RegionShaper",
                           R"(A region's shaped command in parts, so that memory does not grow with the region.

Args:
    path: The programmed path.
    shaper: Taps in whole block periods, common to all axes.
    marked_segments: Ascending indices of segments whose start time is wanted.
    options: How the region is shaped.

Raises:
    ArgumentError: The block period is no multiple of the interpolation period, or a limit is not above 0.)")
      .def(py::init(
               [](std::shared_ptr<Path> path, const Fir& shaper, const std::vector<std::uint32_t>& marked,
                  const ShapingOptions& options) { return RegionShaper(std::move(path), shaper, marked, options); }),
           py::arg("path").none(false), py::arg("shaper"), py::arg("marked_segments"), py::arg("options"),
           "See the class.")
      .def(
          "next",
          [](RegionShaper& self, std::uint32_t periods) -> std::optional<std::shared_ptr<ShapedCommand>> {
            const py::gil_scoped_release release;
            auto part = std::make_shared<ShapedCommand>();
            if (!self.next(*part, periods)) {
              return std::nullopt;
            }
            return part;
          },
          py::arg("periods"), "Next part of at most `periods` periods. None: there is none left, or is_withdrawn.")
      .def("begin_early", &RegionShaper::begin_early,
           R"(Lets next() return parts before the search for the feed has ended; call it before the first part.

If the region is one motion from rest to rest, with a target, next() returns parts while the search measures them, as if
its first plan kept the tolerance. If it does not, next() returns None and is_withdrawn is True: all parts returned are
invalid.)")
      .def("begin_anew", &RegionShaper::restart,
           R"(Restarts the region from its beginning, with the feed that the search then finds.

Returns:
    False, and nothing is done, if begin_early() was not called or had no effect.)")
      .def_property_readonly("is_withdrawn", &RegionShaper::is_withdrawn, "Whether the returned parts are invalid.")
      .def_property_readonly("largest_deviation_mm", &RegionShaper::largest_deviation_mm,
                             "Largest deviation of the target from the path, over the motions returned so far, mm.")
      .def_property_readonly("is_slowed", &RegionShaper::is_slowed,
                             "Whether any motion so far is slower than without a tolerance; True without a target.")
      .def_property_readonly("share", &RegionShaper::share, "Progress in the region, 0 to 1.")
      .def_property_readonly("stops", &RegionShaper::stops,
                             "Number of stops at junctions that exceed the tolerance at every speed.");

  module.def(
      "plan_tolerances",
      [](const std::shared_ptr<Path>& path, const Fir& shaper, const ShapingOptions& options,
         const std::vector<double>& tolerances_mm) {
        std::vector<PlannedTolerance> planned;
        {
          const py::gil_scoped_release release;
          planned = plan_tolerances(path, shaper, options, tolerances_mm);
        }
        std::vector<std::pair<double, double>> pairs;
        for (const PlannedTolerance& each : planned) pairs.emplace_back(each.duration_s, each.deviation_mm);
        return pairs;
      },
      py::arg("path").none(false), py::arg("shaper"), py::arg("options"), py::arg("tolerances_mm"),
      R"(Durations of a region at several contour tolerances, without its command.

Args:
    path: The programmed path.
    shaper: Taps in whole block periods, common to all axes.
    options: How the region is shaped; its own contour tolerance has no effect.
    tolerances_mm: Descending is fastest, as each search starts from the speeds of the last one; infinity: no slowing.

Returns:
    For each tolerance the duration of the shaped command, s, and the largest deviation of the target, mm.

Raises:
    ArgumentError: As RegionShaper.)");

  py::class_<ContourSolver>(module, "ContourSolver",
                            R"(Correction of a command before shaping that brings the shaped command back to the path.

Minimises |e + f*c|^2 + w |second differences of c|^2 for one axis.

Args:
    kernel: f, taps at delays 0, 1, ... samples.
    smoothness: w, above 0.

Raises:
    ArgumentError: An empty or not finite kernel, or a smoothness that is not above 0.

Source: this project.)")
      .def(py::init<std::vector<double>, double>(), py::arg("kernel"), py::arg("smoothness"), "See the class.")
      .def(
          "solve",
          [](ContourSolver& self, const Column& error, const Column& carried, const Column& stiffness) {
            const auto values = [](const Column& column) {
              return std::span<const double>(column.data(), static_cast<std::size_t>(column.size()));
            };
            const std::size_t past = values(carried).size();
            const std::size_t m = values(error).size() - std::min(values(error).size(), self.reach());
            std::vector<double> correction(past + m);
            std::ranges::copy(values(carried), correction.begin());
            {
              const py::gil_scoped_release release;
              self.solve(values(error), correction, values(stiffness));
            }
            return py::array_t<double>(static_cast<py::ssize_t>(m), correction.data() + past);
          },
          py::arg("error"), py::arg("carried"), py::arg("stiffness") = Column(0),
          "Corrections (m,) for errors (m + len(kernel) - 1,); `carried`: the len(kernel) + 1 corrections before; "
          "`stiffness`: empty, or m + 2 factors of the smoothness.");
  module.def(
      "contour_kernel",
      [](const Fir& shaper, const std::vector<Mode>& modes, double period_s, ContourTarget target) {
        return contour_kernel(shaper, modes, period_s, target);
      },
      py::arg("shaper"), py::arg("modes"), py::arg("period_s"), py::arg("target"),
      "Kernel from a command before shaping to the motion that is to follow the path; `shaper`: taps in samples of "
      "`period_s`.");
}

}  // namespace shapegcode::bindings
