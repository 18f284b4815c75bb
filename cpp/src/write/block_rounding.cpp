#include "write/block_rounding.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>

#include "path/arc_frame.hpp"
#include "write/rounding.hpp"

namespace shapegcode {
namespace {

// A position within this distance of an increment, in increments, is on it.
constexpr double on_increment = 1e-6;
// Memory stays bounded: a longer run is rounded in pieces of so many blocks.
constexpr std::size_t longest_section = 4096;
// Rounds in which blocks that a choice would spoil are taken back to their nearest ends; then the whole section is.
constexpr int max_rounds = 4;
// Distance that a block may stand still at its end and be left out of account, in increments.
constexpr double negligible_early = 0.1;

class BlockRounder {
 public:
  BlockRounder(std::vector<FittedBlock>& blocks, const Eigen::Ref<const Eigen::MatrixXd>& grid, const BlockShape& shape,
               std::uint32_t covered, std::span<const std::uint32_t> rests, const FitOptions& options)
      : blocks_(blocks),
        grid_(grid),
        shape_(shape),
        options_(options),
        covered_(covered),
        rests_(rests),
        limit_(std::max(1.0 - on_increment, options.merge_tolerance_increments)) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      rounders_.emplace_back(options.modes[axis], options.block_period_s,
                             static_cast<int>(std::lround(options.block_period_s / options.interpolation_period_s)));
      bulge_excitation_[axis].resize(options.modes[axis].size());
    }
  }

  void run() {
    from_ = shape_.rounded(0);
    while (first_ < blocks_.size()) {
      find_end();
      round_section();
      begin_period_ = end_of_blocks_;
      from_ = blocks_[first_ + count_ - 1].end;
      first_ += count_;
    }
  }

 private:
  // Period of the command at which a block ends, and the one before it.
  [[nodiscard]] std::uint32_t end_period(std::size_t block) const {
    return block + 1 < blocks_.size() ? blocks_[block + 1].first_period : covered_;
  }

  // The section goes to the last block that ends before the next rest, where everything behind it is rest.
  void find_end() {
    while (rest_ < rests_.size() && rests_[rest_] < end_period(first_)) {
      ++rest_;
    }
    const std::uint32_t rest = rest_ < rests_.size() ? rests_[rest_] : static_cast<std::uint32_t>(grid_.rows() - 1);
    count_ = 1;
    const std::size_t most = std::min(longest_section, blocks_.size() - first_);
    while (count_ < most && end_period(first_ + count_) <= rest) {
      ++count_;
    }
    const std::size_t behind = first_ + count_;
    at_rest_ = behind == blocks_.size() || end_period(behind) > rest;
    rest_period_ = rest;
  }

  void round_section() {
    starts_.resize(count_);
    std::uint32_t at = begin_period_;
    for (std::size_t n = 0; n < count_; ++n) {
      starts_[n] = at;
      at += blocks_[first_ + n].periods;
    }
    end_of_blocks_ = at;
    nearest_.resize(count_);
    for (std::size_t n = 0; n < count_; ++n) {
      nearest_[n] = blocks_[first_ + n].end;
    }
    forced_.assign(count_, false);
    forced_[count_ - 1] = true;
    for (std::size_t n = 0; n < count_; ++n) {
      if (is_rigid(n)) {
        force(n);
      }
    }
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      find_excitation(axis);
    }
    for (int round = 0;; ++round) {
      if (round == max_rounds) {
        forced_.assign(count_, true);
      }
      for (std::size_t axis = 0; axis < axis_count; ++axis) {
        if (rounders_[axis].mode_count() > 0) {
          choose(axis);
        }
      }
      if (shape_blocks() || round == max_rounds) {
        break;
      }
    }
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      rounders_[axis].accept();
      if (at_rest_) {
        std::fill(bulge_excitation_[axis].begin(), bulge_excitation_[axis].end(), 0.0);
      }
    }
  }

  void force(std::size_t n) {
    forced_[n] = true;
    if (n > 0) {
      forced_[n - 1] = true;
    }
  }

  [[nodiscard]] const BlockPosition& nearest_start(std::size_t n) const { return n == 0 ? from_ : nearest_[n - 1]; }

  // A block that does not stand for the periods that it lasts, or a long one whose F would not come out for any end.
  [[nodiscard]] bool is_rigid(std::size_t n) const {
    const FittedBlock& block = blocks_[first_ + n];
    if (starts_[n] != block.first_period || starts_[n] + block.periods != end_period(first_ + n)) {
      return true;
    }
    const double step_mm = options_.feed_unit_mm_per_s * options_.block_period_s * block.periods;
    return block.periods > 1 && step_mm > negligible_early * options_.increment_mm;
  }

  // Excitation of an axis' modes by the blocks between nearest ends, against the exact command, and by what the command
  // still moves behind the last one.
  void find_excitation(std::size_t axis) {
    ModalRounder& rounder = rounders_[axis];
    const std::size_t modes = rounder.mode_count();
    auto& excitation = excitation_[axis];
    excitation.assign(modes * count_, {});
    rest_excitation_[axis].assign(modes, {});
    if (modes == 0) {
      return;
    }
    for (std::size_t n = 0; n < count_; ++n) {
      const FittedBlock& block = blocks_[first_ + n];
      const std::span<std::complex<double>> at(&excitation[n * modes], modes);
      const auto from = static_cast<double>(nearest_start(n)[axis]);
      const double move = static_cast<double>(nearest_[n][axis]) - from;
      double reached = 0.0;
      follow(n, axis, [&](double fraction, double position) {
        const auto k = static_cast<Eigen::Index>(starts_[n]) + std::lround(fraction * block.periods);
        rounder.advance(at, position - reached - exact_step(k - 1, axis));
        reached = position;
      });
      rounder.advance(at, move - reached - exact_step(starts_[n] + block.periods - 1, axis));
      find_bulge(n, axis);
    }
    for (std::uint32_t k = end_of_blocks_; at_rest_ && k < rest_period_; ++k) {
      rounder.advance(rest_excitation_[axis], -exact_step(k, axis));
    }
  }

  // What the curvature of arcs leaves against straight lines between the borders of periods.
  void find_bulge(std::size_t n, std::size_t axis) {
    const FittedBlock& block = blocks_[first_ + n];
    auto& excitation = bulge_excitation_[axis];
    const ModalRounder& rounder = rounders_[axis];
    if (block.kind == FittedKind::line || axis == block.normal) {
      for (std::uint32_t i = 0; i < block.periods; ++i) {
        rounder.advance(excitation, 0.0);
      }
      return;
    }
    const ChordArc arc = shape_.arc_of(nearest_start(n), block);
    const Eigen::Index row = static_cast<std::size_t>(ArcFrame(block.normal).a) == axis ? 0 : 1;
    double before = arc.at(0.0)[row];
    for (std::uint32_t i = 0; i < block.periods; ++i) {
      const double middle = arc.at((i + 0.5) / block.periods)[row];
      const double behind = arc.at((i + 1.0) / block.periods)[row];
      rounder.advance(excitation, 0.0);
      rounder.bulge(excitation, (middle - 0.5 * (before + behind)) / options_.increment_mm);
      before = behind;
    }
  }

  [[nodiscard]] double exact(Eigen::Index k, std::size_t axis) const {
    return grid_(k, static_cast<Eigen::Index>(axis)) / options_.increment_mm;
  }

  [[nodiscard]] double exact_step(Eigen::Index k, std::size_t axis) const {
    return exact(k + 1, axis) - exact(k, axis);
  }

  // Calls `visit` with every border of periods within a block and its travel so far there, between nearest ends.
  template <typename Visit>
  void follow(std::size_t n, std::size_t axis, const Visit& visit) const {
    const FittedBlock& block = blocks_[first_ + n];
    if (block.periods == 1) {
      return;
    }
    const BlockPosition& from = nearest_start(n);
    const double move = static_cast<double>(nearest_[n][axis] - from[axis]);
    std::optional<ChordArc> arc;
    Eigen::Index row = 0;
    if (block.kind != FittedKind::line && axis != block.normal) {
      FittedBlock nearest = block;
      nearest.end = nearest_[n];
      arc = shape_.arc_of(from, nearest);
      row = static_cast<std::size_t>(ArcFrame(block.normal).a) == axis ? 0 : 1;
    }
    for (std::uint32_t i = 1; i < block.periods; ++i) {
      const double fraction = static_cast<double>(i) / block.periods;
      visit(fraction, arc ? (arc->at(fraction)[row] - arc->start[row]) / options_.increment_mm : move * fraction);
    }
  }

  void choose(std::size_t axis) {
    nodes_.resize(count_);
    shift_.resize(count_);
    for (std::size_t n = 0; n < count_; ++n) {
      RoundingNode& node = nodes_[n];
      const double position = exact(end_period(first_ + n), axis);
      node.periods = blocks_[first_ + n].periods;
      node.error = static_cast<double>(nearest_[n][axis]) - position;
      node.other = forced_[n] || std::abs(node.error) < on_increment ? std::int8_t{0}
                   : node.error < 0.0                                ? std::int8_t{1}
                                                                     : std::int8_t{-1};
      node.allowed = allowed(n, axis);
    }
    RoundingEnd end;
    if (at_rest_) {
      end = {true, bulge_excitation_[axis], rest_period_ - std::min(rest_period_, end_of_blocks_),
             rest_excitation_[axis]};
    }
    rounders_[axis].choose(nodes_, excitation_[axis], end, shift_);
    for (std::size_t n = 0; n < count_; ++n) {
      blocks_[first_ + n].end[axis] = nearest_[n][axis] + shift_[n];
    }
  }

  // Which ends of a block go together: none against the motion, none that leaves nothing of the block, none that takes
  // its inside out of tolerance.
  [[nodiscard]] std::uint8_t allowed(std::size_t n, std::size_t axis) const {
    const std::int8_t before = n == 0 ? std::int8_t{0} : nodes_[n - 1].other;
    const std::int8_t after = nodes_[n].other;
    if (before == 0 && after == 0) {
      return 0xF;
    }
    const double step = exact(end_period(first_ + n), axis) - exact(blocks_[first_ + n].first_period, axis);
    const std::int64_t move = nearest_[n][axis] - nearest_start(n)[axis];
    const bool carries = carries_block(n, axis);
    std::uint8_t mask = 1;
    for (unsigned pair = 1; pair < 4; ++pair) {
      const int from = (pair & 2U) != 0 ? before : 0;
      const int to = (pair & 1U) != 0 ? after : 0;
      const std::int64_t travel = move + to - from;
      const bool still = std::abs(step) < on_increment;
      if ((still && travel != 0) || (!still && step > 0.0 && travel < 0) || (!still && step < 0.0 && travel > 0) ||
          (carries && travel == 0) || !stays_inside(n, axis, from, to)) {
        continue;
      }
      mask = static_cast<std::uint8_t>(mask | 1U << pair);
    }
    return mask;
  }

  // Whether the axis is the one that moves most, which must not come to a stand.
  [[nodiscard]] bool carries_block(std::size_t n, std::size_t axis) const {
    const BlockPosition& from = nearest_start(n);
    const auto travel = [&](std::size_t i) { return std::abs(nearest_[n][i] - from[i]); };
    for (std::size_t i = 0; i < axis_count; ++i) {
      if (travel(i) > travel(axis) || (travel(i) == travel(axis) && i < axis)) {
        return false;
      }
    }
    return true;
  }

  [[nodiscard]] bool stays_inside(std::size_t n, std::size_t axis, int from, int to) const {
    const auto start = static_cast<double>(nearest_start(n)[axis]);
    const auto first = static_cast<Eigen::Index>(starts_[n]);
    bool inside = true;
    follow(n, axis, [&](double fraction, double position) {
      const auto k = first + std::lround(fraction * blocks_[first_ + n].periods);
      const double off = start + position + from + (to - from) * fraction - exact(k, axis);
      inside = inside && std::abs(off) <= limit_;
    });
    return inside;
  }

  // Gives the blocks F and R for the ends chosen. False if one would be spoilt: its ends are the nearest ones from then
  // on.
  bool shape_blocks() {
    bool good = true;
    shaped_.resize(count_);
    for (std::size_t n = 0; n < count_; ++n) {
      const FittedBlock& block = blocks_[first_ + n];
      const BlockPosition& from = n == 0 ? from_ : blocks_[first_ + n - 1].end;
      shaped_[n] = block;
      if (from == nearest_start(n) && block.end == nearest_[n]) {
        continue;
      }
      bool fits = false;
      if (block.kind == FittedKind::line) {
        const auto feed = shape_.feed((shape_.to_mm(block.end) - shape_.to_mm(from)).norm(), block.periods);
        fits = feed.has_value();
        shaped_[n].feed = feed.value_or(block.feed);
      } else {
        const auto arc = shape_.arc(from, block.end, {block.first_period, end_period(first_ + n)}, block.normal,
                                    block.periods, std::max(limit_, options_.merge_tolerance_increments + 0.25));
        fits = arc && arc->kind == block.kind;
        if (fits) {
          shaped_[n] = *arc;
        }
      }
      if (!fits) {
        force(n);
        good = false;
      }
    }
    if (good) {
      std::copy(shaped_.begin(), shaped_.end(), blocks_.begin() + static_cast<std::ptrdiff_t>(first_));
    }
    return good;
  }

  std::vector<FittedBlock>& blocks_;
  Eigen::Ref<const Eigen::MatrixXd> grid_;
  const BlockShape& shape_;
  const FitOptions& options_;
  std::uint32_t covered_;
  std::span<const std::uint32_t> rests_;
  double limit_;  // increments by which a block may be off its command
  std::vector<ModalRounder> rounders_;

  // The section under work: blocks first_ ... first_ + count_ - 1.
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::size_t rest_ = 0;
  bool at_rest_ = false;
  std::uint32_t rest_period_ = 0;
  std::uint32_t begin_period_ = 0;   // in which it begins when simulated, which lags where time was lent
  std::uint32_t end_of_blocks_ = 0;  // period in which it ends when simulated
  BlockPosition from_{};             // where it begins
  std::vector<std::uint32_t> starts_;
  std::vector<BlockPosition> nearest_;
  std::vector<bool> forced_;  // to the nearest end
  std::array<std::vector<std::complex<double>>, axis_count> excitation_;
  std::array<std::vector<std::complex<double>>, axis_count> rest_excitation_;
  std::array<std::vector<std::complex<double>>, axis_count> bulge_excitation_;  // since the last rest
  std::vector<RoundingNode> nodes_;
  std::vector<std::int8_t> shift_;
  std::vector<FittedBlock> shaped_;
};

}  // namespace

void round_for_vibration(std::vector<FittedBlock>& blocks, const Eigen::Ref<const Eigen::MatrixXd>& grid_mm,
                         const BlockShape& shape, std::uint32_t covered, std::span<const std::uint32_t> rests,
                         const FitOptions& options) {
  BlockRounder(blocks, grid_mm, shape, covered, rests, options).run();
}

}  // namespace shapegcode
