#pragma once

#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include "program/rewrite/cutter_compensation.hpp"

// Programs for the tests of cutter compensation, and their results as text.
namespace shapegcode::tests {

inline constexpr double pi = std::numbers::pi;

/// A program in G17 that is written block by block; every block has its own source line.
struct Program {
  std::vector<CompensationBlock> blocks;
  Vector3 at = Vector3::Zero();
  int mode = 41;
  double radius = 2.0;

  Segment& add(const Segment& segment) {
    blocks.push_back({segment, mode, radius});
    blocks.back().segment.line = static_cast<std::uint32_t>(blocks.size());
    at = segment.end_mm;
    return blocks.back().segment;
  }
  Segment& line(double x, double y) { return add(make_line(at, {x, y, at.z()}, 10.0 * (double(blocks.size()) + 1.0))); }
  Segment& height(double z) { return add(make_line(at, {at.x(), at.y(), z}, 5.0)); }
  Segment& arc(double x, double y, double centre_x, double centre_y, double sweep_degrees) {
    return add(make_arc(at, {x, y, at.z()}, {centre_x, centre_y, 0.0}, sweep_degrees * pi / 180.0, 2,
                        10.0 * (double(blocks.size()) + 1.0)));
  }
  [[nodiscard]] std::vector<CompensatedMove> run(const CompensationOptions& options = {}) const {
    return compensate(blocks, 2, options);
  }
};

/// Ends of the moves, one text per move: easy to hold against a drawing.
inline std::string ends(const std::vector<CompensatedMove>& moves) {
  std::string text;
  for (const CompensatedMove& move : moves) {
    char buffer[100];
    const Vector3& p = move.segment.end_mm;
    std::snprintf(buffer, sizeof buffer, "%s%zu(%.3f %.3f)", text.empty() ? "" : " ", move.source, p.x() + 0.0,
                  p.y() + 0.0);
    text += buffer;
  }
  for (std::size_t at = text.find("-0.000"); at != std::string::npos; at = text.find("-0.000")) text.erase(at, 1);
  return text;
}

}  // namespace shapegcode::tests
