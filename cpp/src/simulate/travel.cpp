#include "shapegcode/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/motion.hpp"
#include "simulate/filter_chain.hpp"

namespace shapegcode {
namespace {

constexpr double same_position_mm = 1e-6;
constexpr double steepest = 0.05;  // share of the path in XY below which it counts as a plunge

// Follows set-points along a path and records speed and time between two stations.
class Follower {
 public:
  Follower(const Path& path, std::span<const double> stations, const TravelOptions& options)
      : stations_(stations), options_(options), filters_(options.axis_filters), tracker_(path), path_(path) {
    require_period(options.period_s);
    require_not_below_zero(options.window_s, "window of a travel", "s");
    double before = 0.0;
    for (const double s : stations) {
      if (!(s >= before)) {
        throw Error(ErrorKind::argument, fmt::format("station at {} mm: stations must ascend", s));
      }
      before = s;
    }
    if (stations.empty() || std::abs(before - path.length_mm()) > 1e-6) {
      throw Error(ErrorKind::argument,
                  fmt::format("the stations end at {} mm, the path at {} mm", before, path.length_mm()));
    }
    const double window = std::round(options.window_s / options.period_s);
    const auto periods = require_count(window, max_filter_samples, "window of a travel", "periods");
    steps_.assign(std::max<std::size_t>(static_cast<std::size_t>(periods), 1), Vector3::Zero());
    result_.highest_mm_per_s.assign(stations.size(), 0.0);
    result_.time_s.assign(stations.size(), 0.0);
  }

  void add(Vector3 setpoint) {
    if (!started_) {
      filters_.reset(setpoint);
      last_ = setpoint;
      started_ = true;
    }
    filters_.step(setpoint);
    const Vector3 step = setpoint - last_;
    last_ = setpoint;
    tracker_.step(setpoint);
    ++count_;
    const bool moves = step.squaredNorm() > 0.0;
    if (moves) {
      moved_ = count_;
    }
    Vector3& oldest = steps_[next_];
    within_ += step - oldest;
    oldest = step;
    next_ = next_ + 1 == steps_.size() ? 0 : next_ + 1;
    if (next_ == 0) {  // a sum that is made again each time the ring turns over does not collect rounding errors
      within_ = Vector3::Zero();
      for (const Vector3& part : steps_) {
        within_ += part;
      }
    }
    const double speed = moves ? chip_travel(step) / (static_cast<double>(steps_.size()) * options_.period_s) : 0.0;
    // The period covers the sections from where it began to where it ended.
    advance(behind_mm_ + same_position_mm);
    const std::size_t from = station_;
    behind_mm_ = tracker_.s_mm();
    advance(behind_mm_ - same_position_mm);
    for (std::size_t i = from; i <= station_; ++i) {
      result_.highest_mm_per_s[i] = std::max(result_.highest_mm_per_s[i], speed);
    }
    if (moves) {
      result_.time_s[station_] += options_.period_s;
    }
  }

  Travel finish(const Vector3& end) {
    for (int i = 0; i < filters_.tail(); ++i) {
      add(end);
    }
    // A section without length, as at a corner with a station on both sides, has the feed of the one before it; the
    // first one that of the next.
    if (stations_.size() > 1 && stations_[0] < same_position_mm) {
      result_.highest_mm_per_s[0] = result_.highest_mm_per_s[1];
    }
    for (std::size_t i = 1; i < stations_.size(); ++i) {
      if (stations_[i] - stations_[i - 1] < same_position_mm) {
        result_.highest_mm_per_s[i] = std::max(result_.highest_mm_per_s[i], result_.highest_mm_per_s[i - 1]);
      }
    }
    result_.duration_s = moved_ > 0 ? static_cast<double>(moved_ - 1) * options_.period_s : 0.0;
    return std::move(result_);
  }

 private:
  // To the station before which a position lies.
  void advance(double s_mm) noexcept {
    while (station_ + 1 < stations_.size() && stations_[station_] < s_mm) {
      ++station_;
    }
  }

  // Travel within the window in the direction of the present step, as travel along the path: a chip is cut by the
  // travel in XY alone, and what was travelled before a corner does not make it thicker.
  [[nodiscard]] double chip_travel(const Vector3& step) const noexcept {
    const std::size_t i = tracker_.segment();
    const double level = tangent_at(path_[i], tracker_.s_mm() - path_.distance_mm(i)).head<2>().norm();
    const double step_xy = step.head<2>().norm();
    if (level < steepest) {
      return std::max(0.0, within_.dot(step) / step.norm());
    }
    if (!(step_xy > 0.0)) {
      return 0.0;
    }
    return std::max(0.0, within_.head<2>().dot(step.head<2>()) / step_xy / level);
  }

  std::span<const double> stations_;
  const TravelOptions& options_;
  detail::FilterChain filters_;
  ContourTracker tracker_;
  Travel result_;
  std::vector<Vector3> steps_;  // of each period in the window, a ring
  std::size_t next_ = 0;
  Vector3 within_ = Vector3::Zero();  // their sum
  const Path& path_;
  std::size_t station_ = 0;
  double behind_mm_ = 0.0;  // along the path, at the set-point before
  std::size_t count_ = 0;
  std::size_t moved_ = 0;
  bool started_ = false;
  Vector3 last_ = Vector3::Zero();
};

Segment last_of(const Segments& segments) {
  if (segments.empty()) {
    throw Error(ErrorKind::argument, "a travel needs a path with at least one segment");
  }
  return segments.back();
}

template <typename Motion>
Travel follow(Motion& motion, const Path& path, const Vector3& end, std::span<const double> stations,
              const TravelOptions& options) {
  Follower follower(path, stations, options);
  Vector3 position = Vector3::Zero();
  while (motion.step(position)) {
    follower.add(position);
  }
  return follower.finish(end);
}

}  // namespace

Travel travel_path(const std::shared_ptr<const Path>& path, const std::shared_ptr<const SpeedProfile>& profile,
                   const Path& along, std::span<const double> stations_mm, const TravelOptions& options) {
  Interpolator interpolator(path, profile, options.period_s);
  return follow(interpolator, along, last_of(path->segments()).end_mm, stations_mm, options);
}

Travel travel_blocks(const Segments& blocks, const Path& along, BlockEnd block_end, std::span<const double> stations_mm,
                     const TravelOptions& options) {
  BlockInterpolator motion(blocks, options.period_s, block_end);
  return follow(motion, along, last_of(blocks).end_mm, stations_mm, options);
}

}  // namespace shapegcode
