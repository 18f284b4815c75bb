#include "shapegcode/write.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "path/arc_frame.hpp"
#include "shapegcode/error.hpp"
#include "write/block_rounding.hpp"
#include "write/block_shape.hpp"
#include "write/feed_words.hpp"
#include "write/smooth_arcs.hpp"

namespace shapegcode {
namespace {

constexpr double largest_position_mm = 99999.999;
// Length to which a line is tried beyond its last valid end; keeps the time of the fit linear in the program's length.
constexpr std::uint32_t line_patience = 2048;
constexpr std::uint32_t longest_arc_periods = 65536;
constexpr double straight_increments = 0.05;  // from its chord: the command is a steady line

using Position = BlockPosition;

// A block and how many periods of the command it stands for; what it does not last is lent to its successor.
struct Candidate {
  FittedBlock block;
  std::uint32_t covered = 0;
};

// The slopes, in increments per period, of lines from a point that stay within a tolerance of every sample so far.
class Cone {
 public:
  explicit Cone(double tolerance_increments) : tolerance_(tolerance_increments) {}

  [[nodiscard]] bool holds(const Vector3& slope) const {
    return (slope.array() >= lowest_).all() && (slope.array() <= highest_).all();
  }
  // Takes a sample in; false if no line is left.
  bool narrow(const Vector3& offset, double steps) {
    lowest_ = lowest_.max((offset.array() - tolerance_) / steps);
    highest_ = highest_.min((offset.array() + tolerance_) / steps);
    return (lowest_ <= highest_).all();
  }

 private:
  static constexpr double endless = std::numeric_limits<double>::infinity();

  double tolerance_;
  Eigen::Array3d lowest_ = Eigen::Array3d::Constant(-endless);
  Eigen::Array3d highest_ = Eigen::Array3d::Constant(endless);
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
        shape_(grid, middle, options),
        periods_(static_cast<std::uint32_t>(middle.rows())) {}

  std::vector<FittedBlock> run(std::span<const std::uint32_t> rests) {
    std::vector<FittedBlock> blocks;
    position_ = shape_.rounded(0);
    std::uint32_t k = 0;
    while (k < periods_) {
      const std::optional<Candidate> best = fit(k, next_limit(k));
      if (!best) {
        break;  // rest to the end
      }
      k += best->covered;
      lent_ += best->covered - best->block.periods;
      position_ = best->block.end;
      blocks.push_back(best->block);
    }
    left_ = lent_ + (periods_ - k);
    const auto has_modes = [](const std::vector<Mode>& modes) { return !modes.empty(); };
    if (std::any_of(options_.modes.begin(), options_.modes.end(), has_modes)) {
      round_for_vibration(blocks, grid_, shape_, k, rests, options_);
    }
    end_with_arc(blocks);
    if (options_.smooth_arcs_mm > 0.0) {
      smooth_arcs(blocks, shape_.rounded(0), shape_, options_.smooth_arcs_mm, options_.increment_mm);
    }
    shorten_feeds(blocks, shape_.rounded(0), shape_);
    return blocks;
  }

  [[nodiscard]] std::uint32_t left_periods() const noexcept { return left_; }

 private:
  // Makes the last line an arc where the original ends with one. A line that does not move in the arc's plane (the end
  // of a steep helix) gets one increment of travel in it from its predecessor.
  void end_with_arc(std::vector<FittedBlock>& blocks) const {
    if (options_.last_kind == FittedKind::line || blocks.empty()) {
      return;
    }
    FittedBlock& last = blocks.back();
    const int normal = options_.last_normal;
    if (last.kind == options_.last_kind && last.normal == normal) {
      return;
    }
    const auto start_of = [&](std::size_t i) { return i == 0 ? shape_.rounded(0) : blocks[i - 1].end; };
    if (plane_travel(start_of(blocks.size() - 1), last.end, normal) == 0.0 && !lend_increment(blocks, normal)) {
      return;  // no move in the plane at all: the original's arc is shorter than an increment
    }
    const Position start = start_of(blocks.size() - 1);
    const double chord = plane_travel(start, last.end, normal);
    last.radius = std::llround(std::max(options_.last_radius_mm, chord) / options_.increment_mm);
    last.kind = options_.last_kind;
    last.normal = options_.last_normal;
    const double radius = static_cast<double>(last.radius) * options_.increment_mm;
    const double climb = shape_.to_mm(last.end)[normal] - shape_.to_mm(start)[normal];
    shape_.set_feed(last, std::hypot(2.0 * radius * std::asin(0.5 * chord / radius), climb));
  }

  [[nodiscard]] double plane_travel(const Position& from, const Position& to, int normal) const {
    return ArcFrame(normal).radius(shape_.to_mm(to), shape_.to_mm(from));
  }

  // Takes one increment of the last travel in the plane from the line that made it, or from the line before the last
  // block.
  [[nodiscard]] bool lend_increment(std::vector<FittedBlock>& blocks, int normal) const {
    for (std::size_t i = blocks.size() - 1; i-- > 0;) {
      const Position start = i == 0 ? shape_.rounded(0) : blocks[i - 1].end;
      const auto a = static_cast<std::size_t>(ArcFrame(normal).a);
      const auto b = static_cast<std::size_t>(ArcFrame(normal).b);
      const std::size_t axis = blocks[i].end[a] != start[a] ? a : b;
      const std::int64_t travel = blocks[i].end[axis] - start[axis];
      Position behind = blocks[i].end;
      behind[axis] -= travel > 0 ? 1 : -1;
      if (travel == 0 || behind == start) {
        continue;
      }
      // All blocks from there to the last but one stay one increment behind; lines only, so that no arc changes its
      // shape.
      for (std::size_t k = i; k + 1 < blocks.size(); ++k) {
        if (blocks[k].kind != FittedKind::line) {
          return false;
        }
      }
      for (std::size_t k = i; k + 1 < blocks.size(); ++k) {
        blocks[k].end[axis] -= travel > 0 ? 1 : -1;
      }
      shape_.set_feed(blocks[i], (shape_.to_mm(blocks[i].end) - shape_.to_mm(start)).norm());
      return true;
    }
    return false;
  }

  std::uint32_t next_break(std::uint32_t k) {
    while (break_ < breaks_.size() && breaks_[break_] <= k) {
      ++break_;
    }
    return break_ < breaks_.size() ? std::min(breaks_[break_], periods_) : periods_;
  }

  // The block from period k: the longest line, or the arc that is longer.
  std::optional<Candidate> fit(std::uint32_t k, std::uint32_t limit) {
    const std::optional<Candidate> line = fit_line(k, limit);
    if (line && arc_normal_[k] >= 0) {
      if (const auto arc = fit_arc(k, limit, bends(k) ? 1 : line->covered + 1)) {
        return arc;
      }
    }
    return line;
  }

  // Where the block from period k must end: at a break, or as one of equal blocks.
  std::uint32_t next_limit(std::uint32_t k) {
    const std::uint32_t limit = next_break(k);
    const double travel = (grid_.row(k + 1) - grid_.row(k)).norm() / options_.increment_mm;
    const double ticks = options_.block_period_s / options_.interpolation_period_s;
    if (options_.most_periods >= limit - k || travel <= options_.equal_above_increments * ticks) {
      return limit;
    }
    const std::uint32_t margin = options_.equal_periods;
    if (margin > 0 && k >= looked_until_) {
      const auto whole = fit(k, limit);
      const std::uint32_t covered = whole ? whole->covered : 1;
      looked_until_ = k + covered;
      free_from_ = covered / 2 > margin ? k + margin : looked_until_;
    }
    // What happens in the middle of a long block is forgotten before it ends.
    return margin > 0 && k >= free_from_ && k + margin < looked_until_ ? looked_until_ - margin
                                                                       : k + options_.most_periods;
  }

  // Deviation of the path's middle from the chord within one period, in the plane of the arc it follows.
  [[nodiscard]] Eigen::Vector2d bump(std::uint32_t k, int normal) const {
    const int a = ArcFrame(normal).a;
    const int b = ArcFrame(normal).b;
    return {middle_(k, a) - 0.5 * (grid_(k, a) + grid_(k + 1, a)),
            middle_(k, b) - 0.5 * (grid_(k, b) + grid_(k + 1, b))};
  }

  [[nodiscard]] bool bends(std::uint32_t k) const {
    const int normal = arc_normal_[k];
    return normal >= 0 && bump(k, normal).norm() > 0.5 * options_.increment_mm;
  }

  [[nodiscard]] Candidate line_to(const Position& end, double length, std::uint32_t k, std::uint32_t covered) const {
    Candidate line{{end, 0, 0, k, covered + lent_, FittedKind::line, 2}, covered};
    shape_.set_feed(line.block, length);
    return line;
  }

  // Longest line from period k that stays within the merge tolerance of every sample; or, where the command itself is
  // straight, one that is off by the rounding of its ends alone.
  std::optional<Candidate> fit_line(std::uint32_t k, std::uint32_t limit) {
    Cone near(options_.merge_tolerance_increments + 1e-6);
    Cone straight(straight_increments);
    const Vector3 start = grid_.row(k) / options_.increment_mm;
    const Vector3 from = in_increments(position_);
    std::optional<Candidate> best;
    std::optional<Candidate> forward;  // the one whose end is rounded furthest ahead
    double most_ahead = -std::numeric_limits<double>::infinity();
    std::uint32_t reached = 0;  // periods over which it could be one line, but for F
    for (std::uint32_t j = k + 1; j <= periods_; ++j) {
      if (best && (j > limit || bends(j - 1) || j - k > best->covered + line_patience)) {
        break;
      }
      const double steps = j - k;
      const Position end = shape_.rounded(j);
      const Vector3 sample = grid_.row(j) / options_.increment_mm;
      const Vector3 to = in_increments(end);
      // The end itself is off by its own rounding, at most half an increment, and need not obey the cone.
      const bool inside_near = near.holds((to - from) / steps);
      const bool inside = straight.holds((sample - start) / steps) || inside_near;
      const bool near_open = near.narrow(sample - from, steps);
      const bool open = straight.narrow(sample - start, steps) || near_open;
      if (end != position_ && (inside || !best)) {
        reached = inside ? j - k : reached;
        const double length = (shape_.to_mm(end) - shape_.to_mm(position_)).norm();
        if (const auto f = shape_.feed(length, j - k + lent_)) {
          best = Candidate{{end, 0, *f, k, j - k + lent_, FittedKind::line, 2}, j - k};
          const double ahead = (to - sample).dot((sample - start).normalized());
          if (inside && ahead > most_ahead) {
            most_ahead = ahead;
            forward = best;
          }
        } else if (!best) {
          best = line_to(end, length, k, j - k);
        }
      }
      if (best && !open) {
        break;
      }
    }
    // A block at the F of a steady line cannot catch up: from an end that is rounded backwards no far one is reached.
    return forward && reached > 2 * best->covered ? forward : best;
  }

  [[nodiscard]] std::optional<Candidate> arc_over(std::uint32_t k, std::uint32_t j, int normal) const {
    const auto block = shape_.arc(position_, shape_.rounded(j), {k, j}, normal, j - k + lent_,
                                  options_.merge_tolerance_increments + 0.25);
    return block ? std::optional(Candidate{*block, j - k}) : std::nullopt;
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
  BlockShape shape_;
  std::uint32_t periods_;
  Position position_{};
  std::uint32_t lent_ = 0;  // periods that the blocks so far did not last
  std::uint32_t left_ = 0;  // likewise, at the end
  std::size_t break_ = 0;
  std::uint32_t looked_until_ = 0;  // end of the block that would be written were it not for equal ones
  std::uint32_t free_from_ = 0;     // where it is far from its start
};

// Time that was lent from before is rest in front of the command.
std::vector<FittedBlock> fit_behind_rest(const Eigen::Ref<const Eigen::MatrixXd>& grid,
                                         const Eigen::Ref<const Eigen::MatrixXd>& middle,
                                         std::span<const std::int8_t> arc_normal, const FitBorders& borders,
                                         FitOptions options, std::uint32_t* left_periods) {
  const std::uint32_t lent = std::exchange(options.lent_periods, 0U);
  Eigen::MatrixXd longer(grid.rows() + lent, axis_count);
  longer.topRows(lent).rowwise() = Vector3(grid.row(0)).transpose();
  longer.bottomRows(grid.rows()) = grid;
  Eigen::MatrixXd longer_middle(middle.rows() + lent, axis_count);
  longer_middle.topRows(lent).rowwise() = Vector3(grid.row(0)).transpose();
  longer_middle.bottomRows(middle.rows()) = middle;
  std::vector<std::int8_t> normals(lent, std::int8_t{-1});
  normals.insert(normals.end(), arc_normal.begin(), arc_normal.end());
  const auto later = [lent](std::span<const std::uint32_t> periods) {
    std::vector<std::uint32_t> result(periods.begin(), periods.end());
    std::ranges::for_each(result, [lent](std::uint32_t& period) { period += lent; });
    return result;
  };
  const auto breaks = later(borders.breaks);
  const auto rests = later(borders.rests);
  std::vector<FittedBlock> blocks = fit_blocks(longer, longer_middle, normals, {breaks, rests}, options, left_periods);
  for (FittedBlock& block : blocks) {
    block.first_period -= std::min(block.first_period, lent);
  }
  return blocks;
}

}  // namespace

std::vector<FittedBlock> fit_blocks(const Eigen::Ref<const Eigen::MatrixXd>& grid_mm,
                                    const Eigen::Ref<const Eigen::MatrixXd>& middle_mm,
                                    std::span<const std::int8_t> arc_normal, const FitBorders& borders,
                                    const FitOptions& options, std::uint32_t* left_periods) {
  if (grid_mm.cols() != axis_count || middle_mm.cols() != axis_count || grid_mm.rows() != middle_mm.rows() + 1 ||
      static_cast<Eigen::Index>(arc_normal.size()) != middle_mm.rows()) {
    throw Error(ErrorKind::argument, "fit_blocks needs n+1 grid rows, n middle rows and n plane entries of 3 axes");
  }
  if (!grid_mm.allFinite() || grid_mm.cwiseAbs().maxCoeff() > largest_position_mm) {
    throw Error(ErrorKind::argument, "a position is not finite or outside +-99999.999 mm");
  }
  if (options.lent_periods > 0) {
    return fit_behind_rest(grid_mm, middle_mm, arc_normal, borders, options, left_periods);
  }
  Fitter fitter(grid_mm, middle_mm, arc_normal, borders.breaks, options);
  std::vector<FittedBlock> blocks = fitter.run(borders.rests);
  if (left_periods != nullptr) {
    *left_periods = fitter.left_periods();
  }
  return blocks;
}

}  // namespace shapegcode
