// Private: the canonical moves of a program, line by line.
#pragma once

#include <cstddef>
#include <cstdint>

#include "shapegcode/program.hpp"

namespace shapegcode::detail {

/// Gives the cutting moves of a program in the order of its lines. Lines that nobody asks for are passed over.
class CutMoves {
 public:
  explicit CutMoves(const Program& program) : program_(program) {}

  /// Whether there is a further cutting move of this line; it is then `move()`, until the next call.
  bool next(std::uint32_t line) {
    for (; step_ < program_.steps.size(); ++step_, inside_ = 0) {
      const ProgramStep& step = program_.steps[step_];
      if (step.kind == StepKind::function) {
        continue;
      }
      if (step.kind == StepKind::move) {
        const OtherMove& other = program_.other_moves[step.index];
        const bool cuts = other.dwell_s <= 0.0 && other.segment.kind != SegmentKind::rapid;
        if (cuts && inside_ == 0 && step.line >= line) {
          inside_ = step.line == line ? 1 : 0;
          return step.line == line;
        }
        continue;
      }
      const Path& path = *program_.regions[step.index]->path;
      while (inside_ < path.size() && path.line(inside_) < line) {
        ++inside_;
      }
      if (inside_ < path.size()) {
        const bool here = path.line(inside_) == line;
        inside_ += here ? 1U : 0U;
        return here;
      }
    }
    return false;
  }
  [[nodiscard]] Segment move() const {
    const ProgramStep& step = program_.steps[step_];
    return step.kind == StepKind::region ? (*program_.regions[step.index]->path)[inside_ - 1]
                                         : program_.other_moves[step.index].segment;
  }
  /// The moves to which that one belongs, and its index there.
  [[nodiscard]] Segments run() const {
    const ProgramStep& step = program_.steps[step_];
    if (step.kind == StepKind::region) {
      return *program_.regions[step.index]->path;
    }
    return std::span<const Segment>(&program_.other_moves[step.index].segment, 1);
  }
  [[nodiscard]] std::size_t index() const noexcept { return inside_ - 1; }
  [[nodiscard]] std::size_t step() const noexcept { return step_; }

 private:
  const Program& program_;
  std::size_t step_ = 0;
  std::size_t inside_ = 0;  // moves of the step that were given
};

}  // namespace shapegcode::detail
