// The look-ahead over a window of segments, made in portions of bounded work: a plan that is in force, and a draft
// of the next one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "controller/segment_ring.hpp"

namespace shapegcode {

/// What the look-ahead makes of a segment.
struct SegmentPlan {
  ZoneSet at_start{}, at_end{};
  std::uint8_t piece_count = 0;
  std::array<bool, max_pieces> reduced{};
  std::array<Piece, max_pieces> pieces{};  ///< their start_speed: of the forward pass
};

/// A value in force and its draft, told apart by the version since which each holds.
template <class Value>
class Versions {
 public:
  [[nodiscard]] const Value& at(std::uint64_t version) const noexcept {
    const std::size_t last = newest();
    return values_[since_[last] <= version ? last : 1 - last];
  }
  [[nodiscard]] bool is_of(std::uint64_t version) const noexcept { return since_[newest()] == version; }
  /// Of this version, newer than any other: what was written for it so far, or a place for it.
  [[nodiscard]] Value& draft(std::uint64_t version) noexcept {
    if (is_of(version)) return values_[newest()];
    const std::size_t older = 1 - newest();
    since_[older] = version;
    return values_[older];
  }
  void forget(std::uint64_t version) noexcept {
    if (is_of(version)) since_[newest()] = 0;
  }

 private:
  [[nodiscard]] std::size_t newest() const noexcept { return since_[1] > since_[0] ? 1 : 0; }

  std::array<std::uint64_t, 2> since_{};
  std::array<Value, 2> values_{};
};

/// Of plan_speed it has the limits, zones and pieces. The plan in force always ends at rest at the end of what it
/// sees. New segments and a new override are worked out in a draft, some segments a period; when it is complete it
/// comes into force at once.
class OnlinePlan {
 public:
  /// Where the machine is: the segment that it runs or that comes next, and whether it is within it.
  struct MachinePosition {
    std::uint64_t running = 0;
    bool within = false;
  };

  /// What one period may do: a visit of a segment by a pass counts 1 to 5, in proportion to its time; the first one
  /// more, as another processor has just written the segment. The last visit may go beyond by `beyond_portion`.
  static constexpr int portion = 40;
  static constexpr int first_visit = 8;
  static constexpr int beyond_portion = first_visit;

  OnlinePlan(SegmentRing& ring, const MotionLimits& limits, std::size_t window);

  /// At rest before segment `next`. Nothing is known of any.
  void restart(std::uint64_t next) noexcept;
  /// A ratio above zero of the programmed feeds, for the next draft.
  void override_feeds(double ratio) noexcept { wished_ = ratio; }
  void begin_portion() noexcept { left_ = portion; }
  /// Goes on as far as the portion lets it. True when a draft is complete: take it over or refuse it, then call again.
  [[nodiscard]] bool work(std::uint64_t pushed, MachinePosition machine) noexcept;
  void take_over() noexcept;
  /// The machine cannot keep the draft: fewer segments, and at last a stop before the first of them.
  void refuse() noexcept;

  /// Segments before this one are seen.
  [[nodiscard]] std::uint64_t absorbed() const noexcept { return absorbed_; }
  [[nodiscard]] std::uint64_t version() const noexcept { return version_; }  ///< in force
  [[nodiscard]] std::uint64_t draft() const noexcept { return version_ + 1; }
  [[nodiscard]] double ratio() const noexcept { return ratio_; }
  /// Whether segments that were pushed are not yet seen, though there is room for them.
  [[nodiscard]] bool has_more(std::uint64_t pushed, MachinePosition machine) const noexcept {
    return absorbed_ < pushed && absorbed_ - machine.running < window_;
  }
  [[nodiscard]] bool absorbs() const noexcept { return pass_ != Pass::none && !anew_; }
  [[nodiscard]] bool replans() const noexcept { return anew_ || wished_ != ratio_; }
  /// New segments of the draft, and the first segment that it runs otherwise than before.
  [[nodiscard]] std::uint64_t first_new() const noexcept { return first_; }
  [[nodiscard]] std::uint64_t newest() const noexcept { return newest_; }
  [[nodiscard]] std::uint64_t first_changed() const noexcept { return changed_; }
  /// How long the smoothing by the jerk time lasts; 0 = none.
  [[nodiscard]] double jerk_s() const noexcept { return limits_.jerk_time_s; }
  /// Of this portion.
  [[nodiscard]] int done() const noexcept { return portion - left_; }

  [[nodiscard]] const SegmentPlan& segment(std::uint64_t index, std::uint64_t version) const noexcept {
    return entries_[index & mask_].plan.at(version);
  }
  /// Speed at the start of a segment, of both passes.
  [[nodiscard]] double start(std::uint64_t index, std::uint64_t version) const noexcept {
    return entries_[index & mask_].start.at(version);
  }
  [[nodiscard]] double acceleration_of(const QueuedSegment& entry, double speed, bool reduced) const noexcept;

 private:
  // What a draft goes through; each visits one segment after the other.
  enum class Pass : std::uint8_t {
    none,
    forget,  // a draft that was refused
    zones,   // backwards: those that reach over the junctions at the ends
    pieces,  // forwards: zones that reach over the junctions at the starts, pieces, speeds that acceleration allows
    speeds,  // backwards: speeds that braking allows
    complete,
  };
  struct Entry {
    Versions<double> start;
    Versions<SegmentPlan> plan;
  };

  bool next_draft(std::uint64_t pushed) noexcept;
  void absorb(std::uint64_t first, std::uint64_t count) noexcept;
  void replan() noexcept;
  void go_through(Pass pass) noexcept;
  void visit() noexcept;
  void visit_zones() noexcept;
  void visit_pieces() noexcept;
  void visit_speeds() noexcept;
  void stop_before(std::uint64_t index) noexcept;
  [[nodiscard]] double limit_of(const QueuedSegment& entry) const noexcept;
  [[nodiscard]] ZoneSet zones_between(std::uint64_t from, std::uint64_t into) const noexcept;
  [[nodiscard]] ZoneSet zones_at_start(std::uint64_t index) const noexcept;
  [[nodiscard]] ZoneSet zones_behind(std::uint64_t index) const noexcept;
  void split(const QueuedSegment& entry, SegmentPlan& plan) const noexcept;

  SegmentRing* ring_;
  MotionLimits limits_;
  std::uint64_t window_;  // an eighth more than was asked for: what a draft is being made of is not yet in sight
  std::uint64_t mask_;
  std::vector<Entry> entries_;
  static constexpr std::uint64_t min_batch = 8;  // as many new segments a draft takes in, if so many are there

  std::uint64_t absorbed_ = 0;
  std::uint64_t version_ = 1;
  double ratio_ = 1.0;
  double wished_ = 1.0;
  std::uint64_t seen_ = 0;  // segments in sight when the last draft with a new override was begun

  Pass pass_ = Pass::none;
  int left_ = 0;         // of the portion
  bool anew_ = false;    // with another override; else new segments are taken in
  bool joined_ = false;  // to a motion that may have gone on since the draft was begun
  MachinePosition machine_;
  double draft_ratio_ = 1.0;
  std::uint64_t first_ = 0, newest_ = 0;
  std::uint64_t next_ = 0;  // to be visited, of this pass
  std::uint64_t changed_ = 0;
  std::uint64_t lowest_ = 0;  // written for the draft
  ZoneSet carry_{};
  double reach_ = 0.0;  // how far back zones matter
  double speed_ = 0.0;
};

}  // namespace shapegcode
