#include <pybind11/stl.h>

#include <memory>
#include <utility>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/motion.hpp"

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

}  // namespace

void register_motion(py::module_& module) {
  py::enum_<AccelerationLaw>(module, "AccelerationLaw", "Law of a change of speed.")
      .value("constant_time", AccelerationLaw::constant_time)
      .value("jerk_limited", AccelerationLaw::jerk_limited);

  py::class_<MotionLimits>(module, "MotionLimits", "What look-ahead keeps; infinity switches a limit off.")
      .def(py::init<>())
      .def_readwrite("law", &MotionLimits::law, "Law of a change of speed.")
      .def_readwrite("time_constant_s", &MotionLimits::time_constant_s, "Ramp from rest to the programmed feed, s.")
      .def_readwrite("jerk_time_s", &MotionLimits::jerk_time_s, "Smoothing of the acceleration, s; 0 = none.")
      .def_readwrite("max_feed_mm_per_s", &MotionLimits::max_feed_mm_per_s, "Per axis, shape (3,).")
      .def_readwrite("max_acceleration_mm_per_s2", &MotionLimits::max_acceleration_mm_per_s2, "Per axis, shape (3,).")
      .def_readwrite("max_jerk_mm_per_s3", &MotionLimits::max_jerk_mm_per_s3, "Per axis, shape (3,).")
      .def_readwrite("corner_speed_difference_mm_per_s", &MotionLimits::corner_speed_difference_mm_per_s,
                     "Speed step per axis at a corner, shape (3,).")
      .def_readwrite("centripetal_acceleration_mm_per_s2", &MotionLimits::centripetal_acceleration_mm_per_s2,
                     "Across the path on arcs.")
      .def_readwrite("polyline_acceleration_mm_per_s2", &MotionLimits::polyline_acceleration_mm_per_s2,
                     "Across the path along polylines.")
      .def_readwrite("corner_stop_angle_rad", &MotionLimits::corner_stop_angle_rad,
                     "A corner that turns by as much or more is a stop.")
      .def_readwrite("junction_deviation_mm", &MotionLimits::junction_deviation_mm,
                     "A corner is passed as an arc that cuts it by so much.")
      .def_readwrite("block_time_s", &MotionLimits::block_time_s, "No block is run off faster, s.")
      .def_readwrite("contour_acceleration_mm_per_s2", &MotionLimits::contour_acceleration_mm_per_s2,
                     "Of a change of direction, per axis, on arcs and along polylines, shape (3,).")
      .def_readwrite("feed_override", &MotionLimits::feed_override, "Scales the programmed feeds.")
      .def_readwrite("arc_feed_ratio", &MotionLimits::arc_feed_ratio, "Feed on arcs relative to the programmed one.")
      .def_readwrite("feed_spread_s", &MotionLimits::feed_spread_s,
                     "Time by which a lower programmed feed is reached before its segment and kept behind it, s.")
      .def_readwrite("feed_excess_ratio", &MotionLimits::feed_excess_ratio,
                     "Share by which a neighbour may be faster without that.");

  py::class_<FilterTolerance>(
      module, "FilterTolerance",
      "Within what a filter behind the interpolation must stay at corners and on arcs; without spread no limit.")
      .def(py::init<>())
      .def_readwrite("contour_tolerance_mm", &FilterTolerance::contour_tolerance_mm,
                     "Deviation allowed to the filter, mm; infinity: any.")
      .def_readwrite("corner_share", &FilterTolerance::corner_share,
                     "Share of the tolerance for one corner: several may fall into one filter.")
      .def_readwrite("variance_s2", &FilterTolerance::variance_s2, "Second central moment of the filter, s^2.")
      .def_readwrite("mean_deviation_s", &FilterTolerance::mean_deviation_s, "Its mean absolute deviation, s.");

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
      "Tangential speed profile over a whole path from rest to rest, with a filter behind it that must stay within its "
      "tolerance. Raises ArgumentError on a limit that is not > 0.");

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
          "(moving, position of shape (3,)); moving is False once the last set-point was given.")
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
}

}  // namespace shapegcode::bindings
