#include "shapegcode/filter.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/refuse.hpp"
#include "shapegcode/error.hpp"

#ifdef __FAST_MATH__
#error "varying_fir.cpp needs IEEE arithmetic: -ffast-math would remove the compensation of the running sum"
#endif

namespace shapegcode {

using Eigen::Index;

namespace {

/// A place as the index of the filter below it and the weight of the one above.
struct Shares {
  std::size_t lower;
  double upper_share;
};

Shares shares_at(double place, std::size_t filters) noexcept {
  const double within = place > 0.0 ? std::min(place, static_cast<double>(filters - 1)) : 0.0;  // not a number: 0
  const auto lower = static_cast<std::size_t>(within);
  return {lower, within - static_cast<double>(lower)};
}

}  // namespace

VaryingFir::VaryingFir(std::vector<Fir> set) : set_(std::move(set)) {
  if (set_.empty()) throw Error(ErrorKind::argument, "set of filters without a filter");
  const auto delays = static_cast<std::size_t>(duration_samples());
  to_come_.resize(set_.size() * delays);
  for (std::size_t k = 0; k < set_.size(); ++k) {
    // Summed from the end, so that nothing is left behind the last tap.
    double rest = 0.0;
    std::size_t tap = set_[k].taps().size();
    for (std::size_t delay = delays; delay-- > 0;) {
      while (tap > 0 && static_cast<std::size_t>(set_[k].delays()[tap - 1]) > delay) rest += set_[k].taps()[--tap];
      to_come_[k * delays + delay] = rest;
    }
  }
}

double VaryingFir::value(const double* newest, const double* place) const noexcept {
  const auto delays = static_cast<std::ptrdiff_t>(duration_samples());
  double lag = 0.0;
  for (std::ptrdiff_t delay = 0; delay < delays; ++delay) {
    const double increment = newest[-delay] - newest[-delay - 1];
    if (increment == 0.0) continue;
    const auto [lower, upper_share] = shares_at(place[-delay], set_.size());
    const double* const share = &to_come_[lower * static_cast<std::size_t>(delays) + static_cast<std::size_t>(delay)];
    lag += increment * (upper_share > 0.0 ? share[0] + upper_share * (share[delays] - share[0]) : share[0]);
  }
  return newest[0] - lag;
}

int VaryingFir::duration_samples() const noexcept {
  int longest = 0;
  for (const Fir& fir : set_) longest = std::max(longest, fir.duration_samples());
  return longest;
}

double VaryingFir::mean_samples() const noexcept {
  double sum = 0.0;
  for (const Fir& fir : set_) sum += fir.mean_samples();
  return sum / static_cast<double>(set_.size());
}

double VaryingFir::variance_samples2() const noexcept {
  double largest = set_.front().variance_samples2();
  for (const Fir& fir : set_) largest = std::max(largest, fir.variance_samples2());
  return largest;
}

VaryingFir VaryingFir::on_finer_grid(int factor) const {
  std::vector<Fir> finer;
  finer.reserve(set_.size());
  for (const Fir& fir : set_) finer.push_back(fir.on_finer_grid(factor));
  return VaryingFir(std::move(finer));
}

Samples VaryingFir::apply(const Samples& in, std::span<const double> place) const {
  const Index rows = in.positions_mm.rows();
  const Index axes = in.positions_mm.cols();
  if (rows < 1) throw Error(ErrorKind::argument, "filter input has no samples: there is no value to hold");
  if (place.size() != static_cast<std::size_t>(rows)) {
    detail::refuse("{} places for {} samples", place.size(), rows);
  }
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (!std::isfinite(place[i])) {
      detail::refuse("place of sample {} is not finite", i);
    }
  }
  Samples out;
  out.period_s = in.period_s;
  out.positions_mm.resize(rows + duration_samples(), axes);
  if (axes == 0) return out;
  VaryingFirStream stream(*this, static_cast<int>(axes));
  std::vector<double> position(static_cast<std::size_t>(axes));
  const auto take_row = [&](Index row) {
    for (Index axis = 0; axis < axes; ++axis) position[static_cast<std::size_t>(axis)] = in.positions_mm(row, axis);
  };
  take_row(0);
  stream.reset(position);
  for (Index row = 0; row < out.positions_mm.rows(); ++row) {
    const Index from = std::min(row, rows - 1);
    take_row(from);
    stream.step(position, position, place[static_cast<std::size_t>(from)]);
    for (Index axis = 0; axis < axes; ++axis) out.positions_mm(row, axis) = position[static_cast<std::size_t>(axis)];
  }
  return out;
}

void VaryingFirStream::Lag::add(double value) noexcept {
  const double total = sum + value;
  const double seen = total - sum;
  error += (sum - (total - seen)) + (value - seen);
  sum = total;
}

VaryingFirStream::VaryingFirStream(VaryingFir fir, int n_axes) : fir_(std::move(fir)) {
  if (n_axes < 1) {
    detail::refuse("filter stream of {} axes, at least 1 needed", n_axes);
  }
  const auto rows = std::bit_ceil(static_cast<std::size_t>(fir_.duration_samples()) + 1);
  const auto axes = static_cast<std::size_t>(n_axes);
  row_mask_ = rows - 1;
  pending_.resize(rows * axes);
  last_.resize(axes);
  increment_.resize(axes);
  lag_.resize(axes);
}

void VaryingFirStream::reset(std::span<const double> position) noexcept {
  row_ = 0;
  at_rest_ = 0;
  std::fill(pending_.begin(), pending_.end(), 0.0);
  std::fill(lag_.begin(), lag_.end(), Lag{});
  for (std::size_t axis = 0; axis < last_.size(); ++axis) last_[axis] = position[axis];
}

void VaryingFirStream::begin_train(const Fir& fir, double share) noexcept {
  const std::vector<int>& delays = fir.delays();
  const std::vector<double>& taps = fir.taps();
  const std::size_t axes = last_.size();
  const std::size_t last_tap = taps.size() - 1;
  for (std::size_t axis = 0; axis < axes; ++axis) {
    // The last tap takes what is left, so that no way is lost to rounding.
    double left = share * increment_[axis];
    for (std::size_t k = 0; k <= last_tap; ++k) {
      const double part = k == last_tap ? left : taps[k] * share * increment_[axis];
      left -= part;
      pending_[((row_ + static_cast<std::size_t>(delays[k])) & row_mask_) * axes + axis] += part;
    }
  }
}

void VaryingFirStream::step(std::span<const double> in, std::span<double> out, double place) noexcept {
  const std::size_t axes = last_.size();
  bool moves = false;
  for (std::size_t axis = 0; axis < axes; ++axis) {
    increment_[axis] = in[axis] - last_[axis];
    last_[axis] = in[axis];
    moves = moves || increment_[axis] != 0.0;
  }
  at_rest_ = moves ? 0 : at_rest_ + 1;
  if (moves) {
    const std::vector<Fir>& set = fir_.set();
    const auto [lower, upper_share] = shares_at(place, set.size());
    begin_train(set[lower], 1.0 - upper_share);
    if (upper_share > 0.0) begin_train(set[lower + 1], upper_share);
  }
  double* const arriving = &pending_[(row_ & row_mask_) * axes];
  const bool all_arrived = at_rest_ >= row_mask_ + 1;
  for (std::size_t axis = 0; axis < axes; ++axis) {
    Lag& lag = lag_[axis];
    if (all_arrived) {
      lag = Lag{};
    } else {
      lag.add(increment_[axis]);
      lag.add(-arriving[axis]);
    }
    arriving[axis] = 0.0;
    out[axis] = last_[axis] - (lag.sum + lag.error);
  }
  ++row_;
}

FollowingFir::FollowingFir(VaryingFir fir, int axis, std::vector<double> position_mm)
    : fir_(std::move(fir)), axis_(axis), position_mm_(std::move(position_mm)) {
  if (axis < 0 || axis >= axis_count) {
    detail::refuse("axis {}, 0 to 2 are X, Y and Z", axis);
  }
  if (position_mm_.size() != fir_.set().size()) {
    detail::refuse("{} positions for {} filters", position_mm_.size(), fir_.set().size());
  }
  for (std::size_t k = 0; k < position_mm_.size(); ++k) {
    if (!std::isfinite(position_mm_[k]) || (k > 0 && !(position_mm_[k] > position_mm_[k - 1]))) {
      detail::refuse("positions of filters must be finite and ascend: position {} is {} mm", k, position_mm_[k]);
    }
  }
}

double FollowingFir::place(double position_mm) const noexcept {
  if (!(position_mm > position_mm_.front())) return 0.0;
  const auto above = std::upper_bound(position_mm_.begin(), position_mm_.end(), position_mm);
  const auto count = static_cast<std::size_t>(above - position_mm_.begin());
  if (count == position_mm_.size()) return static_cast<double>(count - 1);
  const double below = position_mm_[count - 1];
  return static_cast<double>(count - 1) + (position_mm - below) / (position_mm_[count] - below);
}

FollowingFir FollowingFir::on_finer_grid(int factor) const { return {fir_.on_finer_grid(factor), axis_, position_mm_}; }

Samples FollowingFir::apply(const Samples& in) const {
  if (in.positions_mm.cols() <= axis_) {
    detail::refuse("samples of {} axes, the filters follow axis {}", in.positions_mm.cols(), axis_);
  }
  std::vector<double> places(static_cast<std::size_t>(in.positions_mm.rows()));
  for (std::size_t row = 0; row < places.size(); ++row) {
    const auto here = static_cast<Index>(row);
    const double middle = 0.5 * (in.positions_mm(here, axis_) + in.positions_mm(std::max<Index>(here - 1, 0), axis_));
    places[row] = place(middle);
  }
  return fir_.apply(in, places);
}

}  // namespace shapegcode
