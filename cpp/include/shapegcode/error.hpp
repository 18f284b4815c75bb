#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace shapegcode {

/// Which part of the input an Error speaks of; the Python binding maps each kind to one exception class.
enum class ErrorKind : std::uint8_t {
  program,   ///< the CNC program text: carries line and column
  design,    ///< a shaper that does not exist, or not on this grid
  argument,  ///< a value handed to a function is outside its stated range
  numeric,   ///< a solver failed; the message carries its flag
};

/// The one error type of the library. The message carries the value and the limit; `line` and `column` count from 1
/// and are 0 where the error does not belong to a program text.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message, std::uint32_t line = 0, std::uint32_t column = 0)
      : std::runtime_error(message), kind_(kind), line_(line), column_(column) {}

  [[nodiscard]] ErrorKind kind() const noexcept { return kind_; }
  [[nodiscard]] std::uint32_t line() const noexcept { return line_; }
  [[nodiscard]] std::uint32_t column() const noexcept { return column_; }

 private:
  ErrorKind kind_;
  std::uint32_t line_;
  std::uint32_t column_;
};

}  // namespace shapegcode
