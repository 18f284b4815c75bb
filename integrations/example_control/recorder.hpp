#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "job.hpp"
#include "shapegcode/measure/contour.hpp"

/// What happened in a period.
struct Row {
  static constexpr std::size_t max_events = 4;

  double time_s = 0.0;
  shapegcode::Activity activity = shapegcode::Activity::idle;
  shapegcode::MotionSetPoint set_point;
  shapegcode::Vector3 table_mm = shapegcode::Vector3::Zero();
  double feed_override = 1.0;
  std::uint64_t line = 0;
  bool probed = false;     // the probe touched in this period
  bool is_on_path = true;  // of the program
  std::size_t event_count = 0;
  std::array<shapegcode::ControllerEvent, max_events> events;
};

/// Rows on their way from the real-time thread to another one. Neither waits; a row that finds no room is counted.
class RowQueue {
 public:
  explicit RowQueue(std::size_t room) : rows_(room) {}
  void put(const Row& row) noexcept;
  bool take(Row& row) noexcept;
  [[nodiscard]] std::size_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

 private:
  std::vector<Row> rows_;
  std::atomic<std::size_t> put_ = 0, taken_ = 0, lost_ = 0;
};

/// Writes rows as CSV, with the deviation of set-points and table from the path, and tells what an operator wants to
/// know. Not real-time.
class Recorder {
 public:
  /// `path` may be empty: no deviations then. `csv` may be null.
  Recorder(const shapegcode::Path& path, std::FILE* csv);
  void write(const Row& row);
  [[nodiscard]] double max_set_point_off_um() const noexcept { return max_set_point_off_um_; }
  [[nodiscard]] double max_table_off_um() const noexcept { return max_table_off_um_; }

 private:
  void tell(const Row& row, const std::string& events) const;
  void write_row(const Row& row, const std::array<double, 2>& off_um, const std::string& events);

  std::unique_ptr<shapegcode::ContourTracker> set_points_, table_;
  double max_set_point_off_um_ = 0.0, max_table_off_um_ = 0.0;
  std::FILE* csv_;
};
