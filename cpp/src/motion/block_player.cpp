#include "shapegcode/control.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// A block that ends on a tick to within rounding ends there.
constexpr double tick_tolerance = 1e-6;

}  // namespace

double whole_periods(double periods) noexcept { return std::ceil(periods - tick_tolerance); }

double block_periods(double length_mm, double feed_mm_per_s, double period_s, BlockEnd block_end) noexcept {
  if (length_mm <= 0.0) {
    return 0.0;
  }
  const double exact = length_mm / feed_mm_per_s / period_s;
  return block_end == BlockEnd::carry ? exact : whole_periods(exact);
}

BlockPlayer::BlockPlayer(std::span<const Segment> blocks, double period_s, BlockEnd block_end, double override_ratio)
    : blocks_(blocks), period_s_(period_s), ratio_(override_ratio), block_end_(block_end) {
  if (!(period_s > 0.0) || !(override_ratio > 0.0)) {
    throw Error(ErrorKind::argument, "interpolation period " + std::to_string(period_s) + " s and override " +
                                         std::to_string(override_ratio) + " must be > 0");
  }
  for (const Segment& block : blocks_) {
    if (block.length_mm > 0.0 && !(block.feed_mm_per_s > 0.0)) {
      throw Error(ErrorKind::argument, "block without a feed greater than zero", block.line);
    }
  }
  if (!blocks_.empty()) {
    open_block();
  }
}

double BlockPlayer::block_duration_s(const Segment& segment) const noexcept {
  return block_periods(segment.length_mm, segment.feed_mm_per_s * ratio_, period_s_, block_end_) * period_s_;
}

void BlockPlayer::open_block() noexcept {
  duration_s_ = block_duration_s(blocks_[block_]);
  if (block_ == paused_block_) {
    duration_s_ += pause_s_;
  }
}

void BlockPlayer::pause_after(std::size_t block, double seconds) {
  if (!(seconds >= 0.0) || !std::isfinite(seconds)) {
    throw Error(ErrorKind::argument, "pause of " + std::to_string(seconds) + " s: must be finite and >= 0");
  }
  if (block < block_ || block >= blocks_.size()) {
    throw Error(ErrorKind::argument, "pause behind block " + std::to_string(block) + ": block " +
                                         std::to_string(block_) + " of " + std::to_string(blocks_.size()) + " is open");
  }
  paused_block_ = block;
  pause_s_ = block_end_ == BlockEnd::ceil ? whole_periods(seconds / period_s_) * period_s_ : seconds;
  open_block();
}

bool BlockPlayer::pausing() const noexcept {
  const double slack = tick_tolerance * period_s_;
  return started_ && !finished_ && pause_s_ > 0.0 && block_ == paused_block_ &&
         elapsed_s_ >= duration_s_ - pause_s_ - slack;
}

bool BlockPlayer::step(Vector3& position) noexcept {
  if (blocks_.empty() || finished_) {
    position = blocks_.empty() ? Vector3(Vector3::Zero()) : blocks_.back().end_mm;
    return false;
  }
  if (started_) {
    elapsed_s_ += period_s_;
  }
  started_ = true;
  const double slack = tick_tolerance * period_s_;
  while (elapsed_s_ >= duration_s_ - slack) {
    elapsed_s_ -= duration_s_;
    if (block_end_ == BlockEnd::ceil) {
      elapsed_s_ = 0.0;  // durations are whole periods: what is left is rounding
    }
    if (block_ + 1 == blocks_.size()) {
      finished_ = true;
      position = blocks_.back().end_mm;
      return true;
    }
    ++block_;
    open_block();
  }
  const Segment& segment = blocks_[block_];
  position = point_at(segment, std::min(segment.length_mm, segment.feed_mm_per_s * ratio_ * elapsed_s_));
  return true;
}

double play_duration_s(std::span<const Segment> blocks, double period_s, BlockEnd block_end, double override_ratio) {
  const BlockPlayer player(blocks, period_s, block_end, override_ratio);
  double total = 0.0;
  for (const Segment& block : blocks) {
    total += player.block_duration_s(block);
  }
  return total;
}

}  // namespace shapegcode
