#include "path/arc_frame.hpp"

#include <doctest/doctest.h>

#include <tuple>

using shapegcode::ArcFrame;
using shapegcode::Vector3;

TEST_CASE("arc frame: the axes of G17, G18 and G19") {
  for (const auto& [normal, a, b] : {std::tuple{2, 0, 1}, {1, 2, 0}, {0, 1, 2}}) {
    const ArcFrame frame(normal);
    CHECK(frame.normal == normal);
    CHECK(frame.a == a);
    CHECK(frame.b == b);
    // Right-handed: a cross b is the normal.
    CHECK(Vector3::Unit(a).cross(Vector3::Unit(b)) == Vector3::Unit(normal));
  }
}

TEST_CASE("arc frame: coordinates in the plane and back") {
  const Vector3 p(3.0, 4.0, 5.0);
  const Vector3 centre(1.0, 1.0, 1.0);
  for (int normal = 0; normal < 3; ++normal) {
    const ArcFrame frame(normal);
    CHECK(frame.lift(frame.project(p), Vector3(p[normal], p[normal], p[normal])) == p);
    CHECK(frame.offset(centre, p) == frame.project(p - centre));
    CHECK(frame.radius(p, centre) == doctest::Approx(frame.offset(centre, p).norm()));
    const double radius = frame.radius(p, centre);
    const double angle = frame.angle_rad(p, centre);
    CHECK((frame.at_angle(centre, radius, angle) - frame.project(p)).norm() < 1e-14);
    // Along the circle is across the way from the centre, outwards is along it.
    const Vector3 outwards = frame.direction(angle, 0.0, radius, 0.0);
    const Vector3 along = frame.direction(angle, radius, 0.0, 7.0);
    CHECK((frame.project(outwards) - frame.offset(centre, p)).norm() < 1e-14);
    CHECK(along.dot(outwards) == doctest::Approx(0.0));
    CHECK(along[normal] == 7.0);
    CHECK(outwards.cross(along)[normal] == doctest::Approx(radius * radius));
  }
}
