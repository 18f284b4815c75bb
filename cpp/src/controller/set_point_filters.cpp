#include "controller/set_point_filters.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/checks.hpp"
#include "base/refuse.hpp"
#include "filter/dense.hpp"

namespace shapegcode {
namespace {

// Permitted difference of a sum of taps from 1.
constexpr double tap_rounding = 1e-12;

// Sums of taps that are 1 to the last bits only would move the machine when it is at rest.
Fir scaled_to_one(const Fir& fir) {
  if (fir.is_moving_average() || fir.decay() != 0.0) return fir;
  const double sum = std::accumulate(fir.taps().begin(), fir.taps().end(), 0.0);
  std::vector<double> taps = fir.taps();
  for (double& tap : taps) tap /= sum;
  return Fir(fir.delays(), std::move(taps));
}

// Shapers that are chosen from: the derivatives of what turns one into the other in a time of 1, at their largest.
constexpr double fade_first = 1.875;
constexpr double fade_second = 5.7736;
constexpr double fade_third = 60.0;
// Places of a fade where it is looked at.
constexpr int fade_places = 8;

double largest_mean(const std::vector<Fir>& chains) {
  double mean = 0.0;
  for (const Fir& chain : chains) mean = std::max(mean, chain.mean_samples());
  return mean;
}

// As late as the slowest of them, or a straight path would not stay straight: a delay by whole samples and a share of
// one, which leaves every zero of the shaper.
void align(std::vector<Fir>& shapers) {
  const double mean = largest_mean(shapers);
  for (Fir& shaper : shapers) {
    const double later = mean - shaper.mean_samples();
    const int whole = static_cast<int>(std::floor(later));
    const double share = later - whole;
    if (later < tap_rounding) continue;
    const bool is_whole = share < tap_rounding;
    const Fir late = convolved(shaper, is_whole ? Fir({whole}, {1.0}) : Fir({whole, whole + 1}, {1.0 - share, share}));
    std::vector<int> delays;
    std::vector<double> taps;
    for (std::size_t k = 0; k < late.taps().size(); ++k) {
      if (late.taps()[k] == 0.0) continue;
      delays.push_back(late.delays()[k]);
      taps.push_back(late.taps()[k]);
    }
    shaper = Fir(std::move(delays), std::move(taps));
  }
}

// One shaper for all axes, or one for each.
template <typename Shapers>
std::vector<Fir> each_of(const Shapers& shapers, int n_axes) {
  if (const auto* one = std::get_if<Fir>(&shapers)) return {scaled_to_one(*one)};
  std::vector<Fir> each = std::get<std::vector<Fir>>(shapers);
  if (each.size() != static_cast<std::size_t>(n_axes)) {
    detail::refuse("{} shapers for {} axes: one for all, or one for each", each.size(), n_axes);
  }
  for (Fir& fir : each) fir = scaled_to_one(fir);
  align(each);
  return each;
}

// The shapers that may act on any axis.
std::vector<Fir> shapers_of(const ControllerSettings& settings, int n_axes) {
  if (const auto* following = std::get_if<FollowingFir>(&settings.shaper)) return following->fir().set();
  return each_of(settings.shaper, n_axes);
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
    : period_s_(settings.period_s), rest_(values(static_cast<std::size_t>(n_axes))) {
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
  FilterStages stages;
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
    stages.push_back(std::move(corrections));
  }
  for (const Fir& chain : chains) measure(chain, settings.period_s);
  means_ = {largest_mean(chains)};
  if (length > 1) {
    chain_.emplace_back(std::vector{average}, n_axes);
    chain_.emplace_back(std::vector{average}, n_axes);
    stages.insert(stages.end(), 2, {average});
  }
  stages.push_back(shapers);
  if (!following_) chains_.push_back(std::move(stages));
  if (following_) {
    const double fastest = settings.limits.max_feed_mm_per_s[following_->axis()];
    change_ = cost_of_change(chains, following_->position_mm(), settings.period_s, fastest);
    gain_ = std::max(gain_, change_.gain);
  } else if (settings.other_shapers.empty()) {
    chain_.emplace_back(shapers, n_axes);
  } else {
    shapers_.emplace_back(shapers, n_axes);
  }
  if (!settings.other_shapers.empty()) add_others(settings, average, std::move(chains), n_axes);
}

void SetPointFilters::add_others(const ControllerSettings& settings, const Fir& average, std::vector<Fir> first,
                                 int n_axes) {
  const Fir smoothing = convolved(average, average);
  if (following_) detail::refuse("shapers to exchange beside one that follows an axis");
  if (settings.contour_correction) detail::refuse("shapers to exchange beside a contour correction");
  require_above_zero(settings.fade_time_s, "time of a fade", "s");
  fade_s_ = settings.fade_time_s;
  std::vector<std::vector<Fir>> sets{std::move(first)};
  for (const AxisShapers& other : settings.other_shapers) {
    const std::vector<Fir> shapers = each_of(other, n_axes);
    shapers_.emplace_back(shapers, n_axes);
    std::vector<Fir> chains;
    chains.reserve(shapers.size());
    for (const Fir& shaper : shapers) chains.push_back(convolved(smoothing, shaper));
    for (const Fir& chain : chains) measure(chain, settings.period_s);
    means_.push_back(largest_mean(chains));
    chains_.push_back({{average}, {average}, shapers});
    for (const std::vector<Fir>& set : sets) measure_fade(set, chains, settings.period_s);
    sets.push_back(std::move(chains));
  }
  outputs_.assign(shapers_.size(), std::vector<double>(rest_.size()));
  cost_of_fade_.first = fade_first / fade_s_;
  cost_of_fade_.second = fade_second / (fade_s_ * fade_s_);
  cost_of_fade_.third = fade_third / (fade_s_ * fade_s_ * fade_s_);
}

// Of an axis' outputs y1 and y2 the difference is what comes in, differenced, through the sum of what the taps differ
// by. On the way from one to the other both act, each with its share.
void SetPointFilters::measure_fade(const std::vector<Fir>& one, const std::vector<Fir>& other, double period_s) {
  for (std::size_t i = 0; i < std::max(one.size(), other.size()); ++i) {
    const Fir& from = one[one.size() == 1 ? 0 : i];
    const Fir& to = other[other.size() == 1 ? 0 : i];
    const std::size_t count = std::max(from.taps().size(), to.taps().size());
    std::vector<int> delays(count);
    std::iota(delays.begin(), delays.end(), 0);
    double sum = 0.0;
    double apart = 0.0;
    for (std::size_t k = 0; k < count; ++k) apart += std::abs(sum += tap_of(to, k) - tap_of(from, k));
    cost_of_fade_.apart_s = std::max(cost_of_fade_.apart_s, apart * period_s);
    for (int place = 1; place < fade_places; ++place) {
      const double share = static_cast<double>(place) / fade_places;
      std::vector<double> taps(count);
      for (std::size_t k = 0; k < count; ++k) taps[k] = (1.0 - share) * tap_of(from, k) + share * tap_of(to, k);
      measure(Fir(delays, std::move(taps)), period_s);
    }
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
  for (AxisFilters& filters : shapers_) filters.reset(rest_);
  from_ = to_;
  fade_ = {};
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
  if (!shapers_.empty()) step_shapers(values);
}

bool SetPointFilters::choose(std::size_t shaper) noexcept {
  if (from_ != to_) return true;
  to_ = shaper;
  faded_s_ = 0.0;
  return from_ != to_;
}

void SetPointFilters::step_shapers(std::span<double> values) noexcept {
  for (std::size_t i = 0; i < shapers_.size(); ++i) {
    std::ranges::copy(values, outputs_[i].begin());
    shapers_[i].step(outputs_[i]);
  }
  if (from_ != to_) {
    faded_s_ += period_s_;
    if (faded_s_ >= fade_s_) {
      from_ = to_;
      fade_ = {};
    } else {
      const double u = faded_s_ / fade_s_;
      const double rest = 1.0 - u;
      fade_ = {u * u * u * (10.0 + u * (-15.0 + 6.0 * u)), 30.0 * u * u * rest * rest / fade_s_,
               60.0 * u * rest * (rest - u) / (fade_s_ * fade_s_)};
    }
  }
  const std::size_t n = values.size() / orders;
  const std::vector<double>& one = outputs_[from_];
  const std::vector<double>& other = outputs_[to_];
  for (std::size_t i = 0; i < n; ++i) {
    const double position = other[i] - one[i];
    const double velocity = other[n + i] - one[n + i];
    const double acceleration = other[2 * n + i] - one[2 * n + i];
    values[i] = one[i] + fade_.value * position;
    values[n + i] = one[n + i] + fade_.value * velocity + fade_.first * position;
    values[2 * n + i] =
        one[2 * n + i] + fade_.value * acceleration + 2.0 * fade_.first * velocity + fade_.second * position;
  }
}

}  // namespace shapegcode
