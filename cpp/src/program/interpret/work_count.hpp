// Private: counts the moves of a program so far and checks them against the limits.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "shapegcode/program.hpp"

namespace shapegcode::detail {

/// Counts moves and least times while they are read, so that what is too much is refused where it becomes too much.
/// Each function gives the words of the limit that is passed, nothing while there is room.
class WorkCount {
 public:
  explicit WorkCount(const WorkLimits& limits) noexcept : limits_(limits) {}

  [[nodiscard]] std::optional<std::string> move(const Segment& segment);
  [[nodiscard]] std::optional<std::string> wait(double seconds, const char* what);
  /// Lines of a text that is read: each may be a move, the others are its expansion.
  void add_lines(std::uint64_t lines) noexcept { lines_ += lines; }
  /// What so many moves of the whole program pass, in words: "800000 moves beyond one for each line
  /// (controller.max_expansion_moves)".
  [[nodiscard]] std::optional<std::string> passed(double moves) const;

  [[nodiscard]] std::uint64_t moves() const noexcept { return moves_; }
  [[nodiscard]] double seconds() const noexcept { return seconds_; }

 private:
  [[nodiscard]] std::optional<std::string> add(double seconds, const char* what, double feed_mm_per_s);

  const WorkLimits& limits_;
  std::uint64_t lines_ = 0;
  std::uint64_t moves_ = 0;
  double seconds_ = 0.0;
};

/// Least time of a move on axes that reach these speeds, s: no longer than any control takes.
[[nodiscard]] double least_time_s(const Segment& segment, const WorkLimits& limits) noexcept;

}  // namespace shapegcode::detail
