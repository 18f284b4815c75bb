#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "program/siemens/value.hpp"

namespace shapegcode::siemens {

/// A variable of a program: a value, or an array by indices.
class Variable {
 public:
  explicit Variable(Kind kind, std::vector<std::int64_t> shape = {}) : kind_(kind), shape_(std::move(shape)) {}

  [[nodiscard]] Kind kind() const { return kind_; }
  /// Its value; what was not set is 0.
  [[nodiscard]] Value read(const std::string& name, std::span<const Value> index, std::uint32_t column) const;
  void write(const std::string& name, std::span<const Value> index, const Value& value, std::uint32_t column);

 private:
  using Place = std::vector<std::int64_t>;
  /// Indices as whole numbers within the array.
  [[nodiscard]] Place place(const std::string& name, std::span<const Value> index, std::uint32_t column) const;

  Kind kind_;
  std::vector<std::int64_t> shape_;
  std::map<Place, Value> values_;
};

using Variables = std::unordered_map<std::string, Variable>;

}  // namespace shapegcode::siemens
