#include "switching_filter.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace shapegcode::linuxcnc {

static_assert(std::atomic<OfferedFilter*>::is_always_lock_free);

namespace {

/// From 0 at 0 to 1 at 1, with slope and curvature 0 at both.
double smooth_step(double x) noexcept { return x * x * x * (10.0 + x * (6.0 * x - 15.0)); }

}  // namespace

SwitchingFilter::SwitchingFilter(int n_joints)
    : active_(std::make_unique<OfferedFilter>(Fir({0}, {1.0}), n_joints, 0)),
      last_(static_cast<std::size_t>(n_joints), 0.0),
      blended_(static_cast<std::size_t>(n_joints), 0.0) {}

SwitchingFilter::~SwitchingFilter() {
  delete offered_.exchange(nullptr);
  clean_up();
}

void SwitchingFilter::step(std::span<const double> in, std::span<double> out, double fade_samples) noexcept {
  if (!started_) {
    active_->stream.reset(in);
    started_ = true;
  }
  still_ = std::ranges::equal(in, last_) ? still_ + 1 : 0;
  std::ranges::copy(in, last_.begin());
  if (!next_) take_offer(last_);
  active_->stream.step(last_, out);
  if (next_) blend_in(last_, out, fade_samples);
}

void SwitchingFilter::take_offer(std::span<const double> in) noexcept {
  // The place for what is done with is emptied by the other thread; without it there is nowhere to put this filter.
  if (retired_.load(std::memory_order_relaxed) != nullptr) return;
  next_.reset(offered_.exchange(nullptr, std::memory_order_acq_rel));
  if (!next_) return;
  next_->stream.reset(in);
  warm_ = 0;
  faded_ = 0.0;
}

void SwitchingFilter::blend_in(std::span<const double> in, std::span<double> out, double fade_samples) noexcept {
  next_->stream.step(in, blended_);
  const int lasts = next_->stream.fir().duration_samples();
  if (++warm_ <= lasts) return;
  if (still_ > std::max(lasts, active_->stream.fir().duration_samples())) {
    faded_ = 1.0;  // both are the input
  } else if (faded_ > 0.0 || fade_samples > 0.0) {
    faded_ = fade_samples > 0.0 ? std::min(faded_ + 1.0 / fade_samples, 1.0) : faded_;
    const double weight = smooth_step(faded_);
    for (std::size_t joint = 0; joint < out.size(); ++joint) out[joint] += weight * (blended_[joint] - out[joint]);
  }
  if (faded_ < 1.0) return;
  std::ranges::copy(blended_, out.begin());
  retired_.store(active_.release(), std::memory_order_release);
  active_ = std::move(next_);
}

void SwitchingFilter::offer(std::unique_ptr<OfferedFilter> filter) noexcept {
  delete offered_.exchange(filter.release(), std::memory_order_acq_rel);
}

void SwitchingFilter::clean_up() noexcept { delete retired_.exchange(nullptr, std::memory_order_acq_rel); }

}  // namespace shapegcode::linuxcnc
