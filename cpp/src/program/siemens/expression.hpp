#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "program/siemens/scanner.hpp"
#include "program/siemens/value.hpp"

namespace shapegcode::siemens {

/// Where an expression finds the values of names.
class Scope {
 public:
  Scope() = default;
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;
  virtual ~Scope() = default;
  /// Value of a variable, an R parameter or an element of an array.
  [[nodiscard]] virtual Value value_of(const std::string& name, std::span<const Value> index, std::uint32_t column) = 0;
};

// clang-format off
enum class Operation : std::uint8_t {
  constant, variable, function, plus, minus, negation, bit_negation,
  // of two values, from the weakest
  equal, unequal, greater, less, at_least, at_most, join, either, exclusive, both, bit_or, bit_xor, bit_and,
  sum, difference, product, quotient, whole_quotient, remainder,
};
// clang-format on

enum class Function : std::uint8_t {
  sin,
  cos,
  tan,
  asin,
  acos,
  atan2,
  sqrt,
  pot,
  abs,
  trunc,
  round,
  roundup,
  ln,
  exp,
  minval,
  maxval,
  bound
};

/// Syntax trees of the expressions of a block, all nodes in one row.
class ExpressionPool {
 public:
  struct Node {
    Operation operation = Operation::constant;
    Function function = Function::sin;
    std::uint32_t column = 0;
    std::uint32_t depth = 1;   // of the tree below
    std::uint32_t left = 0;    // node; of a variable or a function the first of its `given_`
    std::uint32_t right = 0;   // node; of a variable or a function how many of them
    std::uint32_t stored = 0;  // value of a constant, name of a variable
  };

  std::uint32_t add(const Node& node);
  std::uint32_t add_constant(Value value);
  std::uint32_t add_variable(std::string_view name, std::span<const std::uint32_t> index, std::uint32_t column);
  std::uint32_t add_function(Function function, std::span<const std::uint32_t> given, std::uint32_t column);

  [[nodiscard]] std::uint32_t depth(std::uint32_t node) const { return nodes_[node].depth; }
  [[nodiscard]] Value evaluate(std::uint32_t node, Scope& scope) const;

 private:
  [[nodiscard]] std::span<const std::uint32_t> given(const Node& node) const {
    return std::span(given_).subspan(node.left, node.right);
  }
  std::uint32_t add_with(Node node, std::span<const std::uint32_t> given);
  [[nodiscard]] Value unary(const Node& node, Scope& scope) const;
  [[nodiscard]] Value worked(const Node& node, Scope& scope) const;

  std::vector<Node> nodes_;
  std::vector<Value> constants_;
  std::vector<std::string> names_;
  std::vector<std::uint32_t> given_;
};

/// An expression of a block, which must outlive it; or none.
class Expression {
 public:
  Expression() = default;
  Expression(const ExpressionPool& pool, std::uint32_t root) : pool_(&pool), root_(root) {}

  explicit operator bool() const { return pool_ != nullptr; }
  /// Its value in a scope.
  [[nodiscard]] Value operator()(Scope& scope) const;

 private:
  const ExpressionPool* pool_ = nullptr;
  std::uint32_t root_ = 0;
};

/// Read an expression, as far as it reaches.
[[nodiscard]] Expression read_expression(Scanner& scan, ExpressionPool& pool);

/// Read `[...]` behind a name, or nothing.
[[nodiscard]] std::vector<Expression> read_indices(Scanner& scan, ExpressionPool& pool);

/// Read the values in brackets behind a name; none: left out.
[[nodiscard]] std::vector<Expression> read_arguments(Scanner& scan, ExpressionPool& pool, std::string_view name);

/// How many values a function takes, and its name.
struct FunctionName {
  std::string_view name;
  Function function = Function::sin;
  std::size_t count = 1;
};
[[nodiscard]] std::optional<FunctionName> function_of(std::string_view name);
[[nodiscard]] std::string_view name_of(Function function);

/// Work out an operation of two values.
[[nodiscard]] Value work(Operation operation, const Value& a, const Value& b, std::uint32_t column);

/// Its value of numbers; what is none throws.
[[nodiscard]] Value work(Function function, std::span<const Value> given, std::uint32_t column);

}  // namespace shapegcode::siemens
