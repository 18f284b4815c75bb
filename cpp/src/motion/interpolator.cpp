#include "shapegcode/motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/checks.hpp"

namespace shapegcode {
namespace {

int smoothing_length(const SpeedProfile& profile, double period_s) {
  require_period(period_s);
  const double length = std::round(profile.jerk_time_s() / period_s);
  return std::max(1, static_cast<int>(require_count(length, max_filter_samples, "the jerk time", "periods")));
}

}  // namespace

Interpolator::Interpolator(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile,
                           double period_s, double delay_s)
    : path_(std::move(path)),
      profile_(std::move(profile)),
      smoothing_(Fir::moving_average(smoothing_length(*profile_, period_s)), 1),
      smooths_(smoothing_.fir().duration_samples() > 0),
      period_s_(period_s),
      delay_s_(delay_s) {
  const double rest = 0.0;
  smoothing_.reset({&rest, 1});
  // A ramp that ends at a period to within round-off ends exactly there.
  const double ramps = std::ceil((profile_->ramp_duration_s() + delay_s) / period_s - 1e-9);
  sample_count_ = static_cast<std::size_t>(require_count(ramps, max_set_points, "a path", "set-points")) + 1 +
                  static_cast<std::size_t>(smoothing_.fir().duration_samples());
  if (path_->size() > 0) take_segment();
}

void Interpolator::take_segment() noexcept {
  on_ = (*path_)[path_cursor_];
  on_begin_mm_ = path_->distance_mm(path_cursor_);
  on_end_mm_ = path_->distance_mm(path_cursor_ + 1);
}

bool Interpolator::step(Vector3& position, std::size_t periods) noexcept {
  const std::size_t end = std::min(index_ + periods, sample_count_);
  const bool moving = end == index_ + periods;
  // Only what smooths the distance needs the set-points that nobody asks for.
  if (!smooths_ && index_ < end) index_ = end - 1;
  while (index_ < end) {
    distance_mm_ = profile_->distance_mm(static_cast<double>(index_) * period_s_ - delay_s_, phase_cursor_);
    if (smooths_) smoothing_.step({&distance_mm_, 1}, {&distance_mm_, 1});
    // The last set-point is the end itself, whatever the running sum rounds to.
    if (++index_ == sample_count_) distance_mm_ = path_->length_mm();
  }
  if (path_->size() == 0) {
    position = Vector3::Zero();
    return moving;
  }
  // As Path::point, with the segment at hand.
  if (distance_mm_ < on_begin_mm_ || distance_mm_ >= on_end_mm_) {
    path_->seek(distance_mm_, path_cursor_);
    take_segment();
  }
  position = point_at(on_, distance_mm_ - on_begin_mm_);
  return moving;
}

Samples interpolate(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile, double period_s) {
  Interpolator interpolator(std::move(path), std::move(profile), period_s);
  Samples samples;
  samples.period_s = period_s;
  samples.positions_mm.resize(static_cast<Eigen::Index>(interpolator.sample_count()), axis_count);
  Vector3 position;
  for (Eigen::Index row = 0; interpolator.step(position); ++row) {
    samples.positions_mm.row(row) = position;
  }
  return samples;
}

}  // namespace shapegcode
