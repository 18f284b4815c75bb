#include "base/checks.hpp"

#include <cmath>

#include "base/refuse.hpp"

namespace shapegcode {

void require(bool holds, std::string_view name, double value, std::string_view unit, std::string_view range) {
  if (holds) return;
  detail::refuse("{} is {}{}{}, must be {}", name, value, unit.empty() ? "" : " ", unit, range);
}

void require_within(double value, double lowest, double highest, std::string_view name, std::string_view unit) {
  if (std::isfinite(value) && value >= lowest && value <= highest) return;
  require(false, name, value, unit,
          highest < unbounded ? detail::message("within {} ... {}", lowest, highest)
                              : detail::message("finite and >= {}", lowest));
}

void require_not_below_zero(double value, std::string_view name, std::string_view unit) {
  require_within(value, 0.0, unbounded, name, unit);
}

void require_above_zero(double value, std::string_view name, std::string_view unit) {
  require(std::isfinite(value) && value > 0.0, name, value, unit, "finite and above 0");
}

void require_period(double period_s, std::string_view name) { require_above_zero(period_s, name, "s"); }

std::int64_t require_count(double count, double most, std::string_view what, std::string_view things) {
  if (!(count >= 0.0 && count <= most)) {
    detail::refuse("{} takes {} {}, at most {:.10g} are possible", what,
                   std::isfinite(count) ? detail::message("{:.10g}", count) : "far too many", things, most);
  }
  return static_cast<std::int64_t>(count);
}

}  // namespace shapegcode
