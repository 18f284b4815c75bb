#pragma once

#include <deque>
#include <optional>
#include <string>

// What an operator types. A line is a command; `at 1.5` in front of it lets it wait for that second of the run, and
// `wait` lets those behind it wait for rest, so that a session can be written down and repeated.

enum class Key { hold, resume, feed_override, probe, flush, abort, mdi, jog, status, wait, quit, unknown };

struct Command {
  Key key = Key::unknown;
  std::string line;
  double time_s = -1.0;  // below 0: at once
  double value = 0.0;    // of an override, in percent; of a jog, in mm
  int axis = 0;          // of a jog
  std::string block;     // of mdi
};

/// A line as a command; nothing where it is empty or a comment (`#`). The signs of grbl mean the same: ! ~ ?
std::optional<Command> read_command(const std::string& line);

/// Commands from standard input, without waiting for one.
class Terminal {
 public:
  /// Takes what was typed meanwhile.
  void look();
  /// Takes all of the input.
  void read_to_the_end();
  /// The next command, where it is its time; `is_at_rest` is for those behind `wait`.
  std::optional<Command> take(double time_s, bool is_at_rest);
  /// The input is closed, and nothing of it is left.
  [[nodiscard]] bool is_over() const { return is_closed_ && commands_.empty(); }

 private:
  void read();

  std::string text_;  // of a line that is not whole yet
  std::deque<Command> commands_;
  bool is_closed_ = false;
};
