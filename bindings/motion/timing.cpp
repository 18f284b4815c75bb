#include <pybind11/stl.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/plant/servo_lag.hpp"
#include "shapegcode/timing.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

using SpindleRows = std::vector<std::pair<double, double>>;

SpindleRows spindle_rows(const std::vector<SpindleTime>& times) {
  SpindleRows rows;
  for (const SpindleTime& time : times) {
    rows.emplace_back(time.rev_per_min, time.seconds);
  }
  return rows;
}

std::vector<SpindleTime> spindle_times(const SpindleRows& rows) {
  std::vector<SpindleTime> times;
  for (const auto& [rev_per_min, seconds] : rows) {
    times.push_back({rev_per_min, seconds});
  }
  return times;
}

// Read-only structured array over a vector of rows that lives as long as `base`.
template <class Row>
py::array rows(const std::vector<Row>& table, py::handle base) {
  py::array array(py::dtype::of<Row>(), {static_cast<py::ssize_t>(table.size())},
                  {static_cast<py::ssize_t>(sizeof(Row))}, table.data(), base);
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

template <class Owner, class Row>
auto table(std::vector<Row> Owner::*member) {
  return [member](const py::object& self) { return rows(self.cast<const Owner&>().*member, self); };
}

std::span<const double> values(const VectorArray& array) {
  if (array.ndim() != 1) {
    throw Error(ErrorKind::argument, "lengths and feeds must have the shape (n_blocks,)");
  }
  return {array.data(), static_cast<std::size_t>(array.size())};
}

template <class T, class... Extra>
void define_parts(py::class_<T, Extra...>& type, auto parts) {
  const auto part = [&](const char* name, double TimeParts::*member, const char* doc) {
    type.def_property_readonly(
        name, [parts, member](const T& self) { return parts(self).*member; }, doc);
  };
  type.def_property_readonly(
      "total_s", [parts](const T& self) { return parts(self).total_s(); }, "Sum of all parts, s.");
  part("cutting_s", &TimeParts::cutting_s, "Cutting blocks at their feed, s.");
  part("rapid_s", &TimeParts::rapid_s, "Rapids at their rate, s.");
  part("in_position_s", &TimeParts::in_position_s, "Waits after rapids and exact stops, s.");
  part("dwell_s", &TimeParts::dwell_s, "G04 and dwells of cycles, s.");
  part("acceleration_s", &TimeParts::acceleration_s,
       "Time added to cutting blocks and rapids by acceleration and, in look-ahead, by its other limits, s.");
  part("tool_change_s", &TimeParts::tool_change_s, "M06, s.");
  part("function_s", &TimeParts::function_s,
       "Other M codes, start of the program, waits for the spindle, rapids of unknown length, s.");
}

void define_model(py::module_& module) {
  py::enum_<MotionKind>(module, "MotionKind", "Where the controller accelerates a cutting move.")
      .value("look_ahead", MotionKind::look_ahead, "Before interpolation: the speed is planned along the path.")
      .value("after_interpolation", MotionKind::after_interpolation,
             "After it: each axis is filtered, and cutting blocks overlap (paper 004).");
  py::enum_<FilterShape>(module, "FilterShape", "Shape of the acceleration after interpolation.")
      .value("linear", FilterShape::linear,
             "Moving average over the time constant; with a bell time a second one after it.")
      .value("exponential", FilterShape::exponential, "Geometric weights of the time constant.");
  py::enum_<RapidPath>(module, "RapidPath", "Path of a rapid (1401#1).")
      .value("linear", RapidPath::linear, "Straight: the slowest axis determines the tangential rate.")
      .value("non_linear", RapidPath::non_linear, "Every axis at its own rate.");
  py::enum_<InPosition>(module, "InPosition", "How the wait for in-position is determined.")
      .value("measured", InPosition::measured,
             "A constant per axis; the largest of the axes that moved (paper 004, section 2.3).")
      .value("servo_lag", InPosition::servo_lag,
             "Until the position error of a first-order servo loop is within the width (1825, 1826).");
  py::enum_<ShapedRegions>(module, "ShapedRegions", "Which cuts of a program run as shaped blocks.")
      .value("marked", ShapedRegions::marked, "Regions marked in the program.")
      .value("all", ShapedRegions::all, "Every cut.")
      .value("none", ShapedRegions::none, "No cut.");

  py::class_<FanucModel>(module, "FanucModel",
                         "Parameters of a control that determine cycle time and deviation by acceleration.")
      .def(py::init<>())
      .def_readwrite("planner", &FanucModel::planner,
                     "Kinds other than fanuc: look-ahead by their rules, also for shaped blocks.")
      .def_readwrite("chord_tolerance_mm", &FanucModel::chord_tolerance_mm,
                     "Arcs of shaped programs are emitted as chords within it, mm; 0: as arcs.")
      .def_readwrite("period_s", &FanucModel::period_s, "Interpolation period, s.")
      .def_readwrite("block_end", &FanucModel::block_end, "When a block's successor starts.")
      .def_readwrite("motion", &FanucModel::motion, "Where a cutting move is accelerated.")
      .def_readwrite("filter_shape", &FanucModel::filter_shape, "After interpolation: linear or exponential.")
      .def_readwrite("time_constant_s", &FanucModel::time_constant_s, "Time constant after interpolation, s (1622).")
      .def_readwrite("bell_time_s", &FanucModel::bell_time_s,
                     "After interpolation, linear: second moving average, s; 0: none.")
      .def_readwrite("exponential_rest", &FanucModel::exponential_rest,
                     "Exponential: ratio of the sum of the weights that is cut off at the end.")
      .def_readwrite("limits", &FanucModel::limits, "Limits of the look-ahead; the axes' feed limits hold always.")
      .def_readwrite("look_ahead_filter_time_constant_s", &FanucModel::look_ahead_filter_time_constant_s,
                     "Moving average after look-ahead, s (1769); 0: none.")
      .def_readwrite("rapid_rate_mm_per_s", &FanucModel::rapid_rate_mm_per_s, "Per axis, shape (3,) (1420).")
      .def_readwrite("rapid_time_constant_s", &FanucModel::rapid_time_constant_s,
                     "Ramp from rest to the rate at override 1, per axis, s, shape (3,) (1620).")
      .def_readwrite("rapid_bell_time_s", &FanucModel::rapid_bell_time_s, "s (1621); 0: none.")
      .def_readwrite("rapid_path", &FanucModel::rapid_path, "Straight, or every axis at its own rate.")
      .def_readwrite("in_position", &FanucModel::in_position, "Measured or from the servo lag.")
      .def_readwrite("in_position_s", &FanucModel::in_position_s, "Measured wait, per axis, s, shape (3,).")
      .def_readwrite("position_gain_per_s", &FanucModel::position_gain_per_s, "Per axis, 1/s, shape (3,) (1825).")
      .def_readwrite("feed_forward_ratio", &FanucModel::feed_forward_ratio, "Per axis, 0 ... 1, shape (3,) (2092).")
      .def_readwrite("in_position_width_mm", &FanucModel::in_position_width_mm, "Per axis, mm, shape (3,) (1826).")
      .def_readwrite("shaped_regions", &FanucModel::shaped_regions, "Which cuts run as shaped blocks.")
      .def_readwrite("shaped_filter_shape", &FanucModel::shaped_filter_shape, "Acceleration after shaped blocks.")
      .def_readwrite("shaped_time_constant_s", &FanucModel::shaped_time_constant_s,
                     "Time constant after shaped blocks, s; 0: no filter.")
      .def_readwrite("shaped_bell_time_s", &FanucModel::shaped_bell_time_s,
                     "After shaped blocks, linear: second moving average, s; 0: none.")
      .def_readwrite("shaped_block_end", &FanucModel::shaped_block_end,
                     "When a shaped block's successor starts; ceil is the slower rule.")
      .def_readwrite("feed_override", &FanucModel::feed_override, "Scales every programmed feed.")
      .def_readwrite("rapid_override", &FanucModel::rapid_override,
                     "Scales the rapid rates; the acceleration of a rapid does not change.")
      .def_readwrite("program_start_s", &FanucModel::program_start_s, "From the start key to the first block, s.")
      .def_readwrite("last_tool_in_spindle", &FanucModel::last_tool_in_spindle,
                     "The program's last tool is in the spindle at the start: an M06 that calls it changes nothing.")
      .def_readwrite("tool_change_s", &FanucModel::tool_change_s, "M06, s.")
      .def_readwrite("m_function_s", &FanucModel::m_function_s, "Every M code not in `m_code_s`, s.")
      .def_readwrite("m_code_s", &FanucModel::m_code_s, "M codes with individual times: code -> s.")
      .def_readwrite("unknown_move_s", &FanucModel::unknown_move_s,
                     "Per axis: time of a rapid whose start or end the program does not give, s, shape (3,).")
      .def_property(
          "spindle_start_s", [](const FanucModel& self) { return spindle_rows(self.spindle_start_s); },
          [](FanucModel& self, const SpindleRows& rows) { self.spindle_start_s = spindle_times(rows); },
          "Pairs of a spindle speed in 1/min and the time from rest to it in s.")
      .def_property(
          "spindle_stop_s", [](const FanucModel& self) { return spindle_rows(self.spindle_stop_s); },
          [](FanucModel& self, const SpindleRows& rows) { self.spindle_stop_s = spindle_times(rows); },
          "Pairs of a spindle speed in 1/min and the time from it to rest in s.");

  module.def("for_shaped_blocks", &for_shaped_blocks, py::arg("model"),
             "The same controller while shaped blocks run: block by block at their feed, without look-ahead (planners "
             "other than FANUC's keep it).");
  module.def("acceleration_filters", &acceleration_filters, py::arg("model"),
             "Filters after interpolation in order: none, one or two.");
  module.def(
      "block_overlap_time_s",
      [](const VectorArray& lengths_mm, const VectorArray& feeds_mm_per_s, const FanucModel& model) {
        const auto lengths = values(lengths_mm);
        const auto feeds = values(feeds_mm_per_s);
        const py::gil_scoped_release release;
        return block_overlap_time_s(lengths, feeds, model);
      },
      py::arg("lengths_mm"), py::arg("feeds_mm_per_s"), py::arg("model"),
      "Time of a sequence of overlapping cutting blocks, s: sum of ceil(l / (F T)) T (with BlockEnd.carry of l / F) "
      "plus the length of the filters (paper 004). No override. Raises ArgumentError on unequal sizes or a feed <= 0.");
  module.def(
      "rapid_time_s",
      [](const Vector3& travel_mm, const FanucModel& model) {
        check(model);
        return rapid_time_s(travel_mm, model);
      },
      py::arg("travel_mm"), py::arg("model"),
      "Time of a rapid from rest to rest without the wait for in-position, s (paper 004, eq. 6 to 16). `travel_mm`: "
      "signed travel of each axis, shape (3,). Raises ArgumentError on an invalid model.");
  module.def(
      "in_position_wait_s",
      [](const Vector3& travel_mm, const FanucModel& model) {
        check(model);
        return in_position_wait_s(travel_mm, model);
      },
      py::arg("travel_mm"), py::arg("model"),
      "Wait for in-position after a rapid, s. Raises ArgumentError on an invalid model.");
  module.def(
      "in_position_wait_behind_s",
      [](const Vector3& error_mm, const std::array<bool, axis_count>& moved, const FanucModel& model) {
        check(model);
        return in_position_wait_s(error_mm, moved, model);
      },
      py::arg("error_mm"), py::arg("moved"), py::arg("model"),
      "Wait for in-position after any command, s. `error_mm`: the servo lag at its end, (3,); `moved`: the axes that "
      "moved, (3,). Raises ArgumentError on an invalid model.");
  module.def(
      "rapid_samples",
      [](const Vector3& start_mm, const Vector3& end_mm, const FanucModel& model) {
        Samples samples;
        {
          const py::gil_scoped_release release;
          samples = rapid_samples(start_mm, end_mm, model);
        }
        return take(std::move(samples.positions_mm));
      },
      py::arg("start_mm"), py::arg("end_mm"), py::arg("model"),
      "Set-points of a rapid, one per period, (n, 3), mm, read-only. Raises ArgumentError on an invalid model.");
}

void define_simulation(py::module_& module) {
  py::class_<ServoLag>(module, "ServoLag",
                       "Position loop of each axis as a first-order lag with feed-forward: x' = K (r - x) + a r'.")
      .def(py::init<const Vector3&, const Vector3&, double>(), py::arg("position_gain_per_s"),
           py::arg("feed_forward_ratio"), py::arg("period_s"),
           "At rest at zero. Raises ArgumentError on a period or gain <= 0 or a ratio outside 0 ... 1.")
      .def("reset", &ServoLag::reset, py::arg("position"), "Rest at `position`, shape (3,).")
      .def("step", py::overload_cast<const Vector3&>(&ServoLag::step), py::arg("setpoint"),
           "Position of the axes at the set-point's instant, shape (3,).")
      .def_property_readonly("error_mm", &ServoLag::error_mm, "Set-point minus position, shape (3,), mm.");

  py::class_<CircleFigures>(module, "CircleFigures", "Effect of acceleration and servo lag on a circle.")
      .def_readonly("command_error_mm", &CircleFigures::command_error_mm,
                    "Programmed radius minus radius of the set-points after the filters, mm.")
      .def_readonly("radial_error_mm", &CircleFigures::radial_error_mm,
                    "Programmed radius minus radius of the axes after the servo loop, mm.");
  module.def(
      "simulate_circle",
      [](double radius_mm, double feed_mm_per_s, const FanucModel& model) {
        const py::gil_scoped_release release;
        return simulate_circle(radius_mm, feed_mm_per_s, model);
      },
      py::arg("radius_mm"), py::arg("feed_mm_per_s"), py::arg("model"),
      "Run circles in XY at a constant feed and measure the mean radius over one turn. Raises ArgumentError on a "
      "radius or feed <= 0.");
}

}  // namespace

void register_timing(py::module_& module) {
  define_model(module);
  define_simulation(module);

  PYBIND11_NUMPY_DTYPE(RegionTime, first_line, last_line, tool, start_s, duration_s, cutting_s, acceleration_s,
                       in_position_s, length_mm);
  PYBIND11_NUMPY_DTYPE(BlockTime, line, kind, start_s, duration_s, feed_mm_per_s);

  py::enum_<BlockKind>(module, "BlockKind", "Kind of a row of CycleTime.blocks, which has it as a number.")
      .value("cutting", BlockKind::cutting)
      .value("rapid", BlockKind::rapid)
      .value("dwell", BlockKind::dwell)
      .value("tool_change", BlockKind::tool_change)
      .value("function", BlockKind::function);

  py::class_<ToolTime> tool(module, "ToolTime", "All uses of one tool.");
  tool.def_readonly("tool", &ToolTime::tool, "T number; -1: before the first tool is known.")
      .def_readonly("first_line", &ToolTime::first_line, "Line of its first use, from 1.");
  define_parts(tool, [](const ToolTime& self) -> const TimeParts& { return self.parts; });

  py::class_<CycleTime, std::shared_ptr<CycleTime>> cycle(module, "CycleTime", "Cycle time of a program.");
  define_parts(cycle, [](const CycleTime& self) -> const TimeParts& { return self.parts; });
  cycle
      .def_readonly("outside_regions_s", &CycleTime::outside_regions_s,
                    "Whole time without cutting and acceleration of the regions, s.")
      .def_readonly("cutting_length_mm", &CycleTime::cutting_length_mm, "mm.")
      .def_readonly("rapid_length_mm", &CycleTime::rapid_length_mm, "mm.")
      .def_property_readonly("regions", table(&CycleTime::regions),
                             "One row per region, structured and read-only: first_line, last_line, tool, start_s, "
                             "duration_s and its parts cutting_s, acceleration_s and in_position_s, length_mm.")
      .def_property_readonly(
          "tools", [](const CycleTime& self) { return self.tools; }, "ToolTime in the order of first use.")
      .def_property_readonly("blocks", table(&CycleTime::blocks),
                             "One row per block, structured and read-only: line, kind (a BlockKind number), start_s, "
                             "duration_s, feed_mm_per_s reached; empty unless requested.");

  py::class_<InterpolatedTime, std::shared_ptr<InterpolatedTime>>(module, "InterpolatedTime",
                                                                  "Cycle time of a program by full interpolation.")
      .def_readonly("total_s", &InterpolatedTime::total_s, "Sum of all parts, s.")
      .def_readonly("cutting_s", &InterpolatedTime::cutting_s, "Cutting blocks with their acceleration, s.")
      .def_readonly("rapid_s", &InterpolatedTime::rapid_s, "Rapids with their acceleration, s.")
      .def_readonly("in_position_s", &InterpolatedTime::in_position_s, "Waits after rapids and exact stops, s.")
      .def_readonly("dwell_s", &InterpolatedTime::dwell_s, "s.")
      .def_readonly("tool_change_s", &InterpolatedTime::tool_change_s, "s.")
      .def_readonly("function_s", &InterpolatedTime::function_s, "As in CycleTime, s.")
      .def_readonly("set_points", &InterpolatedTime::set_points, "Number of set-points.")
      .def_readonly("region_s", &InterpolatedTime::region_s, "Per region, wait included, s.");

  module.def(
      "time_program",
      [](const std::shared_ptr<Program>& program, const FanucModel& model, bool per_block) {
        const py::gil_scoped_release release;
        return std::make_shared<CycleTime>(time_program(*program, model, per_block));
      },
      py::arg("program").none(false), py::arg("model"), py::arg("per_block") = false,
      "Cycle time in closed form: O(1) per block for acceleration after interpolation (paper 004), by the planner in "
      "look-ahead. Raises ArgumentError on an invalid model, or a block without a feed.");
  module.def(
      "interpolate_program",
      [](const std::shared_ptr<Program>& program, const FanucModel& model) {
        const py::gil_scoped_release release;
        return std::make_shared<InterpolatedTime>(interpolate_program(*program, model));
      },
      py::arg("program").none(false), py::arg("model"),
      "Cycle time by full interpolation, set-point by set-point. Raises ArgumentError on an invalid model, a block "
      "without a feed, or a program of more than 4e9 set-points.");
}

}  // namespace shapegcode::bindings
