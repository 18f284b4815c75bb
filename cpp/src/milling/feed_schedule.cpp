#include "shapegcode/milling/feed.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "milling/checks.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

constexpr double rounding_mm = 1e-9;
constexpr double same_position_mm = 1e-6;
constexpr double border_charge = 0.01;    // of the time of the shortest section
constexpr double candidates = 4.0;        // for a border, per least length within a block
constexpr double longest_section = 16.0;  // least lengths; longer ones come from equal neighbours
constexpr double seconds_per_minute = 60.0;

void check(std::span<const FeedBlock> blocks, const FeedStations& stations, const FeedScheduleOptions& options) {
  if (blocks.empty() || stations.s_mm.empty() || stations.s_mm.size() != stations.feed_mm_per_min.size()) {
    refuse("a feed schedule needs blocks, and stations with one feed each");
  }
  double before = 0.0;
  for (const FeedBlock& block : blocks) {
    if (!(block.end_mm >= before) || !std::isfinite(block.end_mm)) {
      refuse("blocks of a feed schedule must ascend: one ends at {} mm", block.end_mm);
    }
    before = block.end_mm;
  }
  if (!(before > 0.0)) refuse("the blocks of a feed schedule end at {} mm, must have a length", before);
  if (!(std::abs(stations.s_mm.back() - before) <= 1e-6)) {
    refuse("the stations end at {} mm, the blocks at {} mm", stations.s_mm.back(), before);
  }
  before = 0.0;
  for (std::size_t i = 0; i < stations.s_mm.size(); ++i) {
    if (!(stations.s_mm[i] >= before) || !(stations.feed_mm_per_min[i] > 0.0)) {
      refuse("station at {} mm with feed {} mm/min: must ascend, feeds above 0", stations.s_mm[i],
             stations.feed_mm_per_min[i]);
    }
    before = stations.s_mm[i];
  }
  if (!(options.least_length_mm > 0.0) || !(options.most_change_mm_per_min > 0.0) ||
      !(options.resolution_mm_per_min > 0.0)) {
    refuse("least length, largest change and resolution of a feed schedule must be above 0");
  }
  detail::check_pieces(blocks.back().end_mm, options.least_length_mm / candidates, "a quarter of the least length");
}

// Lowest feed over a section; sections must be requested in ascending order.
class LowestFeed {
 public:
  explicit LowestFeed(const FeedStations& stations) : stations_(stations) {}
  double operator()(double begin_mm, double end_mm) {
    while (first_ + 1 < stations_.s_mm.size() && stations_.s_mm[first_] <= begin_mm + rounding_mm) {
      ++first_;
    }
    double lowest = stations_.feed_mm_per_min[first_];
    for (std::size_t i = first_; i + 1 < stations_.s_mm.size() && stations_.s_mm[i] < end_mm - rounding_mm; ++i) {
      lowest = std::min(lowest, stations_.feed_mm_per_min[i + 1]);
    }
    return lowest;
  }

 private:
  const FeedStations& stations_;
  std::size_t first_ = 0;
};

// A change of feed spread over the distance that it needs at max_change per least length.
FeedStations with_ramps(const FeedStations& stations, const FeedScheduleOptions& options) {
  FeedStations ramped = stations;
  if (!std::isfinite(options.most_change_mm_per_min)) {
    return ramped;
  }
  const double slope = options.most_change_mm_per_min / options.least_length_mm;
  std::vector<double>& feed = ramped.feed_mm_per_min;
  for (std::size_t i = 1; i < feed.size(); ++i) {
    feed[i] = std::min(feed[i], feed[i - 1] + slope * (ramped.s_mm[i] - ramped.s_mm[i - 1]));
  }
  for (std::size_t i = feed.size() - 1; i > 0; --i) {
    feed[i - 1] = std::min(feed[i - 1], feed[i] + slope * (ramped.s_mm[i] - ramped.s_mm[i - 1]));
  }
  return ramped;
}

double rounded_down(double feed, const FeedScheduleOptions& options) {
  // Divided by its inverse: 2067 / 10 is the nearest number to 206.7, 2067 * .1 is not.
  const double whole = std::floor(feed / options.resolution_mm_per_min + 1e-9) / (1.0 / options.resolution_mm_per_min);
  return whole > 0.0 ? whole : feed;
}

// Where a run of blocks may change its feed, its start and end included.
std::vector<double> border_candidates(double begin_mm, std::span<const FeedBlock> run, double least_mm) {
  std::vector<double> borders = {begin_mm};
  for (const FeedBlock& block : run) {
    const double from = borders.back();
    const double room = block.end_mm - from - 2.0 * least_mm;
    if (block.divisible && room > -rounding_mm) {
      const auto steps = static_cast<std::size_t>(std::max(0.0, std::ceil(candidates * room / least_mm - rounding_mm)));
      const double width = steps > 0 ? room / static_cast<double>(steps) : 0.0;
      for (std::size_t k = 0; k <= steps; ++k) {
        borders.push_back(from + least_mm + width * static_cast<double>(k));
      }
    }
    if (block.end_mm > from) {
      borders.push_back(block.end_mm);
    }
  }
  return borders;
}

// Borders of the sections of one run: the cheapest ones from its start to its end.
void schedule_run(const std::vector<double>& borders, LowestFeed& lowest, const FeedScheduleOptions& options,
                  std::vector<FeedStretch>& sections) {
  const std::size_t count = borders.size();
  std::vector<double> between(count - 1);
  for (std::size_t k = 0; k + 1 < count; ++k) {
    between[k] = lowest(borders[k], borders[k + 1]);
  }
  struct Best {
    double cost = std::numeric_limits<double>::infinity();
    std::size_t from = 0;
    double feed = 0.0;
  };
  std::vector<Best> best(count);
  best[0].cost = 0.0;
  const double least = options.least_length_mm - rounding_mm;
  for (std::size_t to = 1; to < count; ++to) {
    double feed = std::numeric_limits<double>::infinity();
    for (std::size_t from = to; from-- > 0;) {
      feed = std::min(feed, between[from]);
      const double length = borders[to] - borders[from];
      if (length > longest_section * options.least_length_mm && std::isfinite(best[to].cost)) {
        break;
      }
      // A run that is too short as a whole is one section.
      const bool whole = from == 0 && to + 1 == count;
      if ((length < least && !whole) || !std::isfinite(best[from].cost)) {
        continue;
      }
      const double used = rounded_down(feed, options);
      const double cost =
          best[from].cost + (length + border_charge * options.least_length_mm) / used * seconds_per_minute;
      if (cost < best[to].cost) {
        best[to] = {cost, from, used};
      }
    }
  }
  const std::size_t first = sections.size();
  for (std::size_t to = count - 1; to > 0; to = best[to].from) {
    sections.push_back({borders[best[to].from], borders[to], best[to].feed});
  }
  std::reverse(sections.begin() + static_cast<std::ptrdiff_t>(first), sections.end());
}

Segment piece_of(const Segment& segment, const Vector3& from, const Vector3& to, double share, double feed_mm_per_s) {
  return segment.kind == SegmentKind::arc ? make_arc(from, to, segment.centre_mm, segment.sweep_rad * share,
                                                     segment.normal, feed_mm_per_s, segment.line)
                                          : make_line(from, to, feed_mm_per_s, segment.line);
}

void limit_change(std::vector<FeedStretch>& sections, const std::vector<bool>& kept, double most) {
  for (std::size_t i = 1; i < sections.size(); ++i) {
    if (!kept[i]) {
      sections[i].feed_mm_per_min = std::min(sections[i].feed_mm_per_min, sections[i - 1].feed_mm_per_min + most);
    }
  }
  for (std::size_t i = sections.size() - 1; i > 0; --i) {
    if (!kept[i - 1]) {
      sections[i - 1].feed_mm_per_min = std::min(sections[i - 1].feed_mm_per_min, sections[i].feed_mm_per_min + most);
    }
  }
}

}  // namespace

std::vector<FeedStretch> schedule_feed(std::span<const FeedBlock> blocks, const FeedStations& stations,
                                       const FeedScheduleOptions& options) {
  check(blocks, stations, options);
  const FeedStations ramped = with_ramps(stations, options);
  LowestFeed lowest(ramped);
  std::vector<FeedStretch> sections;
  std::vector<bool> kept;
  double begin = 0.0;
  for (std::size_t i = 0; i < blocks.size();) {
    if (blocks[i].kept_mm_per_min > 0.0) {
      if (blocks[i].end_mm > begin) {
        sections.push_back({begin, blocks[i].end_mm, blocks[i].kept_mm_per_min});
        kept.push_back(true);
      }
      begin = blocks[i].end_mm;
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < blocks.size() && !(blocks[end].kept_mm_per_min > 0.0)) {
      ++end;
    }
    const std::vector<double> borders = border_candidates(begin, blocks.subspan(i, end - i), options.least_length_mm);
    if (borders.size() > 1) {
      schedule_run(borders, lowest, options, sections);
      kept.resize(sections.size(), false);
    }
    begin = blocks[end - 1].end_mm;
    i = end;
  }
  limit_change(sections, kept, options.most_change_mm_per_min);
  std::vector<FeedStretch> merged;
  for (const FeedStretch& section : sections) {
    if (!merged.empty() && merged.back().feed_mm_per_min == section.feed_mm_per_min) {
      merged.back().end_mm = section.end_mm;
    } else {
      merged.push_back(section);
    }
  }
  return merged;
}

bool covers(std::span<const FeedStretch> sections, double length_mm) {
  double at = 0.0;
  for (const FeedStretch& section : sections) {
    if (!(std::abs(section.begin_mm - at) <= same_position_mm && section.end_mm >= section.begin_mm)) return false;
    at = section.end_mm;
  }
  return !sections.empty() && std::abs(at - length_mm) <= same_position_mm;
}

Path with_feeds(const Path& path, std::span<const FeedStretch> sections) {
  if (!covers(sections, path.length_mm())) {
    refuse("the sections of a feed schedule must cover the path of {} mm", path.length_mm());
  }
  std::vector<Segment> pieces;
  pieces.reserve(path.size() + sections.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Segment& segment = path[i];
    const double begin = path.distance_mm(i);
    const double end = path.distance_mm(i + 1);
    while (k + 1 < sections.size() && sections[k].end_mm <= begin + same_position_mm) {
      ++k;
    }
    Vector3 from = segment.start_mm;
    double at = begin;
    for (; k < sections.size(); ++k) {
      const double feed = sections[k].feed_mm_per_min / seconds_per_minute;
      if (k + 1 == sections.size() || sections[k].end_mm >= end - same_position_mm) {
        pieces.push_back(piece_of(segment, from, segment.end_mm, (end - at) / segment.length_mm, feed));
        pieces.back().stop_at_end = segment.stop_at_end;
        break;
      }
      const Vector3 to = point_at(segment, sections[k].end_mm - begin);
      pieces.push_back(piece_of(segment, from, to, (sections[k].end_mm - at) / segment.length_mm, feed));
      from = to;
      at = sections[k].end_mm;
    }
  }
  return Path(pieces);
}

void look_ahead_on_load(FeedStations& stations, std::span<const double> load_mm_per_min,
                        std::span<const double> before_s, std::span<const double> behind_s) {
  const std::size_t count = stations.s_mm.size();
  if (before_s.size() != count || behind_s.size() != count || load_mm_per_min.size() != count ||
      stations.feed_mm_per_min.size() != count) {
    refuse("a look-ahead on the load needs one load and two times per station");
  }
  const std::vector<double>& s = stations.s_mm;
  std::vector<double>& feed = stations.feed_mm_per_min;
  for (std::size_t i = 0; i < count; ++i) {
    const double load = load_mm_per_min[i];
    if (!std::isfinite(load)) {
      continue;
    }
    const double begin = i > 0 ? s[i - 1] : 0.0;  // of the section for which station i speaks
    for (std::size_t k = i; k-- > 0 && begin - s[k] < before_s[i] * load / seconds_per_minute;) {
      feed[k] = std::min(feed[k], load);
    }
    for (std::size_t k = i + 1; k < count && s[k - 1] - s[i] < behind_s[i] * load / seconds_per_minute; ++k) {
      feed[k] = std::min(feed[k], load);
    }
  }
}

}  // namespace shapegcode
