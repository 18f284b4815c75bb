// What the drivers of peers.py share: a path and the settings of a control, read as text.
#pragma once

#include <istream>
#include <span>
#include <vector>

#include "shapegcode/controller.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode::peers {

/// One keyword a line, lengths in mm, times in s:
///
///     period 0.001 | window 128 | smoothing 0.01 | tolerance 0.05 | passes 5 | program_feed 100 | correction 1
///     feed 250 250 100 | acceleration 1000 1000 1000 | jerk 50000 50000 50000      of X, Y and Z
///     shaper 0 0.5 11 0.5                                  delay in periods and tap, as often as there are taps
///     start 0 0 0
///     line X Y Z FEED | arc X Y Z CX CY CZ SWEEP NORMAL FEED | stop        stop: at the end of the segment before
struct Task {
  ControllerSettings settings;
  std::vector<Segment> segments;
  int passes = 1;
  double program_feed = 0.0;  ///< mm/s, of all segments of a program; 0: as programmed
};

/// Throws std::runtime_error on a line that is none of these.
Task read_task(std::istream& in);

/// A control that gets each segment as soon as there is room for it, as from a reader that is never late.
class FedController {
 public:
  FedController(const ControllerSettings& settings, std::span<const Segment> segments);
  /// As MotionController::step. Throws std::runtime_error if a segment is refused.
  Activity step(std::span<double> out) {
    feed();
    return control_.step(out);
  }
  [[nodiscard]] bool all_pushed() const { return next_ == segments_.size(); }
  [[nodiscard]] MotionController& control() { return control_; }
  /// Pushes what there is room for.
  void feed();

 private:
  MotionController control_;
  std::span<const Segment> segments_;
  std::size_t next_ = 0;
};

/// `window WINDOW... -- PROGRAM...`: time under each window against the plan of the whole path; JSON on stdout.
int compare_windows(const Task& task, std::span<const char* const> arguments);

/// `random COUNT FIRST_SEED [TRACE]`: random paths, overrides and holds; JSON with the worst set-points on stdout.
int random_motion(std::span<const char* const> arguments);

}  // namespace shapegcode::peers
