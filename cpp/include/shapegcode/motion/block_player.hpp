#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "shapegcode/path/segment.hpp"

namespace shapegcode {

/// When a block's successor starts.
enum class BlockEnd : std::uint8_t {
  ceil,   ///< on the next interpolation tick (paper 004)
  carry,  ///< at once: the remainder of a period is carried over
};

/// Time after which a block's successor starts, in periods: l / (F T_I), a whole number under `ceil` (spec section 0).
/// 0 for a block without length.
[[nodiscard]] double block_periods(double length_mm, double feed_mm_per_s, double period_s,
                                   BlockEnd block_end) noexcept;

/// Whole periods that hold so many: rounded up, but for what is rounding error.
[[nodiscard]] double whole_periods(double periods) noexcept;

/// A controller without look-ahead: every block runs at its feed for its whole length, the next one follows at once.
/// The acceleration filter comes after it (a moving average: block overlap). Real-time form.
class BlockPlayer {
 public:
  /// `override_ratio` scales every feed. Throws Error(argument) on period or ratio <= 0, or a segment without feed.
  BlockPlayer(std::span<const Segment> blocks, double period_s, BlockEnd block_end, double override_ratio = 1.0);

  /// Stop for so long behind a block, as where the block buffer runs empty: the set-points stay at its end, then the
  /// next block follows. One pause per player, a later call takes the place of an earlier one. Under `ceil` whole
  /// periods, rounded up. Throws Error(argument) on a time that is negative or not finite, or a block that is
  /// over already or does not exist.
  void pause_after(std::size_t block, double seconds);
  /// Next set-point, the start first; false once the end was given.
  bool step(Vector3& position) noexcept;
  /// Block on which the set-point last given lies.
  [[nodiscard]] std::size_t block() const noexcept { return block_; }
  /// Whether the set-point last given is one of a pause.
  [[nodiscard]] bool pausing() const noexcept;
  /// Duration of one block: a whole number of periods under `ceil`.
  [[nodiscard]] double block_duration_s(const Segment& segment) const noexcept;

 private:
  void open_block() noexcept;

  std::span<const Segment> blocks_;
  double period_s_;
  double ratio_;
  BlockEnd block_end_;
  std::size_t block_ = 0;
  double elapsed_s_ = 0.0;   // since the open block began
  double duration_s_ = 0.0;  // of the open block and a pause behind it
  std::size_t paused_block_ = 0;
  double pause_s_ = 0.0;
  bool started_ = false;
  bool finished_ = false;
};

/// Sum of block durations in s.
[[nodiscard]] double play_duration_s(std::span<const Segment> blocks, double period_s, BlockEnd block_end,
                                     double override_ratio = 1.0);

}  // namespace shapegcode
