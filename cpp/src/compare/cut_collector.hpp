// Private: the canonical moves of a program, line by line, gathered into cuts.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compare/events.hpp"
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

/// Puts the cutting moves of a program together as cuts, each with its event.
class CutCollector {
 public:
  CutCollector(const Program& program, Events& events) : moves_(program), events_(events) {}

  /// The moves of a line: of the open cut, or of a new one with these modes, whose event `make_event()` gives.
  template <typename MakeEvent>
  void add(std::uint32_t line, const CutModes& modes, const MakeEvent& make_event) {
    while (moves_.next(line)) {
      const Segment move = moves_.move();
      if (open_ && (move.start_mm - events_.cuts.back().end_mm).norm() > joined_mm) {
        close();
      }
      if (!open_) {
        opened_ = events_.all.size();
        events_.all.push_back(make_event());
        events_.all.back().cut = events_.cuts.size();
        events_.cuts.emplace_back();
        events_.cuts.back().modes = modes;
        events_.cuts.back().start_mm = move.start_mm;
        open_ = true;
      }
      Cut& cut = events_.cuts.back();
      if (count_ == 0 || step_ != moves_.step() || moves_.index() != first_ + count_) {
        finish_piece();
        step_ = moves_.step();
        first_ = moves_.index();
        cut.pieces.push_back(moves_.run());
      }
      ++count_;
      cut.end_mm = move.end_mm;
      cut.length_mm += move.length_mm;
      cut.exact_stops += move.stop_at_end ? 1U : 0U;
      ++cut.moves;
    }
  }
  void close() {
    finish_piece();
    open_ = false;
  }
  [[nodiscard]] bool is_open() const noexcept { return open_; }
  /// Of the open cut.
  [[nodiscard]] Event& event() noexcept { return events_.all[opened_]; }

 private:
  static constexpr double joined_mm = 1e-6;

  // The open piece has the moves that were given, and no more.
  void finish_piece() {
    if (count_ > 0) {
      Segments& piece = events_.cuts.back().pieces.back();
      piece = piece.part(first_, count_);
      count_ = 0;
    }
  }

  CutMoves moves_;
  Events& events_;
  bool open_ = false;
  std::size_t opened_ = 0;  // the event of the open cut
  // Of its open piece: the step of the program, and moves of that.
  std::size_t step_ = 0;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace shapegcode::detail
