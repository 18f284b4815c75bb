#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "shapegcode/metrology/circle_fit.hpp"
#include "shapegcode/metrology/contour.hpp"
#include "shapegcode/metrology/corner_reach.hpp"
#include "shapegcode/metrology/orbit.hpp"
#include "shapegcode/metrology/roughness.hpp"
#include "shapegcode/metrology/sections.hpp"
#include "shapegcode/metrology/swept_walls.hpp"
#include "shapegcode/metrology/vibration.hpp"
#include "shapegcode/path/path.hpp"

namespace shapegcode {

struct MetrologyOptions {
  double period_s = 0.001;           ///< between two samples
  double tool_radius_mm = 1.5;       ///< of the disc that is swept along the response
  double station_spacing_mm = 0.05;  ///< largest distance of two stations; see SweptWalls
  double band_mm = 0.001;            ///< settled is what stays within this of the command
  double least_rest_s = 0.02;        ///< a shorter standstill inside of the path is no stop
  double cutoff_mm = 0.0;            ///< lambda_c; 0: standard_cutoff_mm() of each section
  double lambda_s_mm = 0.0;          ///< 0: none
};

/// One wall of a section, or the width between both. mm; zero if `stations` is 0.
struct WallFigures {
  double least_mm = 0.0;
  double mean_mm = 0.0;
  double largest_mm = 0.0;
  std::size_t stations = 0;  ///< at which it could be measured
  [[nodiscard]] double band_mm() const noexcept { return largest_mm - least_mm; }
};

/// A circle through what was moved or cut on an arc, beside the programmed one.
struct ArcFigures {
  CircleFit fit;
  double mean_radius_mm = 0.0;  ///< mean distance from the programmed centre
};

/// Largest distance from the path on each side of it, mm. A deviation counts on one side alone: above or below where it
/// is more along Z than across it, else left or right; beside a travel along Z only on none.
struct SideFigures {
  double left_mm = 0.0;
  double right_mm = 0.0;
  double above_mm = 0.0;
  double below_mm = 0.0;
  void add(PathSide side, double distance_mm) noexcept;
};

/// What was measured in one section.
struct SectionFigures {
  PathSection section;
  double time_s = 0.0;                ///< while the foot of the command is in it
  Vector3 peak_mm = Vector3::Zero();  ///< largest |response - command| while the command moves
  std::optional<RestVibration> rest;  ///< the worst stop of the command in it (largest residual)
  DeviationStats command;             ///< signed, from the path; RMS while the command moves
  DeviationStats response;
  SideFigures command_sides;
  SideFigures response_sides;
  std::optional<double> command_orbit_percent;  ///< arcs only; see OrbitError
  std::optional<double> response_orbit_percent;
  double nominal_radius_mm = 0.0;                               ///< arcs only
  bool turns_left = false;                                      ///< arcs only: the left wall is the inside one
  Eigen::Vector2d nominal_centre_mm = Eigen::Vector2d::Zero();  ///< in the arc's plane axes (normal+1, normal+2)
  std::optional<ArcFigures> command_arc;                        ///< arcs of 10 degrees and more
  std::optional<ArcFigures> response_arc;
  std::optional<ArcFigures> left_wall_arc;  ///< of arcs in the XY plane that leave a wall on this side
  std::optional<ArcFigures> right_wall_arc;
  WallFigures left;  ///< deviation from what the programmed path cuts, positive to the left
  WallFigures right;
  WallFigures width;                        ///< left less right wall, with the tool's diameter
  std::optional<Roughness> left_roughness;  ///< of the longest stretch of wall without a gap
  std::optional<Roughness> right_roughness;
};

/// Figures of a whole run.
struct RunFigures {
  std::vector<SectionFigures> sections;
  double duration_s = 0.0;  ///< until the command rests for the last time
  RestVibration rest;       ///< the stop at the end
  DeviationStats command;   ///< as PlaybackFigures has them: corners that were missed count
  DeviationStats response;
  SideFigures command_sides;
  SideFigures response_sides;
};

/// Measures what a run of samples does to the sections of a path, sample by sample. Memory is bounded by the path and
/// the number of stations on it, not by the samples. A section's stations stand in the middle of cells of equal length
/// that fill it; circles are fitted to the points at which the track passes them, so that every part of an arc weighs
/// the same however slowly it is passed.
class SectionMetrology {
 public:
  /// Copies what it needs of the path. Throws Error(argument) on a path without length, sections that are not of this
  /// path, or an option outside its range.
  SectionMetrology(const Path& path, std::vector<PathSection> sections, const MetrologyOptions& options);

  /// Next sample of both, mm; the first is the start. Does not allocate. Samples that are not finite are an error that
  /// the caller excludes.
  void step(const Vector3& command, const Vector3& response) noexcept;
  /// Everything measured so far. May be called once more after further samples.
  [[nodiscard]] RunFigures finish() const;
  /// Deviations of the walls at the stations of a section.
  [[nodiscard]] SweptWalls::Profile wall_profile(std::size_t section) const { return walls_.profile(section); }
  [[nodiscard]] const std::vector<PathSection>& sections() const noexcept { return sections_; }
  /// Largest distance of two stations, mm.
  [[nodiscard]] double station_spacing_mm() const noexcept { return walls_.spacing_mm(); }

 private:
  struct Running {
    double time_s = 0.0;
    Vector3 peak = Vector3::Zero();
    std::optional<RestVibration> rest;
    DeviationStats command, response;
    SideFigures command_sides, response_sides;
  };
  /// An arc section's stations in the plane of the arc.
  struct ArcTrack {
    std::size_t section;
    int a, b;     // plane axes
    double turn;  // signed sweep, rad
    double radius;
    Eigen::Vector2d centre;
    std::vector<Eigen::Vector2d> programmed, command, response;  // NaN where the track has not passed yet
  };
  /// A point that moves along the path.
  struct Follower {
    explicit Follower(const Path& path) : tracker(path), reach(path), orbit(path) {}
    ContourTracker tracker;
    CornerReach reach;
    OrbitError orbit;
    DeviationStats whole;
    SideFigures sides;
    Vector3 last = Vector3::Zero();
    double last_foot = 0.0;
    /// Deviation of the next point from the path; `moves`: the command does.
    double step(const Vector3& p, bool moves) noexcept;
  };

  void pass_stations(const Follower& follower, const Vector3& p,
                     std::vector<Eigen::Vector2d> ArcTrack::*points) noexcept;
  void close_rest() noexcept;
  [[nodiscard]] Running* running_at(std::size_t segment) noexcept;
  [[nodiscard]] SectionFigures figures_of(std::size_t section) const;
  void measure_orbits(std::vector<SectionFigures>& figures) const;
  void measure_arc(const ArcTrack& track, const SweptWalls::Profile& walls, SectionFigures& figures) const;
  [[nodiscard]] std::optional<Roughness> roughness_of(const std::vector<double>& wall, double spacing_mm,
                                                      const ArcTrack* arc) const;

  MetrologyOptions options_;
  Path path_;
  std::vector<PathSection> sections_;
  std::vector<std::int32_t> section_of_;  // per segment; -1: none
  std::vector<std::int32_t> track_of_;    // per section; -1: no arc
  std::vector<ArcTrack> tracks_;
  std::vector<Running> running_;
  SweptWalls walls_;
  VibrationWatch vibration_;
  Follower command_;
  Follower response_;
  std::size_t count_ = 0;
  bool has_moved_ = false;
};

}  // namespace shapegcode
