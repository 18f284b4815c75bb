#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "shapegcode/filter/fir.hpp"
#include "shapegcode/filter/varying_fir.hpp"
#include "shapegcode/motion/interpolator.hpp"
#include "shapegcode/path/path.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/shaping/contour_kernel.hpp"
#include "shapegcode/shaping/contour_solver.hpp"

namespace shapegcode {

/// Change of direction as segment `i` >= 1 of a path is entered: the length of the difference of the unit tangents.
[[nodiscard]] double junction_change(const Path& path, std::size_t i) noexcept;

/// From this `junction_change` on a junction is a corner: 5 degrees. Smoother junctions of polylines are curves.
inline constexpr double corner_change = 0.0872;

/// What follows the look-ahead of a run, on half the block grid, and how the contour is kept.
struct RunFilter {
  /// `shapers`: taps in whole block periods, one common to all axes or one for each, of one mean delay. `followed`: a
  /// set of shapers along an axis, which is used instead of it; the contour is then kept with the modes at each of its
  /// positions, by `tables`. Throws as `contour_kernel` and ContourSolver do.
  RunFilter(std::span<const Fir> shapers, ContourTarget target, const AxisModes& modes, double block_period_s,
            double smoothness, const std::optional<FollowingFir>& followed = {}, const AxisModeTables& tables = {});

  /// Half block periods by which the shaped command moves longer.
  [[nodiscard]] int shaper_rows() const noexcept { return following ? following->fir().duration_samples() : longest_; }

  std::vector<Fir> half_shapers;          ///< one per axis, taps in half block periods
  std::optional<FollowingFir> following;  ///< likewise, instead of it
  ContourTarget target;
  AxisModes modes;
  double half_period_s;
  double mean_delay_s;                                               ///< of the shaper
  std::vector<std::array<std::vector<double>, axis_count>> kernels;  ///< one per shaper that is followed
  double smoothness;

 private:
  int longest_ = 0;
};

/// What the axes may do while the contour is corrected. A stretch whose plain shaping asks for more keeps what it asks.
struct RunLimits {
  Vector3 max_speed_mm_per_s = Vector3::Constant(1e300);
  Vector3 max_acceleration_mm_per_s2 = Vector3::Constant(1e300);
};

/// Largest deviation of what follows the path, near each junction and segment of a run, in mm.
struct RunDeviation {
  std::vector<float> at_junction;  ///< [i]: while segment i is entered, within half the shaper
  std::vector<float> on_segment;   ///< further than that from every corner; negative: nowhere
  std::vector<float> near_corner;  ///< [i]: on segment i, within half the shaper of a corner
};

/// One run from rest to rest as a shaped command on half the block grid: row 2k is the border k of block periods, row
/// 2k+1 the middle of period k. With a target, the command before shaping is corrected so that the shaped command or
/// the response keeps to the path (spec 5): windows around the places where it would leave it, solved per axis, carried
/// on where they are long; memory does not grow with the run. The correction is zero at both ends of the run: nothing
/// moves before the start and nothing is added behind the stop.
///
/// The deviation that is corrected is the one across the path; along it only near corners, where time cannot be given
/// away. Where the corrected command would ask more of an axis than `limits`, the correction is made smoother there,
/// down to none.
class RunShaper {
 public:
  /// `step_s`: sampling step of the path, half a block period over a whole number. `measured`: filled while the run is
  /// read if not null.
  RunShaper(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile, const RunFilter& filter,
            const RunLimits& limits, std::size_t steps_per_half, RunDeviation* measured = nullptr);

  /// Whole block periods of the shaped run.
  [[nodiscard]] std::uint32_t periods() const noexcept { return periods_; }
  /// Next row of the shaped command; call 2*periods()+1 times.
  void next(Vector3& position);
  /// Axis across the plane of an arc that the command follows in the period that begins at the row last given, or -1.
  [[nodiscard]] std::int8_t arc_normal();

 private:
  using Column = std::vector<double>;
  struct ArcRow {
    std::size_t row = 0;
    std::int8_t normal = -1;
  };

  void read_to(std::size_t row);
  void read_row();
  void decide_to(std::size_t row);
  void correct(std::size_t begin, std::size_t end, std::size_t accepted);
  [[nodiscard]] bool asks_too_much(std::size_t begin, std::size_t end, std::size_t axis);
  [[nodiscard]] bool active(std::size_t row) const noexcept;
  [[nodiscard]] Vector3 deviation(std::size_t row);
  [[nodiscard]] Vector3 as_block(std::size_t row) const noexcept;
  void measure(std::size_t row);
  void forget();
  [[nodiscard]] double shaped(std::size_t axis, std::ptrdiff_t row, bool corrected) const noexcept;
  /// What a column comes to behind the kernel that is valid at its entry `i`.
  [[nodiscard]] double behind_kernel(std::size_t axis, const Column& column, std::size_t i) const noexcept;
  [[nodiscard]] std::size_t index(std::size_t row) const noexcept {
    return static_cast<std::size_t>(static_cast<std::ptrdiff_t>(row) - base_);
  }

  std::shared_ptr<const Path> path_;
  const RunFilter& filter_;
  RunLimits limits_;
  RunDeviation* measured_;
  std::size_t steps_per_half_;
  Interpolator ahead_;                    // the command before shaping
  std::unique_ptr<Interpolator> target_;  // where the path should be: later by the shaper's mean delay
  std::vector<std::array<ContourSolver, axis_count>> solvers_;  // one per shaper that is followed
  std::size_t reach_ = 0;                                       // samples by which any kernel acts ahead
  std::size_t margin_ = 0;  // samples by which a window is longer than what it corrects

  std::size_t rows_in_ = 0;     // of the command before shaping, until it rests
  std::size_t rows_error_ = 0;  // until the error rests too
  std::uint32_t periods_ = 0;
  std::ptrdiff_t history_ = 0;              // rows kept behind what is given out
  std::ptrdiff_t base_ = 0;                 // row of the first entry of the columns
  std::size_t read_ = 0;                    // rows read
  std::size_t scan_ = 0;                    // rows looked at for something to correct
  std::size_t decided_ = 0;                 // rows whose correction is final
  std::size_t out_ = 0;                     // rows given out
  std::array<Column, axis_count> command_;  // before shaping
  Column place_;                            // in the set of shapers that are followed, else empty
  std::array<Column, axis_count> error_;    // to be corrected
  std::array<Column, axis_count> correction_;
  std::vector<Vector3> tangent_;        // of the target, only where deviations are measured
  std::vector<Vector3> wanted_;         // likewise, its position
  std::vector<std::uint32_t> segment_;  // likewise
  std::vector<Vector3> left_;           // likewise, the deviation
  std::unique_ptr<ModalPlant> plant_;   // likewise, of the response; null where modes move
  std::deque<ArcRow> arcs_;             // rows on arcs that are still ahead
  ArcRow seen_;
  double since_corner_ = 1e300;  // rows
  double along_ = 0.0;           // how much the place along the path counts
  std::size_t segment_before_ = 0;
  Column window_, stiffness_;
  std::vector<std::size_t> raised_;
};

}  // namespace shapegcode
