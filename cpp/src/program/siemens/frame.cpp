#include "program/siemens/frame.hpp"

#include <Eigen/LU>
#include <cmath>

namespace shapegcode::siemens {
namespace {

constexpr double smallest = 1e-12;

Vector3 product(const Eigen::Matrix3d& matrix, const Vector3& point) {
  Vector3 found = Vector3::Zero();
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (std::abs(matrix(row, k)) >= smallest) found[row] += matrix(row, k) * point[k];
    }
  }
  return found;
}

}  // namespace

Frame::Frame(const Eigen::Matrix3d& linear, const Vector3& offset)
    : linear_(linear), offset_(offset), is_shift_(linear == Eigen::Matrix3d::Identity()) {
  if (!is_shift_) inverse_ = linear.partialPivLu().solve(Eigen::Matrix3d::Identity());
}

Frame Frame::then(const Frame& other) const {
  return {linear_ * other.linear_, Vector3(offset_ + linear_ * other.offset_)};
}

Vector3 Frame::apply(const Vector3& point) const { return offset_ + product(linear_, point); }

Vector3 Frame::undo(const Vector3& point) const { return product(inverse_, point - offset_); }

}  // namespace shapegcode::siemens
