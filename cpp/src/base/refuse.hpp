// How a value that cannot be is refused.
#pragma once

#include <fmt/format.h>

#include <utility>

#include "shapegcode/error.hpp"

namespace shapegcode::detail {

/// Throws Error(argument) with a message that {fmt} makes.
template <class... Values>
[[noreturn]] void refuse(fmt::format_string<Values...> pattern, Values&&... values) {
  throw Error(ErrorKind::argument, fmt::format(pattern, std::forward<Values>(values)...));
}

}  // namespace shapegcode::detail
