#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/measure/contour.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// Deviation vectors of the response from the path that its command follows, for magnified pictures. `ContourTracker`
/// gives signed distances.
class PathFollower {
 public:
  /// Both are expected at the path's start. Throws Error(argument) on a path without segments.
  explicit PathFollower(const Path& path);
  /// The next samples of both, (k, 3), mm. Returns the vectors from foot to response, (k, 3), mm; rows that are not
  /// finite stay so. Throws Error(argument) if the two differ in length.
  [[nodiscard]] Eigen::MatrixXd step(const Eigen::Ref<const Eigen::MatrixXd>& command_mm,
                                     const Eigen::Ref<const Eigen::MatrixXd>& response_mm);

 private:
  Path path_;
  ContourTracker command_;
  ContourTracker response_;
  std::size_t cursor_ = 0;
};

/// Decimates curves over time: selects rows such that every curve, drawn straight between them, stays within its
/// tolerance at every omitted row (Douglas and Peucker 1973, with distance along the value). First and last row are
/// selected, and at least one of 512. `times`: (n), rising; `values`: (n, curves); `tolerances`: one for each curve,
/// above 0. O(n). Throws Error(argument) on other shapes, times that do not rise, a tolerance that is not above 0, or a
/// value that is not finite.
[[nodiscard]] std::vector<std::size_t> thin_curves(const Eigen::Ref<const Eigen::VectorXd>& times,
                                                   const Eigen::Ref<const Eigen::MatrixXd>& values,
                                                   const Eigen::Ref<const Eigen::VectorXd>& tolerances);

}  // namespace shapegcode
