#include "simulate/feed_meter.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace shapegcode::detail {
namespace {

constexpr std::array<std::size_t, 3> window_periods{1, 4, 16};
constexpr double surely_below = 1.0 - 1e-9;
constexpr double min_gain = 1e-6;  // what is faster by less than this share is as fast

}  // namespace

FeedMeter::FeedMeter(const Path& path, const SimulationOptions& options)
    : path_(&path), period_s_(options.period_s), slack_mm_(options.feed_slack_mm) {
  if (!(options.feed_window_s > 0.0) || path.size() == 0) {
    return;
  }
  const double samples = std::max(1.0, std::round(options.feed_window_s / options.period_s));
  for (std::size_t i = 0; i < windows_.size(); ++i) {
    windows_[i] = window_periods[i] * static_cast<std::size_t>(samples);
  }
  rows_.resize(std::bit_ceil(windows_.back() + 1));
  mask_ = rows_.size() - 1;
}

void FeedMeter::step(const Vector3& command, const ContourTracker& tracker, double deviation_mm) noexcept {
  Row& now = rows_[count_ & mask_];
  double travelled = 0.0;
  if (count_ > 0) {
    const Row& last = row(count_ - 1);
    travelled = last.travelled_mm + (command - last.position).norm();
  }
  now = {command, travelled, std::abs(deviation_mm), tracker.segment()};
  if (now.segment != limits_of_) {
    set_limits(now.segment);
  }
  for (std::size_t i = 0; i < windows_.size(); ++i) {
    if (count_ < windows_[i]) continue;
    const Row& from = row(count_ - windows_[i]);
    if (travelled - from.travelled_mm > limits_mm_[i]) {
      compare(from, now, static_cast<double>(windows_[i]) * period_s_);
      set_limits(now.segment);
    }
  }
  ++count_;
}

void FeedMeter::set_limits(std::size_t segment) noexcept {
  const double speed = surely_below * ratio_to_beat_ * path_->feed_mm_per_s(segment);
  for (std::size_t i = 0; i < windows_.size(); ++i) {
    limits_mm_[i] = speed * static_cast<double>(windows_[i]) * period_s_ + surely_below * slack_mm_;
  }
  limits_of_ = segment;
}

void FeedMeter::compare(const Row& from, const Row& to, double time_s) noexcept {
  const double speed = (to.travelled_mm - from.travelled_mm - slack_mm_) / time_s;
  const auto beats = [&](double feed) { return speed > ratio_to_beat_ * feed; };
  if (!(speed > 0.0) || !beats(path_->feed_mm_per_s(to.segment))) {
    return;
  }
  // A position is as good as the motion is near the path: of short segments that all lie there each may be meant.
  const double near = 2.0 * std::max(from.deviation_mm, to.deviation_mm) + slack_mm_;
  std::size_t first = std::min(from.segment, to.segment);
  std::size_t last = std::max(from.segment, to.segment);
  while (first > 0 && (from.position - path_->start_mm(first)).norm() <= near) {
    --first;
  }
  while (last + 1 < path_->size() && (to.position - path_->end_mm(last)).norm() <= near) {
    ++last;
  }
  std::size_t fastest = first;
  for (std::size_t i = first + 1; i <= last; ++i) {
    if (path_->feed_mm_per_s(i) > path_->feed_mm_per_s(fastest)) {
      fastest = i;
    }
  }
  const double programmed = path_->feed_mm_per_s(fastest);
  if (beats(programmed)) {
    largest_ = {speed, programmed, path_->line(fastest)};
    ratio_to_beat_ = largest_.ratio() * (1.0 + min_gain);
  }
}

}  // namespace shapegcode::detail
