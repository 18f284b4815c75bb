#include "shapegcode/fanuc_model.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/checks.hpp"
#include "base/refuse.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// A block that ends at a period to within round-off ends exactly there.
constexpr double tick_tolerance = 1e-6;
// Blocks that one step takes one by one; where more of them end within a period, whole groups are passed at once.
constexpr std::size_t group_size = 16;

void require_simulable(const Segments& blocks, double period_s, double override_ratio) {
  require_period(period_s);
  require_above_zero(override_ratio, "override", "");
  for (const Segment& block : blocks) {
    if (block.length_mm > 0.0 && !(block.feed_mm_per_s > 0.0)) {
      throw Error(ErrorKind::argument, "block without a feed greater than zero", block.line);
    }
  }
}

}  // namespace

double whole_periods(double periods) noexcept { return std::ceil(periods - tick_tolerance); }

double block_periods(double length_mm, double feed_mm_per_s, double period_s, BlockEnd block_end) noexcept {
  if (length_mm <= 0.0) {
    return 0.0;
  }
  const double exact = length_mm / feed_mm_per_s / period_s;
  return block_end == BlockEnd::carry ? exact : whole_periods(exact);
}

BlockInterpolator::BlockInterpolator(Segments blocks, double period_s, BlockEnd block_end, double override_ratio)
    : blocks_(std::move(blocks)), period_s_(period_s), ratio_(override_ratio), block_end_(block_end) {
  require_simulable(blocks_, period_s, override_ratio);
  if (!blocks_.empty()) {
    find_crowds();
    open_block();
  }
}

void BlockInterpolator::find_crowds() {
  const auto duration_of = [this](std::size_t first) {
    double sum = 0.0;
    for (const Segment& block : blocks_.part(first, group_size)) {
      sum += block_duration_s(block);
    }
    return sum;
  };
  // Most programs have no crowd, and most groups are seen to be none by their first block.
  const auto is_crowd = [this](std::size_t first) {
    double sum = 0.0;
    for (std::size_t i = first; i < first + group_size && sum <= period_s_; ++i) {
      sum += block_duration_s(blocks_[i]);
    }
    return sum <= period_s_;
  };
  bool crowded = false;
  for (std::size_t first = 0; first + group_size <= blocks_.size() && !crowded; first += group_size) {
    crowded = is_crowd(first);
  }
  if (!crowded) {
    return;
  }
  // The last block is in no group: it ends the run.
  std::vector<std::vector<double>> sums(1);
  for (std::size_t group = 0; group < (blocks_.size() - 1) / group_size; ++group) {
    sums[0].push_back(duration_of(group * group_size));
  }
  while (sums.back().size() >= group_size) {
    const std::vector<double>& parts = sums.back();
    std::vector<double> wholes;
    for (std::size_t group = 0; group < parts.size() / group_size; ++group) {
      const auto first = parts.begin() + static_cast<std::ptrdiff_t>(group * group_size);
      wholes.push_back(std::accumulate(first, first + group_size, 0.0));
    }
    sums.push_back(std::move(wholes));
  }
  crowds_ = std::make_shared<const std::vector<std::vector<double>>>(std::move(sums));
}

bool BlockInterpolator::leap(double slack) noexcept {
  const std::vector<std::vector<double>>& sums = *crowds_;
  std::size_t size = group_size;
  std::size_t largest = 0;  // group that ends within the time elapsed
  double duration_s = 0.0;
  for (std::size_t level = 0; level < sums.size() && block_ % size == 0; ++level, size *= group_size) {
    const std::size_t group = block_ / size;
    const bool pauses = pause_s_ > 0.0 && paused_block_ >= block_ && paused_block_ < block_ + size;
    if (group >= sums[level].size() || pauses || sums[level][group] > elapsed_s_ + slack) {
      break;
    }
    largest = size;
    duration_s = sums[level][group];
  }
  block_ += largest;
  elapsed_s_ = block_end_ == BlockEnd::ceil ? 0.0 : elapsed_s_ - duration_s;
  return largest > 0;
}

double BlockInterpolator::block_duration_s(const Segment& segment) const noexcept {
  return block_periods(segment.length_mm, segment.feed_mm_per_s * ratio_, period_s_, block_end_) * period_s_;
}

void BlockInterpolator::open_block() noexcept {
  open_ = blocks_[block_];
  duration_s_ = block_duration_s(open_);
  if (block_ == paused_block_) {
    duration_s_ += pause_s_;
  }
  travel_mm_ = open_.end_mm - open_.start_mm;
  speed_mm_per_s_ = open_.feed_mm_per_s * ratio_;
  on_line_until_s_ = 0.0;
}

void BlockInterpolator::pause_after(std::size_t block, double seconds) {
  if (!(seconds >= 0.0) || !std::isfinite(seconds)) {
    detail::refuse("pause of {} s: must be finite and >= 0", seconds);
  }
  if (block < block_ || block >= blocks_.size()) {
    detail::refuse("pause behind block {}: block {} of {} is open", block, block_, blocks_.size());
  }
  paused_block_ = block;
  pause_s_ = block_end_ == BlockEnd::ceil ? whole_periods(seconds / period_s_) * period_s_ : seconds;
  open_block();
}

bool BlockInterpolator::pausing() const noexcept {
  const double slack = tick_tolerance * period_s_;
  return started_ && !finished_ && pause_s_ > 0.0 && block_ == paused_block_ &&
         elapsed_s_ >= duration_s_ - pause_s_ - slack;
}

bool BlockInterpolator::step_on(Vector3& position) noexcept {
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
      on_line_until_s_ = 0.0;
      position = blocks_.back().end_mm;
      return true;
    }
    ++block_;
    while (crowds_ && leap(slack)) {
    }
    open_block();
  }
  position = stand_on_block();
  return true;
}

Vector3 BlockInterpolator::stand_on_block() noexcept {
  if (open_.kind != SegmentKind::arc && open_.length_mm > 0.0) {
    on_line_until_s_ = duration_s_ - tick_tolerance * period_s_;
  }
  return point_at(open_, along_mm());
}

std::size_t BlockInterpolator::pass_block(Vector3& position, double until_mm) noexcept {
  if (finished_ || !(open_.length_mm > 0.0)) {
    return 0;
  }
  const double until_s = std::min(duration_s_ - tick_tolerance * period_s_, until_mm / speed_mm_per_s_);
  std::size_t passed = 0;
  while (elapsed_s_ + period_s_ < until_s) {
    elapsed_s_ += period_s_;
    ++passed;
  }
  if (passed > 0) {
    position = stand_on_block();
  }
  return passed;
}

Vector3 BlockInterpolator::begin_on(std::size_t block, double elapsed_s) noexcept {
  block_ = block;
  open_block();
  elapsed_s_ = elapsed_s;
  started_ = true;
  finished_ = false;
  return stand_on_block();
}

double blocks_duration_s(const Segments& blocks, double period_s, BlockEnd block_end, double override_ratio) {
  require_simulable(blocks, period_s, override_ratio);
  double total = 0.0;
  for (const Segment& block : blocks) {
    total += block_periods(block.length_mm, block.feed_mm_per_s * override_ratio, period_s, block_end) * period_s;
  }
  return total;
}

}  // namespace shapegcode
