#include "shapegcode/milling/material.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "milling/azimuth.hpp"
#include "milling/checks.hpp"
#include "milling/material_layer.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using detail::half_pi;
using detail::refuse;

using Eigen::Vector2d;

constexpr double steps_per_diameter = 40.0;
constexpr double largest_turn_rad = 0.35;  // of one step on an arc
// After a vertex the load changes abruptly: the first step there is divided at these fractions.
constexpr std::array<double, 4> shares_behind_vertex = {0.0625, 0.125, 0.25, 0.5};
constexpr double vertex_rad = 0.05;
// The newest step of the tool is kept apart from the grid, exactly, for this share of the radius: beside the tool it
// has left its own wall a moment ago, and errors of the grid there must not be taken for material.
constexpr double exact_share = 0.1;
constexpr double widest_look_rad = 0.05;  // between two looks along the circumference
constexpr double azimuth_tolerance_rad = 1e-7;
constexpr double same_azimuth_rad = 1e-4;
constexpr double min_horizontal = 1e-6;
constexpr double touching_mm = 1e-6;  // a tip so little below a layer's top stands on it
constexpr std::size_t samples_between_reports = 1024;

/// A step of the tool with the lowest layer that it cuts.
struct LayerStep {
  ToolStep step;
  std::size_t lowest;
  std::uint32_t segment;
  double end_mm;                   // along the path
  bool continues;                  // its predecessor ends where it starts...
  std::size_t predecessor_lowest;  // ...and swept these layers
};

struct AzimuthRange {
  double from;
  double to;
};

double step_of(const SweepOptions& options, double diameter_mm) {
  return options.step_mm > 0.0 ? options.step_mm : diameter_mm / steps_per_diameter;
}

class Sweeper {
 public:
  Sweeper(Material& material, double diameter, const SweepOptions& options)
      : material_(material), radius_(0.5 * diameter), step_(step_of(options, diameter)), options_(options) {
    const double h = material.resolution_mm();
    const double look = std::min(h / radius_, widest_look_rad);
    const auto looks = static_cast<std::size_t>(std::ceil(2.0 * half_pi / look));
    for (std::size_t k = 0; k <= looks; ++k) {
      const double share = 2.0 * static_cast<double>(k) / static_cast<double>(looks) - 1.0;
      const double azimuth = half_pi * share;
      looks_.push_back({azimuth, Vector2d(std::cos(azimuth), std::sin(azimuth))});
    }
    // The bilinear interpolation of the distance from a disc is off by up to h^2 / (8 R); four of these are not met.
    grid_error_ = std::max(1e-6, h * h / (8.0 * radius_));
    touch_ = std::max(options.touch_mm, 4.0 * grid_error_);
    kept_mm_ = exact_share * radius_;
    longest_step_mm_ = 2.0 * kept_mm_;
  }

  EngagementTrack run(const Path& path) {
    track_.first_arc.push_back(0);
    for (std::size_t i = 0; i < path.size(); ++i) run_segment(path[i], path.distance_mm(i), i);
    while (!pending_.empty()) sweep_oldest();
    return std::move(track_);
  }

 private:
  void run_segment(const Segment& segment, double begin_mm, std::size_t index) {
    if (!(segment.length_mm > 0.0)) return;
    if (segment.kind == SegmentKind::arc && segment.normal != 2) {
      throw Error(ErrorKind::argument, fmt::format("line {}: arc outside of the XY plane (G17)", segment.line),
                  segment.line);
    }
    index_ = static_cast<std::uint32_t>(index);
    if (track_.size() == 0 && pending_.empty()) stand_at(segment.start_mm);
    const double longest = segment.kind == SegmentKind::arc
                               ? std::min(step_, largest_turn_rad * segment.length_mm / std::abs(segment.sweep_rad))
                               : step_;
    stations_.clear();
    const double count = std::ceil(segment.length_mm / longest * (1.0 - 1e-12));
    const double spacing = segment.length_mm / count;
    const Vector3 start_tangent = tangent_at(segment, 0.0);
    const Vector2d start_direction = start_tangent.head<2>();
    if (start_direction.norm() > min_horizontal && !goes_on(start_direction.normalized())) {
      for (const double share : shares_behind_vertex) stations_.push_back(share * spacing);
    }
    for (double k = 1.0; k < count; ++k) stations_.push_back(k * spacing);
    stations_.push_back(segment.length_mm);
    if (segment.start_mm.z() != segment.end_mm.z()) add_crossings(segment);

    double from_mm = 0.0;
    for (const double to_mm : stations_) {
      const double middle_z = point_at(segment, 0.5 * (from_mm + to_mm)).z();
      sample(segment, begin_mm, to_mm, material_.lowest_cut(middle_z));
      from_mm = to_mm;
    }
  }

  /// Positions at which a ramp passes the middle of a layer.
  void add_crossings(const Segment& segment) {
    const double low = std::min(segment.start_mm.z(), segment.end_mm.z());
    const double high = std::max(segment.start_mm.z(), segment.end_mm.z());
    const double per_mm = segment.length_mm / (segment.end_mm.z() - segment.start_mm.z());
    const std::vector<double>& borders = material_.borders_mm();
    for (std::size_t i = 1; i < borders.size(); ++i) {
      const double middle = 0.5 * (borders[i - 1] + borders[i]);
      if (middle > low && middle < high) stations_.push_back((middle - segment.start_mm.z()) * per_mm);
    }
    std::sort(stations_.begin(), stations_.end());
    stations_.erase(std::unique(stations_.begin(), stations_.end()), stations_.end());
  }

  [[nodiscard]] bool goes_on(const Vector2d& direction) const {
    return has_direction_ && direction.dot(last_direction_) > std::cos(vertex_rad);
  }

  /// The tool is where the path begins: its disc has gone.
  void stand_at(const Vector3& position) {
    last_point_ = position.head<2>();
    last_lowest_ = material_.lowest_cut(position.z());
    pending_.push_back({ToolStep(last_point_, last_point_), last_lowest_, index_, 0.0, false, 0});
  }

  void sample(const Segment& segment, double begin_mm, double to_mm, std::size_t lowest) {
    const Vector3 position = point_at(segment, to_mm);
    const Vector3 tangent = tangent_at(segment, to_mm);
    const Vector2d point = position.head<2>();
    const double along = tangent.head<2>().norm();
    const bool travels = along > min_horizontal;
    const double horizontal = tangent.z() == 0.0 ? 1.0 : (travels ? std::min(1.0, along) : 0.0);
    const Vector2d direction = travels ? Vector2d(tangent.head<2>() / along) : Vector2d::Zero();

    double area = 0.0;
    widths_.clear();
    open_.clear();
    if (travels) {
      for (std::size_t layer = lowest; layer < material_.size(); ++layer) {
        meet(layer, point, direction);
        // A tool takes away everything above its tip, so above a layer without material there is none either.
        if (found_.empty()) break;
        area += add_arcs(layer, position.z());
      }
    }
    const double plunged = tangent.z() < 0.0 ? plunged_area(position, lowest) : 0.0;

    track_.s_mm.push_back(begin_mm + to_mm);
    track_.x_mm.push_back(point.x());
    track_.y_mm.push_back(point.y());
    track_.direction_rad.push_back(travels ? std::atan2(direction.y(), direction.x()) : 0.0);
    track_.horizontal.push_back(horizontal);
    track_.segment.push_back(index_);
    track_.radial_depth_mm.push_back(union_width());
    track_.section_mm2.push_back(horizontal * area + std::max(0.0, -tangent.z()) * plunged);
    track_.plunged_mm2.push_back(plunged);
    track_.first_arc.push_back(static_cast<std::uint32_t>(track_.arcs.size()));

    travel(segment, point, lowest, begin_mm + to_mm);
    last_point_ = point;
    last_lowest_ = lowest;
    if (travels) {
      last_direction_ = direction;
      has_direction_ = true;
    } else {
      has_direction_ = false;
    }
    while (!pending_.empty() && begin_mm + to_mm - pending_.front().end_mm >= kept_mm_) sweep_oldest();
    if (options_.progress && track_.size() % samples_between_reports == 0) options_.progress(begin_mm + to_mm);
  }

  /// Area below the end of a tool on its way down. A layer is taken away when the tip passes its middle: above that it
  /// is looked at, below it counts what was there.
  [[nodiscard]] double plunged_area(const Vector3& position, std::size_t lowest) {
    if (lowest > 0 && position.z() < material_.borders_mm()[lowest] - touching_mm) {
      plunged_layer_ = lowest - 1;
      // Less than a rim as wide as the grid is what the grid does not know.
      const double rim_mm2 = 2.0 * std::numbers::pi * radius_ * material_.resolution_mm();
      const double area = area_below(lowest - 1, position.head<2>());
      plunged_mm2_ = area > rim_mm2 ? area : 0.0;
      return plunged_mm2_;
    }
    return plunged_layer_ == lowest ? plunged_mm2_ : 0.0;
  }

  /// Adds the travel to a position to what is pending; on one segment to the latest step, so that the grid has less to
  /// do.
  void travel(const Segment& segment, const Vector2d& point, std::size_t lowest, double end_mm) {
    double curvature = 0.0;
    if (segment.kind == SegmentKind::arc) {
      // Start and end radius may differ a little: the arc through both ends of the step.
      const Vector2d centre = segment.centre_mm.head<2>();
      const double radius = 0.5 * ((last_point_ - centre).norm() + (point - centre).norm());
      curvature = (segment.sweep_rad > 0.0 ? 1.0 : -1.0) / radius;
    }
    if (!pending_.empty() && pending_.back().continues && pending_.back().segment == index_ &&
        pending_.back().lowest == lowest) {
      LayerStep& latest = pending_.back();
      const double chord = (point - latest.step.from()).norm();
      if (chord < longest_step_mm_ && chord * std::abs(curvature) < 2.0 * largest_turn_rad) {
        latest.step = ToolStep(latest.step.from(), point, curvature);
        latest.end_mm = end_mm;
        return;
      }
    }
    pending_.push_back({ToolStep(last_point_, point, curvature), lowest, index_, end_mm, true, last_lowest_});
  }

  void sweep_oldest() {
    const LayerStep& swept = pending_.front();
    const double half = 0.5 * swept.step.chord().norm();
    const Vector2d middle = swept.step.from() + 0.5 * swept.step.chord();
    for (std::size_t layer = swept.lowest; layer < material_.size(); ++layer) {
      const MaterialLayer& field = material_.layer(layer);
      // Nor is there anything above: see `sample`.
      if (field.is_empty_around(middle.x(), middle.y(), radius_ + half + field.band_mm())) break;
      const bool continues = swept.continues && layer >= swept.predecessor_lowest;
      if (half == 0.0 && continues) continue;
      // Where nothing is left to take away, nothing is above; only the layers that the tool has just reached are new.
      if (!material_.remove(layer, swept.step, radius_, continues) && continues) break;
    }
    pending_.pop_front();
  }

  /// Distance of a position on the tool's circumference from where there is no material, the newest step included.
  [[nodiscard]] double distance(std::size_t layer, const Vector2d& position) {
    double d = material_.layer(layer).distance_mm(position.x(), position.y());
    in_grid_ = d;
    if (d <= 0.0) return d;
    for (const LayerStep& swept : pending_) {
      if (swept.lowest <= layer) d = std::min(d, swept.step.distance_mm(position) - radius_);
    }
    return d;
  }

  /// Fills found_ with the azimuths at which the front half of the tool is in a layer's material.
  void meet(std::size_t layer, const Vector2d& point, const Vector2d& direction) {
    found_.clear();
    if (material_.layer(layer).is_empty_around(point.x(), point.y(), radius_)) return;
    const Vector2d left(-direction.y(), direction.x());
    const auto at = [&](const Vector2d& unit) {
      return distance(layer, point + radius_ * (unit.x() * direction + unit.y() * left));
    };
    double before = at(looks_[0].unit);
    double from = -half_pi;
    double depth = in_grid_;
    for (std::size_t k = 1; k < looks_.size(); ++k) {
      const double now = at(looks_[k].unit);
      const double here = in_grid_;
      if (now > 0.0 && before <= 0.0) {
        from = boundary(at, looks_[k - 1].azimuth, before, looks_[k].azimuth, now);
        depth = here;
      }
      if (now <= 0.0 && before > 0.0 && depth > touch_) {
        add_range(from, boundary(at, looks_[k - 1].azimuth, before, looks_[k].azimuth, now));
      }
      depth = std::max(depth, here);
      before = now;
    }
    if (before > 0.0 && depth > touch_) add_range(from, half_pi);
  }

  /// Azimuth at which the distance changes its sign, by the Illinois form of regula falsi.
  template <typename Function>
  static double boundary(const Function& at, double a, double fa, double b, double fb) {
    constexpr int most_iterations = 40;
    int kept = 0;
    for (int i = 0; i < most_iterations && b - a > azimuth_tolerance_rad && fa != fb; ++i) {
      const double c = std::clamp((a * fb - b * fa) / (fb - fa), a, b);
      const double fc = at(Vector2d(std::cos(c), std::sin(c)));
      if (fc == 0.0) return c;
      if ((fc > 0.0) == (fb > 0.0)) {
        if (c == b) return c;
        b = c;
        fb = fc;
        if (kept == -1) fa *= 0.5;
        kept = -1;
      } else {
        if (c == a) return c;
        a = c;
        fa = fc;
        if (kept == 1) fb *= 0.5;
        kept = 1;
      }
    }
    return 0.5 * (a + b);
  }

  /// Keeps a range that is wide enough; ends that the grid cannot tell from the side of the tool are there.
  void add_range(double from, double to) {
    if (radius_ * (1.0 + std::sin(from)) < grid_error_) from = -half_pi;
    if (radius_ * (1.0 - std::sin(to)) < grid_error_) to = half_pi;
    if (radius_ * (std::sin(to) - std::sin(from)) > touch_) found_.push_back({from, to});
  }

  /// Puts found_ into the track; returns the area across the direction of feed.
  double add_arcs(std::size_t layer, double tip_mm) {
    const double bottom = std::max(0.0, material_.borders_mm()[layer] - tip_mm);
    const double top = material_.borders_mm()[layer + 1] - tip_mm;
    double area = 0.0;
    next_open_.clear();
    for (const AzimuthRange& range : found_) {
      area += radius_ * (std::sin(range.to) - std::sin(range.from)) * (top - bottom);
      widths_.push_back({radius_ * std::sin(range.from), radius_ * std::sin(range.to)});
      const auto same = std::find_if(open_.begin(), open_.end(), [&](std::size_t k) {
        const EngagedArc& arc = track_.arcs[k];
        return std::abs(arc.from_rad - range.from) <= same_azimuth_rad &&
               std::abs(arc.to_rad - range.to) <= same_azimuth_rad;
      });
      if (same != open_.end()) {
        track_.arcs[*same].top_mm = top;
        next_open_.push_back(*same);
      } else {
        next_open_.push_back(track_.arcs.size());
        track_.arcs.push_back({range.from, range.to, bottom, top});
      }
    }
    std::swap(open_, next_open_);
    return area;
  }

  /// How wide the ranges of all layers are together, across the direction of feed.
  double union_width() {
    std::sort(widths_.begin(), widths_.end());
    double width = 0.0;
    double reached = -radius_;
    for (const auto& [from, to] : widths_) {
      width += std::max(0.0, to - std::max(from, reached));
      reached = std::max(reached, to);
    }
    return width;
  }

  double area_below(std::size_t layer, const Vector2d& point) {
    const auto is_swept_later = [&](const LayerStep& swept) { return swept.lowest <= layer; };
    if (std::any_of(pending_.begin(), pending_.end(), is_swept_later)) {
      while (!pending_.empty()) sweep_oldest();
    }
    return material_.layer(layer).area_in_disc_mm2(point.x(), point.y(), radius_);
  }

  struct Look {
    double azimuth;
    Vector2d unit;  // along and left of the direction of feed
  };

  Material& material_;
  double radius_;
  double step_;
  const SweepOptions& options_;
  double grid_error_ = 0.0;
  double touch_ = 0.0;
  double in_grid_ = 0.0;  // the latest distance, without the newest step: tells how deep a contact is at any step
  double kept_mm_ = 0.0;
  double longest_step_mm_ = 0.0;
  std::vector<Look> looks_;
  std::deque<LayerStep> pending_;  // not yet in the grid, oldest first
  std::vector<double> stations_;
  std::vector<AzimuthRange> found_;
  std::vector<std::pair<double, double>> widths_;
  std::vector<std::size_t> open_;  // arcs of the layer below
  std::vector<std::size_t> next_open_;
  Vector2d last_point_ = Vector2d::Zero();
  Vector2d last_direction_ = Vector2d::Zero();
  std::size_t last_lowest_ = 0;
  bool has_direction_ = false;
  std::size_t plunged_layer_ = std::numeric_limits<std::size_t>::max();
  double plunged_mm2_ = 0.0;
  std::uint32_t index_ = 0;
  EngagementTrack track_;
};

}  // namespace

EngagementTrack sweep(Material& material, const Path& path, double tool_diameter_mm, const SweepOptions& options) {
  detail::check_positive(tool_diameter_mm, "tool diameter", "mm");
  if (!(options.step_mm >= 0.0) || !std::isfinite(options.step_mm)) {
    refuse("step is {} mm, must be above 0, or 0 for a fortieth of the diameter", options.step_mm);
  }
  if (!(options.touch_mm >= 0.0) || !std::isfinite(options.touch_mm)) {
    refuse("touch is {} mm, must be at least 0", options.touch_mm);
  }
  detail::check_pieces(std::numbers::pi * tool_diameter_mm, material.resolution_mm(), "a grid");
  detail::check_pieces(path.length_mm(), step_of(options, tool_diameter_mm), "a step");
  return Sweeper(material, tool_diameter_mm, options).run(path);
}

}  // namespace shapegcode
