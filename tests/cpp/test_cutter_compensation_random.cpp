#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "program/interpret/arc_geometry.hpp"
#include "program/rewrite/cutter_compensation.hpp"
#include "random_blocks.hpp"
#include "shapegcode/error.hpp"

// Properties of compensated paths on random programs, by brute force: the distance of dense samples of the tool centre
// to the programmed blocks, with a distance function of its own.

using shapegcode::ArcWords;
using shapegcode::compensate;
using shapegcode::CompensatedMove;
using shapegcode::CompensationBlock;
using shapegcode::CompensationOptions;
using shapegcode::Error;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::point_at;
using shapegcode::resolve_arc;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::Vector3;
using shapegcode::tests::block_from;
using shapegcode::tests::Random;
using shapegcode::tests::uniform;

namespace {

constexpr double pi = std::numbers::pi;

/// A chain in G17 that starts and is cancelled by lines of its own.
struct Chain {
  std::vector<CompensationBlock> blocks;
  Vector3 at = Vector3::Zero();
  double heading = 0.0;
  int mode = 41;
  double radius = 1.0;

  void add(const Segment& segment) {
    blocks.push_back({segment, mode, radius});
    blocks.back().segment.line = static_cast<std::uint32_t>(blocks.size());
    at = segment.end_mm;
  }
  void line(double length) { add(block_from(at, heading, length, 0.0, 1.0, 10.0)); }
  void arc(double arc_radius, double sweep) {
    add(block_from(at, heading, arc_radius * std::abs(sweep), arc_radius, sweep < 0.0 ? -1.0 : 1.0, 10.0));
    heading += sweep;
  }
};

/// Distance of `p` to a block in the XY plane, and whether the foot lies inside the block; `side` is positive on the
/// left.
struct Distance {
  double value = 0.0;
  double side = 0.0;
  bool interior = false;
};

Distance distance_to(const Segment& block, const Vector3& p) {
  const Vector3 from_start = p - block.start_mm;
  const Vector3 from_end = p - block.end_mm;
  const double to_ends = std::min(std::hypot(from_start.x(), from_start.y()), std::hypot(from_end.x(), from_end.y()));
  if (block.kind == SegmentKind::arc) {
    const Vector3 arm = p - block.centre_mm;
    const double sense = block.sweep_rad < 0.0 ? -1.0 : 1.0;
    const Vector3 first = block.start_mm - block.centre_mm;
    double ahead = sense * (std::atan2(arm.y(), arm.x()) - std::atan2(first.y(), first.x()));
    while (ahead < 0.0) ahead += 2.0 * pi;
    while (ahead >= 2.0 * pi) ahead -= 2.0 * pi;
    const double off = std::hypot(arm.x(), arm.y()) - block.start_radius_mm;
    if (ahead <= std::abs(block.sweep_rad)) return {std::abs(off), -sense * off, true};
    return {to_ends, 0.0, false};
  }
  const double dx = block.end_mm.x() - block.start_mm.x();
  const double dy = block.end_mm.y() - block.start_mm.y();
  const double length = std::hypot(dx, dy);
  if (length == 0.0) return {to_ends, 0.0, false};
  const double along = (from_start.x() * dx + from_start.y() * dy) / length;
  const double left = (dx * from_start.y() - dy * from_start.x()) / length;
  if (along >= 0.0 && along <= length) return {std::abs(left), left, true};
  return {to_ends, 0.0, false};
}

/// Distance of `p` to the unbounded line or circle of a block.
double distance_to_curve(const Segment& block, const Vector3& p) {
  if (block.kind == SegmentKind::arc) {
    return std::abs((p - block.centre_mm).norm() - block.start_radius_mm);
  }
  const Vector3 along = (block.end_mm - block.start_mm).normalized();
  return std::abs(along.x() * (p - block.start_mm).y() - along.y() * (p - block.start_mm).x());
}

double largest_gap(const std::vector<CompensatedMove>& moves) {
  double gap = 0.0;
  for (std::size_t i = 1; i < moves.size(); ++i) {
    gap = std::max(gap, (moves[i].segment.start_mm - moves[i - 1].segment.end_mm).norm());
  }
  return gap;
}

/// A chain that runs towards +X as the graph of a function: headings within 75 degrees of +X, blocks long against the
/// cutter, arcs larger than it. So no two blocks that are not neighbours come near each other.
Chain graph_chain(Random& random, int mode, double radius) {
  Chain chain;
  chain.mode = mode;
  chain.radius = radius;
  const double steepest = 75.0 * pi / 180.0;
  const double size = std::abs(radius);
  chain.heading = uniform(random, -steepest, steepest);
  chain.line(12.0 * size);
  for (int i = 0; i < 12; ++i) {
    // Some corners are tangent or nearly so.
    const double kind = uniform(random, 0.0, 1.0);
    if (kind < 0.7) chain.heading = uniform(random, -steepest, steepest);
    if (kind > 0.8) {
      chain.heading = std::clamp(chain.heading + std::pow(10.0, uniform(random, -9.0, -1.0)), -steepest, steepest);
    }
    if (uniform(random, 0.0, 1.0) < 0.5) {
      chain.line(uniform(random, 14.0, 40.0) * size);
    } else {
      const double target = uniform(random, -steepest, steepest);
      const double sweep = target - chain.heading;
      // Long against the cutter and not tightly curved.
      chain.arc(std::max(uniform(random, 14.0, 40.0) * size / std::max(std::abs(sweep), 1e-3), 12.0 * size), sweep);
    }
  }
  chain.mode = 40;
  chain.heading = uniform(random, -steepest, steepest);
  chain.line(20.0 * size);
  return chain;
}

Segment mirrored(const Segment& segment) {
  const auto flip = [](const Vector3& p) { return Vector3(p.x(), -p.y(), p.z()); };
  Segment result = segment.kind == SegmentKind::arc
                       ? make_arc(flip(segment.start_mm), flip(segment.end_mm), flip(segment.centre_mm),
                                  -segment.sweep_rad, segment.normal, segment.feed_mm_per_s, segment.line)
                       : make_line(flip(segment.start_mm), flip(segment.end_mm), segment.feed_mm_per_s, segment.line);
  if (segment.kind == SegmentKind::rapid) result.kind = SegmentKind::rapid;
  return result;
}

}  // namespace

TEST_CASE("cutter compensation: on random chains the tool centre keeps the radius, on its side, without gaps") {
  Random random(2024);
  double nearest = 1e9;       // least distance less the radius, in the offset path
  double worst_offset = 0.0;  // of the blocks' own moves from the radius
  double worst_gap = 0.0;
  double farthest = 0.0;  // in radii: acute corners reach sqrt(2)
  int wrong_side = 0;
  int samples = 0;
  for (int round = 0; round < 600; ++round) {
    const double radius = (round % 3 == 0 ? -1.0 : 1.0) * uniform(random, 0.2, 8.0);
    const int mode = round % 2 == 0 ? 41 : 42;
    const Chain chain = graph_chain(random, mode, radius);
    CompensationOptions options;
    options.start_up = round % 5 < 2 ? 'A' : 'B';
    const auto moves = compensate(chain.blocks, 2, options);
    worst_gap = std::max(worst_gap, largest_gap(moves));
    const double size = std::abs(radius);
    const double left = (mode == 41 ? 1.0 : -1.0) * (radius < 0.0 ? -1.0 : 1.0);
    const std::size_t last = chain.blocks.size() - 1;
    for (std::size_t m = 0; m < moves.size(); ++m) {
      const CompensatedMove& move = moves[m];
      const bool own = m + 1 == moves.size() || moves[m + 1].source != move.source;
      if (own && (move.source == 0 || move.source == last)) continue;  // on the way to and from the offset path
      const Segment& block = chain.blocks[move.source].segment;
      for (int k = 0; k <= 40; ++k) {
        const Vector3 p = point_at(move.segment, move.segment.length_mm * k / 40.0);
        if (own) worst_offset = std::max(worst_offset, std::abs(distance_to_curve(block, p) - size));
        Distance best{1e9};
        for (std::size_t i = 0; i <= last; ++i) {
          // Type A's start-up and cancel cut their own corner, and the blocks they are in are not machined.
          if (i == 0 || i == last) continue;
          const Distance distance = distance_to(chain.blocks[i].segment, p);
          if (distance.value < best.value) best = distance;
        }
        nearest = std::min(nearest, best.value - size);
        farthest = std::max(farthest, best.value / size);
        if (best.interior && best.side * left < 0.0) ++wrong_side;
        ++samples;
      }
    }
  }
  CHECK(samples > 200000);
  CHECK(nearest > -1e-6);
  CHECK(worst_offset < 1e-6);
  CHECK(worst_gap <= 1e-9);
  CHECK(wrong_side == 0);
  CHECK(farthest < std::sqrt(2.0) + 1e-9);
}

TEST_CASE("cutter compensation: the mirrored path with the other side gives the mirrored result") {
  Random random(7);
  double worst = 0.0;
  double worst_sweep = 0.0;
  for (int round = 0; round < 200; ++round) {
    const Chain chain = graph_chain(random, 41, uniform(random, -3.0, 3.0));
    std::vector<CompensationBlock> other = chain.blocks;
    for (CompensationBlock& block : other) {
      block.segment = mirrored(block.segment);
      if (block.mode == 41) block.mode = 42;
    }
    CompensationOptions options;
    options.start_up = round % 2 == 0 ? 'A' : 'B';
    const auto a = compensate(chain.blocks, 2, options);
    const auto b = compensate(other, 2, options);
    REQUIRE(a.size() == b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      CHECK(a[i].source == b[i].source);
      CHECK(a[i].segment.kind == b[i].segment.kind);
      worst = std::max(worst, (mirrored(a[i].segment).end_mm - b[i].segment.end_mm).norm());
      worst_sweep = std::max(worst_sweep, std::abs(a[i].segment.sweep_rad + b[i].segment.sweep_rad));
    }
  }
  CHECK(worst < 1e-9);
  CHECK(worst_sweep < 1e-9);
}

TEST_CASE("cutter compensation: the planes are one after turning the axes, and the normal axis is untouched") {
  Random random(99);
  const auto turned = [](const Vector3& p, int by) {
    Vector3 q;
    for (int axis = 0; axis < 3; ++axis) q[(axis + by) % 3] = p[axis];
    return q;
  };
  double worst = 0.0;
  for (int round = 0; round < 60; ++round) {
    Chain chain = graph_chain(random, 42, 1.5);
    double z = 0.0;
    for (CompensationBlock& block : chain.blocks) {  // lift every block: lines slope, arcs become helices
      block.segment.start_mm.z() = z;
      z += uniform(random, -2.0, 2.0);
      block.segment.end_mm.z() = z;
    }
    const auto flat = compensate(chain.blocks, 2, {});
    for (const int by : {1, 2}) {
      std::vector<CompensationBlock> other = chain.blocks;
      for (CompensationBlock& block : other) {
        const Segment& s = block.segment;
        block.segment = s.kind == SegmentKind::arc
                            ? make_arc(turned(s.start_mm, by), turned(s.end_mm, by), turned(s.centre_mm, by),
                                       s.sweep_rad, (2 + by) % 3, 10.0, s.line)
                            : make_line(turned(s.start_mm, by), turned(s.end_mm, by), 10.0, s.line);
      }
      const auto moves = compensate(other, (2 + by) % 3, {});
      REQUIRE(moves.size() == flat.size());
      for (std::size_t i = 0; i < moves.size(); ++i) {
        worst = std::max(worst, (turned(flat[i].segment.end_mm, by) - moves[i].segment.end_mm).norm());
      }
    }
    for (std::size_t i = 0; i < flat.size(); ++i) {
      const bool own = i + 1 == flat.size() || flat[i + 1].source != flat[i].source;
      const Segment& block = chain.blocks[flat[i].source].segment;
      CHECK(flat[i].segment.end_mm.z() == (own ? block.end_mm.z() : block.start_mm.z()));
      CHECK(flat[i].segment.start_mm.z() == block.start_mm.z());
    }
  }
  CHECK(worst < 1e-12);
}

TEST_CASE("cutter compensation: radius zero gives the programmed path, a vanishing one the same to its size") {
  Random random(5);
  for (int round = 0; round < 50; ++round) {
    Chain chain = graph_chain(random, 41, 2.0);
    for (CompensationBlock& block : chain.blocks) block.radius_mm = 0.0;
    const auto same = compensate(chain.blocks, 2, {});
    REQUIRE(same.size() == chain.blocks.size());
    for (std::size_t i = 0; i < same.size(); ++i) {
      CHECK(same[i].segment.end_mm == chain.blocks[i].segment.end_mm);
      CHECK(same[i].segment.kind == chain.blocks[i].segment.kind);
      CHECK(same[i].segment.sweep_rad == chain.blocks[i].segment.sweep_rad);
    }
    for (CompensationBlock& block : chain.blocks) block.radius_mm = 1e-9;
    const auto near = compensate(chain.blocks, 2, {});
    std::size_t at = 0;
    for (const CompensatedMove& move : near) {
      const bool own = at + 1 == near.size() || near[at + 1].source != move.source;
      ++at;
      const Segment& block = chain.blocks[move.source].segment;
      CHECK((move.segment.end_mm - (own ? block.end_mm : block.start_mm)).norm() <
            4e-9);  // 1 over the cosine of 75 degrees inside the sharpest corner
    }
  }
}

TEST_CASE("cutter compensation: tangent joints rounded to 1 um make neither spikes nor gaps") {
  // A smooth chain in words of 1 um, ends and centres; arcs are read back from their words as the interpreter does.
  Random random(31);
  const auto rounded = [](const Vector3& p) {
    return Vector3(std::round(p.x() * 1e3) / 1e3, std::round(p.y() * 1e3) / 1e3, 0.0);
  };
  double nearest = 1e9;
  double farthest = -1e9;
  double worst_gap = 0.0;
  double longest_own_loss = 0.0;
  for (int round = 0; round < 600; ++round) {
    Chain exact;
    exact.heading = uniform(random, -1.0, 1.0);
    exact.line(20.0);
    for (int i = 0; i < 10; ++i) {
      if (uniform(random, 0.0, 1.0) < 0.4) {
        exact.line(uniform(random, 1.0, 30.0));
      } else {
        const double sweep = uniform(random, 0.3, 1.2) * (exact.heading > 0.0 ? -1.0 : 1.0);
        exact.arc(uniform(random, 3.0, 60.0), sweep);
      }
    }
    std::vector<CompensationBlock> blocks;
    Vector3 at = rounded(exact.blocks.front().segment.start_mm);
    const double radius = round % 2 == 0 ? 2.0 : 2.999;
    for (const CompensationBlock& block : exact.blocks) {
      const Vector3 end = rounded(block.segment.end_mm);
      Segment segment = make_line(at, end, 10.0);
      if (block.segment.kind == SegmentKind::arc) {
        ArcWords words;
        words.start_mm = at;
        words.end_mm = end;
        words.clockwise = block.segment.sweep_rad < 0.0;
        words.centre_mm = at + rounded(block.segment.centre_mm - at);
        segment = resolve_arc(words, 10.0, 1, 1);
      }
      blocks.push_back({segment, round % 4 < 2 ? 41 : 42, radius});
      at = end;
    }
    const auto moves = compensate(blocks, 2, {});
    worst_gap = std::max(worst_gap, largest_gap(moves));
    for (std::size_t m = 1; m < moves.size(); ++m) {
      const Segment& move = moves[m].segment;
      longest_own_loss = std::max(longest_own_loss, move.length_mm - 20.0 * blocks[moves[m].source].segment.length_mm);
      for (int k = 0; k <= 20; ++k) {
        const Vector3 p = point_at(move, move.length_mm * k / 20.0);
        double distance = 1e9;
        for (std::size_t i = 1; i < blocks.size(); ++i) {
          distance = std::min(distance, distance_to(blocks[i].segment, p).value);
        }
        nearest = std::min(nearest, distance - radius);
        farthest = std::max(farthest, distance - radius);
      }
    }
  }
  CHECK(worst_gap <= 1e-9);
  CHECK(nearest > -2e-3);  // a rounded end and a rounded centre
  CHECK(farthest < 2e-3);
  CHECK(longest_own_loss <= 0.0);
}

TEST_CASE("cutter compensation: arbitrary chains end in a path or a refusal") {
  Random random(123456);
  std::map<int, int> outcome;
  int bad = 0;
  for (int round = 0; round < 60000; ++round) {
    Chain chain;
    const int count = 1 + static_cast<int>(uniform(random, 0.0, 8.0));
    const double scale = std::pow(10.0, uniform(random, -4.0, 3.0));
    chain.mode = round % 2 == 0 ? 41 : 42;
    chain.radius = scale * std::pow(10.0, uniform(random, -3.0, 1.0));
    for (int i = 0; i < count; ++i) {
      const double kind = uniform(random, 0.0, 1.0);
      const double turn = uniform(random, 0.0, 1.0);
      if (turn < 0.5) chain.heading += uniform(random, -pi, pi);
      if (turn > 0.8) chain.heading += std::round(uniform(random, -2.0, 2.0)) * 0.5 * pi;
      if (turn > 0.9) chain.heading += std::pow(10.0, uniform(random, -16.0, -2.0));
      if (kind < 0.45 || i == 0) {
        chain.line(scale * uniform(random, 0.1, 10.0));
      } else if (kind < 0.85) {
        chain.arc(scale * std::pow(10.0, uniform(random, -2.0, 1.0)),
                  uniform(random, 0.0, 1.0) < 0.1 ? 2.0 * pi : uniform(random, -2.0 * pi, 2.0 * pi));
      } else if (kind < 0.9) {
        chain.add(make_line(chain.at, chain.at + Vector3(0, 0, scale), 5.0));
      } else {
        chain.line(uniform(random, 0.0, 1.0) < 0.5 ? 0.0 : 5e-8);  // under what counts as motion
      }
      if (chain.blocks.back().segment.kind == SegmentKind::line && uniform(random, 0.0, 1.0) < 0.1) {
        chain.blocks.back().segment.kind = SegmentKind::rapid;
      }
      if (uniform(random, 0.0, 1.0) < 0.05) chain.mode = chain.mode == 41 ? 42 : 41;
      if (uniform(random, 0.0, 1.0) < 0.03) chain.mode = 40;
      if (uniform(random, 0.0, 1.0) < 0.05) chain.radius *= uniform(random, -1.0, 1.5);
      if (uniform(random, 0.0, 1.0) < 0.03) chain.radius = 0.0;
    }
    CompensationOptions options;
    options.start_up = round % 3 == 0 ? 'B' : 'A';
    options.check_interference = round % 7 != 0;
    options.ignorable_corner_mm = round % 4 == 0 ? 0.1 * scale : 0.0;
    options.blocks_read = 3 + round % 6;
    try {
      const auto moves = compensate(chain.blocks, 2, options);
      bool fine = largest_gap(moves) <= 1e-9;
      std::vector<bool> seen(chain.blocks.size(), false);
      std::size_t source = 0;
      for (const CompensatedMove& move : moves) {
        const Segment& s = move.segment;
        fine = fine && s.start_mm.allFinite() && s.end_mm.allFinite() && std::isfinite(s.length_mm) &&
               std::isfinite(s.sweep_rad) && move.source >= source;
        if (s.kind == SegmentKind::arc) {
          // The arc's own formula must end where it says it ends.
          fine = fine && std::abs(s.sweep_rad) <= 4.0 * pi &&
                 (point_at(s, s.length_mm * (1.0 - 1e-12)) - s.end_mm).norm() <= 1e-6 * (scale + s.length_mm);
        }
        source = move.source;
        seen[source] = true;
      }
      fine = fine && std::all_of(seen.begin(), seen.end(), [](bool one) { return one; });
      bad += fine ? 0 : 1;
      ++outcome[0];
    } catch (const Error& error) {
      ++outcome[error.alarm()];
      bad += error.alarm() == 0 || error.line() == 0 ? 1 : 0;
    }
  }
  CHECK(bad == 0);
  CHECK(outcome[0] > 1000);
  for (const int alarm : {33, 34, 41}) CHECK_MESSAGE(outcome[alarm] > 100, alarm);
}
