// Queue of finished set-points from the planning thread to the stepping one.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "controller/beside_path.hpp"
#include "controller/shared_state.hpp"
#include "planner/path_motion.hpp"

namespace shapegcode {

/// A period of planned motion: the set-point at its end, before the filters.
struct PlannedPoint {
  AxisValues position{}, velocity{}, acceleration{};
  PathPoint point;
  double distance = 0.0;  ///< since the last rest, mm
  std::uint32_t line = 0;
  FeedRate rate_of = FeedRate::per_time;
};

/// Some periods of motion, and behind them a stop along the path, all of it within the limits: whoever runs a section
/// needs no other one.
struct Section {
  std::uint32_t after = 0;      ///< the section that it goes on from
  std::size_t start = 0;        ///< and behind how many of its points
  std::size_t count = 0;        ///< points that are run if another section follows
  std::size_t whole_count = 0;  ///< with the stop
  std::uint64_t first_period = 0;
  std::uint64_t serial = 0;  ///< which one it is since the restart; its number comes again
  std::uint64_t done = 0;    ///< segments that have been run to their ends where it comes to rest
  bool runs_out = false;     ///< it rests there only because no segment follows
  bool is_bound = false;     ///< to the spindle: its one point is where the motion ends that somebody else runs
  AxisValues low{}, high{};  ///< of the positions
  /// Points before the first, newest first.
  std::array<PlannedPoint, 3> before{};
  /// Where these and those before them are, newest first: as many as filters behind hold.
  std::vector<Vector3> past;
  std::vector<PlannedPoint> points;

  /// The point after so many periods; up to three before the first one.
  [[nodiscard]] const PlannedPoint& at(std::ptrdiff_t periods) const noexcept {
    return periods > 0 ? points[static_cast<std::size_t>(periods - 1)] : before[static_cast<std::size_t>(-periods)];
  }
};

/// Sections by their numbers; one thread writes and another one reads. Each follows another at a certain point: one
/// that comes too late for that is dropped, and the stop is run.
class Sections {
 public:
  /// `capacity`: points of a section; `count`: sections that there is room for, at most 16; `past`: positions before.
  Sections(std::size_t capacity, std::size_t count, std::size_t past = 0) : slots_(count) {
    for (Section& section : slots_) {
      section.points.resize(capacity);
      section.past.resize(past, Vector3::Zero());
    }
  }
  /// At rest at a point; neither thread is at work.
  void restart(const PlannedPoint& point) noexcept;

  // Of the thread that plans.

  struct Reader {
    std::uint32_t section = 0;
    std::uint32_t next = 0;  ///< the first section that may still follow
    std::size_t slot = 0;    ///< where the section is
    std::size_t index = 0;   ///< points of the section that were given out
  };
  [[nodiscard]] Reader reader() const noexcept;
  /// One that is not dropped yet.
  [[nodiscard]] const Section& section(std::uint32_t number) const noexcept { return slots_[slot_of(number)]; }
  [[nodiscard]] const Section& section_of(const Reader& reader) const noexcept { return slots_[reader.slot]; }
  /// The number of the section that will be run last, as the reader goes on now.
  [[nodiscard]] std::uint32_t last_behind(const Reader& reader) const noexcept;
  /// The number of the next section.
  [[nodiscard]] std::uint32_t next_number() const noexcept { return published_.load(std::memory_order_relaxed); }
  /// Room for another section; none while the reader may still need all of them.
  [[nodiscard]] Section* free_section() noexcept;
  /// Gives it the next number.
  void publish() noexcept;
  [[nodiscard]] std::size_t capacity() const noexcept { return slots_.front().points.size(); }

  // Of the thread that steps.

  /// One period on; a section that leads out of the travel is not begun.
  const PlannedPoint& step(bool stopping, const SoftLimits& travel) noexcept;
  /// Whether motion that is bound to the spindle has to be run; and that it was.
  [[nodiscard]] bool is_bound() const noexcept { return current().is_bound && index_ == 0; }
  void pass() noexcept { ++index_; }
  /// The point that was given last.
  [[nodiscard]] const PlannedPoint& point() const noexcept { return current().at(static_cast<std::ptrdiff_t>(index_)); }
  [[nodiscard]] std::size_t index() const noexcept { return index_; }
  [[nodiscard]] const Section& current() const noexcept { return slots_[slot_]; }
  [[nodiscard]] bool at_rest() const noexcept { return index_ == current().whole_count; }
  /// Whether the last step ran the first point of a stop that was not asked for: no section came in time.
  [[nodiscard]] bool was_late() const noexcept { return was_late_; }
  /// Whether it stopped because the next section leads out of the travel.
  [[nodiscard]] bool was_refused() const noexcept { return was_refused_; }
  /// Whether another section is wanted for the next step.
  [[nodiscard]] bool wants_more() const noexcept { return index_ >= current().count; }

 private:
  // What the reader says shares a word: two numbers, a slot and an index.
  static constexpr std::uint32_t number_bits = 16;
  static constexpr std::uint32_t numbers = 1U << number_bits;
  static constexpr std::uint32_t slot_bits = 4;

  [[nodiscard]] std::size_t slot_of(std::uint32_t number) const noexcept { return slot_of_[number % slot_of_.size()]; }
  void say() noexcept;

  std::vector<Section> slots_;
  std::array<std::uint8_t, 32> slot_of_{};  // of the numbers that are not dropped yet
  std::uint8_t free_ = 0;
  alignas(cache_line) std::atomic<std::uint32_t> published_{0};  // the next number
  alignas(cache_line) std::atomic<std::uint64_t> reader_{0};

  std::uint32_t current_ = 0, next_ = 0;
  std::size_t slot_ = 0, index_ = 0;
  bool was_late_ = false, was_refused_ = false;
};

}  // namespace shapegcode
