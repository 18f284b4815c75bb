#include "write/smooth_arcs.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "path/arc_frame.hpp"

namespace shapegcode {
namespace {

// Weight of a change of an arc relative to the angle at a junction, both in rad^2: it prevents arcs from turning
// alternately more and less to cancel each other's angles.
constexpr double change_weight = 0.02;
constexpr double largest_angle_rad = 0.2;  // a corner is meant
constexpr double radius_slack_rad = 2e-5;  // by which a shorter R may turn an arc
constexpr double longest_radius = 99999999.0;

// A block seen in the plane: direction of its chord and by how much it turns, positive to the left.
struct Turn {
  Eigen::Vector2d along = Eigen::Vector2d::Zero();
  double chord = 0.0;
  double sweep = 0.0;
  bool is_arc = false;
};

Turn turn_of(const BlockPosition& from, const FittedBlock& block, int normal, const BlockShape& shape) {
  Turn turn;
  const Eigen::Vector2d chord = ArcFrame(normal).offset(shape.to_mm(from), shape.to_mm(block.end));
  turn.chord = chord.norm();
  if (turn.chord > 0.0) turn.along = chord / turn.chord;
  turn.is_arc = block.kind != FittedKind::line;
  if (turn.is_arc) turn.sweep = -shape.arc_of(from, block).bulge_side * shape.arc_of(from, block).sweep;
  return turn;
}

double angle_between(const Turn& before, const Turn& behind) {
  const double cross = before.along.x() * behind.along.y() - before.along.y() * behind.along.x();
  return std::atan2(cross, before.along.dot(behind.along));
}

// The sweeps with the least sum of squares of the angles between neighbours, and of their own changes.
std::vector<double> smooth_sweeps(const std::vector<Turn>& turns) {
  const std::size_t n = turns.size();
  std::vector<double> diagonal(n, 1.0);
  std::vector<double> beside(n, 0.0);  // [i]: of i and i + 1
  std::vector<double> right(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    diagonal[i] = turns[i].is_arc ? change_weight : 1.0;
    right[i] = turns[i].is_arc ? change_weight * turns[i].sweep : 0.0;
  }
  for (std::size_t i = 0; i + 1 < n; ++i) {
    const double turned = angle_between(turns[i], turns[i + 1]);
    const double meets = turned - 0.5 * (turns[i].sweep + turns[i + 1].sweep);
    if (!(std::abs(meets) < largest_angle_rad)) continue;
    for (const std::size_t k : {i, i + 1}) {
      if (!turns[k].is_arc) continue;
      diagonal[k] += 0.25;
      right[k] += 0.5 * turned;
    }
    if (turns[i].is_arc && turns[i + 1].is_arc) beside[i] = 0.25;
  }
  for (std::size_t i = 1; i < n; ++i) {
    const double share = beside[i - 1] / diagonal[i - 1];
    diagonal[i] -= share * beside[i - 1];
    right[i] -= share * right[i - 1];
  }
  std::vector<double> sweeps(n);
  for (std::size_t i = n; i-- > 0;) {
    const double behind = i + 1 < n ? beside[i] * sweeps[i + 1] : 0.0;
    sweeps[i] = (right[i] - behind) / diagonal[i];
  }
  return sweeps;
}

// The radius with few digits that turns an arc as far, but for a slack; 0 where there is none.
std::int64_t radius_of(double chord_increments, double sweep) {
  const double radius = 0.5 * chord_increments / std::sin(0.5 * sweep);
  if (!(radius < longest_radius) || !(radius > 0.5 * chord_increments)) return 0;
  double step = 1.0;
  while (10.0 * step < radius * radius_slack_rad / sweep) step *= 10.0;
  const double rounded = std::round(radius / step) * step;
  return 2.0 * rounded > chord_increments ? std::llround(rounded) : 0;
}

// Blocks in a row that lie in one plane: arcs of one normal, and lines.
void smooth_run(std::vector<FittedBlock>& blocks, const BlockPosition& start, std::size_t first, std::size_t end,
                const BlockShape& shape, const std::array<double, 2>& most_and_increment) {
  const auto [most_mm, increment_mm] = most_and_increment;
  const auto start_of = [&](std::size_t i) { return i == 0 ? start : blocks[i - 1].end; };
  int normal = -1;
  for (std::size_t i = first; i < end; ++i) {
    if (blocks[i].kind != FittedKind::line) normal = blocks[i].normal;
  }
  if (normal < 0) return;
  std::vector<Turn> turns;
  for (std::size_t i = first; i < end; ++i) turns.push_back(turn_of(start_of(i), blocks[i], normal, shape));
  const std::vector<double> sweeps = smooth_sweeps(turns);
  for (std::size_t k = 0; k < turns.size(); ++k) {
    const Turn& turn = turns[k];
    if (!turn.is_arc || !(turn.chord > 0.0)) continue;
    // The middle of an arc is an eighth of chord times sweep off its chord.
    const double most = 8.0 * most_mm / turn.chord;
    const double sweep = std::clamp(sweeps[k], turn.sweep - most, turn.sweep + most);
    if (sweep * turn.sweep <= 0.0 || std::abs(sweep) > 0.5 * std::numbers::pi) continue;
    FittedBlock block = blocks[first + k];
    block.radius = radius_of(turn.chord / increment_mm, std::abs(sweep));
    if (block.radius == 0) continue;
    // A long block lasts its time only at a length for which there is an F.
    const double length = shape.length_mm(start_of(first + k), block);
    if (block.periods > 1 && !shape.feed(length, block.periods)) continue;
    shape.set_feed(block, length);
    blocks[first + k] = block;
  }
}

}  // namespace

void smooth_arcs(std::vector<FittedBlock>& blocks, const BlockPosition& start, const BlockShape& shape, double most_mm,
                 double increment_mm) {
  std::size_t first = 0;
  int normal = -1;
  for (std::size_t i = 0; i <= blocks.size(); ++i) {
    const bool is_arc = i < blocks.size() && blocks[i].kind != FittedKind::line;
    if (i == blocks.size() || (is_arc && normal >= 0 && blocks[i].normal != normal)) {
      smooth_run(blocks, start, first, i, shape, {most_mm, increment_mm});
      first = i;
      normal = -1;
    }
    if (is_arc) normal = blocks[i].normal;
  }
}

}  // namespace shapegcode
