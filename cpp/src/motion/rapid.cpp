#include "shapegcode/fanuc_model.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"

namespace shapegcode {
namespace {

// Length, rate and acceleration of one move at a constant rate: the whole path of a linear rapid, or one axis.
struct EvenMove {
  double length_mm = 0.0;
  double rate_mm_per_s = MotionLimits::none;
  double acceleration_mm_per_s2 = MotionLimits::none;
};

EvenMove axis_move(const Vector3& travel_mm, int axis, const FanucModel& model) noexcept {
  const double full_rate = model.rapid_rate_mm_per_s[axis];
  const double ramp_s = model.rapid_time_constant_s[axis];
  return {std::abs(travel_mm[axis]), full_rate * model.rapid_override,
          ramp_s > 0.0 ? full_rate / ramp_s : MotionLimits::none};
}

// fanuc.md B1: v = min_i(1420_i L/d_i), a = min_i(1420_i/1620_i L/d_i).
EvenMove straight_move(const Vector3& travel_mm, const FanucModel& model) noexcept {
  EvenMove move;
  move.length_mm = travel_mm.norm();
  for (int i = 0; i < axis_count; ++i) {
    if (travel_mm[i] != 0.0) {
      const EvenMove axis = axis_move(travel_mm, i, model);
      const double share = move.length_mm / axis.length_mm;
      move.rate_mm_per_s = std::min(move.rate_mm_per_s, axis.rate_mm_per_s * share);
      move.acceleration_mm_per_s2 = std::min(move.acceleration_mm_per_s2, axis.acceleration_mm_per_s2 * share);
    }
  }
  return move;
}

struct Counts {
  int travel = 0;
  int ramp = 0;
};

int countable(double periods) {
  constexpr double most_periods = 1e8;
  return static_cast<int>(require_count(periods, most_periods, "rapid", "periods"));
}

int full_ramp(const EvenMove& move, double period_s) {
  return countable(std::round(move.rate_mm_per_s / move.acceleration_mm_per_s2 / period_s));
}

// Paper 004: eq. 6 for a rapid that reaches its rate, eq. 9 to 11 for a short one.
Counts counts_in_closed_form(const EvenMove& move, double period_s) {
  const Counts full{countable(whole_periods(move.length_mm / move.rate_mm_per_s / period_s)),
                    full_ramp(move, period_s)};
  if (full.travel >= full.ramp) {
    return full;
  }
  const double half_s = std::sqrt(move.length_mm / move.acceleration_mm_per_s2);
  const int half = std::max(1, countable(whole_periods(half_s / period_s)));
  return {half, half};
}

// The same by trial: the fewest periods in which neither the rate nor the acceleration is exceeded.
Counts counts_by_trial(const EvenMove& move, double period_s) {
  countable(move.length_mm / move.rate_mm_per_s / period_s);
  constexpr double slack = 1.0 + 1e-7;  // a rapid that ends on a tick to within rounding ends there
  Counts counts{1, full_ramp(move, period_s)};
  while (move.length_mm / (counts.travel * period_s) > move.rate_mm_per_s * slack) {
    ++counts.travel;
  }
  if (counts.travel < counts.ramp) {
    counts = {1, 1};
    while (move.length_mm / (counts.travel * period_s) / (counts.ramp * period_s) >
           move.acceleration_mm_per_s2 * slack) {
      ++counts.travel;
      ++counts.ramp;
    }
  }
  return counts;
}

int bell_periods(const FanucModel& model) { return countable(std::round(model.rapid_bell_time_s / model.period_s)); }

int periods_of(const RapidShape& shape, std::size_t axis) noexcept {
  return shape.travel[axis] > 0 ? shape.travel[axis] + shape.ramp[axis] + shape.bell : 0;
}

int periods_of(const RapidShape& shape) noexcept {
  return std::max({periods_of(shape, 0), periods_of(shape, 1), periods_of(shape, 2)});
}

template <class CountsOf>
RapidShape shape_of(const Vector3& travel_mm, const FanucModel& model, CountsOf&& counts_of) {
  RapidShape shape;
  shape.bell = bell_periods(model);
  if (travel_mm.isZero(0.0)) {
    return shape;
  }
  const bool linear = model.rapid_path == RapidPath::linear;
  const EvenMove straight = straight_move(travel_mm, model);
  int longest = 0;
  for (int i = 0; i < axis_count; ++i) {
    if (travel_mm[i] == 0.0) {
      continue;
    }
    const auto axis = static_cast<std::size_t>(i);
    const EvenMove move = linear ? straight : axis_move(travel_mm, i, model);
    const Counts counts = counts_of(move, model.period_s);
    shape.travel[axis] = counts.travel;
    shape.ramp[axis] = counts.ramp;
    if (periods_of(shape, axis) > longest) {
      longest = periods_of(shape, axis);
      shape.even_s = move.length_mm / move.rate_mm_per_s;
      shape.rate_mm_per_s = move.length_mm / (counts.travel * model.period_s);
    }
  }
  return shape;
}

// What a smoothing over n periods leaves of the error that the servo loop has when the smoothing begins to run out: the
// mean of decay^k, and of its two ends as RapidInterpolator joins them.
double smoothing_share(int n, double decay) noexcept {
  return n > 0 ? (1.0 - std::pow(decay, n)) / (n * (1.0 - decay)) * 0.5 * (1.0 + decay) : 1.0;
}

}  // namespace

RapidShape rapid_shape(const Vector3& travel_mm, const FanucModel& model) {
  return shape_of(travel_mm, model, counts_in_closed_form);
}

double rapid_time_s(const Vector3& travel_mm, const FanucModel& model) {
  return periods_of(rapid_shape(travel_mm, model)) * model.period_s;
}

double in_position_wait_s(const Vector3& error_mm, const std::array<bool, axis_count>& moved, const FanucModel& model) {
  double wait_s = 0.0;
  for (int i = 0; i < axis_count; ++i) {
    if (!moved[static_cast<std::size_t>(i)]) {
      continue;
    }
    if (model.in_position == InPosition::measured) {
      wait_s = std::max(wait_s, model.in_position_s[i]);
    } else if (const double error = std::abs(error_mm[i]); error > model.in_position_width_mm[i]) {
      const double exact_s = std::log(error / model.in_position_width_mm[i]) / model.position_gain_per_s[i];
      wait_s = std::max(wait_s, whole_periods(exact_s / model.period_s) * model.period_s);
    }
  }
  return wait_s;
}

double in_position_wait_s(const Vector3& travel_mm, const FanucModel& model) {
  const RapidShape shape = rapid_shape(travel_mm, model);
  const int longest = periods_of(shape);
  Vector3 error = Vector3::Zero();
  std::array<bool, axis_count> moved{};
  for (int i = 0; i < axis_count; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    moved[axis] = travel_mm[i] != 0.0;
    if (!moved[axis] || model.in_position == InPosition::measured) {
      continue;
    }
    // Error of a lag behind an even run of so many periods, then through the two smoothings, then at rest until the
    // slowest axis arrives (non-linear rapids).
    const double gain = model.position_gain_per_s[i];
    const double decay = std::exp(-gain * model.period_s);
    const double speed = travel_mm[i] / (shape.travel[axis] * model.period_s);
    error[i] = (1.0 - model.feed_forward_ratio[i]) * speed / gain * (1.0 - std::pow(decay, shape.travel[axis])) *
               smoothing_share(shape.ramp[axis], decay) * smoothing_share(shape.bell, decay) *
               std::pow(decay, longest - periods_of(shape, axis));
  }
  return in_position_wait_s(error, moved, model);
}

RapidInterpolator::RapidInterpolator(const Vector3& start_mm, const Vector3& end_mm, const FanucModel& model)
    : start_mm_(start_mm), travel_mm_(end_mm - start_mm), end_mm_(end_mm) {
  check(model);
  const RapidShape shape = shape_of(travel_mm_, model, counts_by_trial);
  count_ = periods_of(shape);
  for (std::size_t i = 0; i < axis_count; ++i) {
    axes_[i].travel = shape.travel[i];
    for (const int length : {shape.ramp[i], shape.bell}) {
      if (shape.travel[i] > 0 && length > 0) {
        // A moving average of speed that changes in straight lines between the ticks: half weights at its ends.
        axes_[i].filters.emplace_back(Fir::moving_average(length), 1);
        axes_[i].filters.emplace_back(Fir({0, 1}, {0.5, 0.5}), 1);
      }
    }
  }
}

bool RapidInterpolator::step(Vector3& position) noexcept {
  if (index_ > count_) {
    position = end_mm_;
    return false;
  }
  for (std::size_t i = 0; i < axis_count; ++i) {
    Axis& axis = axes_[i];
    double share = axis.travel > 0 ? std::min(1.0, static_cast<double>(index_) / axis.travel) : 1.0;
    for (FirStream& filter : axis.filters) {
      filter.step({&share, 1}, {&share, 1});
    }
    const auto k = static_cast<Eigen::Index>(i);
    position[k] = start_mm_[k] + share * travel_mm_[k];
  }
  if (index_ == count_) {
    position = end_mm_;
  }
  ++index_;
  return true;
}

Samples rapid_samples(const Vector3& start_mm, const Vector3& end_mm, const FanucModel& model) {
  RapidInterpolator interpolator(start_mm, end_mm, model);
  Samples samples;
  samples.period_s = model.period_s;
  samples.positions_mm.resize(interpolator.period_count() + 1, axis_count);
  Vector3 position;
  for (Eigen::Index row = 0; interpolator.step(position); ++row) {
    samples.positions_mm.row(row) = position;
  }
  return samples;
}

}  // namespace shapegcode
