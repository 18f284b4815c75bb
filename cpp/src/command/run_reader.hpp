#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "command/junctions.hpp"
#include "command/run_filter.hpp"
#include "command/run_motion.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// The samples of a motion from rest to rest on half the block grid: the command before shaping and, with a contour
/// target, its uncorrected deviation and the position on the path. Rows are read on request and freed after output, so
/// that memory does not grow with the motion. Corrections are stored with their rows; they are computed elsewhere.
///
/// The deviation is perpendicular to the path; its component along the path counts only near corners.
class RunReader {
 public:
  /// `motion`: along the path. `keeps_places`: tangents, target positions and segments are kept, too.
  RunReader(std::shared_ptr<const Path> path, std::shared_ptr<const RunMotion> motion, const RunFilter& filter,
            bool keeps_places);

  [[nodiscard]] const Path& path() const noexcept { return *path_; }
  [[nodiscard]] const RunMotion& motion() const noexcept { return *motion_; }
  [[nodiscard]] const Corners& corners() const noexcept { return corners_; }
  [[nodiscard]] const RunFilter& filter() const noexcept { return filter_; }
  /// Whole block periods of the shaped run.
  [[nodiscard]] std::uint32_t periods() const noexcept { return periods_; }
  /// Rows of the command before shaping, until it rests, and until the deviation rests too.
  [[nodiscard]] std::size_t rows_in() const noexcept { return rows_in_; }
  [[nodiscard]] std::size_t rows_error() const noexcept { return rows_in_ + reach_; }
  /// Rows by which any kernel acts ahead.
  [[nodiscard]] std::size_t reach() const noexcept { return reach_; }
  [[nodiscard]] std::size_t rows_read() const noexcept { return read_; }

  void read_to(std::size_t row);
  /// Drops what lies further behind row `out` than anything looks back.
  void forget(std::size_t out);

  [[nodiscard]] const double* error(std::size_t axis, std::size_t row) const noexcept {
    return error_[axis].data() + index(row);
  }
  [[nodiscard]] double* correction(std::size_t axis, std::size_t row) noexcept {
    return correction_[axis].data() + index(row);
  }
  /// The programmed feed where the shaped command is at a row, or a row beside it, in mm/s.
  [[nodiscard]] double programmed_feed(std::ptrdiff_t row) const noexcept;
  /// Place of a row in the set of shapers that are followed; 0 without one.
  [[nodiscard]] double place(std::size_t row) const noexcept { return place_.empty() ? 0.0 : place_[index(row)]; }
  /// Whether a row's deviation is worth a correction.
  [[nodiscard]] bool leaves_path(std::size_t row) const noexcept;
  /// What the corrections of the other axes do to an axis.
  [[nodiscard]] double crossed(std::size_t axis, std::size_t row) const noexcept;
  /// What the corrections leave of the deviation behind the kernel.
  [[nodiscard]] Vector3 left_of_error(std::size_t row) const noexcept;
  /// The command behind the shaper, with the corrections or without them.
  [[nodiscard]] double shaped(std::size_t axis, std::ptrdiff_t row, bool corrected) const noexcept;
  [[nodiscard]] Vector3 shaped(std::ptrdiff_t row, bool corrected) const noexcept {
    return {shaped(0, row, corrected), shaped(1, row, corrected), shaped(2, row, corrected)};
  }

  // Where the path is as a row is given out; only with keeps_places. The rows before the first one are like it.
  [[nodiscard]] const Vector3& tangent(std::size_t row) const noexcept { return tangent_[index(row)]; }
  [[nodiscard]] const Vector3& wanted(std::size_t row) const noexcept { return wanted_[index(row)]; }
  [[nodiscard]] std::uint32_t segment(std::ptrdiff_t row) const noexcept {
    return segment_[static_cast<std::size_t>(row - base_)];
  }

  /// Axis across the plane of an arc on which the command is around `row`, as far as `lead` rows ahead and as far as
  /// it takes the shaper behind it, or -1. Rows must ascend.
  [[nodiscard]] std::int8_t arc_normal(std::size_t row, std::size_t lead);

 private:
  using Column = std::vector<double>;
  struct ArcRow {
    std::size_t row = 0;
    std::int8_t normal = -1;
  };

  void read_row();
  void read_command();
  void read_error();
  /// What the columns of the axes come to at one of them, behind the kernels that are valid at their entry `i`.
  [[nodiscard]] double behind_kernels(std::size_t axis, const std::array<Column, axis_count>& columns,
                                      std::size_t i) const noexcept;
  /// The same of one of them.
  [[nodiscard]] double behind_kernel(std::size_t axis, std::size_t commanded, const Column& column,
                                     std::size_t i) const noexcept;
  [[nodiscard]] std::size_t index(std::size_t row) const noexcept {
    return static_cast<std::size_t>(static_cast<std::ptrdiff_t>(row) - base_);
  }

  std::shared_ptr<const Path> path_;
  std::shared_ptr<const RunMotion> motion_;
  Corners corners_;
  const RunFilter& filter_;
  bool keeps_places_;
  std::unique_ptr<RunRowsReader> ahead_;   // the command before shaping
  std::unique_ptr<RunRowsReader> target_;  // where the path should be: later by the shaper's mean delay
  std::size_t reach_ = 0;
  std::size_t rows_in_ = 0;
  std::uint32_t periods_ = 0;
  std::ptrdiff_t history_ = 0;              // rows kept behind what is given out
  std::ptrdiff_t base_ = 0;                 // row of the first entry of the columns
  std::size_t read_ = 0;                    // rows read
  std::array<Column, axis_count> command_;  // before shaping
  Column feed_;                             // programmed, of the command before shaping
  Column place_;                            // in the set of shapers that are followed, else empty
  std::array<Column, axis_count> error_;    // to be corrected
  std::array<Column, axis_count> correction_;
  std::vector<Vector3> tangent_;        // of the target, only where places are kept
  std::vector<Vector3> wanted_;         // likewise, its position
  std::vector<std::uint32_t> segment_;  // likewise
  std::deque<ArcRow> arcs_;             // rows on arcs that are still ahead
  ArcRow seen_;
  double since_corner_ = 1e300;  // rows
  double along_ = 0.0;           // how much the place along the path counts
  std::size_t segment_before_ = 0;
};

}  // namespace shapegcode
