#include "controller/set_point_filters.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/checks.hpp"
#include "base/refuse.hpp"
#include "filter/dense.hpp"

namespace shapegcode {
namespace {

// By which a sum of taps may miss 1.
constexpr double tap_rounding = 1e-12;

// Sums of taps that are 1 to the last bits only would move the machine when it is at rest.
Fir scaled_to_one(const Fir& fir) {
  if (fir.is_moving_average() || fir.decay() != 0.0) return fir;
  const double sum = std::accumulate(fir.taps().begin(), fir.taps().end(), 0.0);
  std::vector<double> taps = fir.taps();
  for (double& tap : taps) tap /= sum;
  return Fir(fir.delays(), std::move(taps));
}

// The shapers that may act on any axis.
std::vector<Fir> shapers_of(const ControllerSettings& settings, int n_axes) {
  if (const auto* one = std::get_if<Fir>(&settings.shaper)) return {scaled_to_one(*one)};
  if (const auto* following = std::get_if<FollowingFir>(&settings.shaper)) return following->fir().set();
  std::vector<Fir> each = std::get<std::vector<Fir>>(settings.shaper);
  if (each.size() != static_cast<std::size_t>(n_axes)) {
    detail::refuse("{} shapers for {} axes: one for all, or one for each", each.size(), n_axes);
  }
  for (Fir& fir : each) fir = scaled_to_one(fir);
  return each;
}

// The second difference over `delay` samples, scaled so that an arc comes out of both with its own radius.
Fir correction(double variance, int delay) {
  const double share = variance / (2.0 * delay * delay);
  return Fir({0, delay, 2 * delay}, {-share, 1.0 + 2.0 * share, -share});
}

}  // namespace

SetPointFilters::AxisFilters::AxisFilters(const std::vector<Fir>& filters, int n_axes) {
  const bool is_one = filters.size() == 1;
  for (std::size_t order = 0; order < (is_one ? 1 : orders); ++order) {
    for (const Fir& fir : filters) streams_.emplace_back(fir, is_one ? static_cast<int>(orders) * n_axes : 1);
  }
}

void SetPointFilters::AxisFilters::reset(std::span<const double> values) noexcept {
  const std::size_t width = values.size() / streams_.size();
  for (std::size_t i = 0; i < streams_.size(); ++i) streams_[i].reset(values.subspan(i * width, width));
}

void SetPointFilters::AxisFilters::step(std::span<double> values) noexcept {
  const std::size_t width = values.size() / streams_.size();
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    const std::span<double> part = values.subspan(i * width, width);
    streams_[i].step(part, part);
  }
}

SetPointFilters::SetPointFilters(const ControllerSettings& settings, int n_axes)
    : rest_(values(static_cast<std::size_t>(n_axes))) {
  require_not_below_zero(settings.smoothing_time_s, "smoothing time", "s");
  const double periods = std::round(settings.smoothing_time_s / settings.period_s);
  const auto length =
      std::max<std::int64_t>(1, require_count(periods, max_filter_samples, "the smoothing time", "periods"));
  const Fir average = Fir::moving_average(static_cast<int>(length));
  const Fir smoothing = convolved(average, average);
  const std::vector<Fir> shapers = shapers_of(settings, n_axes);
  std::vector<Fir> chains;
  double variance = 0.0;
  for (const Fir& shaper : shapers) {
    chains.push_back(convolved(smoothing, shaper));
    variance = std::max(variance, chains.back().variance_samples2());
  }
  if (const auto* following = std::get_if<FollowingFir>(&settings.shaper)) {
    following_ = *following;
    varying_.emplace_back(following->fir(), static_cast<int>(orders) * n_axes);
  }
  if (settings.contour_correction && variance > 0.0) {
    correction_delay_ = std::max(1, static_cast<int>(std::ceil(2.0 * std::sqrt(variance))));
    std::vector<Fir> corrections;
    for (Fir& chain : chains) {
      // A set that is followed has one correction: that of the filter which cuts most.
      const Fir fir = correction(following_ ? variance : chain.variance_samples2(), correction_delay_);
      chain = convolved(fir, chain);
      if (!following_ || corrections.empty()) corrections.push_back(fir);
    }
    chain_.emplace_back(corrections, n_axes);
  }
  for (const Fir& chain : chains) measure(chain, settings.period_s);
  if (length > 1) {
    chain_.emplace_back(std::vector{average}, n_axes);
    chain_.emplace_back(std::vector{average}, n_axes);
  }
  if (following_) {
    const double fastest = settings.limits.max_feed_mm_per_s[following_->axis()];
    change_ = cost_of_change(chains, following_->position_mm(), settings.period_s, fastest);
    gain_ = std::max(gain_, change_.gain);
  } else {
    chain_.emplace_back(shapers, n_axes);
  }
}

void SetPointFilters::measure(const Fir& chain, double period_s) {
  const std::vector<double>& taps = chain.taps();
  double gain = 0.0;
  double deviation = 0.0;
  const double mean = chain.mean_samples();
  for (std::size_t k = 0; k < taps.size(); ++k) {
    gain += std::abs(taps[k]);
    deviation += std::abs(taps[k]) * std::abs(static_cast<double>(k) - mean);
  }
  duration_ = std::max(duration_, static_cast<int>(taps.size()) - 1);
  mean_ = std::max(mean_, mean);
  if (gain > 1.0 + tap_rounding) gain_ = std::max(gain_, gain);
  // After the correction rounding may leave less than nothing.
  const double variance = correction_delay_ > 0 ? 0.0 : chain.variance_samples2();
  tolerance_.variance_s2 = std::max(tolerance_.variance_s2, variance * period_s * period_s);
  tolerance_.mean_deviation_s = std::max(tolerance_.mean_deviation_s, deviation * period_s);
}

void SetPointFilters::reset(std::span<const double> position) noexcept {
  std::ranges::fill(rest_, 0.0);
  std::ranges::copy(position, rest_.begin());
  for (AxisFilters& filters : chain_) filters.reset(rest_);
  for (VaryingFirStream& varying : varying_) varying.reset(rest_);
  if (following_) followed_mm_ = position[static_cast<std::size_t>(following_->axis())];
}

// A shaper that changes comes first: what its changes do to the motion is smoothed as well.
void SetPointFilters::step(std::span<double> values) noexcept {
  if (following_) {
    const double now_mm = values[static_cast<std::size_t>(following_->axis())];
    varying_.front().step(values, values, following_->place(0.5 * (followed_mm_ + now_mm)));
    followed_mm_ = now_mm;
  }
  for (AxisFilters& filters : chain_) filters.step(values);
}

}  // namespace shapegcode
