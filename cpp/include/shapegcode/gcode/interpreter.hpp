#pragma once

#include <string>

#include "shapegcode/gcode/program.hpp"

namespace shapegcode {

/// Reads a program text into regions of canonical moves (FANUC milling dialect; see docs/dialect.md for what is read,
/// passed through and refused). Pure function of its arguments. Throws Error(program) with line and column.
[[nodiscard]] Program read_program(std::string text, const ReaderOptions& options = {});

}  // namespace shapegcode
