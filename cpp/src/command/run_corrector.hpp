#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "command/run_reader.hpp"
#include "shapegcode/command.hpp"

namespace shapegcode {

/// Limits of the axes during contour correction. A section that exceeds them by shaping alone is left unchanged.
struct RunLimits {
  Vector3 max_speed_mm_per_s = Vector3::Constant(1e300);
  Vector3 max_acceleration_mm_per_s2 = Vector3::Constant(1e300);
};

/// Corrects the command of a run before shaping so that the shaped command or the response keeps to the path: windows
/// around the rows that would leave it, solved per axis, carried on where they are long; what a correction does to
/// another axis through a mode is part of that axis' deviation. The correction is zero at both ends of the run: nothing
/// moves before the start and nothing is added behind the stop. Where the corrected command would ask more of an axis
/// than `limits`, or run faster along the path than the filter's share of the programmed feed allows, the correction is
/// made smoother there, down to none.
class RunCorrector {
 public:
  RunCorrector(RunReader& rows, const RunLimits& limits);

  /// Every row below `row` gets its final correction.
  void decide_to(std::size_t row);
  /// Rows by which a window begins before what it corrects.
  [[nodiscard]] std::size_t lead() const noexcept { return rows_.reach() + margin_; }

 private:
  void correct(std::size_t begin, std::size_t end, std::size_t accepted);
  [[nodiscard]] ContourSolver& solver(std::size_t begin, std::size_t end, std::size_t axis);
  void solve(std::size_t begin, std::size_t end, std::size_t axis);
  /// Whether the corrected command leaves a limit that the plain one keeps; where it does, the axis' stiffness is
  /// raised.
  [[nodiscard]] bool asks_too_much(std::size_t begin, std::size_t end, std::size_t axis);
  /// The same of the speed along the path: the stiffness of all axes is raised.
  [[nodiscard]] bool runs_too_fast(std::size_t begin, std::size_t end);
  /// Notes the rows of a window whose corrections act at `row`.
  void blame(std::size_t row, std::size_t begin, std::size_t end);
  /// One step of stiffness for all that were noted; false if none were.
  bool stiffen(std::size_t rows, std::size_t axis);

  RunReader& rows_;
  RunLimits limits_;
  std::vector<std::array<ContourSolver, axis_count>> solvers_;  // one per shaper that is followed
  std::size_t margin_;       // rows by which a window is longer than what it corrects
  std::size_t scan_ = 0;     // rows looked at for something to correct
  std::size_t decided_ = 0;  // rows whose correction is final
  std::vector<double> window_;
  std::vector<double> error_;  // of an axis that others move
  std::array<std::vector<double>, axis_count> stiffness_;
  std::vector<std::size_t> raised_;
};

}  // namespace shapegcode
