#include "shapegcode/command.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {
namespace {

// Deviations below this are left alone: a tenth of what a word can say.
constexpr double active_mm = 1e-4;
constexpr std::size_t longest_window = 8192;
constexpr std::size_t read_ahead = 1024;
constexpr std::size_t forget_after = 32768;
constexpr int attempts = 6;
constexpr double stiffer = 20.0;  // factor of the smoothness where a limit would be left
constexpr double same_delay_s = 1e-9;
constexpr double stiffest = 1e12;

double smooth_step(double x) noexcept { return x * x * (3.0 - 2.0 * x); }

// Whether there is a corner on the way from one segment to a later one.
bool passes_corner(const Path& path, std::size_t before, std::size_t after) noexcept {
  for (std::size_t i = before + 1; i <= after; ++i) {
    if (junction_change(path, i) >= corner_change) {
      return true;
    }
  }
  return false;
}

}  // namespace

double junction_change(const Path& path, std::size_t i) noexcept {
  const Segment& before = path[i - 1];
  return (tangent_at(path[i], 0.0) - tangent_at(before, before.length_mm)).norm();
}

RunFilter::RunFilter(std::span<const Fir> shapers, ContourTarget contour_target, const AxisModes& axis_modes,
                     double block_period_s, double weight, const std::optional<FollowingFir>& followed,
                     const AxisModeTables& tables)
    : target(contour_target),
      modes(axis_modes),
      half_period_s(0.5 * block_period_s),
      mean_delay_s((followed ? followed->fir().mean_samples() : shapers.front().mean_samples()) * block_period_s),
      smoothness(weight) {
  if (shapers.size() != 1 && shapers.size() != axis_count) {
    throw Error(ErrorKind::argument, std::to_string(shapers.size()) + " shapers: one for all axes, or one for each");
  }
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const Fir& shaper = shapers[shapers.size() == 1 ? 0 : axis];
    const double other_s = shaper.mean_samples() * block_period_s;
    if (!(std::abs(other_s - shapers.front().mean_samples() * block_period_s) <= same_delay_s)) {
      throw Error(ErrorKind::argument, "shapers of several axes have mean delays of " + std::to_string(other_s) +
                                           " s and " + std::to_string(mean_delay_s) + " s, must be equal");
    }
    half_shapers.push_back(shaper.on_finer_grid(2));
    longest_ = std::max(longest_, half_shapers.back().duration_samples());
  }
  if (followed) following = followed->on_finer_grid(2);
  const std::size_t nodes = following ? following->position_mm().size() : 1;
  for (std::size_t node = 0; node < nodes; ++node) {
    std::array<std::vector<double>, axis_count>& kernel = kernels.emplace_back();
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      std::vector<Mode> here = axis_modes[axis];
      for (std::size_t m = 0; following && m < std::min(here.size(), tables[axis].size()); ++m) {
        const ModeTable& table = tables[axis][m];
        if (!table.empty() && table.axis == following->axis()) {
          here[m] = mode_at(here[m], table, following->position_mm()[node]);
        }
      }
      kernel[axis] =
          contour_kernel(following ? following->fir().set()[node] : half_shapers[axis], here, half_period_s, target);
    }
  }
}

RunShaper::RunShaper(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile,
                     const RunFilter& filter, const RunLimits& limits, std::size_t steps_per_half,
                     RunDeviation* measured)
    : path_(std::move(path)),
      filter_(filter),
      limits_(limits),
      measured_(measured),
      steps_per_half_(steps_per_half),
      ahead_(path_, profile, filter.half_period_s / static_cast<double>(steps_per_half)) {
  const std::size_t steps_per_period = 2 * steps_per_half_;
  const std::size_t periods_in = (ahead_.sample_count() - 1 + steps_per_period - 1) / steps_per_period;
  rows_in_ = 2 * periods_in + 1;
  const auto shaper_rows = static_cast<std::size_t>(filter_.shaper_rows());
  periods_ = static_cast<std::uint32_t>(periods_in + shaper_rows / 2);
  reach_ = shaper_rows;
  if (filter_.target != ContourTarget::none) {
    target_ = std::make_unique<Interpolator>(path_, std::move(profile), ahead_.period_s(), filter_.mean_delay_s);
    for (const auto& kernel : filter_.kernels) {
      solvers_.push_back({ContourSolver(kernel[0], filter_.smoothness), ContourSolver(kernel[1], filter_.smoothness),
                          ContourSolver(kernel[2], filter_.smoothness)});
      for (const std::vector<double>& of_axis : kernel) reach_ = std::max(reach_, of_axis.size() - 1);
    }
    margin_ = std::max<std::size_t>(reach_, 8);
  }
  rows_error_ = rows_in_ + reach_;
  history_ = static_cast<std::ptrdiff_t>(2 * reach_ + 8);
  base_ = -history_;
}

void RunShaper::read_row() {
  Vector3 position;
  for (std::size_t skip = 0; skip < (read_ == 0 ? 1 : steps_per_half_); ++skip) {
    ahead_.step(position);
  }
  const std::size_t segment = ahead_.segment();
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    if (read_ == 0) {
      command_[axis].assign(static_cast<std::size_t>(history_), position[static_cast<Eigen::Index>(axis)]);
      error_[axis].assign(static_cast<std::size_t>(history_), 0.0);
      correction_[axis].assign(static_cast<std::size_t>(history_), 0.0);
    }
    command_[axis].push_back(position[static_cast<Eigen::Index>(axis)]);
    correction_[axis].push_back(0.0);
  }
  if (filter_.following) {
    const double here = position[filter_.following->axis()];
    if (read_ == 0) place_.assign(static_cast<std::size_t>(history_), filter_.following->place(here));
    const Column& along = command_[static_cast<std::size_t>(filter_.following->axis())];
    place_.push_back(filter_.following->place(0.5 * (here + along[along.size() - 2])));
  }
  const Segment& on = (*path_)[segment];
  if (on.kind == SegmentKind::arc && read_ < rows_in_) {
    arcs_.push_back({read_, static_cast<std::int8_t>(on.normal)});
  }
  ++read_;
  if (!target_) {
    return;
  }
  // Near a corner the place along the path matters too: it is where both legs meet.
  const double delay_rows = std::max(1.0, filter_.mean_delay_s / filter_.half_period_s);
  if (passes_corner(*path_, segment_before_, segment)) {
    since_corner_ = 0.0;
  }
  segment_before_ = segment;
  const bool near = since_corner_ <= 1.5 * delay_rows;
  along_ = std::clamp(along_ + (near ? 1.25 / delay_rows : -0.6 / delay_rows), 0.0, 1.0);
  since_corner_ += 1.0;

  Vector3 wanted;
  for (std::size_t skip = 0; skip < (read_ == 1 ? 1 : steps_per_half_); ++skip) {
    target_->step(wanted);
  }
  const std::size_t at = target_->segment();
  const Vector3 tangent = tangent_at((*path_)[at], target_->distance_mm() - path_->distance_mm(at));
  Vector3 error;
  const std::size_t row = index(read_ - 1);
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    error[a] = behind_kernel(axis, command_[axis], row) - wanted[a];
  }
  error -= (1.0 - smooth_step(along_)) * tangent.dot(error) * tangent;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    error_[axis].push_back(error[static_cast<Eigen::Index>(axis)]);
  }
  if (measured_ != nullptr) {
    if (read_ == 1) {
      tangent_.assign(static_cast<std::size_t>(history_), tangent);
      wanted_.assign(static_cast<std::size_t>(history_), wanted);
      segment_.assign(static_cast<std::size_t>(history_), 0);
      left_.assign(static_cast<std::size_t>(history_), Vector3::Zero());
      if (filter_.target == ContourTarget::response && !filter_.following) {
        plant_ = std::make_unique<ModalPlant>(filter_.modes, filter_.half_period_s);
        plant_->reset(wanted);
      }
    }
    tangent_.push_back(tangent);
    wanted_.push_back(wanted);
    segment_.push_back(static_cast<std::uint32_t>(at));
    left_.push_back(Vector3::Zero());
  }
}

void RunShaper::read_to(std::size_t row) {
  while (read_ < row) {
    read_row();
  }
}

bool RunShaper::active(std::size_t row) const noexcept {
  const std::size_t i = index(row);
  return std::abs(error_[0][i]) > active_mm || std::abs(error_[1][i]) > active_mm || std::abs(error_[2][i]) > active_mm;
}

// Everything below `row` gets its final correction.
void RunShaper::decide_to(std::size_t row) {
  if (!target_) {
    read_to(row);
    decided_ = row;
    return;
  }
  const std::size_t lead = reach_ + margin_;
  while (decided_ < row) {
    read_to(decided_ + read_ahead + lead);
    scan_ = std::max(scan_, decided_);
    while (scan_ < read_ && scan_ < rows_error_ && !active(scan_)) {
      ++scan_;
    }
    const std::size_t begin = scan_ >= rows_error_ ? std::max(row, decided_ + 1) : scan_ - std::min(scan_, lead);
    if (begin > decided_) {
      decided_ = begin;
      read_to(decided_);
      continue;
    }
    std::size_t last = scan_;
    std::size_t seen = scan_ + 1;
    for (; seen < rows_error_ && seen - last < 2 * lead && seen - decided_ <= longest_window + 8 * lead; ++seen) {
      if (seen >= read_) {
        read_to(seen + read_ahead);
      }
      if (active(seen)) {
        last = seen;
      }
    }
    const std::size_t first = std::max<std::size_t>(decided_, 1);
    const bool cut = last - decided_ > longest_window;
    std::size_t end = cut ? decided_ + longest_window + 6 * lead : last + margin_ + 1;
    end = std::min(end, rows_in_ - 1);
    const std::size_t accepted = cut ? std::min(end, decided_ + longest_window) : std::max(end, last + 1);
    if (end > first) {
      read_to(end + reach_ + 1);
      correct(first, end, std::min(end, accepted));
    }
    decided_ = std::max(accepted, decided_ + 1);
    scan_ = cut ? decided_ : last + 1;
  }
}

void RunShaper::correct(std::size_t begin, std::size_t end, std::size_t accepted) {
  const std::size_t m = end - begin;
  // Windows are short against the way between two shapers that are followed: the nearest one serves.
  const double place = place_.empty() ? 0.0 : place_[index(begin + m / 2)];
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    ContourSolver& solver = solvers_[static_cast<std::size_t>(std::lround(place))][axis];
    const std::size_t past = solver.reach() + 2;
    const double* error = error_[axis].data() + index(begin);
    double* correction = correction_[axis].data() + index(begin);
    const auto still = [](double value) { return std::abs(value) <= 1e-9; };
    if (std::all_of(error, error + m + solver.reach(), still) && std::all_of(correction - past, correction, still)) {
      continue;
    }
    window_.assign(correction - past, correction + m);
    stiffness_.clear();
    for (int attempt = 0;; ++attempt) {
      solver.solve({error, m + solver.reach()}, window_, stiffness_);
      std::copy(window_.begin() + static_cast<std::ptrdiff_t>(past), window_.end(), correction);
      if (attempt > attempts || !asks_too_much(begin, end, axis)) {
        break;
      }
      if (attempt == attempts) {
        std::ranges::fill(stiffness_, stiffest);
      }
    }
    std::fill(correction + (accepted - begin), correction + m, 0.0);
  }
}

// Whether the corrected command leaves a limit that the plain one keeps; where it does, `stiffness_` is raised.
bool RunShaper::asks_too_much(std::size_t begin, std::size_t end, std::size_t axis) {
  const auto shaper_rows = static_cast<std::size_t>(filter_.shaper_rows());
  const double period = 2.0 * filter_.half_period_s;
  const std::size_t from = begin + begin % 2;
  const std::size_t to = end + shaper_rows + 4;
  double speed_limit = limits_.max_speed_mm_per_s[static_cast<Eigen::Index>(axis)];
  double acceleration_limit = limits_.max_acceleration_mm_per_s2[static_cast<Eigen::Index>(axis)];
  const auto look = [&](bool corrected, auto&& seen) {
    double before = shaped(axis, static_cast<std::ptrdiff_t>(from) - 4, corrected);
    double last = shaped(axis, static_cast<std::ptrdiff_t>(from) - 2, corrected);
    for (std::size_t row = from; row <= to; row += 2) {
      const double now = shaped(axis, static_cast<std::ptrdiff_t>(row), corrected);
      seen(row, std::abs(now - last) / period, std::abs(now - 2.0 * last + before) / (period * period));
      before = last;
      last = now;
    }
  };
  read_to(to + 1);
  look(false, [&](std::size_t, double speed, double acceleration) {
    speed_limit = std::max(speed_limit, speed);
    acceleration_limit = std::max(acceleration_limit, acceleration);
  });
  bool found = false;
  look(true, [&](std::size_t row, double speed, double acceleration) {
    if (speed <= speed_limit * (1.0 + 1e-6) && acceleration <= acceleration_limit * (1.0 + 1e-6)) {
      return;
    }
    if (stiffness_.empty()) {
      stiffness_.assign(end - begin + 2, 1.0);
    }
    found = true;
    // One step per look, however many rows complain.
    const std::size_t low = row - std::min(row, shaper_rows + 4);
    for (std::size_t k = std::max(low, begin); k < std::min(row + 3, end + 2); ++k) {
      raised_.push_back(k - begin);
    }
  });
  std::ranges::sort(raised_);
  raised_.erase(std::unique(raised_.begin(), raised_.end()), raised_.end());
  for (const std::size_t k : raised_) {
    stiffness_[k] *= stiffer;
  }
  raised_.clear();
  return found;
}

double RunShaper::behind_kernel(std::size_t axis, const Column& column, std::size_t i) const noexcept {
  const auto at = [&](std::size_t node) {
    const std::vector<double>& kernel = filter_.kernels[node][axis];
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

double RunShaper::shaped(std::size_t axis, std::ptrdiff_t row, bool corrected) const noexcept {
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

// A row as the emitted blocks pass it: a block is straight, or an arc where the path is one.
Vector3 RunShaper::as_block(std::size_t row) const noexcept {
  const std::size_t half = static_cast<std::size_t>(filter_.shaper_rows()) / 2 + 1;
  const std::size_t i = index(row);
  bool bends = row % 2 == 0;
  for (std::size_t k = segment_[i - half]; k <= segment_[i + half]; ++k) {
    bends = bends || (*path_)[k].kind == SegmentKind::arc;
  }
  const auto at = static_cast<std::ptrdiff_t>(row);
  Vector3 position;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    position[static_cast<Eigen::Index>(axis)] =
        bends ? shaped(axis, at, true) : 0.5 * (shaped(axis, at - 1, true) + shaped(axis, at + 1, true));
  }
  return position;
}

// What the emitted blocks leave of the error; call once for each row in turn.
Vector3 RunShaper::deviation(std::size_t row) {
  const std::size_t i = index(row);
  if (filter_.target == ContourTarget::command) {
    return as_block(row) - wanted_[i];
  }
  if (plant_) {
    return plant_->step(as_block(row)) - wanted_[i];
  }
  Vector3 result;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    result[static_cast<Eigen::Index>(axis)] = error_[axis][i] + behind_kernel(axis, correction_[axis], i);
  }
  return result;
}

void RunShaper::measure(std::size_t row) {
  const std::size_t half = static_cast<std::size_t>(filter_.shaper_rows()) / 2 + 1;
  read_to(row + half + 1);
  const std::size_t i = index(row);
  left_[i] = deviation(row);
  const Vector3& left = left_[i];
  double size = (left - tangent_[i].dot(left) * tangent_[i]).norm();
  // At a corner the way by which the corner itself is missed counts.
  constexpr std::size_t around = 4;  // rows, within which the place along the path counts fully
  if (segment_[i - around] != segment_[i - around - 1] &&
      passes_corner(*path_, segment_[i - around - 1], segment_[i - around])) {
    const Vector3& corner = (*path_)[segment_[i - around]].start_mm;
    double nearest = MotionLimits::none;
    for (std::size_t k = row - std::min(row, 2 * around); k < row; ++k) {
      const Vector3 from = wanted_[index(k)] + left_[index(k)];
      const Vector3 step = wanted_[index(k + 1)] + left_[index(k + 1)] - from;
      const double length2 = step.squaredNorm();
      const double share = length2 > 0.0 ? std::clamp((corner - from).dot(step) / length2, 0.0, 1.0) : 0.0;
      nearest = std::min(nearest, (from + share * step - corner).norm());
    }
    size = std::max(size, nearest);
  }
  const auto found = static_cast<float>(size);
  // A corner's deviation is no reason to slow the whole arc beside it.
  std::vector<float>& on =
      passes_corner(*path_, segment_[i - half], segment_[i + half]) ? measured_->near_corner : measured_->on_segment;
  for (std::uint32_t k = segment_[i - half]; k <= segment_[i + half]; ++k) {
    on[k] = std::max(on[k], found);
    if (k > segment_[i - half]) {
      measured_->at_junction[k] = std::max(measured_->at_junction[k], found);
    }
  }
}

void RunShaper::forget() {
  const auto keep = static_cast<std::ptrdiff_t>(out_) - history_;
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
  if (filter_.following) {
    drop(place_);
  }
  if (measured_ != nullptr) {
    drop(tangent_);
    drop(wanted_);
    drop(segment_);
    drop(left_);
  }
  base_ = keep;
}

void RunShaper::next(Vector3& position) {
  decide_to(out_ + (measured_ != nullptr ? 2 : 1));
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    position[static_cast<Eigen::Index>(axis)] = shaped(axis, static_cast<std::ptrdiff_t>(out_), target_ != nullptr);
  }
  if (measured_ != nullptr) {
    measure(out_);
  }
  ++out_;
  forget();
}

std::int8_t RunShaper::arc_normal() {
  // A correction bends the command a little before the arc begins and behind its end.
  const std::size_t lead = target_ ? reach_ + margin_ : 0;
  const std::size_t row = out_ - 1;
  read_to(std::min(row + 3 + lead, rows_in_));
  const auto behind = static_cast<std::size_t>(filter_.shaper_rows()) + lead;
  while (!arcs_.empty() && arcs_.front().row <= row + 2 + lead) {
    seen_ = arcs_.front();
    arcs_.pop_front();
  }
  return seen_.normal >= 0 && row <= seen_.row + behind ? seen_.normal : std::int8_t{-1};
}

}  // namespace shapegcode
