#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/path.hpp"

using shapegcode::Error;
using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Path;
using shapegcode::point_at;
using shapegcode::Segment;
using shapegcode::Vector3;

namespace {

/// The path of paper 000: line, quarter arc of 20 mm, line.
Path paper_path() {
  return Path({make_line({0, 0, 0}, {20, 0, 0}, 100.0),
               make_arc({20, 0, 0}, {40, 20, 0}, {20, 20, 0}, std::numbers::pi / 2, 2, 100.0),
               make_line({40, 20, 0}, {40, 40, 0}, 100.0)});
}

}  // namespace

TEST_CASE("path: distances by hand") {
  const Path path = paper_path();
  REQUIRE(path.size() == 3);
  const double arc = 10.0 * std::numbers::pi;
  CHECK(path.distance_mm(0) == 0.0);
  CHECK(path.distance_mm(1) == 20.0);
  CHECK(path.distance_mm(2) == doctest::Approx(20.0 + arc));
  CHECK(path.length_mm() == doctest::Approx(40.0 + arc));
  std::size_t cursor = 0;
  CHECK(path.point(5.0, cursor) == Vector3(5.0, 0.0, 0.0));
  const double h = 20.0 * std::sqrt(0.5);
  CHECK((path.point(20.0 + 0.5 * arc, cursor) - Vector3(20.0 + h, 20.0 - h, 0.0)).norm() < 1e-12);
  CHECK(cursor == 1);
  CHECK((path.point(30.0 + arc, cursor) - Vector3(40.0, 30.0, 0.0)).norm() < 1e-12);
  CHECK(path.point(1e9, cursor) == Vector3(40.0, 40.0, 0.0));
  CHECK(path.point(-1.0, cursor) == Vector3(0.0, 0.0, 0.0));
}

TEST_CASE("path: a point does not depend on where the cursor stood") {
  const Path path = paper_path();
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> distance(-1.0, 1.1 * path.length_mm());
  std::size_t wandering = 0;
  for (int i = 0; i < 2000; ++i) {
    const double s = distance(generator);
    std::size_t fresh = 0;
    std::size_t beyond = 99;
    const Vector3 expected = path.point(s, fresh);
    CHECK(path.point(s, wandering) == expected);
    CHECK(path.point(s, beyond) == expected);
  }
}

TEST_CASE("path: refuses gaps and numbers that are not finite") {
  CHECK_THROWS_AS(Path({make_line({0, 0, 0}, {1, 0, 0}, 1.0), make_line({1, 0, 2e-6}, {2, 0, 0}, 1.0)}), Error);
  CHECK_NOTHROW(Path({make_line({0, 0, 0}, {1, 0, 0}, 1.0), make_line({1, 0, 0.5e-6}, {2, 0, 0}, 1.0)}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(Path({make_line({0, 0, 0}, {nan, 0, 0}, 1.0)}), Error);
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(Path({make_line({0, 0, 0}, {infinity, 0, 0}, 1.0)}), Error);
}

TEST_CASE("path: empty, and with segments of no length") {
  const Path empty;
  std::size_t cursor = 3;
  CHECK(empty.length_mm() == 0.0);
  CHECK(empty.point(1.0, cursor) == Vector3::Zero());
  const Path path({make_line({0, 0, 0}, {1, 0, 0}, 1.0), make_line({1, 0, 0}, {1, 0, 0}, 1.0),
                   make_line({1, 0, 0}, {3, 0, 0}, 1.0)});
  CHECK(path.length_mm() == 3.0);
  cursor = 0;
  CHECK(path.point(1.0, cursor) == Vector3(1.0, 0.0, 0.0));
  CHECK(path.point(2.0, cursor) == Vector3(2.0, 0.0, 0.0));
}
