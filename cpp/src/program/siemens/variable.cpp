#include "program/siemens/variable.hpp"

#include <fmt/format.h>

namespace shapegcode::siemens {

Variable::Place Variable::place(const std::string& name, std::span<const Value> index, std::uint32_t column) const {
  if (index.size() != shape_.size()) {
    const std::string needs = shape_.empty() ? "no index" : fmt::format("{} indices", shape_.size());
    throw error_at(column, fmt::format("{} with {} indices: it has {}", name, index.size(), needs));
  }
  if (shape_.empty()) return {};
  Place found;
  for (const Value& each : index) found.push_back(whole(each, "index of " + name, column));
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (found[k] < 0 || found[k] >= shape_[k]) {
      throw error_at(column, fmt::format("{}[{}]: the index must be 0 to {}", name, found[k], shape_[k] - 1));
    }
  }
  return found;
}

Value Variable::read(const std::string& name, std::span<const Value> index, std::uint32_t column) const {
  const auto found = values_.find(place(name, index, column));
  return found != values_.end() ? found->second : Value{.kind = kind_, .number = 0.0, .text = {}};
}

void Variable::write(const std::string& name, std::span<const Value> index, const Value& value, std::uint32_t column) {
  // The value first: of two errors it is the one that is told.
  Value kept = convert(value, kind_, column);
  values_.insert_or_assign(place(name, index, column), std::move(kept));
}

}  // namespace shapegcode::siemens
