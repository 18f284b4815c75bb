#include "program/siemens/expression.hpp"

#include <algorithm>
#include <utility>

namespace shapegcode::siemens {
namespace {

constexpr std::uint32_t most_depth = 1000;  // of a tree that is worked out

}  // namespace

Value Expression::operator()(Scope& scope) const {
  if (pool_->depth(root_) > most_depth) throw too_deep();
  return pool_->evaluate(root_, scope);
}

std::uint32_t ExpressionPool::add(const Node& node) {
  nodes_.push_back(node);
  if (node.operation >= Operation::plus) {
    const std::uint32_t right = node.operation >= Operation::equal ? depth(node.right) : 0;
    nodes_.back().depth = 1 + std::max(depth(node.left), right);
  }
  return static_cast<std::uint32_t>(nodes_.size() - 1);
}

std::uint32_t ExpressionPool::add_constant(Value value) {
  constants_.push_back(std::move(value));
  return add({.stored = static_cast<std::uint32_t>(constants_.size() - 1)});
}

std::uint32_t ExpressionPool::add_with(Node node, std::span<const std::uint32_t> given) {
  node.left = static_cast<std::uint32_t>(given_.size());
  node.right = static_cast<std::uint32_t>(given.size());
  for (const std::uint32_t each : given) node.depth = std::max(node.depth, 1 + depth(each));
  given_.insert(given_.end(), given.begin(), given.end());
  return add(node);
}

std::uint32_t ExpressionPool::add_variable(std::string_view name, std::span<const std::uint32_t> index,
                                           std::uint32_t column) {
  names_.emplace_back(name);
  return add_with(
      {.operation = Operation::variable, .column = column, .stored = static_cast<std::uint32_t>(names_.size() - 1)},
      index);
}

std::uint32_t ExpressionPool::add_function(Function function, std::span<const std::uint32_t> given,
                                           std::uint32_t column) {
  return add_with({.operation = Operation::function, .function = function, .column = column}, given);
}

Value ExpressionPool::evaluate(std::uint32_t at, Scope& scope) const {
  const Node& node = nodes_[at];
  switch (node.operation) {
    case Operation::constant:
      return constants_[node.stored];
    case Operation::variable: {
      std::vector<Value> index;
      for (const std::uint32_t each : given(node)) index.push_back(evaluate(each, scope));
      return scope.value_of(names_[node.stored], index, node.column);
    }
    case Operation::function:
      return worked(node, scope);
    case Operation::plus:
    case Operation::minus:
    case Operation::negation:
    case Operation::bit_negation:
      return unary(node, scope);
    default:
      break;
  }
  const Value left = evaluate(node.left, scope);
  const Value right = evaluate(node.right, scope);
  return work(node.operation, left, right, node.column);
}

Value ExpressionPool::unary(const Node& node, Scope& scope) const {
  const Value inner = evaluate(node.left, scope);
  if (node.operation == Operation::negation) return truth(!is_true(inner));
  if (node.operation == Operation::bit_negation) {
    return whole_value(static_cast<double>(~whole(inner, "B_NOT", node.column)));
  }
  const double given = number(inner, node.column);
  const double signed_value = node.operation == Operation::minus ? -given : given;
  return inner.kind == Kind::real ? real_value(signed_value) : whole_value(signed_value);
}

Value ExpressionPool::worked(const Node& node, Scope& scope) const {
  std::vector<Value> values;
  values.reserve(node.right);
  for (const std::uint32_t each : given(node)) {
    values.push_back(evaluate(each, scope));
    values.back().number = number(values.back(), node.column);
    if (values.back().kind == Kind::boolean) values.back().kind = Kind::whole;
  }
  return work(node.function, values, node.column);
}

}  // namespace shapegcode::siemens
