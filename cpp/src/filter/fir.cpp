#include "shapegcode/filter.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "base/checks.hpp"
#include "base/refuse.hpp"
#include "base/rest.hpp"
#include "shapegcode/error.hpp"

#ifdef __FAST_MATH__
#error "fir.cpp needs IEEE arithmetic: -ffast-math would remove the compensation of the running sum"
#endif

namespace shapegcode {
namespace {

using Eigen::Index;

constexpr int taps_per_pass = 8;
constexpr int max_delay = 100'000'000;  // a day of milliseconds; sums of a few filters stay countable
constexpr Index block_rows = 1024;      // 8 kB of output: stays in the first-level cache between passes

/// Sum of the last `length` samples, free of drift: the round-off of `sum` is stored exactly (two-sum) in `error`.
struct RunningSum {
  double sum = 0.0;
  double error = 0.0;

  void start(double value, double length) noexcept {
    sum = value * length;
    error = std::fma(value, length, -sum);
  }
  void replace(double newest, double oldest) noexcept {
    const double change = newest - oldest;
    const double seen_newest = change + oldest;
    const double change_error = (newest - seen_newest) - (oldest - (seen_newest - change));
    const double total = sum + change;
    const double seen_change = total - sum;
    const double total_error = (sum - (total - seen_change)) + (change - seen_change);
    error += total_error + change_error;
    sum = total;
  }
  /// Keeps `error` below the last digit of `sum`; batch and stream call it after the same samples.
  void normalise() noexcept {
    const double total = sum + error;
    error -= total - sum;
    sum = total;
  }
  [[nodiscard]] double mean(double length) const noexcept { return (sum + error) / length; }
};

/// Geometric weights in O(1): `lag` is sum over the n taps q^j (x[i-j] - x[i]), the filtered value newest + lag / G
/// with G = sum q^j. Held as a difference, it is exactly zero at rest, and its rounding dies out with q.
struct GeometricWeights {
  double decay;    // q
  double leaving;  // q^n
  double sum;      // G

  [[nodiscard]] double lag_behind(double lag, double newest, double previous, double oldest) const noexcept {
    return decay * lag - (sum - 1.0) * (newest - previous) + leaving * (previous - oldest);
  }
};

/// out[i] (+)= sum of taps[k] * in[i - delays[k]], left to right, for begin <= i < end. One store per output.
template <int n_taps, bool accumulate>
void weigh(const double* in, const int* delays, const double* taps, double* __restrict out, Index begin, Index end) {
  std::array<const double*, n_taps> x{};
  std::array<double, n_taps> a{};
  for (std::size_t k = 0; k < n_taps; ++k) {
    x[k] = in + begin - delays[k];
    a[k] = taps[k];
  }
  double* __restrict y = out + begin;
  const Index count = end - begin;
  for (Index i = 0; i < count; ++i) {
    double sum = 0.0;
    if constexpr (accumulate) {
      sum = y[i] + a[0] * x[0][i];
    } else {
      sum = a[0] * x[0][i];
    }
    for (std::size_t k = 1; k < n_taps; ++k) sum += a[k] * x[k][i];
    y[i] = sum;
  }
}

using WeighFunction = void (*)(const double*, const int*, const double*, double* __restrict, Index, Index);

template <bool accumulate>
constexpr std::array<WeighFunction, taps_per_pass> weigh_table{
    weigh<1, accumulate>, weigh<2, accumulate>, weigh<3, accumulate>, weigh<4, accumulate>,
    weigh<5, accumulate>, weigh<6, accumulate>, weigh<7, accumulate>, weigh<8, accumulate>};

/// Samples whose delayed inputs all exist.
void weigh_interior(const double* in, const std::vector<int>& delays, const std::vector<double>& taps, double* out,
                    Index begin, Index end) {
  const auto n_taps = taps.size();
  const auto first = std::min<std::size_t>(n_taps, taps_per_pass);
  if (first == n_taps) {
    weigh_table<false>[first - 1](in, delays.data(), taps.data(), out, begin, end);
    return;
  }
  for (Index block = begin; block < end; block += block_rows) {
    const Index block_end = std::min(block + block_rows, end);
    weigh_table<false>[first - 1](in, delays.data(), taps.data(), out, block, block_end);
    for (std::size_t k = first; k < n_taps; k += taps_per_pass) {
      const auto pass = std::min<std::size_t>(n_taps - k, taps_per_pass);
      weigh_table<true>[pass - 1](in, &delays[k], &taps[k], out, block, block_end);
    }
  }
}

struct Range {
  Index begin, end;
};

/// Samples near the ends, where the input is held.
void weigh_boundary(const double* in, Index rows, const std::vector<int>& delays, const std::vector<double>& taps,
                    double* out, Range range) {
  for (Index i = range.begin; i < range.end; ++i) {
    const auto delayed = [&](std::size_t k) { return in[std::clamp<Index>(i - delays[k], 0, rows - 1)]; };
    double sum = taps[0] * delayed(0);
    for (std::size_t k = 1; k < taps.size(); ++k) sum += taps[k] * delayed(k);
    out[i] = sum;
  }
}

void weigh_column(const double* in, Index rows, const std::vector<int>& delays, const std::vector<double>& taps,
                  double* out) {
  const Index duration = delays.back();
  const Index interior_begin = std::min(duration, rows);
  weigh_boundary(in, rows, delays, taps, out, {0, interior_begin});
  weigh_interior(in, delays, taps, out, interior_begin, rows);
  weigh_boundary(in, rows, delays, taps, out, {rows, rows + duration});
}

/// Row-major samples: all axes together are one series whose delays are n_axes times as long.
void weigh_rows(const double* in, Index rows, Index n_axes, const std::vector<int>& delays,
                const std::vector<double>& taps, double* out) {
  std::vector<int> flat_delays(delays);
  for (int& delay : flat_delays) delay *= static_cast<int>(n_axes);
  const Index duration = delays.back();
  const auto boundary = [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      for (Index axis = 0; axis < n_axes; ++axis) {
        const auto delayed = [&](std::size_t k) {
          return in[std::clamp<Index>(i - delays[k], 0, rows - 1) * n_axes + axis];
        };
        double sum = taps[0] * delayed(0);
        for (std::size_t k = 1; k < taps.size(); ++k) sum += taps[k] * delayed(k);
        out[i * n_axes + axis] = sum;
      }
    }
  };
  const Index interior_begin = std::min(duration, rows);
  boundary(0, interior_begin);
  weigh_interior(in, flat_delays, taps, out, interior_begin * n_axes, rows * n_axes);
  boundary(rows, rows + duration);
}

void average_column(const double* in, Index rows, Index length, double* out) {
  const Index out_rows = rows + length - 1;
  const auto divisor = static_cast<double>(length);
  RunningSum running;
  running.start(in[0], divisor);
  for (Index block = 0; block < out_rows; block += block_rows) {
    const Index block_end = std::min(block + block_rows, out_rows);
    for (Index begin = block; begin < block_end;) {
      // Up to the next point at which one of the two inputs stops or starts to be held.
      Index end = block_end;
      if (begin < length) end = std::min(end, length);
      if (begin < rows) end = std::min(end, rows);
      const bool ended = begin >= rows;
      const bool started = begin >= length;
      const double* newest = ended ? in + rows - 1 : in + begin;
      const double* oldest = started ? in + begin - length : in;
      const Index newest_stride = ended ? 0 : 1;
      const Index oldest_stride = started ? 1 : 0;
      for (Index i = begin; i < end; ++i, newest += newest_stride, oldest += oldest_stride) {
        running.replace(*newest, *oldest);
        out[i] = running.mean(divisor);
      }
      begin = end;
    }
    if (block_end - block == block_rows) running.normalise();
  }
}

void decay_column(const double* in, Index rows, Index length, const GeometricWeights& weights, double* out) {
  double lag = 0.0;
  double previous = in[0];
  for (Index i = 0; i < rows + length - 1; ++i) {
    const double newest = in[std::min(i, rows - 1)];
    lag = weights.lag_behind(lag, newest, previous, in[std::clamp<Index>(i - length, 0, rows - 1)]);
    out[i] = newest + lag / weights.sum;
    if ((i + 1) % rows_between_looks == 0) lag = state_or_none(lag);
    previous = newest;
  }
}

}  // namespace

void Fir::apply_rows(const double* in, Index rows, int n_axes, double* out) const {
  if (rows < 1 || n_axes < 1) {
    detail::refuse("filter input of {} samples and {} axes, at least 1 of each needed", rows, n_axes);
  }
  const bool flat_delays_fit = duration_samples() <= std::numeric_limits<int>::max() / n_axes;
  if (!moving_average_ && decay_ == 0.0 && flat_delays_fit) {
    weigh_rows(in, rows, n_axes, delays_, taps_, out);
    return;
  }
  const auto to_row_major = Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(1, n_axes);
  using Rows = Eigen::Map<Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  using ConstRows = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  const Eigen::MatrixXd columns = ConstRows(in, rows, n_axes, to_row_major);
  Eigen::MatrixXd result(rows + duration_samples(), n_axes);
  apply(columns.data(), rows, n_axes, result.data());
  Rows(out, result.rows(), n_axes, to_row_major) = result;
}

Fir::Fir(std::vector<int> delays, std::vector<double> taps) : delays_(std::move(delays)), taps_(std::move(taps)) {
  if (taps_.empty()) throw Error(ErrorKind::argument, "filter without taps");
  if (delays_.size() != taps_.size()) {
    detail::refuse("filter with {} delays but {} taps", delays_.size(), taps_.size());
  }
  if (delays_.front() < 0) {
    detail::refuse("filter delay {} is negative", delays_.front());
  }
  double sum = 0.0;
  for (std::size_t k = 0; k < taps_.size(); ++k) {
    if (delays_[k] > max_delay) {
      detail::refuse("filter delay {}, at most {} is possible", delays_[k], max_delay);
    }
    if (k > 0 && delays_[k] <= delays_[k - 1]) {
      detail::refuse("filter delays must ascend: {} follows {}", delays_[k], delays_[k - 1]);
    }
    if (!std::isfinite(taps_[k])) {
      detail::refuse("filter tap {} is not finite", k);
    }
    sum += taps_[k];
  }
  if (!(std::abs(sum - 1.0) <= 1e-9)) {
    detail::refuse("filter taps add up to 1 + {:.6g}, limit 1 +- 1e-9", sum - 1.0);
  }
}

Fir Fir::on_finer_grid(int factor) const {
  if (factor < 1) {
    detail::refuse("grid {} times as fine, at least 1 needed", factor);
  }
  if (duration_samples() > max_delay / factor) {
    detail::refuse("filter delay {} on a grid {} times as fine, at most {} is possible", duration_samples(), factor,
                   max_delay);
  }
  std::vector<int> delays = delays_;
  for (int& delay : delays) delay *= factor;
  return Fir(std::move(delays), taps_);
}

Fir Fir::moving_average(int length) {
  if (length < 1) {
    detail::refuse("moving average over {} samples, at least 1 needed", length);
  }
  if (length > max_delay) {
    detail::refuse("moving average over {} samples, at most {} are possible", length, max_delay);
  }
  std::vector<int> delays(static_cast<std::size_t>(length));
  for (std::size_t k = 0; k < delays.size(); ++k) delays[k] = static_cast<int>(k);
  Fir fir(std::move(delays), std::vector<double>(static_cast<std::size_t>(length), 1.0 / length));
  fir.moving_average_ = true;
  return fir;
}

Fir Fir::exponential(double time_constant_samples, double rest) {
  if (!(time_constant_samples > 0.0) || !std::isfinite(time_constant_samples)) {
    detail::refuse("exponential time constant is {} samples, must be > 0 and finite", time_constant_samples);
  }
  if (!(rest > 0.0 && rest < 1.0)) {
    detail::refuse("share of the exponential that is cut off is {}, must be between 0 and 1", rest);
  }
  const double length = std::max(1.0, std::ceil(-std::log(rest) * time_constant_samples));
  if (!(length <= max_filter_samples)) {
    detail::refuse("exponential filter of {:.10g} taps, at most {:.10g} are possible", length, max_filter_samples);
  }
  const double decay = std::exp(-1.0 / time_constant_samples);
  const double leaving = std::exp(-length / time_constant_samples);
  const double weight_sum = std::expm1(-length / time_constant_samples) / std::expm1(-1.0 / time_constant_samples);
  std::vector<int> delays(static_cast<std::size_t>(length));
  std::vector<double> taps(delays.size());
  for (std::size_t k = 0; k < taps.size(); ++k) {
    delays[k] = static_cast<int>(k);
    taps[k] = std::exp(-static_cast<double>(k) / time_constant_samples) / weight_sum;
  }
  Fir fir(std::move(delays), std::move(taps));
  fir.decay_ = decay;
  fir.leaving_ = leaving;
  fir.weight_sum_ = weight_sum;
  return fir;
}

int Fir::duration_samples() const noexcept { return delays_.back(); }

double Fir::mean_samples() const noexcept {
  if (moving_average_) return 0.5 * duration_samples();
  double mean = 0.0;
  for (std::size_t k = 0; k < taps_.size(); ++k) mean += taps_[k] * delays_[k];
  return mean;
}

double Fir::variance_samples2() const noexcept {
  if (moving_average_) {
    const double length = duration_samples() + 1.0;
    return (length * length - 1.0) / 12.0;
  }
  const double mean = mean_samples();
  double variance = 0.0;
  for (std::size_t k = 0; k < taps_.size(); ++k) variance += taps_[k] * (delays_[k] - mean) * (delays_[k] - mean);
  return variance;
}

void Fir::apply(std::span<const double> in, std::span<double> out) const {
  const auto expected = in.size() + static_cast<std::size_t>(duration_samples());
  if (out.size() != expected) {
    detail::refuse("filter output has {} samples, {} needed", out.size(), expected);
  }
  apply(in.data(), static_cast<Index>(in.size()), 1, out.data());
}

Samples Fir::apply(const Samples& in) const {
  Samples out;
  out.period_s = in.period_s;
  out.positions_mm.resize(in.positions_mm.rows() + duration_samples(), in.positions_mm.cols());
  apply(in.positions_mm.data(), in.positions_mm.rows(), static_cast<int>(in.positions_mm.cols()),
        out.positions_mm.data());
  return out;
}

void Fir::apply(const double* in, Index in_rows, int n_axes, double* out) const {
  if (in_rows < 1) throw Error(ErrorKind::argument, "filter input has no samples: there is no value to hold");
  if (n_axes < 0) detail::refuse("filter input has {} axes", n_axes);
  const Index out_rows = in_rows + duration_samples();
  for (int axis = 0; axis < n_axes; ++axis) {
    const double* column_in = in + axis * in_rows;
    double* column_out = out + axis * out_rows;
    if (moving_average_) {
      average_column(column_in, in_rows, duration_samples() + 1, column_out);
    } else if (decay_ > 0.0) {
      decay_column(column_in, in_rows, duration_samples() + 1, {decay_, leaving_, weight_sum_}, column_out);
    } else {
      weigh_column(column_in, in_rows, delays_, taps_, column_out);
    }
  }
}

FirStream::FirStream(Fir fir, int n_axes) : fir_(std::move(fir)), n_axes_(n_axes) {
  if (n_axes < 1) {
    detail::refuse("filter stream of {} axes, at least 1 needed", n_axes);
  }
  // A moving average also needs the sample that leaves it: one more than the largest delay, beside the newest.
  const auto rows = std::bit_ceil(static_cast<std::size_t>(fir_.duration_samples()) + 2);
  const auto axes = static_cast<std::size_t>(n_axes);
  row_mask_ = rows - 1;
  ring_.resize(rows * axes);
  sum_.resize(axes);
  sum_error_.resize(axes);
  const std::vector<double> zero(axes, 0.0);
  reset(zero);
}

void FirStream::reset(std::span<const double> position) noexcept {
  const auto axes = static_cast<std::size_t>(n_axes_);
  row_ = 0;
  for (std::size_t at = 0; at < ring_.size(); at += axes) {
    for (std::size_t axis = 0; axis < axes; ++axis) ring_[at + axis] = position[axis];
  }
  for (std::size_t axis = 0; axis < axes; ++axis) {
    RunningSum running;
    running.start(position[axis], static_cast<double>(fir_.duration_samples() + 1));
    sum_[axis] = fir_.decay_ > 0.0 ? 0.0 : running.sum;
    sum_error_[axis] = running.error;
  }
}

void FirStream::step(std::span<const double> in, std::span<double> out) noexcept {
  const auto axes = static_cast<std::size_t>(n_axes_);
  double* const newest = &ring_[(row_ & row_mask_) * axes];
  for (std::size_t axis = 0; axis < axes; ++axis) newest[axis] = in[axis];
  if (fir_.is_moving_average()) {
    const auto length = static_cast<std::size_t>(fir_.duration_samples()) + 1;
    const double* const oldest = &ring_[((row_ - length) & row_mask_) * axes];
    const bool block_ends = (row_ + 1) % static_cast<std::size_t>(block_rows) == 0;
    for (std::size_t axis = 0; axis < axes; ++axis) {
      RunningSum running{sum_[axis], sum_error_[axis]};
      running.replace(newest[axis], oldest[axis]);
      out[axis] = running.mean(static_cast<double>(length));
      if (block_ends) running.normalise();
      sum_[axis] = running.sum;
      sum_error_[axis] = running.error;
    }
  } else if (fir_.decay_ > 0.0) {
    const auto length = static_cast<std::size_t>(fir_.duration_samples()) + 1;
    const double* const previous = &ring_[((row_ - 1) & row_mask_) * axes];
    const double* const leaving = &ring_[((row_ - length) & row_mask_) * axes];
    const GeometricWeights weights{fir_.decay_, fir_.leaving_, fir_.weight_sum_};
    for (std::size_t axis = 0; axis < axes; ++axis) {
      sum_[axis] = weights.lag_behind(sum_[axis], newest[axis], previous[axis], leaving[axis]);
      out[axis] = newest[axis] + sum_[axis] / fir_.weight_sum_;
      if ((row_ + 1) % static_cast<std::size_t>(rows_between_looks) == 0) sum_[axis] = state_or_none(sum_[axis]);
    }
  } else {
    const std::vector<int>& delays = fir_.delays();
    const std::vector<double>& taps = fir_.taps();
    for (std::size_t k = 0; k < taps.size(); ++k) {
      const double* const delayed = &ring_[((row_ - static_cast<std::size_t>(delays[k])) & row_mask_) * axes];
      for (std::size_t axis = 0; axis < axes; ++axis) {
        const double share = taps[k] * delayed[axis];
        out[axis] = k == 0 ? share : out[axis] + share;
      }
    }
  }
  ++row_;
}

}  // namespace shapegcode
