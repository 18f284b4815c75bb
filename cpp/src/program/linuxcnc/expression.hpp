// Private: values of a line, which are read once and worked out each time the line runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "program/linuxcnc/parameter_names.hpp"

namespace shapegcode::linuxcnc {

/// What a step of an expression does with the values before it.
enum class Operation : std::uint8_t {
  number,       // puts a constant
  numbered,     // puts #5
  numbered_by,  // takes a value and puts the parameter of that number
  named,        // puts #<name>
  exists,       // puts whether #<name> has a value
  negate,       // of one value, as all up to `tan`
  abs,
  acos,
  asin,
  cos,
  exp,
  fix,
  fup,
  ln,
  round,
  sin,
  sqrt,
  tan,
  atan,  // of two values, as all that follow
  power,
  multiply,
  divide,
  modulo,
  add,
  subtract,
  equal,
  not_equal,
  less,
  greater,
  less_equal,
  greater_equal,
  both,
  either,
  one_of_both,
};

struct Step {
  Operation operation;
  std::int64_t index = 0;  ///< number or name of a parameter
  double number = 0.0;
};

using Code = std::vector<Step>;

/// A number, or steps of the code of its line.
struct Value {
  double number = 0.0;
  std::uint32_t begin = 0;
  std::uint32_t end = 0;  ///< `begin`: it is a number

  [[nodiscard]] bool is_number() const noexcept { return begin == end; }
};

/// `#5 = ...`, or `#<name> = ...`.
struct Setting {
  std::optional<NameId> name;
  Value parameter;
  Value value;
};

/// A binary operator: its length, and what it binds before.
struct BinaryOperator {
  Operation operation;
  std::size_t length;
  int rank;
};

/// Reads the values of one line, whose blanks are gone and letters small, into a code.
class ValueReader {
 public:
  ValueReader(std::string_view text, Code& code, ParameterNames& names) : text_(text), code_(code), names_(names) {}

  [[nodiscard]] bool is_done() const noexcept { return at_ >= text_.size(); }
  [[nodiscard]] char front() const noexcept { return text_[at_]; }
  /// What was not read yet.
  [[nodiscard]] std::string_view left() const noexcept { return text_.substr(at_); }
  void skip() noexcept { ++at_; }

  /// A number, a parameter, an expression in brackets or a function, each with its sign.
  Value value();
  /// `#5=...`; the `#` stands here.
  Setting setting();

 private:
  bool take(std::string_view sign) noexcept;
  /// Appends the steps of a value; a number alone is given back instead.
  std::optional<double> operand();
  void append_operand();
  void append_parameter();
  bool append_function();
  void append_exists();
  /// Up to the bracket that closes it; operators of one precedence from left to right.
  void append_expression();
  void append_operation(int above);
  [[nodiscard]] std::optional<BinaryOperator> operator_here() const noexcept;
  /// The name of `#<name>`, which may stand here.
  std::optional<NameId> take_name();
  void append(Operation operation, std::int64_t index = 0, double number = 0.0) {
    code_.push_back({operation, index, number});
  }

  std::string_view text_;
  Code& code_;
  ParameterNames& names_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

class ParameterTable;

/// Works out values with the parameters as they are.
class Evaluator {
 public:
  explicit Evaluator(const ParameterTable& parameters) : parameters_(parameters) {}

  /// The value of a word when its line runs; one beyond all measure is refused.
  double operator()(const Value& value, const Code& code);

 private:
  void run(const Step& step);
  double take() {
    const double value = stack_.back();
    stack_.pop_back();
    return value;
  }

  const ParameterTable& parameters_;
  std::vector<double> stack_;
};

/// The number of a parameter.
[[nodiscard]] std::int64_t parameter_number(double value);

[[noreturn]] void refuse_too_large();

}  // namespace shapegcode::linuxcnc
