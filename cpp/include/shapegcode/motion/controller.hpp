#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/motion/block_player.hpp"
#include "shapegcode/motion/limits.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// Where the controller accelerates a cutting move.
enum class MotionKind : std::uint8_t {
  look_ahead,           ///< before interpolation: the speed is planned along the path
  after_interpolation,  ///< behind it: each axis is filtered, and cutting blocks overlap (paper 004)
};

/// Shape of the acceleration after interpolation.
enum class FilterShape : std::uint8_t {
  linear,       ///< moving average of the time constant; with a bell time a second one behind it
  exponential,  ///< geometric weights of the time constant
};

/// Way of a rapid (1401#1).
enum class RapidPath : std::uint8_t {
  linear,      ///< straight: the axis that needs longest sets the tangential rate
  non_linear,  ///< every axis at its own rate
};

/// Where the wait for in-position comes from.
enum class InPosition : std::uint8_t {
  measured,   ///< a constant per axis; the slowest axis that moved counts (paper 004, section 2.3)
  servo_lag,  ///< until the position error of a first-order servo loop is within the width (1825, 1826)
};

/// Everything that decides how long a program takes on a controller, and what its acceleration does to the path.
/// Plain values; the numbers in the comments are FANUC parameters.
struct ControllerModel {
  double period_s = 0.001;  ///< interpolation period T_I
  BlockEnd block_end = BlockEnd::ceil;

  MotionKind motion = MotionKind::look_ahead;
  FilterShape filter_shape = FilterShape::linear;  ///< after_interpolation only (1610)
  double time_constant_s = 0.05;                   ///< after_interpolation: A (1622); rounded to whole periods
  double bell_time_s = 0.0;                        ///< after_interpolation, linear: second moving average; 0: none
  /// Exponential: the weights end where less than this share of them is left (the controller stops when less than an
  /// increment is left); the filter then lasts time_constant_s * ln(1 / share).
  double exponential_rest = 1e-4;
  /// Look-ahead before interpolation (1783, 1735, 1737, 1660, 1772). `max_feed_mm_per_s` holds in both kinds of motion.
  MotionLimits limits;
  double look_ahead_filter_time_constant_s = 0.0;  ///< moving average behind look-ahead (1769); 0: none

  Vector3 rapid_rate_mm_per_s = Vector3::Constant(400.0);   ///< 1420
  Vector3 rapid_time_constant_s = Vector3::Constant(0.15);  ///< 1620: from rest to the rate at override 1
  double rapid_bell_time_s = 0.0;                           ///< 1621; 0: none
  RapidPath rapid_path = RapidPath::linear;
  InPosition in_position = InPosition::measured;
  Vector3 in_position_s = Vector3::Zero();                 ///< measured
  Vector3 position_gain_per_s = Vector3::Constant(30.0);   ///< servo_lag (1825)
  Vector3 feed_forward_ratio = Vector3::Zero();            ///< servo_lag, 0 ... 1 (2092)
  Vector3 in_position_width_mm = Vector3::Constant(0.02);  ///< servo_lag (1826)

  double feed_override = 1.0;   ///< scales every programmed feed
  double rapid_override = 1.0;  ///< scales the rapid rates; the acceleration of a rapid stays what it is
  double tool_change_s = 0.0;   ///< M06
  double m_function_s = 0.0;    ///< every other M code
};

/// Throws Error(argument) on a value that no controller can have; the message names it.
void check(const ControllerModel& model);

/// Filters behind interpolation in order: none, one or two (acceleration after interpolation, or 1769 in look-ahead).
[[nodiscard]] std::vector<Fir> acceleration_filters(const ControllerModel& model);

/// Periods that filters add to a run of set-points: as many as their cascade has taps (spec section 0: A for one moving
/// average); 0 without filters.
[[nodiscard]] int filter_periods(const std::vector<Fir>& filters) noexcept;

/// Feed of a cutting block in mm/s: programmed feed times override, no axis above its largest feed.
[[nodiscard]] double controlled_feed_mm_per_s(const Segment& segment, const ControllerModel& model) noexcept;

/// Time of a run of overlapping cutting blocks (spec section 0, paper 004): sum of ceil(l / (F T_I)) T_I (or of l / F
/// under `carry`) plus the length of the acceleration filters. Blocks without length take no time. Lengths in mm, feeds
/// in mm/s, taken as they are (no override). Throws Error(argument) on unequal sizes or a feed <= 0.
[[nodiscard]] double block_overlap_time_s(std::span<const double> lengths_mm, std::span<const double> feeds_mm_per_s,
                                          const ControllerModel& model);

}  // namespace shapegcode
