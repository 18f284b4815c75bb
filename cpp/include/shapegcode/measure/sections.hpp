#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/measure/contour.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// Least-squares circle through points (radial distances).
struct CircleFit {
  Eigen::Vector2d centre_mm = Eigen::Vector2d::Zero();
  double radius_mm = 0.0;
  double form_mm = 0.0;  ///< largest less smallest radial distance from the circle
  double rms_mm = 0.0;   ///< root mean square of the radial distances
};

/// Geometric fit: the start is Pratt's algebraic fit (Chernov, Circular and Linear Regression, 2010, section 5.6),
/// which also holds on short arcs; Gauss-Newton steps with Levenberg's damping follow. Throws Error(argument) on fewer
/// than three points, one that is not finite, or points on a line, Error(numeric) if the steps do not converge.
[[nodiscard]] CircleFit fit_circle(std::span<const Eigen::Vector2d> points_mm);

/// Figures of a profile after ISO 4287 (ISO 21920-2), in mm.
struct Roughness {
  double cutoff_mm = 0.0;     ///< lambda_c: separates roughness from waviness
  double evaluated_mm = 0.0;  ///< evaluation length: the profile less one cut-off at each end
  double ra_mm = 0.0;         ///< arithmetic mean height of the roughness profile
  double rz_mm = 0.0;         ///< mean over sampling lengths (one cut-off each) of highest peak less deepest valley
  double wa_mm = 0.0;         ///< arithmetic mean height of the waviness profile
};

/// Gaussian low-pass of ISO 16610-21: weight exp(-pi (x / (alpha L))^2) / (alpha L), alpha = sqrt(ln 2 / pi), so that a
/// wave of length L is transmitted with a factor of one half. The weights end at one L on either side (where they are
/// 1e-6 of the middle) and are normalised to a sum of one, also where the profile ends within them. Throws
/// Error(argument) unless spacing and cut-off are > 0 and the profile is finite.
[[nodiscard]] std::vector<double> gaussian_low_pass(std::span<const double> profile_mm, double spacing_mm,
                                                    double cutoff_mm);

/// Roughness and waviness of an evenly spaced profile. `lambda_s_mm` > 0 smooths it first (0: no such filter). Waviness
/// is measured from its own mean: remove form before. Throws Error(argument) if less than one sampling length remains,
/// or as gaussian_low_pass() does.
[[nodiscard]] Roughness measure_roughness(std::span<const double> profile_mm, double spacing_mm, double cutoff_mm,
                                          double lambda_s_mm = 0.0);

/// Vibration of a plant while its command is at rest.
struct RestVibration {
  double begin_s = 0.0;                   ///< start of the rest of the command
  double observed_s = 0.0;                ///< duration of the rest
  Vector3 residual_mm = Vector3::Zero();  ///< largest |response - command|
  /// From the beginning of the rest until |response - command| stays within the band; NaN if it left the band in the
  /// last eighth of the observed time, so that it may leave it again.
  Vector3 settling_s = Vector3::Zero();
};

/// Follows |response - command| of X, Y and Z from sample to sample. Maxima between samples count: at a local maximum
/// the parabola through three samples gives the height (for a wave of 8 samples per period exact to 0.5 %).
class VibrationWatch {
 public:
  /// The command is at rest while no axis moves by more than 1e-9 mm per period. Throws Error(argument) unless period
  /// and band are > 0.
  VibrationWatch(double period_s, double band_mm);

  /// Whether this next sample of the command would end its rest.
  [[nodiscard]] bool moves(const Vector3& command) const noexcept;
  /// Takes the next sample. Returns |response - command| at it, or just before it if that is larger, mm.
  Vector3 step(const Vector3& command, const Vector3& response) noexcept;
  /// The present rest of the command; `observed_s` 0 while it moves.
  [[nodiscard]] RestVibration rest() const noexcept;

 private:
  double period_;
  double band_;
  std::size_t count_ = 0;
  std::size_t rest_begin_ = 0;  // sample at which the command came to rest
  Vector3 residual_ = Vector3::Zero();
  Vector3 outside_ = Vector3::Constant(-1.0);  // last sample outside of the band
  Vector3 last_command_ = Vector3::Zero();
  Vector3 last_ = Vector3::Zero();  // response - command, one and two samples ago
  Vector3 before_last_ = Vector3::Zero();
};

enum class SectionKind : std::uint8_t {
  line,   ///< lines of one direction
  arc,    ///< arcs about one centre
  curve,  ///< anything else
};

/// A section of a path that is measured separately.
struct PathSection {
  std::size_t first = 0;  ///< index of its first segment
  std::size_t last = 0;   ///< inclusive
  double begin_mm = 0.0;  ///< distance of its start from the path's start
  double end_mm = 0.0;
  std::uint32_t first_line = 0;  ///< source lines, from 1; 0 if there are none
  std::uint32_t last_line = 0;
  SectionKind kind = SectionKind::line;
  bool stops_at_end = false;  ///< the path stops there: an exact stop, or its end

  [[nodiscard]] double length_mm() const noexcept { return end_mm - begin_mm; }
};

/// Source lines, both inclusive.
struct LineRange {
  std::uint32_t first = 0;
  std::uint32_t last = 0;
};

/// The whole path as sections: maximal sequences of lines of one direction (1e-4 rad) and of arcs about one centre (1
/// µm) with one radius (1 µm) and sense, which end at an exact stop at the latest. Successive sequences shorter than
/// `short_mm` (a curve that a CAM system divided) are one section of the kind `curve`. Throws Error(argument) if
/// `short_mm` is not finite or negative.
[[nodiscard]] std::vector<PathSection> path_sections(const Path& path, double short_mm = 0.5);

/// The parts of a path that come from given source lines, in the order of the path; a range that the path enters
/// several times gives several sections. Throws Error(argument) if a range runs backwards or two overlap.
[[nodiscard]] std::vector<PathSection> line_sections(const Path& path, std::span<const LineRange> ranges);

/// The walls that a round tool leaves on the left and right of a path: the envelope of a disc (tool axis Z, seen from
/// above) that is swept in straight lines from one sample to the next.
///
/// Stations lie evenly along each section, in the middle of their cells. At each one the wall is the end of the swept
/// area on the horizontal normal of the path, computed exactly, not on a grid. Only the area swept while the foot of
/// the tool's centre lies within one tool radius along the path counts: another pass of the path nearby cuts a separate
/// wall. The reference is the wall cut by the programmed path itself. A wall's deviation is positive to the left of it,
/// on either side of the path (at a left wall: too much material removed; at a right wall: material left). Where the
/// programmed walls of two legs intersect (inside of corners and of arcs narrower than the tool) there is no wall to
/// measure.
///
/// Memory is proportional to the number of stations. `sweep` does not allocate.
class SweptWalls {
 public:
  /// Wall deviations at the stations of a section, in order; NaN where there is no wall. mm.
  struct Profile {
    double spacing_mm = 0.0;
    double first_mm = 0.0;  ///< distance of the first station from the path's start
    std::vector<double> left;
    std::vector<double> right;
    std::vector<Eigen::Vector2d> point;   // of the path, from above
    std::vector<Eigen::Vector2d> normal;  // unit, to the left; zero where the path has no horizontal direction
  };

  /// `spacing_mm` is the largest distance between two stations; it is increased if the path would need more than
  /// `max_stations`. Throws Error(argument) on a tool radius or spacing that is not > 0, or a path of more than 1e8
  /// tool radii.
  SweptWalls(const Path& path, const std::vector<PathSection>& sections, double tool_radius_mm, double spacing_mm,
             std::size_t max_stations = 500'000);

  /// Sweeps a move of the tool's centre; the arc lengths are those of the feet of its ends on the path, the deviation
  /// the larger one of both ends from the path.
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
  double deviation_ = 0.0;  // largest so far
  double min_fall_ = 0.0;   // 1/mm, see sweep()
  std::vector<Station> stations_;
  std::vector<Reference> reference_;
  std::vector<std::size_t> first_of_;  // per section, and the end
  std::vector<double> spacing_of_;
};

struct MetrologyOptions {
  double period_s = 0.001;           ///< between two samples
  double tool_radius_mm = 1.5;       ///< of the disc that is swept along the response
  double station_spacing_mm = 0.05;  ///< largest distance of two stations; see SweptWalls
  double band_mm = 0.001;            ///< settled: the response stays within this of the command
  double least_rest_s = 0.02;        ///< a shorter rest within the path is no stop
  double cutoff_mm = 0.0;            ///< lambda_c; 0: that of ISO 4288 for each section's length
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

/// A circle fitted to the motion or cut on an arc, for comparison with the programmed one.
struct ArcFigures {
  CircleFit fit;
  double mean_radius_mm = 0.0;  ///< mean distance from the programmed centre
};

/// Largest distance from the path on each side of it, mm. A deviation counts on one side only: above or below if it is
/// more along Z than across it, else left or right; on none for travel along Z only.
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
  double time_s = 0.0;                ///< in which the command moves with its foot in the section
  Vector3 peak_mm = Vector3::Zero();  ///< largest |response - command| while the command moves
  std::optional<RestVibration> rest;  ///< worst stop of the command in it (largest residual); at the end the last one
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
  WallFigures left;  ///< deviation from the wall cut by the programmed path, positive to the left
  WallFigures right;
  WallFigures width;                        ///< left less right wall, plus the tool's diameter
  std::optional<Roughness> left_roughness;  ///< of the longest section of wall without a gap
  std::optional<Roughness> right_roughness;
};

/// Figures of all samples measured.
struct TrackFigures {
  std::vector<SectionFigures> sections;
  double duration_s = 0.0;  ///< until the command rests for the last time
  RestVibration rest;       ///< the stop at the end
  DeviationStats command;   ///< as in SimulationFigures: missed corners count
  DeviationStats response;
  SideFigures command_sides;
  SideFigures response_sides;
};

/// Measures a motion per section of a path, sample by sample. Memory is bounded by the path and the number of stations
/// on it, not by the samples. A section's stations lie in the middle of cells of equal length that fill it. Circles are
/// fitted to the points at which the track passes the stations, so that every part of an arc has the same weight at any
/// speed.
class SectionMetrology {
 public:
  /// Copies what it needs of the path. Throws Error(argument) on a path without length, sections that are not of this
  /// path, or an option outside its range.
  SectionMetrology(const Path& path, std::vector<PathSection> sections, const MetrologyOptions& options);

  /// Next sample of both, mm; the first is the start. Does not allocate. The caller must exclude samples that are not
  /// finite.
  void step(const Vector3& command, const Vector3& response) noexcept;
  /// Everything measured so far. May be called again after further samples.
  [[nodiscard]] TrackFigures finish() const;
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
    /// Deviation of the next point from the path; `moves`: the command does; `driver`: of the point that drives this
    /// one, null: none does.
    double step(const Vector3& p, bool moves, const ContourTracker* driver) noexcept;
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
