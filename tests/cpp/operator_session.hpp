// What an operator and a program do to a control, drawn at random, and what must hold of its set-points.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "random_trial.hpp"

namespace shapegcode::tests {

/// Pushes segments, events, dwells and stops; holds, jogs, retraces, flushes, probes, offsets, stops in an emergency.
class OperatorSession {
 public:
  explicit OperatorSession(std::uint32_t seed);

  /// So many periods, then until everything that was pushed is run. What did not hold; empty: all did.
  std::string run(std::size_t periods);

 private:
  using Point = std::array<double, axis_count>;

  void step();
  void push();
  void flush();
  void rest();
  void move_by_hand();
  void emergency_stop();
  void operate();
  void end();
  [[nodiscard]] bool rests_from(std::size_t row) const;
  void see_limits();
  void see_piece(std::size_t begin, std::size_t end);
  void see_events();
  void expect(bool holds, const std::string& what);

  Draw draw_;
  bool plans_, offsets_, exchanges_;
  MotionController control_;
  std::vector<Point> rows_;
  Point at_{};
  std::vector<Point> places_;  // of events that were pushed
  std::vector<std::pair<std::uint32_t, std::size_t>> reached_;
  std::size_t forgotten_ = 0;        // events before this one were flushed or reached
  std::vector<std::size_t> braked_;  // rows at which an emergency stop began
  std::string broken_;
};

}  // namespace shapegcode::tests
