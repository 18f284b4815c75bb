#include "command/run_corrector.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode {
namespace {

constexpr std::size_t longest_window = 8192;
constexpr std::size_t read_ahead = 1024;
constexpr int attempts = 6;
constexpr double stiffer = 20.0;  // factor of the smoothness where a limit would be left
constexpr double stiffest = 1e12;
constexpr double used_share = 0.9;  // of the speed above the programmed one: the rest is for rounding

}  // namespace

RunCorrector::RunCorrector(RunReader& rows, const RunLimits& limits)
    : rows_(rows), limits_(limits), margin_(std::max<std::size_t>(rows.reach(), 8)) {
  const double smoothness = rows.filter().smoothness;
  for (const auto& kernel : rows.filter().kernels) {
    solvers_.push_back({ContourSolver(kernel[0][0], smoothness), ContourSolver(kernel[1][1], smoothness),
                        ContourSolver(kernel[2][2], smoothness)});
  }
}

void RunCorrector::decide_to(std::size_t row) {
  const std::size_t lead = this->lead();
  while (decided_ < row) {
    rows_.read_to(decided_ + read_ahead + lead);
    scan_ = std::max(scan_, decided_);
    while (scan_ < rows_.rows_read() && scan_ < rows_.rows_error() && !rows_.leaves_path(scan_)) {
      ++scan_;
    }
    const std::size_t begin = scan_ >= rows_.rows_error() ? std::max(row, decided_ + 1) : scan_ - std::min(scan_, lead);
    if (begin > decided_) {
      decided_ = begin;
      rows_.read_to(decided_);
      continue;
    }
    std::size_t last = scan_;
    std::size_t seen = scan_ + 1;
    for (; seen < rows_.rows_error() && seen - last < 2 * lead && seen - decided_ <= longest_window + 8 * lead;
         ++seen) {
      if (seen >= rows_.rows_read()) {
        rows_.read_to(seen + read_ahead);
      }
      if (rows_.leaves_path(seen)) {
        last = seen;
      }
    }
    const std::size_t first = std::max<std::size_t>(decided_, 1);
    const bool cut = last - decided_ > longest_window;
    std::size_t end = cut ? decided_ + longest_window + 6 * lead : last + margin_ + 1;
    end = std::min(end, rows_.rows_in() - 1);
    const std::size_t accepted = cut ? std::min(end, decided_ + longest_window) : std::max(end, last + 1);
    if (end > first) {
      rows_.read_to(end + rows_.reach() + 5);  // all that `correct` looks at: no column may move under it
      correct(first, end, std::min(end, accepted));
    }
    decided_ = std::max(accepted, decided_ + 1);
    scan_ = cut ? decided_ : last + 1;
  }
}

void RunCorrector::correct(std::size_t begin, std::size_t end, std::size_t accepted) {
  const std::size_t m = end - begin;
  std::array<bool, axis_count> acts{};
  // Axis after axis; where one moves another, once more with what the others have become.
  const std::size_t sweeps = rows_.filter().crosses ? 2 : 1;
  for (std::size_t k = 0; k < sweeps * axis_count; ++k) {
    const std::size_t axis = k % axis_count;
    const std::size_t reach = solver(begin, end, axis).reach();
    const double* error = rows_.error(axis, begin);
    const double* correction = rows_.correction(axis, begin);
    const auto still = [](double value) { return std::abs(value) <= 1e-9; };
    acts[axis] = !std::all_of(error, error + m + reach, still) ||
                 !std::all_of(correction - static_cast<std::ptrdiff_t>(reach + 2), correction, still);
    if (!acts[axis]) {
      continue;
    }
    stiffness_[axis].clear();
    for (int attempt = 0;; ++attempt) {
      solve(begin, end, axis);
      if (attempt > attempts || !asks_too_much(begin, end, axis)) {
        break;
      }
      if (attempt == attempts) {
        std::ranges::fill(stiffness_[axis], stiffest);
      }
    }
  }
  for (int attempt = 0; attempt <= attempts && runs_too_fast(begin, end); ++attempt) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      if (acts[axis]) {
        stiffen(m + 2, axis);
        if (attempt == attempts) {
          std::ranges::fill(stiffness_[axis], stiffest);
        }
        solve(begin, end, axis);
      }
    }
    raised_.clear();
  }
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    if (acts[axis]) {
      double* correction = rows_.correction(axis, begin);
      std::fill(correction + (accepted - begin), correction + m, 0.0);
    }
  }
}

// Windows are short against the distance between two shapers that are followed: the nearest one serves.
ContourSolver& RunCorrector::solver(std::size_t begin, std::size_t end, std::size_t axis) {
  return solvers_[static_cast<std::size_t>(std::lround(rows_.place(begin + (end - begin) / 2)))][axis];
}

void RunCorrector::solve(std::size_t begin, std::size_t end, std::size_t axis) {
  const std::size_t m = end - begin;
  ContourSolver& by = solver(begin, end, axis);
  const auto past = static_cast<std::ptrdiff_t>(by.reach() + 2);
  double* correction = rows_.correction(axis, begin);
  window_.assign(correction - past, correction + m);
  const double* error = rows_.error(axis, begin);
  if (rows_.filter().crosses) {
    error_.assign(error, error + m + by.reach());
    for (std::size_t k = 0; k < error_.size(); ++k) error_[k] += rows_.crossed(axis, begin + k);
    error = error_.data();
  }
  by.solve({error, m + by.reach()}, window_, stiffness_[axis]);
  std::copy(window_.begin() + past, window_.end(), correction);
}

// One step per look, however many rows complain.
void RunCorrector::blame(std::size_t row, std::size_t begin, std::size_t end) {
  const auto acting = static_cast<std::size_t>(rows_.filter().shaper_rows()) + 4;
  for (std::size_t k = std::max(row - std::min(row, acting), begin); k < std::min(row + 3, end + 2); ++k) {
    raised_.push_back(k - begin);
  }
}

bool RunCorrector::stiffen(std::size_t rows, std::size_t axis) {
  std::ranges::sort(raised_);
  raised_.erase(std::unique(raised_.begin(), raised_.end()), raised_.end());
  if (raised_.empty()) {
    return false;
  }
  std::vector<double>& stiffness = stiffness_[axis];
  if (stiffness.empty()) {
    stiffness.assign(rows, 1.0);
  }
  for (const std::size_t k : raised_) {
    stiffness[k] *= stiffer;
  }
  return true;
}

bool RunCorrector::asks_too_much(std::size_t begin, std::size_t end, std::size_t axis) {
  const auto shaper_rows = static_cast<std::size_t>(rows_.filter().shaper_rows());
  const double period = 2.0 * rows_.filter().half_period_s;
  const std::size_t from = begin + begin % 2;
  const std::size_t to = end + shaper_rows + 4;
  double speed_limit = limits_.max_speed_mm_per_s[static_cast<Eigen::Index>(axis)];
  double acceleration_limit = limits_.max_acceleration_mm_per_s2[static_cast<Eigen::Index>(axis)];
  const auto look = [&](bool corrected, auto&& seen) {
    double before = rows_.shaped(axis, static_cast<std::ptrdiff_t>(from) - 4, corrected);
    double last = rows_.shaped(axis, static_cast<std::ptrdiff_t>(from) - 2, corrected);
    for (std::size_t row = from; row <= to; row += 2) {
      const double now = rows_.shaped(axis, static_cast<std::ptrdiff_t>(row), corrected);
      seen(row, std::abs(now - last) / period, std::abs(now - 2.0 * last + before) / (period * period));
      before = last;
      last = now;
    }
  };
  look(false, [&](std::size_t, double speed, double acceleration) {
    speed_limit = std::max(speed_limit, speed);
    acceleration_limit = std::max(acceleration_limit, acceleration);
  });
  look(true, [&](std::size_t row, double speed, double acceleration) {
    if (speed > speed_limit * (1.0 + 1e-6) || acceleration > acceleration_limit * (1.0 + 1e-6)) {
      blame(row, begin, end);
    }
  });
  const bool found = stiffen(end - begin + 2, axis);
  raised_.clear();
  return found;
}

bool RunCorrector::runs_too_fast(std::size_t begin, std::size_t end) {
  const double ratio = rows_.filter().feed_excess_ratio;
  if (!std::isfinite(ratio)) {
    return false;
  }
  const double period = 2.0 * rows_.filter().half_period_s;
  const auto from = static_cast<std::ptrdiff_t>(begin + begin % 2);
  const auto to = static_cast<std::ptrdiff_t>(end) + rows_.filter().shaper_rows() + 4;
  Vector3 plain = rows_.shaped(from - 2, false);
  Vector3 last = rows_.shaped(from - 2, true);
  for (std::ptrdiff_t row = from; row <= to; row += 2) {
    const Vector3 next_plain = rows_.shaped(row, false);
    const Vector3 next = rows_.shaped(row, true);
    const double allowed = (1.0 + used_share * ratio) * period * rows_.programmed_feed(row);
    if ((next - last).norm() > std::max(allowed, (next_plain - plain).norm() * (1.0 + 1e-6))) {
      blame(static_cast<std::size_t>(row), begin, end);
    }
    plain = next_plain;
    last = next;
  }
  return !raised_.empty();
}

}  // namespace shapegcode
