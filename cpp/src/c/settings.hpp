#pragma once

#include "shapegcode/controller.hpp"
#include "shapegcode/samples.hpp"
#include "shapegcode/shapegcode.h"

namespace shapegcode::c {

[[nodiscard]] inline Vector3 vector_of(const double* values) noexcept { return {values[0], values[1], values[2]}; }

/// Whether a struct was initialised, by this header or an older one.
[[nodiscard]] bool has_known_size(const shapegcode_settings& settings) noexcept;

/// What an older header does not know has its default. Throws Error(argument).
[[nodiscard]] ControllerSettings settings_of(const shapegcode_settings& given);

}  // namespace shapegcode::c
