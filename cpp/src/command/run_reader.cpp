#include "command/run_reader.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace shapegcode {
namespace {

constexpr double active_mm = 1e-4;  // deviations below it are left alone: a tenth of what a word can say
constexpr std::size_t forget_after = 32768;

double smooth_step(double x) noexcept { return x * x * (3.0 - 2.0 * x); }

}  // namespace

RunReader::RunReader(std::shared_ptr<const Path> path, std::shared_ptr<const RunMotion> motion, const RunFilter& filter,
                     bool keeps_places)
    : path_(std::move(path)),
      motion_(std::move(motion)),
      corners_(*path_),
      filter_(filter),
      keeps_places_(keeps_places),
      ahead_(motion_->read(filter.half_period_s, 0.0)) {
  const std::size_t periods_in = motion_->block_periods(filter.half_period_s);
  rows_in_ = 2 * periods_in + 1;
  const auto shaper_rows = static_cast<std::size_t>(filter_.shaper_rows());
  periods_ = static_cast<std::uint32_t>(periods_in + shaper_rows / 2);
  reach_ = shaper_rows;
  if (filter_.target != ContourTarget::none) {
    target_ = motion_->read(filter.half_period_s, filter_.mean_delay_s);
    for (const auto& at_node : filter_.kernels) {
      for (const auto& moved : at_node) {
        for (const std::vector<double>& kernel : moved)
          reach_ = std::max(reach_, std::max<std::size_t>(kernel.size(), 1) - 1);
      }
    }
  }
  history_ = static_cast<std::ptrdiff_t>(2 * reach_ + 8);
  base_ = -history_;
}

void RunReader::read_row() {
  read_command();
  if (target_) {
    read_error();
  }
}

void RunReader::read_command() {
  Vector3 position;
  ahead_->next(position);
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    if (read_ == 0) {
      command_[axis].assign(static_cast<std::size_t>(history_), position[static_cast<Eigen::Index>(axis)]);
      error_[axis].assign(static_cast<std::size_t>(history_), 0.0);
      correction_[axis].assign(static_cast<std::size_t>(history_), 0.0);
    }
    command_[axis].push_back(position[static_cast<Eigen::Index>(axis)]);
    correction_[axis].push_back(0.0);
  }
  const Segment& on = ahead_->on();
  if (read_ == 0) feed_.assign(static_cast<std::size_t>(history_), on.feed_mm_per_s);
  feed_.push_back(on.feed_mm_per_s);
  if (filter_.following) {
    const double here = position[filter_.following->axis()];
    if (read_ == 0) place_.assign(static_cast<std::size_t>(history_), filter_.following->place(here));
    const Column& along = command_[static_cast<std::size_t>(filter_.following->axis())];
    place_.push_back(filter_.following->place(0.5 * (here + along[along.size() - 2])));
  }
  if (on.kind == SegmentKind::arc && read_ < rows_in_) {
    arcs_.push_back({read_, static_cast<std::int8_t>(on.normal)});
  }
  ++read_;
}

void RunReader::read_error() {
  const std::size_t segment = ahead_->segment();
  // Near a corner the place along the path matters too: it is where both legs meet.
  const double delay_rows = std::max(1.0, filter_.mean_delay_s / filter_.half_period_s);
  if (corners_.passed(segment_before_, segment)) {
    since_corner_ = 0.0;
  }
  segment_before_ = segment;
  const bool near = since_corner_ <= 1.5 * delay_rows;
  along_ = std::clamp(along_ + (near ? 1.25 / delay_rows : -0.6 / delay_rows), 0.0, 1.0);
  since_corner_ += 1.0;

  Vector3 wanted;
  target_->next(wanted);
  const std::size_t at = target_->segment();
  const Vector3 tangent = target_->tangent();
  Vector3 error;
  const std::size_t row = index(read_ - 1);
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    error[a] = behind_kernels(axis, command_, row) - wanted[a];
  }
  error -= (1.0 - smooth_step(along_)) * tangent.dot(error) * tangent;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    error_[axis].push_back(error[static_cast<Eigen::Index>(axis)]);
  }
  if (keeps_places_) {
    if (read_ == 1) {
      tangent_.assign(static_cast<std::size_t>(history_), tangent);
      wanted_.assign(static_cast<std::size_t>(history_), wanted);
      segment_.assign(static_cast<std::size_t>(history_), 0);
    }
    tangent_.push_back(tangent);
    wanted_.push_back(wanted);
    segment_.push_back(static_cast<std::uint32_t>(at));
  }
}

void RunReader::read_to(std::size_t row) {
  while (read_ < row) {
    read_row();
  }
}

bool RunReader::leaves_path(std::size_t row) const noexcept {
  const std::size_t i = index(row);
  return std::abs(error_[0][i]) > active_mm || std::abs(error_[1][i]) > active_mm || std::abs(error_[2][i]) > active_mm;
}

Vector3 RunReader::left_of_error(std::size_t row) const noexcept {
  const std::size_t i = index(row);
  Vector3 result;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    result[static_cast<Eigen::Index>(axis)] = error_[axis][i] + behind_kernels(axis, correction_, i);
  }
  return result;
}

double RunReader::crossed(std::size_t axis, std::size_t row) const noexcept {
  const std::size_t i = index(row);
  return behind_kernels(axis, correction_, i) - behind_kernel(axis, axis, correction_[axis], i);
}

double RunReader::behind_kernels(std::size_t axis, const std::array<Column, axis_count>& columns,
                                 std::size_t i) const noexcept {
  double sum = behind_kernel(axis, axis, columns[axis], i);
  for (std::size_t other = 0; filter_.crosses && other < axis_count; ++other) {
    if (other != axis) sum += behind_kernel(axis, other, columns[other], i);
  }
  return sum;
}

double RunReader::behind_kernel(std::size_t axis, std::size_t commanded, const Column& column,
                                std::size_t i) const noexcept {
  const auto at = [&](std::size_t node) {
    const std::vector<double>& kernel = filter_.kernels[node][axis][commanded];
    double sum = 0.0;
    for (std::size_t j = 0; j < kernel.size(); ++j) {
      sum += kernel[j] * column[i - j];
    }
    return sum;
  };
  if (place_.empty()) {
    return at(0);
  }
  const auto lower = static_cast<std::size_t>(place_[i]);
  const double upper_share = place_[i] - static_cast<double>(lower);
  const double below = at(lower);
  return upper_share > 0.0 ? below + upper_share * (at(lower + 1) - below) : below;
}

double RunReader::shaped(std::size_t axis, std::ptrdiff_t row, bool corrected) const noexcept {
  if (filter_.following) {
    const auto i = row - base_;
    const VaryingFir& fir = filter_.following->fir();
    const double plain = fir.value(command_[axis].data() + i, place_.data() + i);
    return corrected ? plain + fir.value(correction_[axis].data() + i, place_.data() + i) : plain;
  }
  const std::vector<int>& delays = filter_.half_shapers[axis].delays();
  const std::vector<double>& taps = filter_.half_shapers[axis].taps();
  const double* command = command_[axis].data() + (row - base_);
  double sum = 0.0;
  for (std::size_t k = 0; k < taps.size(); ++k) {
    sum += taps[k] * *(command - delays[k]);
  }
  if (corrected) {
    const double* correction = correction_[axis].data() + (row - base_);
    for (std::size_t k = 0; k < taps.size(); ++k) {
      sum += taps[k] * *(correction - delays[k]);
    }
  }
  return sum;
}

double RunReader::programmed_feed(std::ptrdiff_t row) const noexcept {
  const auto delay = static_cast<std::ptrdiff_t>(std::lround(filter_.mean_delay_s / filter_.half_period_s));
  const auto last = static_cast<std::ptrdiff_t>(feed_.size()) - 1;
  double feed = 0.0;
  for (std::ptrdiff_t k = row - delay - 1; k <= row - delay + 1; ++k) {
    feed = std::max(feed, feed_[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k - base_, 0, last))]);
  }
  return feed;
}

void RunReader::forget(std::size_t out) {
  const auto keep = static_cast<std::ptrdiff_t>(out) - history_;
  if (keep - base_ < static_cast<std::ptrdiff_t>(forget_after)) {
    return;
  }
  const auto drop = [&](auto& column) { column.erase(column.begin(), column.begin() + (keep - base_)); };
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    drop(command_[axis]);
    drop(correction_[axis]);
    if (target_) {
      drop(error_[axis]);
    }
  }
  drop(feed_);
  if (filter_.following) {
    drop(place_);
  }
  if (keeps_places_) {
    drop(tangent_);
    drop(wanted_);
    drop(segment_);
  }
  base_ = keep;
}

std::int8_t RunReader::arc_normal(std::size_t row, std::size_t lead) {
  read_to(std::min(row + 3 + lead, rows_in_));
  const auto behind = static_cast<std::size_t>(filter_.shaper_rows()) + lead;
  while (!arcs_.empty() && arcs_.front().row <= row + 2 + lead) {
    seen_ = arcs_.front();
    arcs_.pop_front();
  }
  return seen_.normal >= 0 && row <= seen_.row + behind ? seen_.normal : std::int8_t{-1};
}

}  // namespace shapegcode
