#include "program/rewrite/cutter_compensation.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include "program/rewrite/compensation_corner.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using plane::Corner;
using plane::Curve;
using plane::join_mm;
using plane::OffsetCurve;
using plane::pi;
using plane::Vector2;

// A block reversed by less than this counts as completely used by its corners.
constexpr double used_up_mm = 1e-9;

[[noreturn]] void refuse(const std::string& what, std::uint32_t line = 0) {
  throw Error(ErrorKind::argument, what, line);
}

bool finite(const CompensationBlock& block) {
  const Segment& segment = block.segment;
  return std::isfinite(block.radius_mm) && segment.start_mm.allFinite() && segment.end_mm.allFinite() &&
         (segment.kind != SegmentKind::arc || (segment.centre_mm.allFinite() && std::isfinite(segment.sweep_rad)));
}

void check(std::span<const CompensationBlock> blocks, int plane_normal, const CompensationOptions& options) {
  if (plane_normal < 0 || plane_normal > 2) {
    refuse(fmt::format("plane normal {}: 0, 1 or 2 is expected", plane_normal));
  }
  if (options.start_up != 'A' && options.start_up != 'B') {
    refuse("start-up type: A or B is expected");
  }
  if (!(options.ignorable_corner_mm >= 0.0) || !std::isfinite(options.ignorable_corner_mm)) {
    refuse(fmt::format("ignorable corner {} mm: zero or more is expected", options.ignorable_corner_mm));
  }
  if (options.blocks_read < 3 || options.blocks_read > 8) {
    refuse(fmt::format("blocks read in compensation: {}, 3 to 8 is expected", options.blocks_read));
  }
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const CompensationBlock& block = blocks[i];
    if (block.mode < 40 || block.mode > 42) {
      refuse(fmt::format("compensation mode {}: 40, 41 or 42 is expected", block.mode), block.segment.line);
    }
    if (!finite(block)) {
      refuse("cutter compensation needs finite values", block.segment.line);
    }
    const double gap = i == 0 ? 0.0 : (block.segment.start_mm - blocks[i - 1].segment.end_mm).norm();
    if (gap > join_mm) {
      refuse(fmt::format("block starts {:.6f} mm off the end of the one before, limit {:.6f} mm", gap, join_mm),
             block.segment.line);
    }
  }
}

class Compensator {
 public:
  Compensator(std::span<const CompensationBlock> blocks, int normal, const CompensationOptions& options)
      : blocks_(blocks), normal_(normal), options_(options) {}

  std::vector<CompensatedMove> run() {
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (i == 0) {
        at_ = blocks_[0].segment.start_mm;
      }
      if (!offset_ && !(moves(i) && active(i))) {
        keep(i);
      } else if (!moves(i)) {
        rest(i);
      } else {
        move(i);
      }
    }
    return std::move(path_);
  }

 private:
  bool active(std::size_t i) const { return blocks_[i].mode != 40 && blocks_[i].radius_mm != 0.0; }

  bool moves(std::size_t i) const {
    const Segment& segment = blocks_[i].segment;
    return segment.kind == SegmentKind::arc ||
           (plane::in_plane(segment.end_mm, normal_) - plane::in_plane(segment.start_mm, normal_)).norm() >
               plane::coincident_mm;
  }

  double side(std::size_t i) const { return blocks_[i].mode == 42 ? -1.0 : 1.0; }

  Curve curve(std::size_t i) const {
    const Segment& segment = blocks_[i].segment;
    if (segment.kind == SegmentKind::arc && segment.normal != normal_) {
      constexpr char names[] = "XYZ";
      throw alarm_error(37,
                        fmt::format("arc about {} in cutter compensation of the plane across {}",
                                    names[segment.normal % 3], names[normal_]),
                        segment.line, 0);
    }
    Curve result = plane::curve_of(segment, normal_);
    if (result.arc && (!(result.start_radius_mm > plane::coincident_mm) ||
                       !(result.end_radius_mm > plane::coincident_mm) || !result.moves())) {
      throw alarm_error(
          38,
          fmt::format("arc of start radius {:.7f} mm, end radius {:.7f} mm and sweep {:.3g} rad has no room "
                      "for a cutter",
                      result.start_radius_mm, result.end_radius_mm, result.sweep_rad),
          segment.line, 0);
    }
    return result;
  }

  // Block i, offset by the value in force at the corner.
  OffsetCurve offset(std::size_t i, double radius_mm) const {
    return {curve(i), side(i) * radius_mm, blocks_[i].segment.line};
  }

  // The next block that moves in the plane, if the control knows it while it works out the end of block i.
  std::optional<std::size_t> next_known(std::size_t i) const {
    std::size_t j = i + 1;
    bool cancelled = false;
    while (j < blocks_.size() && !moves(j)) {
      cancelled = cancelled || !active(j);
      ++j;
    }
    const bool read = j < blocks_.size() && j - i - 1 <= static_cast<std::size_t>(options_.blocks_read - 2);
    return read && !cancelled ? std::optional<std::size_t>(j) : std::nullopt;
  }

  Corner corner_at_end(std::size_t i) const {
    const double radius = blocks_[i].radius_mm;
    const OffsetCurve before = offset(i, radius);
    const auto next = next_known(i);
    if (!next || (!offset_ && !active(*next))) {
      plane::require_offset_arc(before, true);
      return {{plane::across_end(before)}};
    }
    Corner corner;
    OffsetCurve after = offset(*next, radius);
    if (!active(*next)) {
      after.left_mm = before.left_mm;  // the cancel block has no side of its own
      corner = plane::cancel_corner(before, after, options_.start_up);
    } else if (!offset_) {
      corner = plane::start_up_corner(before, after, options_.start_up);
    } else {
      corner = plane::offset_corner(before, after);
    }
    plane::drop_minute_moves(corner, before.curve.arc && offset_, after.curve.arc && active(*next),
                             options_.ignorable_corner_mm);
    return corner;
  }

  // A block without motion in the plane: the vector stands.
  void rest(std::size_t i) {
    const Segment& segment = blocks_[i].segment;
    line_to(i, plane::in_space(plane::in_plane(at_, normal_), segment.end_mm, normal_));
    path_.back().segment.stop_at_end = segment.stop_at_end;
  }

  void keep(std::size_t i) {
    path_.push_back({blocks_[i].segment, i});
    at_ = blocks_[i].segment.end_mm;
  }

  void move(std::size_t i) {
    const Segment& segment = blocks_[i].segment;
    const bool start_up = !offset_;
    const bool cancel = !active(i);
    if (segment.kind == SegmentKind::arc && (start_up || cancel)) {
      throw alarm_error(
          34,
          fmt::format("cutter compensation can be {} only in a straight block: this arc has radius "
                      "{:.4f} mm, the cutter {:.4f} mm",
                      cancel ? "cancelled" : "started", segment.start_radius_mm, std::abs(blocks_[i].radius_mm)),
          segment.line, 0);
    }
    Corner corner;
    if (!cancel) {
      corner = corner_at_end(i);
    } else {
      corner.points = {plane::in_plane(segment.end_mm, normal_)};
    }
    go_round(i);
    if (segment.kind == SegmentKind::arc) {
      arc_to(i, corner);
    } else {
      if (!start_up && !cancel) {
        require_direction(i, corner.points.front());
      }
      line_to(i, plane::in_space(corner.points.front(), segment.end_mm, normal_));
    }
    path_.back().segment.stop_at_end = segment.stop_at_end;
    corner_ = corner;
    known_corner_ = next_known(i).has_value();
    offset_ = !cancel;
    if (cancel) {
      corner_ = {};
      at_ = segment.end_mm;
    }
  }

  // The rest of the corner before block i, now that block i runs.
  void go_round(std::size_t i) {
    for (std::size_t k = 1; k < corner_.points.size(); ++k) {
      line_to(i, plane::in_space(corner_.points[k], at_, normal_));
    }
    if (offset_ && !known_corner_ && blocks_[i].segment.kind == SegmentKind::arc) {
      const OffsetCurve own = offset(i, blocks_[i].radius_mm);
      plane::require_offset_arc(own, false);
      line_to(i, plane::in_space(plane::across_start(own), at_, normal_));
    }
  }

  void line_to(std::size_t i, const Vector3& end) {
    const Segment& segment = blocks_[i].segment;
    Segment line = make_line(at_, end, segment.feed_mm_per_s, segment.line);
    if (segment.kind == SegmentKind::rapid) {
      line.kind = SegmentKind::rapid;
    }
    line.normal = segment.normal;
    path_.push_back({line, i});
    at_ = end;
  }

  void require_direction(std::size_t i, const Vector2& end) const {
    if (!options_.check_interference) {
      return;
    }
    const Curve programmed = curve(i);
    const double along = programmed.start_direction.dot(end - plane::in_plane(at_, normal_));
    if (along < -used_up_mm) {
      throw alarm_error(41,
                        fmt::format("block of {:.4f} mm is too short for its corners with cutter radius {:.4f} mm: the "
                                    "tool centre would run {:.4f} mm against the programmed direction",
                                    programmed.length_mm, std::abs(blocks_[i].radius_mm), -along),
                        blocks_[i].segment.line, 0);
    }
  }

  // The angle by which `to` lies ahead of `from` on the arc, the value nearest to `about`.
  static double turned(const Curve& curve, const Vector2& from, const Vector2& to, double about) {
    const double angle = plane::angle_of(to - curve.centre) - plane::angle_of(from - curve.centre);
    return about + std::remainder(curve.sense() * angle - about, 2.0 * pi);
  }

  void arc_to(std::size_t i, const Corner& corner) {
    const Segment& segment = blocks_[i].segment;
    const Curve programmed = curve(i);
    const Vector2 from = plane::in_plane(at_, normal_);
    const Vector2& to = corner.points.front();
    const double before = turned(programmed, programmed.start, from, corner_.turn_after_rad);
    const double after = turned(programmed, to, programmed.end, corner.turn_before_rad);
    const double sweep = std::abs(programmed.sweep_rad) - before - after;
    const Vector3 end = plane::in_space(to, segment.end_mm, normal_);
    const double radius = (from - programmed.centre).norm();
    if (sweep * radius < -used_up_mm) {
      throw alarm_error(
          41,
          fmt::format("arc of radius {:.4f} mm and sweep {:.3f} degrees is too short for its corners with "
                      "cutter radius {:.4f} mm: they take {:.3f} degrees",
                      programmed.start_radius_mm, std::abs(programmed.sweep_rad) * 180.0 / pi,
                      std::abs(blocks_[i].radius_mm), (before + after) * 180.0 / pi),
          segment.line, 0);
    }
    if (sweep * radius <= used_up_mm) {
      line_to(i, end);
      return;
    }
    path_.push_back({make_arc(at_, end, segment.centre_mm, programmed.sense() * sweep, normal_, segment.feed_mm_per_s,
                              segment.line),
                     i});
    at_ = end;
  }

  std::span<const CompensationBlock> blocks_;
  int normal_;
  CompensationOptions options_;
  std::vector<CompensatedMove> path_;
  Vector3 at_ = Vector3::Zero();
  bool offset_ = false;        // a vector is in force
  bool known_corner_ = false;  // the control knew the next block when it worked out the vector
  Corner corner_;              // at the end of the last block that moved
};

}  // namespace

std::vector<CompensatedMove> compensate(std::span<const CompensationBlock> blocks, int plane_normal,
                                        const CompensationOptions& options) {
  check(blocks, plane_normal, options);
  return Compensator(blocks, plane_normal, options).run();
}

}  // namespace shapegcode
