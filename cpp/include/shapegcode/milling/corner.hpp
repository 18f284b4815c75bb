#pragma once

#include <cstdint>

#include "shapegcode/milling/force.hpp"
#include "shapegcode/milling/material.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode {

/// The corner of a pocket that is finished after roughing (paper 001, figures 1 and 2). The tool moves along +X with
/// the wall to its right, turns left at the corner and follows the second wall; the finished walls meet at the origin.
struct CornerCut {
  double tool_radius_mm = 4.0;
  double rough_radius_mm = 8.0;          ///< of the corner after roughing
  double finish_radius_mm = 8.0;         ///< of the corner to be made; equal to the tool's: the path has a sharp vertex
  double allowance_mm = 0.8;             ///< left on both walls by roughing
  double turn_rad = 1.5707963267948966;  ///< turning angle of the path
  double before_mm = 10.0;               ///< straight path before the corner
  double after_mm = 10.0;                ///< and after it
  bool mirrored = false;                 ///< wall to the left, turn to the right (Y mirrored): up milling with M03
};

/// Throws Error(argument) on a tool radius or allowance that is not positive, an allowance above the tool's radius, a
/// rough or finish radius below the tool's, a rough corner that leaves no material on the finished one, a turn outside
/// of 1 to 179 degrees, or a straight below 0.
void check(const CornerCut& cut);

/// Sections of the path of paper 001.
enum class CornerSection : std::uint8_t {
  s1,  ///< straight, the rough wall is straight where the tool enters
  s2,  ///< still straight, but the tool enters in the rough corner
  s3,  ///< on the arc of the finished corner
  s4,  ///< on the straight after it
};

/// Engagement of the tool at one position of the corner, in closed form.
struct CornerEngagement {
  CornerSection section = CornerSection::s1;
  double x_mm = 0.0;  ///< of the tool's axis
  double y_mm = 0.0;
  double direction_rad = 0.0;  ///< of feed, from +X
  double turned_rad = 0.0;     ///< turned so far on the tool centre's arc, 0 before it
  double from_rad = 0.0;       ///< engaged azimuths from the direction of feed, positive to its left
  double to_rad = 0.0;
  double radial_depth_mm = 0.0;  ///< from the engagement's end on the rough boundary to the finished wall's tangent
};

/// Length of the tool's path, mm.
[[nodiscard]] double corner_length_mm(const CornerCut& cut);

/// Engagement at a distance along the path, 0 <= s <= corner_length_mm. At a sharp vertex `behind_vertex` chooses the
/// direction after the turn. Throws Error(argument) on an s outside, a cut that `check` refuses, or if the tool's front
/// leaves the material only where the tool has been before: possible at sharp turns far beyond 90 degrees, or if a
/// rough radius of many tool radii leaves a corner full of material.
[[nodiscard]] CornerEngagement corner_engagement(const CornerCut& cut, double s_mm, bool behind_vertex = false);

/// The tool's path: line, arc (if finish and tool radius differ), line at a height.
[[nodiscard]] Path corner_path(const CornerCut& cut, double feed_mm_per_s, double z_mm = 0.0);

/// The material between the rough boundary and `beyond_mm` outside of the finished walls, from that distance before the
/// path's start to that after its end. The rough corner is a polygon within 0.05 um of its arc.
[[nodiscard]] Ring corner_stock(const CornerCut& cut, double beyond_mm);

/// The corner as a track, for functions that take tracks: samples at most `step_mm` apart and at the ends of lines and
/// arc; at a sharp vertex two samples share one position, before and after the turn.
[[nodiscard]] EngagementTrack corner_track(const CornerCut& cut, double axial_depth_mm, double step_mm);

}  // namespace shapegcode
