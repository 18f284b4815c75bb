#include "shapegcode/planner_models.hpp"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>

#include "register.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_planner_models(py::module_& module) {
  py::enum_<ControllerKind>(module, "ControllerKind", "The control whose rules plan a program.")
      .value("fanuc", ControllerKind::fanuc)
      .value("linuxcnc", ControllerKind::linuxcnc)
      .value("klipper", ControllerKind::klipper)
      .value("grbl", ControllerKind::grbl);

  py::class_<PlannerRules>(module, "PlannerRules", "Settings of the open planners.")
      .def(py::init<>())
      .def_readwrite("kind", &PlannerRules::kind, "The control whose rules are used.")
      .def_readwrite("arc_resolution_mm", &PlannerRules::arc_resolution_mm, "klipper: length of the chords of an arc.")
      .def_readwrite("chord_tolerance_mm", &PlannerRules::chord_tolerance_mm,
                     "klipper, grbl: arcs are emitted as chords within it; 0: as arcs.")
      .def_readwrite("square_corner_velocity_mm_per_s", &PlannerRules::square_corner_velocity_mm_per_s,
                     "klipper: speed at a corner of 90 degrees.")
      .def_readwrite("minimum_cruise_ratio", &PlannerRules::minimum_cruise_ratio,
                     "klipper: max_accel_to_decel is max_accel times (1 - ratio).")
      .def_readwrite("arc_tolerance_mm", &PlannerRules::arc_tolerance_mm, "grbl: chords of an arc lie within it ($12).")
      .def_readwrite("junction_deviation_mm", &PlannerRules::junction_deviation_mm,
                     "grbl: a corner is as fast as an arc that cuts it by this distance ($11).")
      .def_readwrite("period_s", &PlannerRules::period_s, "linuxcnc: period of the servo thread, which plans, s.")
      .def_readwrite("blend_tolerance_mm", &PlannerRules::blend_tolerance_mm,
                     "linuxcnc: G64 P; 0: only half of a segment limits.")
      .def_readwrite(
          "naive_cam_tolerance_mm", &PlannerRules::naive_cam_tolerance_mm,
          "linuxcnc: G64 Q: lines of one feed within it are joined, an arc in XY within it becomes two lines.")
      .def_readwrite("ramp_frequency_hz", &PlannerRules::ramp_frequency_hz,
                     "linuxcnc: segments that take less than 1/it are ramps.")
      .def_readwrite("kink_ratio", &PlannerRules::kink_ratio,
                     "linuxcnc: part of the acceleration that a kink may take.")
      .def_readwrite("max_feed_override", &PlannerRules::max_feed_override, "linuxcnc: override for which it plans.")
      .def_readwrite(
          "rapid_follows", &PlannerRules::rapid_follows,
          "linuxcnc: a rapid follows the path; otherwise the path's last segment has half of the acceleration.")
      .def_readwrite("optimization_depth", &PlannerRules::optimization_depth, "linuxcnc: segments in its look-ahead.")
      .def_readwrite("look_ahead_blocks", &PlannerRules::look_ahead_blocks, "grbl: blocks of its planner's buffer.");

  py::class_<LinuxcncSlowing>(module, "LinuxcncSlowing",
                              "Effect of LinuxCNC's rules for short segments (kinks and ramps) on a path.")
      .def_readonly("segments", &LinuxcncSlowing::segments, "Number of segments.")
      .def_readonly("kinks", &LinuxcncSlowing::kinks,
                    "Junctions that need at least the kink ratio of the acceleration.")
      .def_readonly("largest_ratio", &LinuxcncSlowing::largest_ratio,
                    "Largest ratio of the acceleration that a junction needs.")
      .def_readonly("speed_mm_per_s", &LinuxcncSlowing::speed_mm_per_s, "Speed at that junction, mm/s.")
      .def_readonly("angle_rad", &LinuxcncSlowing::angle_rad, "Change of direction at that junction, rad.")
      .def_readonly("line", &LinuxcncSlowing::line, "Source line of that junction.")
      .def_readonly("ramps", &LinuxcncSlowing::ramps, "Number of segments whose speed is a ramp.");
  module.def(
      "linuxcnc_slowing",
      [](const std::shared_ptr<Path>& path, const MotionLimits& limits, const PlannerRules& rules, double corner_rad) {
        const py::gil_scoped_release release;
        return linuxcnc_slowing(*path, limits, rules, corner_rad);
      },
      py::arg("path").none(false), py::arg("limits"), py::arg("rules"), py::arg("corner_rad"),
      "Effect of LinuxCNC's rules for short segments (kinks and ramps) on a path at its feeds. Turns above "
      "`corner_rad` do not count.");

  module.def(
      "controlled_motion",
      [](const std::shared_ptr<Path>& path, const MotionLimits& limits, const PlannerRules& rules) {
        ControlledMotion motion;
        {
          const py::gil_scoped_release release;
          motion = controlled_motion(path, limits, rules);
        }
        // Python knows no constant objects; neither class lets anything be changed.
        return py::make_tuple(std::const_pointer_cast<Path>(motion.path),
                              std::const_pointer_cast<SpeedProfile>(motion.profile));
      },
      py::arg("path").none(false), py::arg("limits"), py::arg("rules"),
      "The path that a control follows, and its speed along it from rest to rest: (Path, SpeedProfile). Raises "
      "ArgumentError on a segment without feed, or an invalid setting.");
}

}  // namespace shapegcode::bindings
