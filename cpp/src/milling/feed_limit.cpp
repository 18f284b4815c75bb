#include "shapegcode/milling/feed.hpp"

#include <algorithm>
#include <cmath>

#include "milling/checks.hpp"

namespace shapegcode {

namespace {

using detail::refuse;

// Accepted fraction of the limit reached, and the target fraction, chosen so that a step ends on the safe side.
constexpr double accepted = 1.0 - 2e-4;
constexpr double aimed = 1.0 - 8e-5;
constexpr double first_exponent = 0.85;  // of a force against the feed, before anything is known
constexpr double narrow = 1e-7;          // bracket, relative
constexpr int max_steps = 80;

struct Load {
  double share = 0.0;  ///< of the limit that is nearest to being reached
  FeedLimit limit = FeedLimit::none;
};

class Search {
 public:
  Search(MillingForce& force, const FeedLimits& limits) : force_(force), limits_(limits) {
    const auto bounded = [](double limit) { return limit < FeedLimits::none; };
    forces_ = bounded(limits.mean_resultant_n) || bounded(limits.peak_resultant_n) || bounded(limits.peak_torque_nm) ||
              bounded(limits.mean_power_w) || bounded(limits.peak_chip_mm);
    deflection_ = bounded(limits.peak_deflection_um);
  }

  void look_at(std::span<const EngagedArc> arcs) { arcs_ = arcs; }

  [[nodiscard]] Load at(double feed) const {
    Load load;
    const auto note = [&load](double value, double limit, FeedLimit which) {
      if (value / limit > load.share) load = {value / limit, which};
    };
    note(force_.feed_per_tooth_mm(feed), limits_.feed_per_tooth_mm, FeedLimit::chip_load);
    if (forces_) {
      const ForceFigures f = force_.quick_figures(arcs_, feed);
      note(f.mean_resultant_n, limits_.mean_resultant_n, FeedLimit::resultant);
      note(f.peak_resultant_n, limits_.peak_resultant_n, FeedLimit::resultant);
      note(f.peak_torque_nm, limits_.peak_torque_nm, FeedLimit::torque);
      note(f.mean_power_w, limits_.mean_power_w, FeedLimit::power);
      note(f.peak_chip_mm, limits_.peak_chip_mm, FeedLimit::chip_load);
    }
    if (deflection_) {
      note(force_.peak_deflection_um(arcs_, feed, *limits_.beam), limits_.peak_deflection_um, FeedLimit::deflection);
    }
    return load;
  }

  // Secant of the logarithms within a bracket, from `start` on; every feed within the limits that is met is kept.
  [[nodiscard]] LimitedFeed run(double lowest, double highest, double start) {
    double low = lowest;
    double high = highest;
    bool low_known = false;
    bool high_known = false;
    Load below;
    Load above;
    double last_feed = 0.0;
    double last_share = 0.0;
    double next = std::clamp(start, lowest, highest);
    for (int step = 0; step < max_steps; ++step) {
      const Load load = at(next);
      if (load.share <= 1.0) {
        if (next >= highest) return {highest, FeedLimit::none, true};
        if (load.share >= accepted) return {next, load.limit, true};
        low = next;
        below = load;
        low_known = true;
      } else {
        if (next <= lowest) return {lowest, load.limit, false};
        high = next;
        above = load;
        high_known = true;
      }
      if (low_known && high_known && high - low <= narrow * high) break;
      const double slope = std::log(load.share / last_share) / std::log(next / last_feed);
      if (step > 0 && std::isfinite(slope)) exponent_ = std::clamp(slope, 0.1, 10.0);
      last_feed = next;
      last_share = load.share;
      next = load.share > 0.0 ? next * std::pow(aimed / load.share, 1.0 / exponent_) : highest;
      // Towards an end that has not been tried the step goes there at most; within a bracket it must stay inside.
      if (next >= high) next = high_known ? std::sqrt(low * high) : high;
      if (next <= low) next = low_known ? std::sqrt(low * high) : low;
    }
    if (!low_known) return {lowest, above.limit, at(lowest).share <= 1.0};
    // A feed below the limits that does not reach one: the load jumps there.
    return {low, high_known ? above.limit : below.limit, true};
  }

 private:
  MillingForce& force_;
  std::span<const EngagedArc> arcs_;
  const FeedLimits& limits_;
  bool forces_ = false;
  bool deflection_ = false;
  double exponent_ = first_exponent;  // of the load against the feed
};

void check_range(double lowest, double highest) {
  if (!(lowest > 0.0 && lowest <= highest && std::isfinite(highest))) {
    refuse("feeds to choose from are {} ... {} mm/min, must be above 0 and in order", lowest, highest);
  }
}

}  // namespace

void check(const FeedLimits& limits) {
  const auto positive = [](double value, const char* what) {
    if (!(value > 0.0)) {
      refuse("limit of the {} is {}, must be above 0", what, value);
    }
  };
  positive(limits.mean_resultant_n, "mean resultant force in N");
  positive(limits.peak_resultant_n, "peak resultant force in N");
  positive(limits.peak_deflection_um, "deflection in um");
  positive(limits.peak_torque_nm, "torque in N m");
  positive(limits.mean_power_w, "power in W");
  positive(limits.feed_per_tooth_mm, "feed per tooth in mm");
  positive(limits.peak_chip_mm, "chip thickness in mm");
  if (limits.beam) check(*limits.beam);
  if (limits.peak_deflection_um < FeedLimits::none && !limits.beam) {
    refuse("limit of the deflection is {} um, but the tool's overhang and diameters are not given",
           limits.peak_deflection_um);
  }
}

LimitedFeed largest_feed(MillingForce& force, std::span<const EngagedArc> arcs, const FeedLimits& limits, double lowest,
                         double highest) {
  check(limits);
  check_range(lowest, highest);
  Search search(force, limits);
  search.look_at(arcs);
  return search.run(lowest, highest, highest);
}

std::vector<LimitedFeed> largest_feeds(MillingForce& force, const EngagementTrack& track, const FeedLimits& limits,
                                       double lowest, double highest) {
  check(limits);
  check_range(lowest, highest);
  std::vector<LimitedFeed> feeds;
  feeds.reserve(track.size());
  Search search(force, limits);
  double start = highest;  // the feed of the sample before is near
  for (std::size_t i = 0; i < track.size(); ++i) {
    const auto arcs = track.arcs_of(i);
    const double level = track.horizontal[i];
    if (arcs.empty() || !(level > 1e-9)) {
      feeds.push_back({highest, FeedLimit::none, true});
      continue;
    }
    if (i > 0 && level == track.horizontal[i - 1] && detail::same_arcs(arcs, track.arcs_of(i - 1))) {
      feeds.push_back(feeds.back());
      continue;
    }
    search.look_at(arcs);
    LimitedFeed feed = search.run(lowest * level, highest * level, start * level);
    start = feed.feed_mm_per_min / level;
    feed.feed_mm_per_min = std::clamp(feed.feed_mm_per_min / level, lowest, highest);
    feeds.push_back(feed);
  }
  return feeds;
}

}  // namespace shapegcode
