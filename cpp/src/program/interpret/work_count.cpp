#include "program/interpret/work_count.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace shapegcode::detail {

double least_time_s(const Segment& segment, const WorkLimits& limits) noexcept {
  const bool rapid = segment.kind == SegmentKind::rapid;
  const Vector3& fastest = rapid ? limits.rapid_mm_per_s : limits.feed_mm_per_s;
  // An arc may have any direction in its plane: all axes together give the bound.
  double least = segment.kind == SegmentKind::arc
                     ? segment.length_mm / fastest.norm()
                     : ((segment.end_mm - segment.start_mm).array().abs() / fastest.array()).maxCoeff();
  if (!rapid && segment.feed_mm_per_s > 0.0) {
    least = std::max(least, segment.length_mm / segment.feed_mm_per_s);
  }
  return least;
}

std::optional<std::string> WorkCount::move(const Segment& segment) {
  return add(least_time_s(segment, limits_), "move", segment.kind == SegmentKind::rapid ? 0.0 : segment.feed_mm_per_s);
}

std::optional<std::string> WorkCount::wait(double seconds, const char* what) { return add(seconds, what, 0.0); }

std::optional<std::string> WorkCount::passed(double moves) const {
  if (moves > static_cast<double>(limits_.expansion_moves) + static_cast<double>(lines_)) {
    return fmt::format("{} moves beyond one for each line (controller.max_expansion_moves)", limits_.expansion_moves);
  }
  if (moves > static_cast<double>(limits_.moves)) {
    return fmt::format("{} moves (controller.max_program_moves)", limits_.moves);
  }
  return std::nullopt;
}

std::optional<std::string> WorkCount::add(double seconds, const char* what, double feed_mm_per_s) {
  seconds_ += seconds;
  ++moves_;
  if (moves_ > limits_.moves || (moves_ > lines_ && moves_ - lines_ > limits_.expansion_moves)) {
    return fmt::format("up to here more than {}", *passed(static_cast<double>(moves_)));
  }
  if (!(seconds_ <= limits_.seconds)) {
    const std::string at = feed_mm_per_s > 0.0 ? fmt::format(" at {:.6g} mm/min", feed_mm_per_s * 60.0) : "";
    return fmt::format(
        "the program runs for more than {:.10g} s up to here (controller.max_program_s); this {} takes "
        "{:.6g} s{}",
        limits_.seconds, what, seconds, at);
  }
  return std::nullopt;
}

}  // namespace shapegcode::detail
