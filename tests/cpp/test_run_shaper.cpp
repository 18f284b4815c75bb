#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <memory>
#include <numbers>
#include <type_traits>
#include <utility>
#include <vector>

#include "command/run_shaper.hpp"
#include "shapegcode/command.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/shaper.hpp"

using shapegcode::AxisModes;
using shapegcode::ContourTarget;
using shapegcode::Fir;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Mode;
using shapegcode::motion_of;
using shapegcode::MotionLimits;
using shapegcode::nearest_on;
using shapegcode::Path;
using shapegcode::plan_speed;
using shapegcode::RegionShaper;
using shapegcode::RunFilter;
using shapegcode::RunLimits;
using shapegcode::RunMotion;
using shapegcode::RunShaper;
using shapegcode::Segment;
using shapegcode::ShapedCommand;
using shapegcode::ShapingOptions;
using shapegcode::SpeedProfile;
using shapegcode::Vector3;

namespace {

using PathPointer = std::shared_ptr<const Path>;
using Rows = std::vector<Vector3>;

constexpr double block_s = 0.005;
const Mode mode_x{46.0, 0.02, 1.0};
const Mode mode_y{131.0, 0.02, 1.0};

AxisModes modes() {
  AxisModes result;
  result[0] = {mode_x};
  result[1] = {mode_y};
  return result;
}

Fir grid_shaper() {
  const std::vector<Mode> both{mode_x, mode_y};
  return to_fir(shapegcode::grid_polynomial(both, block_s), block_s);
}

PathPointer path_of(std::vector<Segment> segments) { return std::make_shared<const Path>(std::move(segments)); }

/// Paper 000: a line, a quarter arc of 20 mm, a line.
PathPointer paper_path(double feed) {
  return path_of({make_line({0, 0, 0}, {20, 0, 0}, feed),
                  make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, std::numbers::pi / 2, 2, feed),
                  make_line({40, 20, 0}, {40, 40, 0}, feed)});
}

/// Curvature right from the start to the very end.
PathPointer half_circle(double feed) {
  return path_of({make_arc({0, 0, 0}, {0, 20, 0}, {0, 10, 0}, std::numbers::pi, 2, feed)});
}

PathPointer right_angle(double feed) {
  return path_of({make_line({0, 0, 0}, {20, 0, 0}, feed), make_line({20, 0, 0}, {20, 20, 0}, feed)});
}

std::shared_ptr<const RunMotion> planned(const PathPointer& path, const MotionLimits& limits = {}) {
  return motion_of(path, std::make_shared<const SpeedProfile>(plan_speed(*path, limits)), 5);
}

RunFilter filter_for(ContourTarget target) {
  const std::vector<Fir> shaper{grid_shaper()};
  return RunFilter(shaper, target, modes(), block_s, 1.0);
}

Rows rows_of(RunShaper& shaper) {
  Rows rows(2 * static_cast<std::size_t>(shaper.periods()) + 1);
  for (Vector3& row : rows) shaper.next(row);
  return rows;
}

Rows shaped(const PathPointer& path, ContourTarget target, const RunLimits& run = {}, const MotionLimits& limits = {}) {
  const RunFilter filter = filter_for(target);
  RunShaper shaper(path, planned(path, limits), filter, run);
  return rows_of(shaper);
}

double distance_to(const Path& path, const Vector3& point) {
  double nearest = 1e300;
  for (const Segment& segment : path.segments()) nearest = std::min(nearest, nearest_on(segment, point).distance_mm);
  return nearest;
}

double largest_distance(const Path& path, const Rows& rows) {
  double largest = 0.0;
  for (const Vector3& row : rows) largest = std::max(largest, distance_to(path, row));
  return largest;
}

/// Deflection in mm that the blocks' staircase leaves in a mode at its end, by the pole's own recursion:
/// sum of changes of velocity times e^(s*time left), to within a factor near one.
double left_over(const Rows& rows, const Mode& mode, Eigen::Index axis) {
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  const std::complex<double> s(-mode.damping_ratio * omega,
                               omega * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio));
  const std::complex<double> turn = std::exp(s * block_s);
  std::complex<double> sum = 0.0;
  double last = rows.front()[axis];
  double step = 0.0;
  for (std::size_t k = 2; k < rows.size() + 2; k += 2) {
    const double now = rows[std::min(k, rows.size() - 1)][axis];
    sum = sum * turn + (now - last - step);
    step = now - last;
    last = now;
  }
  return std::abs(sum) / (std::abs(s) * block_s);
}

/// Largest change of an axis' block velocity per block period, mm/s2.
double peak_acceleration(const Rows& rows, Eigen::Index axis) {
  double peak = 0.0;
  for (std::size_t k = 4; k < rows.size(); k += 2)
    peak = std::max(peak, std::abs(rows[k][axis] - 2.0 * rows[k - 2][axis] + rows[k - 4][axis]));
  return peak / (block_s * block_s);
}

ShapingOptions region_options(ContourTarget target, double tolerance_mm) {
  ShapingOptions options;
  options.block_period_s = block_s;
  options.interpolation_period_s = 0.001;
  options.target = target;
  options.modes = modes();
  options.tolerance.contour_tolerance_mm = tolerance_mm;
  return options;
}

}  // namespace

TEST_CASE("run shaper: a correction begins and ends with the run and keeps the shaper's zeros") {
  for (const PathPointer& path : {paper_path(200.0), half_circle(150.0), right_angle(60.0)}) {
    const Rows plain = shaped(path, ContourTarget::none);
    for (const ContourTarget target : {ContourTarget::command, ContourTarget::response}) {
      const Rows rows = shaped(path, target);
      REQUIRE(rows.size() == plain.size());
      CHECK((rows.front() - path->segments().front().start_mm).norm() < 1e-14);
      CHECK((rows.back() - path->segments().back().end_mm).norm() < 1e-12);
      double moved = 0.0;
      for (std::size_t k = 0; k < rows.size(); ++k) moved = std::max(moved, (rows[k] - plain[k]).norm());
      CHECK(moved > 1e-3);  // something was corrected
      for (const Eigen::Index axis : {0, 1}) {
        CHECK(left_over(rows, mode_x, axis) < 1e-12);
        CHECK(left_over(rows, mode_y, axis) < 1e-12);
      }
    }
  }
}

TEST_CASE("run shaper: the shaped command follows the path where plain shaping leaves it") {
  // The figures of the paper's path at 200 mm/s on blocks of 5 ms.
  const PathPointer path = paper_path(200.0);
  CHECK(largest_distance(*path, shaped(path, ContourTarget::none)) > 0.040);
  CHECK(largest_distance(*path, shaped(path, ContourTarget::command)) < 0.006);
  // At a tenth of the speed nothing is left to be seen.
  const PathPointer slow = paper_path(20.0);
  CHECK(largest_distance(*slow, shaped(slow, ContourTarget::none)) > 0.0004);
  CHECK(largest_distance(*slow, shaped(slow, ContourTarget::command)) < 0.0001);
}

TEST_CASE("run shaper: a run that is longer than what is kept in memory") {
  // Lines and arcs in turn, 158 s in rows of 2.5 ms; what is forgotten begins at 32768 rows.
  std::vector<Segment> segments;
  Vector3 at(0, 0, 0);
  for (int k = 0; k < 70; ++k) {
    const Vector3 next = at + Vector3(25, 0, 0);
    segments.push_back(make_line(at, next, 50.0));
    const Vector3 top = next + Vector3(0, 20, 0);
    const double sweep = k % 2 == 0 ? std::numbers::pi : -std::numbers::pi;
    const Vector3 across = k % 2 == 0 ? top : Vector3(next - Vector3(0, 20, 0));
    segments.push_back(make_arc(next, across, 0.5 * (next + across), sweep, 2, 50.0));
    segments.push_back(make_line(across, across - Vector3(25, 0, 0), 50.0));
    const Vector3 back = across - Vector3(25, 0, 0);
    const Vector3 home = back + Vector3(0, k % 2 == 0 ? 20 : -20, 0);
    segments.push_back(make_arc(back, home, 0.5 * (back + home), -sweep, 2, 50.0));
    at = home;
  }
  const PathPointer path = path_of(segments);
  const RunFilter filter = filter_for(ContourTarget::command);
  RunShaper shaper(path, planned(path), filter, {});
  const Rows rows = rows_of(shaper);
  REQUIRE(rows.size() > 60000);
  // Straight on from the start: every row lies near the segment where it should be, by the distance that it went.
  double worst = 0.0;
  double longest_step = 0.0;
  std::size_t on = 0;
  for (std::size_t k = 1; k < rows.size(); ++k) {
    while (on + 1 < path->size() &&
           nearest_on((*path)[on + 1], rows[k]).distance_mm < nearest_on((*path)[on], rows[k]).distance_mm)
      ++on;
    worst = std::max(worst, nearest_on((*path)[on], rows[k]).distance_mm);
    longest_step = std::max(longest_step, (rows[k] - rows[k - 1]).norm());
  }
  CHECK(on + 1 == path->size());
  CHECK(worst < 0.001);  // plain shaping: 4 um on these arcs
  CHECK(longest_step < 50.0 * 0.5 * block_s * 1.01);
  CHECK((rows.back() - path->segments().back().end_mm).norm() < 1e-11);
  CHECK(left_over(rows, mode_x, 0) < 1e-11);
  CHECK(left_over(rows, mode_y, 1) < 1e-11);
}

TEST_CASE("run shaper: a region cut into pieces is the region, bit for bit") {
  const shapegcode::Segments paper = paper_path(180.0)->segments();
  std::vector<Segment> segments(paper.begin(), paper.end());
  segments.push_back(make_line({40, 40, 0}, {10, 40, 0}, 180.0));
  segments.push_back(make_arc({10, 40, 0}, {5, 35, 0}, {10, 35, 0}, std::numbers::pi / 2, 2, 180.0));
  segments.push_back(make_line({5, 35, 0}, {5, 20, 0}, 180.0));
  segments[2].stop_at_end = true;
  const PathPointer path = path_of(segments);
  for (const ContourTarget target : {ContourTarget::command, ContourTarget::response}) {
    const ShapingOptions options = region_options(target, 0.02);
    const std::vector<std::uint32_t> marks{0, 1, 3, 5};
    const ShapedCommand whole = shape_path(path, grid_shaper(), marks, options);
    CHECK(whole.run_ends.size() == 2);
    RegionShaper shaper(path, grid_shaper(), marks, options);
    ShapedCommand piece;
    std::uint32_t periods = 0;
    std::vector<std::uint32_t> ends;
    std::vector<std::uint32_t> reached;
    while (shaper.next(piece, 7)) {
      const auto n = static_cast<std::uint32_t>(piece.middle_mm.rows());
      REQUIRE(piece.first_period == periods);
      REQUIRE(n <= 7);
      CHECK(piece.grid_mm == whole.grid_mm.middleRows(periods, n + 1));
      CHECK(piece.middle_mm == whole.middle_mm.middleRows(periods, n));
      CHECK(std::equal(piece.arc_normal.begin(), piece.arc_normal.end(), whole.arc_normal.begin() + periods));
      for (const std::uint32_t end : piece.run_ends) ends.push_back(periods + end);
      reached = piece.segment_periods;
      periods += n;
    }
    CHECK(periods == static_cast<std::uint32_t>(whole.middle_mm.rows()));
    CHECK(ends == whole.run_ends);
    CHECK(reached == whole.segment_periods);
  }
}

TEST_CASE("run shaper: what refers into itself cannot be moved, and a region is moved in the midst of a run") {
  static_assert(!std::is_copy_constructible_v<RunShaper> && !std::is_move_constructible_v<RunShaper>);
  static_assert(!std::is_copy_constructible_v<RegionShaper> && std::is_nothrow_move_constructible_v<RegionShaper> &&
                std::is_nothrow_move_assignable_v<RegionShaper>);
  const PathPointer path = paper_path(180.0);
  const ShapingOptions options = region_options(ContourTarget::command, 0.02);
  const ShapedCommand whole = shape_path(path, grid_shaper(), {}, options);
  auto first = std::make_unique<RegionShaper>(path, grid_shaper(), std::vector<std::uint32_t>{}, options);
  ShapedCommand piece;
  REQUIRE(first->next(piece, 9));
  RegionShaper second(std::move(*first));
  first.reset();
  std::uint32_t periods = 9;
  while (second.next(piece, 9)) {
    const auto n = static_cast<std::uint32_t>(piece.middle_mm.rows());
    CHECK(piece.grid_mm == whole.grid_mm.middleRows(periods, n + 1));
    periods += n;
  }
  CHECK(periods == static_cast<std::uint32_t>(whole.middle_mm.rows()));
}

TEST_CASE("run shaper: limits of the axes are kept, and what plain shaping asks for is no reason to ask for more") {
  const PathPointer path = right_angle(60.0);
  const Rows plain = shaped(path, ContourTarget::none);
  const Rows free = shaped(path, ContourTarget::command);
  for (const Eigen::Index axis : {0, 1}) {
    REQUIRE(peak_acceleration(free, axis) > 1.05 * peak_acceleration(plain, axis));
  }
  for (const double room : {1.5, 1.02, 1.0001, 0.5}) {
    RunLimits limits;
    for (const Eigen::Index axis : {0, 1}) {
      limits.max_acceleration_mm_per_s2[axis] = room * peak_acceleration(plain, axis);
    }
    const Rows bounded = shaped(path, ContourTarget::command, limits);
    for (const Eigen::Index axis : {0, 1}) {
      CHECK(peak_acceleration(bounded, axis) <= std::max(room, 1.0) * peak_acceleration(plain, axis) * (1 + 1e-5));
    }
    CHECK(bounded.size() == plain.size());
    CHECK(left_over(bounded, mode_x, 0) < 1e-12);
  }
  // A speed limit just above the command's own.
  RunLimits limits;
  limits.max_speed_mm_per_s = Vector3::Constant(60.001);
  const Rows bounded = shaped(path, ContourTarget::command, limits);
  double fastest = 0.0;
  for (std::size_t k = 2; k < bounded.size(); k += 2)
    fastest = std::max(fastest, (bounded[k] - bounded[k - 2]).cwiseAbs().maxCoeff() / block_s);
  CHECK(fastest <= 60.001 * (1 + 1e-5));
}
