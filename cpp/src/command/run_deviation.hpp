#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "command/run_reader.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/plant/modal.hpp"

namespace shapegcode {

/// Largest deviation of the contour target near each junction and segment of a motion from rest to rest, in mm.
struct RunDeviation {
  std::vector<float> at_junction;  ///< [i]: while segment i is entered, within half the shaper
  std::vector<float> on_segment;   ///< further than that from every corner; negative: nowhere
  std::vector<float> near_corner;  ///< [i]: on segment i, within half the shaper of a corner
  float largest = 0.0F;            ///< of them all
};

/// Finds them row by row, behind the corrections.
class DeviationMeter {
 public:
  /// `rows` must keep places.
  DeviationMeter(RunReader& rows, RunDeviation& measured);

  /// To be called for each row in turn, once its correction and that of the next row are final.
  void measure(std::size_t row);
  /// The shaped command, corrected, at the row that was measured last.
  [[nodiscard]] const Vector3& shaped() const noexcept { return shaped_; }

 private:
  [[nodiscard]] Vector3 deviation(std::size_t row);
  [[nodiscard]] double across_path(std::size_t row);
  [[nodiscard]] Vector3 as_block(std::size_t row) const noexcept;
  /// Distance by which the last rows up to `row` miss a corner.
  [[nodiscard]] double missed_by(const Vector3& corner, std::size_t row) const noexcept;
  [[nodiscard]] Vector3& left(std::size_t row) noexcept { return left_[row % left_.size()]; }
  [[nodiscard]] const Vector3& left(std::size_t row) const noexcept { return left_[row % left_.size()]; }

  RunReader& rows_;
  RunDeviation& measured_;
  std::size_t half_;                   // of the shaper, rows
  std::unique_ptr<ModalPlant> plant_;  // of the response; null where modes move
  // Of a motion that leaves the path by itself: what follows it is measured against the path.
  std::optional<ContourTracker> tracker_;
  std::array<Vector3, 16> left_{};  // deviations of the last rows
  Vector3 shaped_before_ = Vector3::Zero();
  Vector3 shaped_ = Vector3::Zero();
  Vector3 shaped_next_ = Vector3::Zero();
};

}  // namespace shapegcode
