#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <utility>

#include <Eigen/QR>

#include "shapegcode/mode.hpp"
#include "write/linear_fit.hpp"

namespace shapegcode {
namespace {

constexpr std::size_t polished_blocks = 40;     // before the end, whose speeds are chosen once more
constexpr std::size_t polished_periods = 2000;  // no more than these
constexpr std::size_t head_blocks = 200;        // before these, whose vibration counts
constexpr int fine_steps = 10;                  // of a period
constexpr double rest_weight = 30.0;            // of vibration at the end against errors of the command
constexpr double ridge = 0.05;
constexpr double at_rest_mm = 2e-5;  // of a mode
constexpr double rest_share = 1.5;   // of the tolerance: how far rest may lead away from the command
constexpr int rest_rounds = 4;
constexpr std::array<double, 3> steps_tried{1.0, 0.5, 0.25};

using Complex = std::complex<double>;
using Vector = Eigen::VectorXd;

/// A mode and the axis that it moves.
struct AxisPole {
  int axis = 0;
  Complex pole;
};

double total_s(std::span<const LinearBlock> blocks) {
  double sum = 0.0;
  for (const LinearBlock& block : blocks) sum += block.duration_s();
  return sum;
}

std::vector<double> grid(std::size_t count, double step_s, double shift_s) {
  std::vector<double> times;
  times.reserve(count);
  for (std::size_t k = 1; k <= count; ++k) times.push_back(static_cast<double>(k) * step_s + shift_s);
  return times;
}

/// The last blocks of a cut: least squares of their speeds. A micrometre of error at a mode's frequency, in some blocks
/// before the end, is several of vibration after it.
class Tail {
 public:
  Tail(std::span<const LinearBlock> blocks, const LinearFit& fit, const AxisModes& modes);

  [[nodiscard]] std::size_t first() const noexcept { return first_; }
  [[nodiscard]] std::vector<LinearBlock> polished();

 private:
  [[nodiscard]] std::size_t knot_after(const LinearBlock& block) const { return fit_.command().knots[block.last + 1]; }
  void add_vibration_before(std::span<const LinearBlock> head, const Vector3& start);
  [[nodiscard]] std::vector<LinearBlock> with_speeds(const Vector& speeds) const;
  [[nodiscard]] Vector rows(const Vector& speeds) const;
  [[nodiscard]] Eigen::MatrixXd free_speeds() const;
  bool improve(Vector& speeds, Vector& rows_there, const Eigen::MatrixXd& free) const;

  const LinearFit& fit_;
  std::vector<LinearBlock> blocks_;
  std::size_t first_ = 0;
  Vector3 start_ = Vector3::Zero();
  std::span<const Vector3> window_;  // the command at the ends of its periods
  std::vector<double> times_s_;
  std::vector<double> fine_s_;
  std::vector<AxisPole> poles_;
  std::vector<std::vector<Complex>> decays_;  // of each mode, from each fine step to the end
  std::vector<Complex> before_;               // vibration of each mode at the end from the blocks before
  Vector unit_;                               // of the speeds, as they are written
};

Tail::Tail(std::span<const LinearBlock> blocks, const LinearFit& fit, const AxisModes& modes) : fit_(fit) {
  const std::vector<Vector3>& points = fit.command().points;
  const auto start_of = [&](std::size_t block) { return block > 0 ? knot_after(blocks[block - 1]) : 0; };
  const std::size_t end = knot_after(blocks.back());
  first_ = blocks.size() > polished_blocks ? blocks.size() - polished_blocks : 0;
  while (first_ + 1 < blocks.size() && end - start_of(first_) > polished_periods) ++first_;
  blocks_.assign(blocks.begin() + static_cast<std::ptrdiff_t>(first_), blocks.end());
  const std::size_t begin = start_of(first_);
  start_ = points[begin];
  window_ = std::span(points).subspan(begin + 1);
  const double period_s = fit.period_s();
  const double late_s = total_s(blocks.first(first_)) - static_cast<double>(begin) * period_s;
  times_s_ = grid(window_.size(), period_s, -late_s);
  const double step_s = period_s / fine_steps;
  fine_s_ = grid(fine_steps * window_.size() + 2 * fine_steps - 1, step_s, 0.0);
  for (int axis = 0; axis < axis_count; ++axis) {
    for (const Mode& mode : modes[static_cast<std::size_t>(axis)]) poles_.push_back({axis, pole(mode)});
  }
  for (const AxisPole& each : poles_) {
    std::vector<Complex>& decay = decays_.emplace_back();
    for (const double time : fine_s_) decay.push_back(std::exp(each.pole * (fine_s_.back() - time + 0.5 * step_s)));
  }
  const std::size_t head = first_ > head_blocks ? first_ - head_blocks : 0;
  add_vibration_before(blocks.subspan(head, first_ - head), points[start_of(head)]);
  unit_.resize(static_cast<Eigen::Index>(2 * blocks_.size()));
  for (Eigen::Index k = 0; k < unit_.size(); ++k) {
    unit_[k] = blocks_[static_cast<std::size_t>(k / 2)].is_linear ? 0.01 : 0.0001;
  }
}

void Tail::add_vibration_before(std::span<const LinearBlock> head, const Vector3& start) {
  before_.assign(poles_.size(), Complex());
  if (head.empty()) return;
  const double step_s = fit_.period_s() / fine_steps;
  const double head_s = total_s(head);
  const std::vector<double> times_s = grid(static_cast<std::size_t>(std::ceil(head_s / step_s)), step_s, 0.0);
  const std::vector<Vector3> moved = linear_positions_mm(start, head, times_s);
  for (std::size_t m = 0; m < poles_.size(); ++m) {
    double last = start[poles_[m].axis];
    for (std::size_t k = 0; k < moved.size(); ++k) {
      const double here = moved[k][poles_[m].axis];
      before_[m] += (here - last) * std::exp(poles_[m].pole * (fine_s_.back() + head_s - times_s[k] + 0.5 * step_s));
      last = here;
    }
  }
}

std::vector<LinearBlock> Tail::with_speeds(const Vector& speeds) const {
  std::vector<LinearBlock> made = blocks_;
  for (std::size_t k = 0; k < made.size(); ++k) {
    made[k].start_feed_mm_per_min = speeds[static_cast<Eigen::Index>(2 * k)];
    made[k].feed_mm_per_min = speeds[static_cast<Eigen::Index>(2 * k + 1)];
  }
  return made;
}

// Errors of the command, and the residual vibration of the modes.
Vector Tail::rows(const Vector& speeds) const {
  const std::vector<LinearBlock> made = with_speeds(speeds);
  Vector found(static_cast<Eigen::Index>(3 * window_.size() + 2 * poles_.size()));
  const std::vector<Vector3> there = linear_positions_mm(start_, made, times_s_);
  Eigen::Index row = 0;
  for (std::size_t k = 0; k < window_.size(); ++k, row += 3) found.segment<3>(row) = there[k] - window_[k];
  const std::vector<Vector3> fine = linear_positions_mm(start_, made, fine_s_);
  for (std::size_t m = 0; m < poles_.size(); ++m) {
    Complex sum = before_[m];
    double last = start_[poles_[m].axis];
    for (std::size_t k = 0; k < fine.size(); ++k) {
      const double here = fine[k][poles_[m].axis];
      sum += (here - last) * decays_[m][k];
      last = here;
    }
    found[row++] = rest_weight * sum.real();
    found[row++] = rest_weight * sum.imag();
  }
  return found;
}

// Changes of the speeds at both ends of blocks, a column each: a speed that two blocks share is one.
Eigen::MatrixXd Tail::free_speeds() const {
  const auto n = static_cast<Eigen::Index>(blocks_.size());
  Eigen::MatrixXd changes = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  Eigen::Index count = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const LinearBlock& block = blocks_[static_cast<std::size_t>(k)];
    if (block.sets_feed) changes(2 * k, count++) = 1.0;
    if (!block.is_linear) changes(2 * k, count) = 1.0;
    changes(2 * k + 1, count) = 1.0;
    if (k + 1 < n) {
      const LinearBlock& next = blocks_[static_cast<std::size_t>(k + 1)];
      if (!next.sets_feed && next.is_linear) changes(2 * k + 2, count) = 1.0;
    }
    ++count;
  }
  return changes.leftCols(count);
}

// One step of Gauss and Newton, shortened until the command stays near.
bool Tail::improve(Vector& speeds, Vector& rows_there, const Eigen::MatrixXd& free) const {
  const Eigen::Index count = free.cols();
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(rows_there.size() + count, count);
  Vector sizes(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Vector column = rows(speeds + free.col(k)) - rows_there;
    sizes[k] = column.norm();
    if (!(sizes[k] > 0.0)) return false;
    system.col(k).head(rows_there.size()) = column / sizes[k];
    system(rows_there.size() + k, k) = ridge;
  }
  Vector wanted = Vector::Zero(system.rows());
  wanted.head(rows_there.size()) = -rows_there;
  const Vector change = free * system.householderQr().solve(wanted).cwiseQuotient(sizes);
  for (const double share : steps_tried) {
    const Vector wished = (speeds + share * change).cwiseQuotient(unit_);
    const Vector tried = wished.unaryExpr([](double x) { return std::nearbyint(x); }).cwiseProduct(unit_);
    if (tried.minCoeff() <= 0.0) continue;
    Vector found = rows(tried);
    double off = 0.0;
    for (std::size_t k = 0; k < window_.size(); ++k) {
      off = std::max(off, found.segment<3>(static_cast<Eigen::Index>(3 * k)).norm());
    }
    if (off <= rest_share * fit_.tolerance_mm() && found.squaredNorm() < rows_there.squaredNorm()) {
      speeds = tried;
      rows_there = std::move(found);
      return true;
    }
  }
  return false;
}

std::vector<LinearBlock> Tail::polished() {
  Vector speeds(unit_.size());
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    speeds[static_cast<Eigen::Index>(2 * k)] = blocks_[k].start_feed_mm_per_min;
    speeds[static_cast<Eigen::Index>(2 * k + 1)] = blocks_[k].feed_mm_per_min;
  }
  const Eigen::MatrixXd free = free_speeds();
  Vector found = rows(speeds);
  const auto modes = static_cast<Eigen::Index>(2 * poles_.size());
  for (int n = 0; n < rest_rounds; ++n) {
    if (found.tail(modes).cwiseAbs().maxCoeff() < rest_weight * at_rest_mm) break;
    if (!improve(speeds, found, free)) break;
  }
  return with_speeds(speeds);
}

}  // namespace

std::vector<LinearBlock> at_rest(std::vector<LinearBlock> blocks, const LinearFit& fit, const AxisModes& modes) {
  Tail tail(blocks, fit, modes);
  std::ranges::copy(tail.polished(), blocks.begin() + static_cast<std::ptrdiff_t>(tail.first()));
  return blocks;
}

}  // namespace shapegcode
