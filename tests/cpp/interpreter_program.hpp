#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

// Programs for the tests of the interpreter, and what they come to.
namespace shapegcode::tests {

// Lines 1 to 3 of every text below: the position is known and zero, the first line of a body is line 4.
inline const std::string known_zero = "%\nG21 G90 G17 G94\nG00 X0. Y0. Z0.\n";

inline std::string framed(const std::string& body) { return known_zero + body + "M30\n%\n"; }

inline Program read(const std::string& body, const ReaderOptions& options = {}) {
  return read_program(framed(body), options);
}

inline bool near(const Vector3& a, const Vector3& b, double tolerance = 1e-9) { return (a - b).norm() < tolerance; }

inline bool warns(const Program& program, const std::string& part, std::uint32_t line = 0) {
  return std::any_of(program.warnings.begin(), program.warnings.end(), [&](const auto& finding) {
    return finding.message.find(part) != std::string::npos && (line == 0 || finding.line == line);
  });
}

struct Refusal {
  bool thrown = false;
  std::string message;
  std::uint32_t line = 0;
  std::uint32_t column = 0;
};

inline Refusal refusal(const std::string& text, const ReaderOptions& options = {}) {
  try {
    (void)read_program(text, options);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::program);
    return {true, error.what(), error.line(), error.column()};
  }
  return {};
}

inline void check_refused(const std::string& text, std::uint32_t line, std::uint32_t column,
                          const std::vector<std::string>& parts) {
  CAPTURE(text);
  const Refusal found = refusal(text);
  CHECK(found.thrown);
  CHECK(found.line == line);
  CHECK(found.column == column);
  CAPTURE(found.message);
  for (const std::string& part : parts) {
    CAPTURE(part);
    CHECK(found.message.find(part) != std::string::npos);
  }
}

inline std::string text_of(const Program& program, const Region& region) {
  return program.text.substr(region.text_begin, region.text_end - region.text_begin);
}

inline Segment only_segment(const Program& program) {
  REQUIRE(program.regions.size() == 1);
  REQUIRE(program.regions[0]->path->size() == 1);
  return (*program.regions[0]->path)[0];
}

/// Two cuts with `line` between them; how many regions come out.
inline std::size_t regions_around(const std::string& line, const std::string& second = "G90 G01 X20. F600.") {
  return read("G01 X10. F600.\n" + line + "\n" + second + "\n").regions.size();
}

}  // namespace shapegcode::tests
