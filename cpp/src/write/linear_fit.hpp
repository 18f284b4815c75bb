#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "shapegcode/linear_feed.hpp"

namespace shapegcode {

/// The command of blocks of constant feed at the ends of its periods, and the ends of blocks among them.
struct CommandPoints {
  CommandPoints(const Path& path, double period_s);

  std::vector<Vector3> points;
  std::vector<std::size_t> knots;  ///< of each block its start, and the end of the last one: an index into `points`
};

/// Chooses joined blocks one after another, each as long as possible.
class LinearFit {
 public:
  LinearFit(const Path& path, double period_s, double tolerance_mm, std::span<const std::uint32_t> joints);

  [[nodiscard]] std::vector<LinearBlock> blocks();
  [[nodiscard]] const CommandPoints& command() const noexcept { return command_; }
  [[nodiscard]] double period_s() const noexcept { return period_s_; }
  [[nodiscard]] double tolerance_mm() const noexcept { return tolerance_mm_; }

 private:
  /// A line or an arc between two ends of blocks, and the command relative to it.
  struct Shape {
    double length_mm = 0.0;
    double radius_mm = 0.0;
    double sweep_rad = 0.0;
    std::vector<double> along_mm;  ///< of the periods between its ends
    std::vector<double> aside_mm;
  };
  /// A block, and how late it ends.
  struct Timed {
    LinearBlock block;
    double late_s = 0.0;
  };
  using Found = std::optional<Timed>;

  [[nodiscard]] bool is_joint(std::size_t block) const noexcept;
  [[nodiscard]] std::size_t size() const noexcept { return segments_.size(); }
  [[nodiscard]] double duration_s(std::size_t at, std::size_t end) const noexcept;
  [[nodiscard]] double speed_at(std::size_t knot) const noexcept;
  [[nodiscard]] double bias(std::size_t at, std::size_t end) const noexcept;
  [[nodiscard]] Timed single(std::size_t at, double late_s);
  [[nodiscard]] Timed constant(std::size_t at, double late_s) const;
  [[nodiscard]] Found begun(std::size_t at, double late_s);
  [[nodiscard]] Found longest(std::size_t at, std::optional<double> speed, double late_s);
  [[nodiscard]] Found block(std::size_t at, std::size_t end, double speed, double late_s, bool sets_feed);
  [[nodiscard]] LinearBlock made(std::size_t at, std::size_t end, const Shape& shape, std::pair<double, double> speeds,
                                 bool sets_feed) const;
  const std::optional<Shape>& shape(std::size_t at, std::size_t end);
  [[nodiscard]] std::optional<Shape> shape_between(std::size_t at, std::size_t end) const;
  [[nodiscard]] std::optional<Shape> arc(std::span<const Vector3> points, double chord_mm, int normal) const;

  double period_s_;
  double tolerance_mm_;
  std::vector<std::uint32_t> joints_;
  std::vector<Segment> segments_;
  CommandPoints command_;
  std::size_t shapes_at_ = 0;  // where the shapes that are kept begin
  std::vector<std::optional<std::optional<Shape>>> shapes_;
};

/// The last blocks with speeds that leave the modes at rest at the end and stay near the command.
[[nodiscard]] std::vector<LinearBlock> at_rest(std::vector<LinearBlock> blocks, const LinearFit& fit,
                                               const AxisModes& modes);

}  // namespace shapegcode
