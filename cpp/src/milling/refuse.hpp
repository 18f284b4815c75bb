// Private to milling: how a value that cannot be is refused.
#pragma once

#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode::detail {

[[noreturn]] inline void refuse(const std::string& message) { throw Error(ErrorKind::argument, message); }

}  // namespace shapegcode::detail
