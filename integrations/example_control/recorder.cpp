#include "recorder.hpp"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <string>

using namespace shapegcode;

void RowQueue::put(const Row& row) noexcept {
  const std::size_t at = put_.load(std::memory_order_relaxed);
  if (at - taken_.load(std::memory_order_acquire) == rows_.size()) {
    lost_.fetch_add(1, std::memory_order_relaxed);
    return;
  }
  rows_[at % rows_.size()] = row;
  put_.store(at + 1, std::memory_order_release);
}

bool RowQueue::take(Row& row) noexcept {
  const std::size_t at = taken_.load(std::memory_order_relaxed);
  if (at == put_.load(std::memory_order_acquire)) return false;
  row = rows_[at % rows_.size()];
  taken_.store(at + 1, std::memory_order_release);
  return true;
}

Recorder::Recorder(const Path& path, std::FILE* csv) : csv_(csv) {
  if (path.size() > 0) {
    set_points_ = std::make_unique<ContourTracker>(path);
    table_ = std::make_unique<ContourTracker>(path);
  }
  if (csv_ == nullptr) return;
  std::fputs(
      "time_s,activity,line,override,x_mm,y_mm,z_mm,vx_mm_per_s,vy_mm_per_s,vz_mm_per_s,"
      "ax_mm_per_s2,ay_mm_per_s2,az_mm_per_s2,table_x_mm,table_y_mm,table_z_mm,set_point_off_um,table_off_um,events\n",
      csv_);
}

void Recorder::write(const Row& row) {
  std::string events;
  for (std::size_t k = 0; k < row.event_count; ++k) {
    const ControllerEvent& event = row.events[k];
    events += (k > 0 ? " M" : "M") + std::to_string(event.id);
    if (event.word > 0) events += " S" + std::to_string(event.word);
  }
  std::array<double, 2> off_um = {std::nan(""), std::nan("")};
  if (table_ && row.is_on_path) {
    const auto& at = row.set_point.position;
    off_um = {1e3 * set_points_->step({at[0], at[1], at[2]}), 1e3 * table_->step(row.table_mm)};
    max_set_point_off_um_ = std::max(max_set_point_off_um_, std::abs(off_um[0]));
    max_table_off_um_ = std::max(max_table_off_um_, std::abs(off_um[1]));
  }
  tell(row, events);
  if (csv_ != nullptr) write_row(row, off_um, events);
}

void Recorder::tell(const Row& row, const std::string& events) const {
  const auto& at = row.set_point.position;
  if (!events.empty()) std::printf("%.3f s: %s\n", row.time_s, events.c_str());
  if (row.probed) std::printf("%.3f s: probe at X%.4f Y%.4f Z%.4f\n", row.time_s, at[0], at[1], at[2]);
}

void Recorder::write_row(const Row& row, const std::array<double, 2>& off_um, const std::string& events) {
  std::fprintf(csv_, "%.6f,%s,%" PRIu64 ",%g", row.time_s, text_of(row.activity), row.line, row.feed_override);
  for (const auto* values : {&row.set_point.position, &row.set_point.velocity, &row.set_point.acceleration}) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) std::fprintf(csv_, ",%.9f", (*values)[axis]);
  }
  for (int axis = 0; axis < axis_count; ++axis) std::fprintf(csv_, ",%.9f", row.table_mm[axis]);
  std::fprintf(csv_, ",%.4f,%.4f,%s\n", off_um[0], off_um[1], events.c_str());
}
