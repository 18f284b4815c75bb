#include "shapegcode/measure/sections.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/refuse.hpp"
#include "measure/profile.hpp"
#include "path/arc_frame.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

using Eigen::Vector2d;

constexpr double min_fitted_rad = std::numbers::pi / 18.0;
constexpr double min_cutoffs = 3.0;

const MetrologyOptions& checked(const Path& path, const std::vector<PathSection>& sections,
                                const MetrologyOptions& options) {
  if (!(path.length_mm() > 0.0)) refuse("a path without length cannot be measured");
  std::size_t next = 0;
  for (const PathSection& section : sections) {
    if (section.first < next || section.last < section.first || section.last >= path.size()) {
      refuse("section of segments {} to {} does not follow on a path of {} segments", section.first, section.last,
             path.size());
    }
    next = section.last + 1;
  }
  const auto finite = [](double value) { return std::isfinite(value) && value >= 0.0; };
  if (!finite(options.least_rest_s) || !finite(options.cutoff_mm) || !finite(options.lambda_s_mm)) {
    refuse("least rest {} s, cut-off {} mm and lambda s {} mm must be finite and >= 0", options.least_rest_s,
           options.cutoff_mm, options.lambda_s_mm);
  }
  return options;
}

WallFigures wall_figures(const std::vector<double>& values) {
  WallFigures figures;
  double sum = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    figures.least_mm = figures.stations == 0 ? value : std::min(figures.least_mm, value);
    figures.largest_mm = figures.stations == 0 ? value : std::max(figures.largest_mm, value);
    sum += value;
    ++figures.stations;
  }
  if (figures.stations > 0) figures.mean_mm = sum / static_cast<double>(figures.stations);
  return figures;
}

std::span<const double> longest_without_gap(const std::vector<double>& values) {
  std::size_t best = 0;
  std::size_t best_count = 0;
  for (std::size_t i = 0; i < values.size();) {
    std::size_t end = i;
    while (end < values.size() && std::isfinite(values[end])) ++end;
    if (end - i > best_count) {
      best = i;
      best_count = end - i;
    }
    i = end + 1;
  }
  return {values.data() + best, best_count};
}

// While the command stands still the extremes count, the mean does not: it would depend on how long is looked at.
void add_deviation(DeviationStats& stats, double deviation_mm, bool moves) {
  const DeviationStats before = stats;
  stats.add(deviation_mm);
  if (moves) return;
  stats.sum_of_squares_mm2 = before.sum_of_squares_mm2;
  stats.count = before.count;
}

std::optional<ArcFigures> arc_through(const std::vector<Vector2d>& points, const Vector2d& centre) {
  std::vector<Vector2d> passed;
  passed.reserve(points.size());
  double sum = 0.0;
  for (const Vector2d& point : points) {
    if (!point.allFinite()) continue;
    passed.push_back(point);
    sum += (point - centre).norm();
  }
  // Part of an arc alone would be a shorter arc: not the one that is asked for.
  if (passed.size() < 3 || 10 * passed.size() < 9 * points.size()) return std::nullopt;
  return ArcFigures{fit_circle(passed), sum / static_cast<double>(passed.size())};
}

}  // namespace

void SideFigures::add(PathSide side, double distance_mm) noexcept {
  const auto take = [distance_mm](double& largest_mm) { largest_mm = std::max(largest_mm, distance_mm); };
  switch (side) {
    case PathSide::left:
      return take(left_mm);
    case PathSide::right:
      return take(right_mm);
    case PathSide::above:
      return take(above_mm);
    case PathSide::below:
      return take(below_mm);
    case PathSide::none:
      return;
  }
}

double SectionMetrology::Follower::step(const Vector3& p, bool moves, const ContourTracker* driver) noexcept {
  const double deviation = driver == nullptr ? tracker.step(p) : tracker.step(p, *driver);
  reach.step(p, tracker.s_mm());
  orbit.step(p, tracker.segment());
  add_deviation(whole, deviation, moves);
  sides.add(tracker.side(), std::abs(deviation));
  return deviation;
}

SectionMetrology::SectionMetrology(const Path& path, std::vector<PathSection> sections, const MetrologyOptions& options)
    : options_(checked(path, sections, options)),
      path_(path),
      sections_(std::move(sections)),
      section_of_(path.size(), -1),
      track_of_(sections_.size(), -1),
      running_(sections_.size()),
      walls_(path_, sections_, options.tool_radius_mm, options.station_spacing_mm),
      vibration_(options.period_s, options.band_mm),
      command_(path_),
      response_(command_) {
  constexpr double missing = std::numeric_limits<double>::quiet_NaN();
  std::size_t cursor = 0;
  for (std::size_t i = 0; i < sections_.size(); ++i) {
    const PathSection& section = sections_[i];
    for (std::size_t k = section.first; k <= section.last; ++k) section_of_[k] = static_cast<std::int32_t>(i);
    const std::size_t stations = walls_.station_count(i);
    if (section.kind != SectionKind::arc || stations == 0) continue;
    ArcTrack track{};
    track.section = i;
    for (std::size_t k = section.first; k <= section.last; ++k) {
      const Segment& segment = path_[k];
      if (segment.kind != SegmentKind::arc) continue;
      if (track.turn == 0.0) {
        track.a = ArcFrame(segment.normal).a;
        track.b = ArcFrame(segment.normal).b;
        track.radius = segment.start_radius_mm;
        track.centre = {segment.centre_mm[track.a], segment.centre_mm[track.b]};
      }
      track.turn += segment.sweep_rad;
    }
    track.command.assign(stations, {missing, missing});
    track.response = track.command;
    for (std::size_t k = 0; k < stations; ++k) {
      const double share = (static_cast<double>(k) + 0.5) / static_cast<double>(stations);
      const Vector3 p = path_.point(section.begin_mm + share * section.length_mm(), cursor);
      track.programmed.emplace_back(p[track.a], p[track.b]);
    }
    track_of_[i] = static_cast<std::int32_t>(tracks_.size());
    tracks_.push_back(std::move(track));
  }
}

SectionMetrology::Running* SectionMetrology::running_at(std::size_t segment) noexcept {
  const std::int32_t section = section_of_[segment];
  return section < 0 ? nullptr : &running_[static_cast<std::size_t>(section)];
}

void SectionMetrology::step(const Vector3& command, const Vector3& response) noexcept {
  const bool moves = vibration_.moves(command);
  if (moves) close_rest();
  has_moved_ = has_moved_ || moves;
  const Vector3 peak = vibration_.step(command, response);

  const double command_deviation = command_.step(command, moves, nullptr);
  if (Running* running = running_at(command_.tracker.segment()); running != nullptr) {
    add_deviation(running->command, command_deviation, moves);
    running->command_sides.add(command_.tracker.side(), std::abs(command_deviation));
    if (moves) {
      running->time_s += options_.period_s;
      running->peak = running->peak.cwiseMax(peak);
    }
  }
  const double response_deviation = response_.step(response, moves, &command_.tracker);
  if (Running* running = running_at(response_.tracker.segment()); running != nullptr) {
    add_deviation(running->response, response_deviation, moves);
    running->response_sides.add(response_.tracker.side(), std::abs(response_deviation));
  }
  if (count_ == 0) {
    walls_.sweep(response, response, response_.tracker.s_mm(), response_.tracker.s_mm(), response_deviation);
  } else {
    walls_.sweep(response_.last, response, response_.last_foot, response_.tracker.s_mm(), response_deviation);
    pass_stations(command_, command, &ArcTrack::command);
    pass_stations(response_, response, &ArcTrack::response);
  }
  for (Follower* follower : {&command_, &response_}) follower->last_foot = follower->tracker.s_mm();
  command_.last = command;
  response_.last = response;
  ++count_;
}

// The command moves on: was that a stop of its own, or part of the motion?
void SectionMetrology::close_rest() noexcept {
  Running* running = running_at(command_.tracker.segment());
  if (running == nullptr) return;
  const RestVibration rest = vibration_.rest();
  if (has_moved_ && rest.observed_s >= options_.least_rest_s) {
    const bool worse = !running->rest || rest.residual_mm.maxCoeff() > running->rest->residual_mm.maxCoeff();
    if (worse) running->rest = rest;
  } else {
    running->peak = running->peak.cwiseMax(rest.residual_mm);
  }
}

void SectionMetrology::pass_stations(const Follower& follower, const Vector3& p,
                                     std::vector<Vector2d> ArcTrack::*points) noexcept {
  const double from = follower.last_foot;
  const double to = follower.tracker.s_mm();
  if (from == to) return;
  const double least = std::min(from, to);
  const double largest = std::max(from, to);
  auto track = std::lower_bound(tracks_.begin(), tracks_.end(), least,
                                [this](const ArcTrack& each, double s) { return sections_[each.section].end_mm < s; });
  for (; track != tracks_.end() && sections_[track->section].begin_mm < largest; ++track) {
    const PathSection& section = sections_[track->section];
    std::vector<Vector2d>& passed = (*track).*points;
    const auto count = static_cast<double>(passed.size());
    const double per_mm = count / section.length_mm();
    // Station i stands at begin + (i + 1/2) / per_mm.
    double i = std::max(0.0, std::ceil((least - section.begin_mm) * per_mm - 0.5));
    for (; i < count && section.begin_mm + (i + 0.5) / per_mm <= largest; ++i) {
      const double share = (section.begin_mm + (i + 0.5) / per_mm - from) / (to - from);
      const Vector3 at = follower.last + share * (p - follower.last);
      passed[static_cast<std::size_t>(i)] = {at[track->a], at[track->b]};
    }
  }
}

std::optional<Roughness> SectionMetrology::roughness_of(const std::vector<double>& wall, double spacing_mm,
                                                        const ArcTrack* arc) const {
  const std::span<const double> whole = longest_without_gap(wall);
  const double length = static_cast<double>(whole.size()) * spacing_mm;
  const std::optional<double> cutoff =
      options_.cutoff_mm > 0.0 ? std::optional(options_.cutoff_mm) : standard_cutoff_mm(length, spacing_mm);
  if (!cutoff || length < min_cutoffs * *cutoff || *cutoff < spacing_mm) return std::nullopt;
  const std::vector<double> profile =
      arc == nullptr ? without_line(whole) : without_circle(whole, arc->turn / static_cast<double>(wall.size()));
  return measure_roughness(profile, spacing_mm, *cutoff, options_.lambda_s_mm);
}

void SectionMetrology::measure_arc(const ArcTrack& track, const SweptWalls::Profile& walls,
                                   SectionFigures& figures) const {
  figures.nominal_radius_mm = track.radius;
  figures.nominal_centre_mm = track.centre;
  figures.turns_left = track.turn > 0.0;
  if (std::abs(track.turn) < min_fitted_rad) return;
  figures.command_arc = arc_through(track.command, track.centre);
  figures.response_arc = arc_through(track.response, track.centre);
  const bool is_horizontal = track.a == 0 && track.b == 1;
  if (!is_horizontal) return;
  // The left wall lies inside of an arc that turns left.
  const auto wall_arc = [&](const std::vector<double>& deviation, double side) {
    const double inwards = track.turn > 0.0 ? 1.0 : -1.0;
    std::vector<Vector2d> points(deviation.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vector2d out = track.programmed[i] - track.centre;
      points[i] = track.programmed[i] - inwards * (side * options_.tool_radius_mm + deviation[i]) * out.normalized();
    }
    return arc_through(points, track.centre);
  };
  figures.left_wall_arc = wall_arc(walls.left, 1.0);
  figures.right_wall_arc = wall_arc(walls.right, -1.0);
}

SectionFigures SectionMetrology::figures_of(std::size_t section) const {
  const Running& running = running_[section];
  SectionFigures figures;
  figures.section = sections_[section];
  figures.time_s = running.time_s;
  figures.peak_mm = running.peak;
  figures.rest = running.rest;
  figures.command = running.command;
  figures.response = running.response;
  figures.command_sides = running.command_sides;
  figures.response_sides = running.response_sides;
  const SweptWalls::Profile walls = walls_.profile(section);
  figures.left = wall_figures(walls.left);
  figures.right = wall_figures(walls.right);
  std::vector<double> width(walls.left.size());
  for (std::size_t i = 0; i < width.size(); ++i) {
    width[i] = 2.0 * options_.tool_radius_mm + walls.left[i] - walls.right[i];
  }
  figures.width = wall_figures(width);
  const ArcTrack* arc = track_of_[section] < 0 ? nullptr : &tracks_[static_cast<std::size_t>(track_of_[section])];
  figures.left_roughness = roughness_of(walls.left, walls.spacing_mm, arc);
  figures.right_roughness = roughness_of(walls.right, walls.spacing_mm, arc);
  if (arc != nullptr) measure_arc(*arc, walls, figures);
  return figures;
}

// Several arcs about one centre: their areas together, of their sectors together.
void SectionMetrology::measure_orbits(std::vector<SectionFigures>& figures) const {
  const std::vector<double> command = command_.orbit.percent();
  const std::vector<double> response = response_.orbit.percent();
  std::vector<double> sector(sections_.size(), 0.0);
  std::size_t arc = 0;
  for (std::size_t i = 0; i < path_.size(); ++i) {
    if (path_[i].kind != SegmentKind::arc) continue;
    const std::int32_t section = section_of_[i];
    if (section >= 0 && track_of_[static_cast<std::size_t>(section)] >= 0) {
      const auto at = static_cast<std::size_t>(section);
      const double r0 = path_[i].start_radius_mm;
      const double r1 = path_[i].end_radius_mm;
      const double area = std::abs(path_[i].sweep_rad) * (r0 * r0 + r0 * r1 + r1 * r1);
      const auto mean = [&](const std::optional<double>& so_far, double next) {
        return (so_far.value_or(0.0) * sector[at] + next * area) / (sector[at] + area);
      };
      figures[at].command_orbit_percent = mean(figures[at].command_orbit_percent, command[arc]);
      figures[at].response_orbit_percent = mean(figures[at].response_orbit_percent, response[arc]);
      sector[at] += area;
    }
    ++arc;
  }
}

TrackFigures SectionMetrology::finish() const {
  TrackFigures figures;
  figures.sections.reserve(sections_.size());
  for (std::size_t i = 0; i < sections_.size(); ++i) figures.sections.push_back(figures_of(i));
  measure_orbits(figures.sections);
  figures.rest = vibration_.rest();
  figures.duration_s = figures.rest.begin_s;
  figures.command = command_.whole;
  figures.command.include_missed(command_.reach.largest_mm());
  figures.response = response_.whole;
  figures.response.include_missed(response_.reach.largest_mm());
  figures.command_sides = command_.sides;
  figures.response_sides = response_.sides;
  const std::int32_t last = section_of_[command_.tracker.segment()];
  if (last >= 0 && has_moved_) {
    // The stop at the end is the one that a part is left with: it counts even if one before was worse.
    figures.sections[static_cast<std::size_t>(last)].rest = figures.rest;
  }
  return figures;
}

}  // namespace shapegcode
