#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "shapegcode/measure/contour.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/simulation.hpp"

namespace shapegcode::detail {

/// Finds the largest ratio of the speed to the programmed feed at the same position, over one, four and sixteen times
/// `SimulationOptions::feed_window_s`. A tracker of the path gives the positions; near several short segments the
/// highest feed of those within the deviation counts. Without a window it measures nothing.
class FeedMeter {
 public:
  /// `path` stays the caller's.
  FeedMeter(const Path& path, const SimulationOptions& options);

  [[nodiscard]] bool measures() const noexcept { return !rows_.empty(); }
  /// The next set-point, of which `tracker` has just received and found that it lies `deviation_mm` off.
  void step(const Vector3& command, const ContourTracker& tracker, double deviation_mm) noexcept;
  [[nodiscard]] const FeedExcess& largest() const noexcept { return largest_; }

 private:
  struct Row {
    Vector3 position = Vector3::Zero();
    double travelled_mm = 0.0;
    double deviation_mm = 0.0;
    std::size_t segment = 0;
  };

  [[nodiscard]] const Row& row(std::size_t index) const noexcept { return rows_[index & mask_]; }
  void compare(const Row& from, const Row& to, double time_s) noexcept;
  /// What the ways must be longer than on a segment to be a larger excess.
  void set_limits(std::size_t segment) noexcept;

  const Path* path_;
  double period_s_;
  double slack_mm_;
  std::array<std::size_t, 3> windows_{};
  std::vector<Row> rows_;  // a ring longer than the longest window, a power of two
  std::size_t mask_ = 0;
  std::size_t count_ = 0;
  FeedExcess largest_;
  double ratio_to_beat_ = 0.0;
  std::array<double, 3> limits_mm_{};  // per window; a little too short, so that rounding hides nothing
  std::size_t limits_of_ = std::numeric_limits<std::size_t>::max();  // segment
};

}  // namespace shapegcode::detail
