#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "shapegcode/metrology/sections.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

/// The walls that a round tool leaves on the left and right of a path: the envelope of a disc (tool axis Z, seen from
/// above) that is swept in straight lines from one sample to the next.
///
/// Stations stand evenly along each section, in the middle of their cells. At each one the wall is where the swept area
/// ends on the horizontal normal of the path; exactly, not on a raster. Only what is swept while the foot of the tool's
/// centre lies within one tool radius along the path counts: another pass of the path nearby cuts a wall of its own.
/// What the programmed path itself would cut so is the reference: a wall's deviation is positive to the left of it, on
/// either side of the path (at a left wall: material too much removed; at a right wall: material left standing).
/// Where the programmed walls of two legs run into each other (inside of corners and of arcs narrower than the tool)
/// there is no wall to measure.
///
/// Memory is proportional to the number of stations. `sweep` does not allocate.
class SweptWalls {
 public:
  /// What remains at the stations of a section, in order; NaN where there is no wall. mm.
  struct Profile {
    double spacing_mm = 0.0;
    double first_mm = 0.0;  ///< distance of the first station from the path's start
    std::vector<double> left;
    std::vector<double> right;
    std::vector<Eigen::Vector2d> point;   // of the path, from above
    std::vector<Eigen::Vector2d> normal;  // unit, to the left; zero where the path has no horizontal direction
  };

  /// `spacing_mm` is the largest distance of two stations; it becomes wider where the path would need more than
  /// `most_stations`. Throws Error(argument) on a tool radius or spacing that is not > 0.
  SweptWalls(const Path& path, const std::vector<PathSection>& sections, double tool_radius_mm, double spacing_mm,
             std::size_t most_stations = 500'000);

  /// The tool's centre goes from one point to another; the arc lengths are those of their feet on the path, the
  /// deviation that of the further one from the path.
  void sweep(const Vector3& from, const Vector3& to, double from_foot_mm, double to_foot_mm,
             double deviation_mm) noexcept;
  [[nodiscard]] Profile profile(std::size_t section) const;
  [[nodiscard]] std::size_t station_count(std::size_t section) const noexcept {
    return first_of_[section + 1] - first_of_[section];
  }
  /// The spacing in use: at most this between two stations, mm.
  [[nodiscard]] double spacing_mm() const noexcept { return spacing_; }

 private:
  struct Station {
    double s;
    Eigen::Vector2d point;
    Eigen::Vector2d normal;  // horizontal, to the left; zero where the path has no horizontal direction
    double left;             // edges of the swept area on the normal; -inf and +inf before anything is swept
    double right;
  };
  struct Reference {
    double left, right;  // what the programmed path cuts; NaN where this is no wall
  };
  [[nodiscard]] static Station station_at(const Path& path, double s, std::size_t& cursor);
  void take_reference(const Path& path);
  void sweep_within(const Vector3& from, const Vector3& to, double from_foot_mm, double to_foot_mm,
                    double reach_mm) noexcept;

  double radius_;
  double spacing_ = 0.0;
  double deviation_ = 0.0;   // largest so far
  double least_fall_ = 0.0;  // 1/mm, see sweep()
  std::vector<Station> stations_;
  std::vector<Reference> reference_;
  std::vector<std::size_t> first_of_;  // per section, and the end
  std::vector<double> spacing_of_;
};

}  // namespace shapegcode
