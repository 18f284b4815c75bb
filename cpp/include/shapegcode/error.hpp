#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

namespace shapegcode {

/// The kind of input that an Error concerns; the Python binding maps each kind to one exception class.
enum class ErrorKind : std::uint8_t {
  program,   ///< the CNC program text: carries line and column
  design,    ///< a shaper that does not exist, or not on this grid, or cannot be computed
  argument,  ///< an argument of a function is outside its stated range
  numeric,   ///< a solver failed or did not converge; the message says which
};

/// The one error type of the library. The message carries the value and the limit; `line` and `column` count from 1
/// and are 0 where the error does not belong to a program text. `alarm` is the number under which a FANUC control
/// would refuse the program, 0 if it has none.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message, std::uint32_t line = 0, std::uint32_t column = 0, int alarm = 0)
      : std::runtime_error(message), kind_(kind), line_(line), column_(column), alarm_(alarm) {}

  [[nodiscard]] ErrorKind kind() const noexcept { return kind_; }
  [[nodiscard]] std::uint32_t line() const noexcept { return line_; }
  [[nodiscard]] std::uint32_t column() const noexcept { return column_; }
  [[nodiscard]] int alarm() const noexcept { return alarm_; }
  /// Name of the file of the line; empty: the program passed to the function.
  [[nodiscard]] const std::string& file() const noexcept { return file_; }
  void set_file(std::string name) { file_ = std::move(name); }

 private:
  ErrorKind kind_;
  std::uint32_t line_;
  std::uint32_t column_;
  int alarm_;
  std::string file_;
};

/// A refusal that a FANUC control would show under an alarm number; the message ends with "(alarm 0020)".
[[nodiscard]] inline Error alarm_error(int alarm, const std::string& message, std::uint32_t line,
                                       std::uint32_t column) {
  std::string number = std::to_string(alarm);
  number.insert(0, number.size() < 4 ? 4 - number.size() : 0, '0');
  return {ErrorKind::program, message + " (alarm " + number + ")", line, column, alarm};
}

}  // namespace shapegcode
