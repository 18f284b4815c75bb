#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/planner.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

// phases as rows of start_s, duration_s, distance_mm, speed_mm_per_s, acceleration_mm_per_s2
py::array phase_table(const SpeedProfile& profile) {
  const auto& phases = profile.phases();
  Eigen::MatrixXd table(static_cast<Eigen::Index>(phases.size()), 5);
  for (std::size_t i = 0; i < phases.size(); ++i) {
    table.row(static_cast<Eigen::Index>(i)) << phases[i].start_s, phases[i].duration_s, phases[i].distance_mm,
        phases[i].speed_mm_per_s, phases[i].acceleration_mm_per_s2;
  }
  return take(std::move(table));
}

// A polyline through points; without a feed as fast as the axes can be.
Path path_of(const MatrixArray& points_mm, std::optional<double> feed_mm_per_s, const TrajectoryLimits& limits) {
  const Samples points = samples_from(points_mm, 1.0);
  const double feed = feed_mm_per_s.value_or(limits.max_feed_mm_per_s.norm());
  std::vector<Segment> segments;
  for (Eigen::Index k = 1; k < points.positions_mm.rows(); ++k) {
    segments.push_back(make_line(points.positions_mm.row(k - 1), points.positions_mm.row(k), feed));
  }
  return Path(std::move(segments));
}

void register_trajectory(py::module_& module) {
  using AnyPath = std::variant<std::shared_ptr<Path>, MatrixArray>;
  module.def(
      "time_optimal_trajectory",
      [](const AnyPath& given, const PerAxis& feed, const PerAxis& acceleration, const PerAxis& jerk,
         double contour_tolerance_mm, std::optional<double> feed_mm_per_s, double period_s) {
        const TrajectoryLimits limits{each_axis(feed), each_axis(acceleration), each_axis(jerk), contour_tolerance_mm};
        const auto* path = std::get_if<std::shared_ptr<Path>>(&given);
        if (path != nullptr && feed_mm_per_s) {
          throw Error(ErrorKind::argument, "a feed is for points: the segments of a path have their own");
        }
        const Path planned = path != nullptr ? **path : path_of(std::get<MatrixArray>(given), feed_mm_per_s, limits);
        Samples samples;
        {
          const py::gil_scoped_release release;
          samples = time_optimal_trajectory(planned, limits, period_s);
        }
        return take(std::move(samples.positions_mm));
      },
      py::arg("path").none(false), py::kw_only(), py::arg("max_feed_mm_per_s"), py::arg("max_acceleration_mm_per_s2"),
      py::arg("max_jerk_mm_per_s3"), py::arg("contour_tolerance_mm") = TrajectoryLimits{}.contour_tolerance_mm,
      py::arg("feed_mm_per_s") = py::none(), py::arg("period_s") = 0.001,
      R"(Set-points of a whole path from rest to rest, nearly as fast as the limits of every axis allow.

Junctions are rounded within the tolerance, jerk is limited, and the motion rests at exact stops. The differences of the
set-points keep the limits to a factor of 1.001, and the programmed feeds. The set-points are bit for bit those of a
`MotionController` without filters that is given all segments at once. See docs/concepts/time_optimal.md.

Args:
    path: A path whose segments have a feed, or the points of a polyline, (n, 3), mm.
    max_feed_mm_per_s: Limit of every axis, mm/s: a number for all, or one for each, shape (3,).
    max_acceleration_mm_per_s2: Likewise, mm/s^2.
    max_jerk_mm_per_s3: Likewise, mm/s^3.
    contour_tolerance_mm: Permitted deviation where direction or curvature of the path jumps, mm; 0: stop there.
    feed_mm_per_s: Feed along the polyline through points, mm/s; None: as fast as the limits allow.
    period_s: Time between two set-points, s.

Returns:
    Set-points, (n_samples, 3), mm, read-only; the first is the start, the last exactly the end; none without length.

Raises:
    ArgumentError: A limit or period that is not above zero and finite, a tolerance below zero, a segment without feed.
    NumericError: The limits cannot be kept.)");
}

}  // namespace

void register_motion(py::module_& module) {
  py::enum_<AccelerationLaw>(module, "AccelerationLaw", "Law of a change of speed.")
      .value("constant_time", AccelerationLaw::constant_time,
             "A ramp lasts the time constant whatever the speed step, if the path is long enough.")
      .value("jerk_limited", AccelerationLaw::jerk_limited, "The acceleration of the axes, smoothed by the jerk time.");

  py::class_<MotionLimits>(module, "MotionLimits", "Limits of the look-ahead; infinity switches a limit off.")
      .def(py::init<>())
      .def_readwrite("law", &MotionLimits::law, "Law of a change of speed.")
      .def_readwrite("time_constant_s", &MotionLimits::time_constant_s, "Ramp from rest to the programmed feed, s.")
      .def_readwrite("jerk_time_s", &MotionLimits::jerk_time_s, "Smoothing of the acceleration, s; 0 = none.")
      .def_readwrite("max_feed_mm_per_s", &MotionLimits::max_feed_mm_per_s, "Per axis, shape (3,).")
      .def_readwrite("max_acceleration_mm_per_s2", &MotionLimits::max_acceleration_mm_per_s2, "Per axis, shape (3,).")
      .def_readwrite("max_jerk_mm_per_s3", &MotionLimits::max_jerk_mm_per_s3, "Per axis, shape (3,).")
      .def_readwrite("corner_speed_difference_mm_per_s", &MotionLimits::corner_speed_difference_mm_per_s,
                     "Maximum speed difference per axis at a corner, shape (3,), mm/s.")
      .def_readwrite("centripetal_acceleration_mm_per_s2", &MotionLimits::centripetal_acceleration_mm_per_s2,
                     "Centripetal acceleration on arcs, mm/s^2.")
      .def_readwrite("polyline_acceleration_mm_per_s2", &MotionLimits::polyline_acceleration_mm_per_s2,
                     "Centripetal acceleration along polylines, mm/s^2.")
      .def_readwrite("corner_stop_angle_rad", &MotionLimits::corner_stop_angle_rad,
                     "A corner that turns by this angle or more is a stop, rad.")
      .def_readwrite("junction_deviation_mm", &MotionLimits::junction_deviation_mm,
                     "A corner is as fast as an arc that cuts it by this distance, mm.")
      .def_readwrite("block_time_s", &MotionLimits::block_time_s, "Minimum duration of a block, s.")
      .def_readwrite(
          "contour_acceleration_mm_per_s2", &MotionLimits::contour_acceleration_mm_per_s2,
          "Acceleration of each axis by a change of direction, on arcs and along polylines, shape (3,), mm/s^2.")
      .def_readwrite("feed_override", &MotionLimits::feed_override, "Scales the programmed feeds.")
      .def_readwrite("arc_feed_ratio", &MotionLimits::arc_feed_ratio, "Feed on arcs relative to the programmed one.")
      .def_readwrite("feed_spread_s", &MotionLimits::feed_spread_s,
                     "Time by which a lower programmed feed is reached before its segment and held after it, s.")
      .def_readwrite("feed_excess_ratio", &MotionLimits::feed_excess_ratio,
                     "Neighbours faster by up to this ratio need no `feed_spread_s`.");

  py::class_<FilterTolerance>(module, "FilterTolerance",
                              "Deviation permitted to a filter after the interpolation, at corners and on arcs; none "
                              "if its variance and mean deviation are 0.")
      .def(py::init<>())
      .def_readwrite("contour_tolerance_mm", &FilterTolerance::contour_tolerance_mm,
                     "Deviation allowed to the filter, mm; infinity: any.")
      .def_readwrite("corner_share", &FilterTolerance::corner_share,
                     "Part of the tolerance for one corner: deviations of corners within one filter length add up.")
      .def_readwrite("variance_s2", &FilterTolerance::variance_s2, "Second central moment of the filter, s^2.")
      .def_readwrite("mean_deviation_s", &FilterTolerance::mean_deviation_s,
                     "Mean absolute deviation of the filter from its mean delay, s.");

  py::class_<SpeedProfile, std::shared_ptr<SpeedProfile>>(module, "SpeedProfile",
                                                          "Distance along a path as a function of time.")
      .def_property_readonly("duration_s", &SpeedProfile::duration_s, "Whole time, s.")
      .def_property_readonly("length_mm", &SpeedProfile::length_mm, "Distance at the end, mm.")
      .def_property_readonly("phases", &phase_table,
                             "(n, 5): start s, duration s, distance mm, speed mm/s, acceleration mm/s^2.");

  module.def(
      "plan_speed",
      [](const std::shared_ptr<Path>& path, const MotionLimits& limits, const FilterTolerance& tolerance) {
        const py::gil_scoped_release release;
        return std::make_shared<SpeedProfile>(plan_speed(*path, limits, tolerance));
      },
      py::arg("path").none(false), py::arg("limits"), py::arg("tolerance") = FilterTolerance{},
      "Tangential speed profile over a whole path from rest to rest; `tolerance`: the filter after the interpolation, "
      "and the deviation permitted to it. Raises ArgumentError on a limit that is not > 0.");

  py::class_<Interpolator>(module, "Interpolator",
                           "Set-points of a path, one per interpolation period (real-time form).")
      .def(py::init([](std::shared_ptr<Path> path, std::shared_ptr<SpeedProfile> profile, double period_s) {
             return Interpolator(std::move(path), std::move(profile), period_s);
           }),
           py::arg("path").none(false), py::arg("profile").none(false), py::arg("period_s"),
           "Raises ArgumentError on a period <= 0.")
      .def(
          "step",
          [](Interpolator& self) {
            Vector3 position = Vector3::Zero();
            const bool moving = self.step(position);
            return std::make_pair(moving, position);
          },
          "Returns (moving, position of shape (3,)); moving is False after the last set-point.")
      .def_property_readonly("sample_count", &Interpolator::sample_count, "Set-points from start to end.");

  module.def(
      "interpolate",
      [](std::shared_ptr<Path> path, std::shared_ptr<SpeedProfile> profile, double period_s) {
        Samples samples;
        {
          const py::gil_scoped_release release;
          samples = interpolate(std::move(path), std::move(profile), period_s);
        }
        return take(std::move(samples.positions_mm));
      },
      py::arg("path").none(false), py::arg("profile").none(false), py::arg("period_s"),
      "All set-points of a path, (n_samples, 3), mm, read-only. Raises ArgumentError on a period <= 0.");

  register_trajectory(module);
}

}  // namespace shapegcode::bindings
