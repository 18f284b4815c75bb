#include "command/run_deviation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace shapegcode {
namespace {

constexpr std::size_t around = 4;  // rows about a corner, within which the place along the path counts fully

}  // namespace

DeviationMeter::DeviationMeter(RunReader& rows, RunDeviation& measured)
    : rows_(rows), measured_(measured), half_(static_cast<std::size_t>(rows.filter().shaper_rows()) / 2 + 1) {
  const RunFilter& filter = rows.filter();
  if (filter.target == ContourTarget::response && !filter.following) {
    plant_ = std::make_unique<ModalPlant>(filter.modes, filter.half_period_s);
  }
  if (rows.motion().rounding_mm() > 0.0) tracker_.emplace(rows.path());
}

// A row as the emitted blocks pass through it: a block is straight, or an arc where the path is an arc.
Vector3 DeviationMeter::as_block(std::size_t row) const noexcept {
  const auto at = static_cast<std::ptrdiff_t>(row);
  const auto half = static_cast<std::ptrdiff_t>(half_);
  bool bends = row % 2 == 0;
  for (std::size_t k = rows_.segment(at - half); k <= rows_.segment(at + half); ++k) {
    bends = bends || rows_.path().is_arc(k);
  }
  return bends ? shaped_ : Vector3(0.5 * (shaped_before_ + shaped_next_));
}

// What the emitted blocks leave of the error.
Vector3 DeviationMeter::deviation(std::size_t row) {
  if (rows_.filter().target == ContourTarget::command) {
    return as_block(row) - rows_.wanted(row);
  }
  if (plant_) {
    if (row == 0) {
      plant_->reset(rows_.wanted(0));
    }
    return plant_->step(as_block(row)) - rows_.wanted(row);
  }
  return rows_.left_of_error(row);
}

// Distance of what the blocks move from the path.
double DeviationMeter::across_path(std::size_t row) {
  const Vector3& left_here = left(row);
  if (tracker_) return std::abs(tracker_->step(rows_.wanted(row) + left_here));
  const Vector3& tangent = rows_.tangent(row);
  return (left_here - tangent.dot(left_here) * tangent).norm();
}

double DeviationMeter::missed_by(const Vector3& corner, std::size_t row) const noexcept {
  double nearest = MotionLimits::none;
  for (std::size_t k = row - std::min(row, 2 * around); k < row; ++k) {
    const Vector3 from = rows_.wanted(k) + left(k);
    const Vector3 step = rows_.wanted(k + 1) + left(k + 1) - from;
    const double length2 = step.squaredNorm();
    const double share = length2 > 0.0 ? std::clamp((corner - from).dot(step) / length2, 0.0, 1.0) : 0.0;
    nearest = std::min(nearest, (from + share * step - corner).norm());
  }
  return nearest;
}

void DeviationMeter::measure(std::size_t row) {
  rows_.read_to(row + half_ + 1);
  const auto here = static_cast<std::ptrdiff_t>(row);
  shaped_before_ = row == 0 ? rows_.shaped(here - 1, true) : shaped_;
  shaped_ = row == 0 ? rows_.shaped(here, true) : shaped_next_;
  shaped_next_ = rows_.shaped(here + 1, true);
  left(row) = deviation(row);
  double size = across_path(row);
  // At a corner the distance by which the corner itself is missed counts.
  const auto at = static_cast<std::ptrdiff_t>(row);
  const std::uint32_t behind = rows_.segment(at - static_cast<std::ptrdiff_t>(around));
  const std::uint32_t before = rows_.segment(at - static_cast<std::ptrdiff_t>(around) - 1);
  if (behind != before && rows_.corners().passed(before, behind)) {
    size = std::max(size, missed_by(rows_.path().start_mm(behind), row));
  }
  const auto found = static_cast<float>(size);
  measured_.largest = std::max(measured_.largest, found);
  // A corner's deviation is no reason to slow the whole arc beside it.
  const auto half = static_cast<std::ptrdiff_t>(half_);
  const std::uint32_t first = rows_.segment(at - half);
  const std::uint32_t last = rows_.segment(at + half);
  std::vector<float>& on = rows_.corners().passed(first, last) ? measured_.near_corner : measured_.on_segment;
  for (std::uint32_t k = first; k <= last; ++k) {
    on[k] = std::max(on[k], found);
    if (k > first) {
      measured_.at_junction[k] = std::max(measured_.at_junction[k], found);
    }
  }
}

}  // namespace shapegcode
