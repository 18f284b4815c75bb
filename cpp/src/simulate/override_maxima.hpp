// The largest deviations of a motion at another feed override, without simulating most of it.
#pragma once

#include <cstddef>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/simulation.hpp"
#include "simulate/deviation_bounds.hpp"
#include "simulate/free_modes.hpp"
#include "simulate/path_walk.hpp"

namespace shapegcode::detail {

/// A first pass goes from block to block, with the modes moved in closed form, and says how far the table can be from
/// its command in each group of blocks. Where that leaves many groups that could hold a maximum, a second pass takes
/// the distance of the table from the pieces of path beside it, without a search. What then could hold a maximum is
/// followed set-point by set-point as a full simulation does, the most promising group first, until no other can hold
/// a larger one.
class OverrideMaxima {
 public:
  /// `bounds` and `groups` of the same blocks at any override; they, blocks, tracker and options must outlive it.
  OverrideMaxima(const Path& path, const Segments& blocks, const std::vector<BlockGroup>& groups,
                 const CornerReach& corners, const ContourTracker& tracker, BlockEnd block_end,
                 const SimulationOptions& options);
  [[nodiscard]] OverrideFigures at(double override_ratio);

 private:
  struct GroupStart {  // at the first set-point of a group
    std::size_t block = 0;
    double elapsed_s = 0.0;
    Vector3 velocity_mm_per_s = Vector3::Zero();
  };
  void pass(BlockInterpolator interpolator);
  double turn(const Segment& arc, double from_mm, double to_mm, std::size_t periods) noexcept;
  void walk(BlockInterpolator interpolator);
  /// Follows the groups with the largest bounds: so many of them, or until no other can hold a larger maximum.
  void search(const BlockInterpolator& interpolator, std::size_t most);
  [[nodiscard]] bool may_hold_command(std::size_t group) const noexcept;
  [[nodiscard]] bool may_hold_response(std::size_t group) const noexcept;
  [[nodiscard]] bool may_hold_more(std::size_t group) const noexcept {
    return !followed_[group] && (may_hold_command(group) || may_hold_response(group));
  }
  Vector3 begin_at(BlockInterpolator& interpolator, std::size_t group) noexcept;
  [[nodiscard]] std::size_t restart_before(std::size_t group) const noexcept;
  /// Groups from `first` to `last`, and what follows them and promises more.
  void follow(BlockInterpolator interpolator, std::size_t first, std::size_t last);

  Path path_;
  const Segments& blocks_;
  const std::vector<BlockGroup>& groups_;
  BlockEnd block_end_;
  const SimulationOptions& options_;
  FreeModes modes_;
  ContourTracker command_tracker_;
  ContourTracker response_tracker_;
  CornerReach command_reach_;
  CornerReach response_reach_;
  // Of each group:
  std::vector<GroupStart> starts_;
  std::vector<double> states_;         // of the modes
  std::vector<double> deflection_mm_;  // no response is further from its command
  std::vector<double> response_mm_;    // no response is further from the path, nor a corner from its track
  std::vector<bool> followed_;
  OverrideFigures figures_;
  bool is_walked_ = false;  // the bounds are near what they bound
};

}  // namespace shapegcode::detail
