#pragma once

#include <cstdint>
#include <vector>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode {

/// Parts of the cycle time; their sum is the whole.
struct TimeParts {
  double cutting_s = 0.0;       ///< cutting blocks at their feed (override and axis limits included)
  double rapid_s = 0.0;         ///< rapids at their rate
  double in_position_s = 0.0;   ///< waits after rapids and exact stops
  double dwell_s = 0.0;         ///< G04, dwells of cycles
  double acceleration_s = 0.0;  ///< added to cutting blocks and rapids by acceleration; in look-ahead also by the
                                ///< limits at corners and on arcs
  double tool_change_s = 0.0;   ///< M06
  double function_s = 0.0;  ///< other M codes, start of the program, waits for the spindle, rapids of unknown length

  [[nodiscard]] double total_s() const noexcept {
    return cutting_s + rapid_s + in_position_s + dwell_s + acceleration_s + tool_change_s + function_s;
  }
  TimeParts& operator+=(const TimeParts& other) noexcept;
};

/// One region of Program::regions.
struct RegionTime {
  std::uint32_t first_line = 0;
  std::uint32_t last_line = 0;
  std::int64_t tool = -1;  ///< in use; -1: not known
  double start_s = 0.0;
  double duration_s = 0.0;  ///< cutting_s + acceleration_s + in_position_s
  double cutting_s = 0.0;
  double acceleration_s = 0.0;
  double in_position_s = 0.0;
  double length_mm = 0.0;
};

/// Time of a tool, all its uses together. A T word selects the tool, M06 changes it; a program without any M06 changes
/// tools by T.
struct ToolTime {
  std::int64_t tool = -1;        ///< -1: before the first tool is known
  std::uint32_t first_line = 0;  ///< of its first use
  TimeParts parts;
};

enum class BlockKind : std::uint8_t { cutting, rapid, dwell, tool_change, function };

/// One cutting block, rapid, dwell or block with M codes.
struct BlockTime {
  std::uint32_t line = 0;
  BlockKind kind = BlockKind::cutting;
  double start_s = 0.0;     ///< since the start of the program
  double duration_s = 0.0;  ///< until its successor starts; the last block before a rest includes the acceleration and
                            ///< wait of the whole motion
  double feed_mm_per_s = 0.0;  ///< highest speed reached along the path; 0 without motion
};

/// Cycle time of a program and its parts.
struct CycleTime {
  TimeParts parts;
  double outside_regions_s = 0.0;  ///< whole time less cutting_s and acceleration_s of the regions
  double cutting_length_mm = 0.0;
  double rapid_length_mm = 0.0;
  std::vector<RegionTime> regions;
  std::vector<ToolTime> tools;    ///< in order of first use
  std::vector<BlockTime> blocks;  ///< only if requested
};

/// Cycle time in closed form: O(1) per block for acceleration after interpolation (paper 004, section 2.2), by the
/// planner in look-ahead. Each region is a motion from rest to rest, and so is each uninterrupted sequence of cutting
/// moves outside of regions. Waits for in-position follow rapids and motions that end with an exact stop (G09, G61).
/// Moves of an axis of unknown position count as far as they are known. Throws Error(argument) on a model that `check`
/// refuses, or a block without a feed.
[[nodiscard]] CycleTime time_program(const Program& program, const FanucModel& model, bool per_block = false);

/// Cycle time by full interpolation.
struct InterpolatedTime {
  double total_s = 0.0;
  double cutting_s = 0.0;  ///< motions from rest to rest, including acceleration
  double rapid_s = 0.0;    ///< including acceleration
  double in_position_s = 0.0;
  double dwell_s = 0.0;
  double tool_change_s = 0.0;
  double function_s = 0.0;
  std::uint64_t set_points = 0;
  std::vector<double> region_s;  ///< per region, including the wait
};

/// Full interpolation of a program, sample by sample: blocks through the acceleration filters, or look-ahead profiles,
/// until the set-points rest; rapids; the servo loop until the axes are in position. Shares no closed form with
/// `time_program`. Throws Error(argument) on a model that `check` refuses, a block without a feed, or more than 4e9
/// set-points.
[[nodiscard]] InterpolatedTime interpolate_program(const Program& program, const FanucModel& model);

/// Effect of acceleration after interpolation and servo lag on a circle.
struct CircleFigures {
  double command_error_mm = 0.0;  ///< programmed radius minus radius of the set-points after the acceleration filters
  double radial_error_mm = 0.0;   ///< programmed radius minus radius of the axes after the servo loop
};

/// Runs circles in XY at a constant feed until the transient has decayed and measures the mean radius over one turn.
/// To second order the result is (sum of the filters' variances + (1 - a^2) / K^2) v^2 / (2 r): the radial error
/// formulas of the controller manual (fanuc.md B1). Throws Error(argument) on a radius or feed <= 0.
[[nodiscard]] CircleFigures simulate_circle(double radius_mm, double feed_mm_per_s, const FanucModel& model);

}  // namespace shapegcode
