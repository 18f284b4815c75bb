#include "shapegcode/emission/block_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr double largest_position_mm = 99999.999;
constexpr double largest_radius_mm = 99999.999;
// Ticks by which a block ends before its last tick: far over the rounding of any controller, far under what matters.
constexpr double tick_margin = 1e-4;
// How far a line is tried beyond its last good end before it is settled: keeps the fit linear in the program's length.
constexpr std::uint32_t line_patience = 2048;
constexpr std::uint32_t longest_arc_periods = 65536;

using Position = std::array<std::int64_t, axis_count>;

// An arc through two end points with a radius, as a controller builds it from R.
struct ChordArc {
  double chord = 0.0;
  double radius = 0.0;
  double sweep = 0.0;  // > 0
  Eigen::Vector2d along;
  Eigen::Vector2d left;  // unit, left of the chord
  Eigen::Vector2d start;
  double bulge_side = 0.0;  // +1: the arc bulges to the left of the chord

  [[nodiscard]] Eigen::Vector2d at(double fraction) const {
    const double angle = sweep * (fraction - 0.5);
    const double forward = radius * std::sin(angle) + 0.5 * chord;
    const double bulge = radius * (std::cos(angle) - std::cos(0.5 * sweep));
    return start + forward * along + bulge_side * bulge * left;
  }
};

// A block and how many periods of the command it stands for; what it does not last is lent to its successor.
struct Candidate {
  FittedBlock block;
  std::uint32_t covered = 0;
};

class Fitter {
 public:
  Fitter(const Eigen::Ref<const Eigen::MatrixXd>& grid, const Eigen::Ref<const Eigen::MatrixXd>& middle,
         std::span<const std::int8_t> arc_normal, std::span<const std::uint32_t> breaks, const FitOptions& options)
      : grid_(grid),
        middle_(middle),
        arc_normal_(arc_normal),
        breaks_(breaks),
        options_(options),
        periods_(static_cast<std::uint32_t>(middle.rows())),
        ticks_per_period_(std::lround(options.block_period_s / options.interpolation_period_s)) {}

  std::vector<FittedBlock> run() {
    std::vector<FittedBlock> blocks;
    position_ = rounded(0);
    std::uint32_t k = 0;
    while (k < periods_) {
      const std::uint32_t limit = next_break(k);
      std::optional<Candidate> best = fit_line(k, limit);
      if (!best) {
        break;  // rest to the end
      }
      if (arc_normal_[k] >= 0) {
        if (const auto arc = fit_arc(k, limit, bends(k) ? 1 : best->covered + 1)) {
          best = arc;
        }
      }
      k += best->covered;
      lent_ += best->covered - best->block.periods;
      position_ = best->block.end;
      blocks.push_back(best->block);
    }
    end_with_arc(blocks);
    return blocks;
  }

 private:
  // Makes the last line an arc where the original ends with one. A line that does not move in the arc's plane (the end
  // of a steep helix) gets one increment of way in it from its predecessor.
  void end_with_arc(std::vector<FittedBlock>& blocks) const {
    if (options_.last_kind == BlockKind::line || blocks.empty()) {
      return;
    }
    FittedBlock& last = blocks.back();
    const int normal = options_.last_normal;
    if (last.kind == options_.last_kind && last.normal == normal) {
      return;
    }
    const auto start_of = [&](std::size_t i) { return i == 0 ? rounded(0) : blocks[i - 1].end; };
    if (plane_travel(start_of(blocks.size() - 1), last.end, normal) == 0.0 && !lend_increment(blocks, normal)) {
      return;  // no move in the plane at all: the original's arc is shorter than an increment
    }
    const Position start = start_of(blocks.size() - 1);
    const double chord = plane_travel(start, last.end, normal);
    last.radius = std::llround(std::max(options_.last_radius_mm, chord) / options_.increment_mm);
    last.kind = options_.last_kind;
    last.normal = options_.last_normal;
    const double radius = static_cast<double>(last.radius) * options_.increment_mm;
    const double climb = to_mm(last.end)[normal] - to_mm(start)[normal];
    set_feed(last, std::hypot(2.0 * radius * std::asin(0.5 * chord / radius), climb));
  }

  [[nodiscard]] double plane_travel(const Position& from, const Position& to, int normal) const {
    const Vector3 move = to_mm(to) - to_mm(from);
    return std::hypot(move[(normal + 1) % 3], move[(normal + 2) % 3]);
  }

  // Takes one increment of the last way in the plane from the line that made it, or from the line before the last
  // block.
  [[nodiscard]] bool lend_increment(std::vector<FittedBlock>& blocks, int normal) const {
    for (std::size_t i = blocks.size() - 1; i-- > 0;) {
      const Position start = i == 0 ? rounded(0) : blocks[i - 1].end;
      const auto a = static_cast<std::size_t>((normal + 1) % 3);
      const auto b = static_cast<std::size_t>((normal + 2) % 3);
      const std::size_t axis = blocks[i].end[a] != start[a] ? a : b;
      const std::int64_t way = blocks[i].end[axis] - start[axis];
      Position behind = blocks[i].end;
      behind[axis] -= way > 0 ? 1 : -1;
      if (way == 0 || behind == start) {
        continue;
      }
      // All blocks from there to the last but one stay one increment behind; lines only, so that no arc changes its
      // shape.
      for (std::size_t k = i; k + 1 < blocks.size(); ++k) {
        if (blocks[k].kind != BlockKind::line) {
          return false;
        }
      }
      for (std::size_t k = i; k + 1 < blocks.size(); ++k) {
        blocks[k].end[axis] -= way > 0 ? 1 : -1;
      }
      set_feed(blocks[i], (to_mm(blocks[i].end) - to_mm(start)).norm());
      return true;
    }
    return false;
  }

  [[nodiscard]] Position rounded(std::uint32_t k) const {
    Position result;
    for (int i = 0; i < axis_count; ++i) {
      result[static_cast<std::size_t>(i)] = std::llround(grid_(k, i) / options_.increment_mm);
    }
    return result;
  }

  [[nodiscard]] Vector3 to_mm(const Position& p) const {
    return Vector3(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])) *
           options_.increment_mm;
  }

  std::uint32_t next_break(std::uint32_t k) {
    while (break_ < breaks_.size() && breaks_[break_] <= k) {
      ++break_;
    }
    return break_ < breaks_.size() ? std::min(breaks_[break_], periods_) : periods_;
  }

  // Deviation of the path's middle from the chord within one period, in the plane of the arc it follows.
  [[nodiscard]] Eigen::Vector2d bump(std::uint32_t k, int normal) const {
    const int a = (normal + 1) % 3;
    const int b = (normal + 2) % 3;
    return {middle_(k, a) - 0.5 * (grid_(k, a) + grid_(k + 1, a)),
            middle_(k, b) - 0.5 * (grid_(k, b) + grid_(k + 1, b))};
  }

  [[nodiscard]] bool bends(std::uint32_t k) const {
    const int normal = arc_normal_[k];
    return normal >= 0 && bump(k, normal).norm() > 0.5 * options_.increment_mm;
  }

  // F, rounded up, that makes the block end just before its last tick, so that a controller that starts blocks on ticks
  // takes exactly the intended number of them, whatever its own rounding. What it then stands still may be no more than
  // half an increment of way; a longer steady block may have an F that is exact. nullopt if no F of this resolution
  // will do.
  [[nodiscard]] std::optional<std::int64_t> feed(double length_mm, std::uint32_t periods) const {
    const auto wanted = static_cast<double>(periods * ticks_per_period_);
    const auto early = [&](std::int64_t value) {
      const double speed = static_cast<double>(value) * options_.feed_unit_mm_per_s;
      return wanted * options_.interpolation_period_s * speed - length_mm;  // way not used, mm
    };
    const auto last_tick = [&](std::int64_t value) {
      return static_cast<double>(value) * options_.feed_unit_mm_per_s * options_.interpolation_period_s;
    };
    const std::int64_t up = nearest_feed(length_mm, periods);
    if (early(up) <= 0.5 * options_.increment_mm && early(up) < (1.0 - tick_margin) * last_tick(up)) {
      return up;
    }
    const std::int64_t exact =
        std::llround(length_mm / (wanted * options_.interpolation_period_s) / options_.feed_unit_mm_per_s);
    if (exact >= options_.minimum_feed && early(exact) >= -1e-12 * length_mm && early(exact) <= 1e-9 * length_mm) {
      return exact;
    }
    return std::nullopt;
  }

  [[nodiscard]] std::int64_t nearest_feed(double length_mm, std::uint32_t periods) const {
    const double ticks = static_cast<double>(periods * ticks_per_period_) - tick_margin;
    const double exact = length_mm / (ticks * options_.interpolation_period_s) / options_.feed_unit_mm_per_s;
    return std::max(options_.minimum_feed, static_cast<std::int64_t>(std::ceil(exact)));
  }

  // Gives a block its F for the periods that it has. One too slow for the resolution of F is run a little faster, in
  // fewer whole periods.
  void set_feed(FittedBlock& block, double length_mm) const {
    auto f = feed(length_mm, block.periods);
    while (!f && block.periods > 1) {
      f = feed(length_mm, --block.periods);
    }
    block.feed = f ? *f : nearest_feed(length_mm, block.periods);
  }

  [[nodiscard]] Candidate line_to(const Position& end, double length, std::uint32_t k, std::uint32_t covered) const {
    Candidate line{{end, 0, 0, k, covered + lent_, BlockKind::line, 2}, covered};
    set_feed(line.block, length);
    return line;
  }

  // Longest line from period k that stays within the merge tolerance of every sample (an opening cone per axis).
  std::optional<Candidate> fit_line(std::uint32_t k, std::uint32_t limit) {
    const double tolerance = options_.merge_tolerance_increments + 1e-6;
    std::array<double, axis_count> lowest;
    std::array<double, axis_count> highest;
    lowest.fill(-std::numeric_limits<double>::infinity());
    highest.fill(std::numeric_limits<double>::infinity());
    std::optional<Candidate> best;
    for (std::uint32_t j = k + 1; j <= periods_; ++j) {
      if (best && (j > limit || bends(j - 1) || j - k > best->covered + line_patience)) {
        break;
      }
      const double steps = j - k;
      const Position end = rounded(j);
      bool inside = true;
      bool open = true;
      for (std::size_t i = 0; i < axis_count; ++i) {
        const double offset =
            grid_(j, static_cast<Eigen::Index>(i)) / options_.increment_mm - static_cast<double>(position_[i]);
        const double slope = static_cast<double>(end[i] - position_[i]) / steps;
        // The end itself is off by its own rounding, at most half an increment, and need not obey the cone.
        inside = inside && slope >= lowest[i] && slope <= highest[i];
        lowest[i] = std::max(lowest[i], (offset - tolerance) / steps);
        highest[i] = std::min(highest[i], (offset + tolerance) / steps);
        open = open && lowest[i] <= highest[i];
      }
      if (end != position_ && (inside || !best)) {
        const double length = (to_mm(end) - to_mm(position_)).norm();
        if (const auto f = feed(length, j - k + lent_)) {
          best = Candidate{{end, 0, *f, k, j - k + lent_, BlockKind::line, 2}, j - k};
        } else if (!best) {
          best = line_to(end, length, k, j - k);
        }
      }
      if (best && !open) {
        break;
      }
    }
    return best;
  }

  [[nodiscard]] std::optional<ChordArc> chord_arc(const Position& from, const Position& to, int normal,
                                                  const Eigen::Vector2d& middle) const {
    const int a = (normal + 1) % 3;
    const int b = (normal + 2) % 3;
    const Vector3 p = to_mm(from);
    const Vector3 q = to_mm(to);
    ChordArc arc;
    arc.start = {p[a], p[b]};
    const Eigen::Vector2d chord(q[a] - p[a], q[b] - p[b]);
    arc.chord = chord.norm();
    if (arc.chord < options_.arc_min_chord_mm) {
      return std::nullopt;
    }
    arc.along = chord / arc.chord;
    arc.left = {-arc.along.y(), arc.along.x()};
    const double height = (middle - (arc.start + 0.5 * chord)).dot(arc.left);
    if (std::abs(height) < 0.25 * options_.increment_mm) {
      return std::nullopt;
    }
    const double radius = (0.25 * arc.chord * arc.chord + height * height) / (2.0 * std::abs(height));
    arc.radius = std::round(radius / options_.increment_mm) * options_.increment_mm;
    if (arc.radius > largest_radius_mm || 0.5 * arc.chord >= arc.radius) {
      return std::nullopt;
    }
    arc.sweep = 2.0 * std::asin(0.5 * arc.chord / arc.radius);
    arc.bulge_side = height > 0.0 ? 1.0 : -1.0;
    if (arc.sweep > options_.max_sweep_rad) {
      return std::nullopt;
    }
    return arc;
  }

  // An arc over periods k ... j, if it follows every sample between; a single period needs no such check.
  [[nodiscard]] std::optional<Candidate> arc_over(std::uint32_t k, std::uint32_t j, int normal) const {
    const int a = (normal + 1) % 3;
    const int b = (normal + 2) % 3;
    const std::uint32_t m = j - k;
    const Position end = rounded(j);
    Eigen::Vector2d middle;
    if (m % 2 == 1) {
      middle = {middle_(k + m / 2, a), middle_(k + m / 2, b)};
    } else {
      middle = {grid_(k + m / 2, a), grid_(k + m / 2, b)};
    }
    // The chord is rounded, the middle is not: move the middle with the chord's own rounding.
    const Vector3 p = to_mm(position_);
    const Vector3 q = to_mm(end);
    middle += 0.5 * Eigen::Vector2d(p[a] - grid_(k, a) + q[a] - grid_(j, a), p[b] - grid_(k, b) + q[b] - grid_(j, b));
    const auto arc = chord_arc(position_, end, normal, middle);
    if (!arc) {
      return std::nullopt;
    }
    if (m > 1) {
      const double tolerance = (options_.merge_tolerance_increments + 0.25) * options_.increment_mm;
      for (std::uint32_t i = 1; i < m; ++i) {
        const double fraction = static_cast<double>(i) / m;
        const Eigen::Vector2d at = arc->at(fraction);
        const double along_normal = p[normal] + (q[normal] - p[normal]) * fraction;
        if (std::abs(at.x() - grid_(k + i, a)) > tolerance || std::abs(at.y() - grid_(k + i, b)) > tolerance ||
            std::abs(along_normal - grid_(k + i, normal)) > tolerance) {
          return std::nullopt;
        }
      }
    }
    const double length = std::hypot(arc->radius * arc->sweep, q[normal] - p[normal]);
    const auto f = feed(length, m + lent_);
    if (!f && m > 1) {
      return std::nullopt;
    }
    // Counter-clockwise turns left, so its path bulges to the right of the chord.
    const BlockKind kind = arc->bulge_side < 0.0 ? BlockKind::counter_clockwise : BlockKind::clockwise;
    const std::uint32_t periods = m + lent_;
    return Candidate{{end, std::llround(arc->radius / options_.increment_mm), f ? *f : nearest_feed(length, periods), k,
                      periods, kind, static_cast<std::uint8_t>(normal)},
                     m};
  }

  // Longest arc of at least `least` periods from period k, found by doubling and halving steps. A piece too short to
  // show its curvature is no arc by itself but may be part of one.
  std::optional<Candidate> fit_arc(std::uint32_t k, std::uint32_t limit, std::uint32_t least) {
    const int normal = arc_normal_[k];
    std::uint32_t last = k;
    while (last < limit && arc_normal_[last] == normal && last - k < longest_arc_periods) {
      ++last;
    }
    std::optional<Candidate> best;
    std::uint32_t reached = 0;
    for (std::uint32_t step = least; step > 0 && k + least <= last;) {
      const std::uint32_t trial = reached + step;
      const auto longer = k + trial <= last ? arc_over(k, k + trial, normal) : std::nullopt;
      if (longer) {
        best = longer;
        reached = trial;
        step *= 2;
      } else if (!best && step < 4 * least && !bends(k)) {
        step *= 2;  // still too short to bend
      } else {
        step = best ? step / 2 : 0;
      }
    }
    return best;
  }

  Eigen::Ref<const Eigen::MatrixXd> grid_;
  Eigen::Ref<const Eigen::MatrixXd> middle_;
  std::span<const std::int8_t> arc_normal_;
  std::span<const std::uint32_t> breaks_;
  const FitOptions& options_;
  std::uint32_t periods_;
  std::int64_t ticks_per_period_;
  Position position_{};
  std::uint32_t lent_ = 0;  // periods that the blocks so far did not last
  std::size_t break_ = 0;
};

}  // namespace

std::vector<FittedBlock> fit_blocks(const Eigen::Ref<const Eigen::MatrixXd>& grid_mm,
                                    const Eigen::Ref<const Eigen::MatrixXd>& middle_mm,
                                    std::span<const std::int8_t> arc_normal, std::span<const std::uint32_t> breaks,
                                    const FitOptions& options) {
  if (grid_mm.cols() != axis_count || middle_mm.cols() != axis_count || grid_mm.rows() != middle_mm.rows() + 1 ||
      static_cast<Eigen::Index>(arc_normal.size()) != middle_mm.rows()) {
    throw Error(ErrorKind::argument, "fit_blocks needs n+1 grid rows, n middle rows and n plane entries of 3 axes");
  }
  if (!grid_mm.allFinite() || grid_mm.cwiseAbs().maxCoeff() > largest_position_mm) {
    throw Error(ErrorKind::argument, "a position is not finite or outside +-99999.999 mm");
  }
  return Fitter(grid_mm, middle_mm, arc_normal, breaks, options).run();
}

}  // namespace shapegcode
