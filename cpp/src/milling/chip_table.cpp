#include "milling/chip_table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "milling/azimuth.hpp"

namespace shapegcode {

namespace {

using detail::half_pi;

// Grid coordinate: 0 at pi/2, 1 at azimuth 0; a power of the distance from pi/2 becomes twice as smooth.
double azimuth_at(double y) { return half_pi * (1.0 - y * y); }
double coordinate_of(double azimuth) {
  const double rest = 1.0 - azimuth / half_pi;
  return rest > 0.0 ? std::sqrt(rest) : 0.0;
}

constexpr std::array<double, 5> gauss_at = {0.04691007703066800, 0.23076534494715845, 0.5, 0.76923465505284155,
                                            0.95308992296933200};
constexpr std::array<double, 5> gauss_weight = {0.11846344252809454, 0.23931433524968324, 0.28444444444444444,
                                                0.23931433524968324, 0.11846344252809454};

struct Direction {
  double sine;
  double cosine;
};

Direction direction_at(double y) {
  const double azimuth = azimuth_at(y);
  return {std::sin(azimuth), std::max(std::cos(azimuth), 0.0)};
}

}  // namespace

// Directions of the nodes and of the middles between them: the same for every table.
struct ChipTable::Grid {
  explicit Grid(std::size_t count) : cells(count) {
    const double step = 1.0 / static_cast<double>(count);
    for (std::size_t i = 0; i <= count; ++i) {
      node.push_back(direction_at(static_cast<double>(i) * step));
      middle.push_back(direction_at((static_cast<double>(i) + 0.5) * step));
    }
  }

  std::size_t cells;
  std::vector<Direction> node;
  std::vector<Direction> middle;  // of the cell above each node

  static const Grid& fine() {
    static const Grid grid(512);
    return grid;
  }
  static const Grid& quick() {
    static const Grid grid(64);
    return grid;
  }
};

ChipProfile::ChipProfile(const std::vector<double>& runout_mm, int flute) {
  const int flutes = static_cast<int>(runout_mm.size());
  const auto offset = [&](int ahead) {
    return runout_mm[static_cast<std::size_t>(flute)] -
           runout_mm[static_cast<std::size_t>((flute - ahead + flutes) % flutes)];
  };
  int at = 1;
  for (int m = 2; m <= flutes; ++m) {
    if (offset(m) < offset(at)) at = m;
  }
  double from = 0.0;
  for (;;) {  // along the lower envelope of the lines, slopes fall
    lines_.push_back({from, static_cast<double>(at), offset(at)});
    double next_u = std::numeric_limits<double>::infinity();
    int next = 0;
    for (int m = 1; m < at; ++m) {
      const double u = (offset(m) - offset(at)) / (at - m);
      if (u <= next_u && !(u == next_u && next < m && next != 0)) {
        next_u = u;
        next = m;
      }
    }
    const double zero = -offset(at) / at;
    if (zero > from && zero <= next_u) kinks_.push_back(zero);
    if (next == 0) break;
    kinks_.push_back(next_u);
    from = next_u;
    at = next;
  }
}

ChipTable::ChipTable(const ChipPowers& powers, ChipProfile profile, double feed_per_tooth_mm, bool quick)
    : powers_(powers),
      profile_(std::move(profile)),
      feed_mm_(feed_per_tooth_mm),
      size_(3U + (powers.one_power() ? 0U : 2U) + (powers.edges ? 3U : 0U)),
      grid_(quick ? Grid::quick() : Grid::fine()),
      nodes_((grid_.cells + 1) * size_ * 2) {
  for (const double u : profile_.kinks()) {
    if (u < feed_mm_) kinks_.push_back(coordinate_of(std::acos(u / feed_mm_)));
  }
  std::sort(kinks_.begin(), kinks_.end());
  Values sum{};
  Values here{};
  Values above{};
  const double per_cell = -std::numbers::pi / static_cast<double>(grid_.cells * grid_.cells);
  for (std::size_t node = grid_.cells + 1; node-- > 0;) {
    values(grid_.node[node].sine, grid_.node[node].cosine, here);
    if (node < grid_.cells) integrate(node, here, above, sum);
    const double fall = per_cell * static_cast<double>(node);  // of azimuth
    double* to = nodes_.data() + node * size_ * 2;
    for (std::size_t k = 0; k < size_; ++k) {
      to[2 * k] = sum[k];
      to[2 * k + 1] = fall * here[k];
    }
    above = here;
  }
}

// Simpson's rule, its middle from the cubic.
void ChipTable::prepare_twice() {
  if (!twice_.empty()) return;
  twice_.resize(nodes_.size());
  const double step = 1.0 / static_cast<double>(grid_.cells);
  for (std::size_t node = grid_.cells + 1; node-- > 0;) {
    const double y = static_cast<double>(node) * step;
    const double* at = nodes_.data() + node * size_ * 2;
    double* to = twice_.data() + node * size_ * 2;
    for (std::size_t k = 0; k < 2 * size_; k += 2) {
      to[k + 1] = -std::numbers::pi * y * step * at[k];
      if (node == grid_.cells) continue;
      const double* next = at + 2 * size_;
      const double middle = 0.5 * (at[k] + next[k]) + 0.125 * (at[k + 1] - next[k + 1]);
      to[k] = to[k + 2 * size_] +
              std::numbers::pi / 6.0 * step * (y * at[k] + 4.0 * (y + 0.5 * step) * middle + (y + step) * next[k]);
    }
  }
}

void ChipTable::integrate_section(double from, double to, Values& sum) const {
  Values value{};
  for (std::size_t g = 0; g < gauss_at.size(); ++g) {
    const double y = from + (to - from) * gauss_at[g];
    const Direction direction = direction_at(y);
    values(direction.sine, direction.cosine, value);
    const double weight = gauss_weight[g] * (to - from) * std::numbers::pi * y;
    for (std::size_t k = 0; k < size_; ++k) sum[k] += weight * value[k];
  }
}

// Adds what lies between the nodes of a cell, from the integrands there: Simpson's rule but where a kink or the end
// lies.
void ChipTable::integrate(std::size_t cell, const Values& lower, const Values& upper, Values& sum) const {
  const double step = 1.0 / static_cast<double>(grid_.cells);
  double from = static_cast<double>(cell) * step;
  const double end = from + step;
  auto kink = std::upper_bound(kinks_.begin(), kinks_.end(), from);
  if (cell > 0 && (kink == kinks_.end() || *kink >= end)) {
    Values middle{};
    values(grid_.middle[cell].sine, grid_.middle[cell].cosine, middle);
    const double share = std::numbers::pi * step / 6.0;
    const double at_lower = share * from;
    const double at_middle = share * 4.0 * (from + 0.5 * step);
    const double at_upper = share * end;
    for (std::size_t k = 0; k < size_; ++k) {
      sum[k] += at_lower * lower[k] + at_middle * middle[k] + at_upper * upper[k];
    }
    return;
  }
  for (; kink != kinks_.end() && *kink < end; ++kink) {
    integrate_section(from, *kink, sum);
    from = *kink;
  }
  integrate_section(from, end, sum);
}

double ChipTable::chip_mm(double azimuth) const noexcept {
  return profile_(feed_mm_ * std::max(std::cos(azimuth), 0.0));
}

void ChipTable::density(double azimuth, Values& out) const noexcept {
  values(std::sin(azimuth), std::max(std::cos(azimuth), 0.0), out);
}

void ChipTable::values(double sine, double cosine, Values& out) const noexcept {
  const double t = profile_(feed_mm_ * cosine);
  const double tangential = powers_.tangential(t);
  out[0] = tangential * sine;
  out[1] = tangential * cosine;
  out[2] = tangential;
  std::size_t k = 3;
  if (!powers_.one_power()) {
    const double radial = powers_.radial(t);
    out[k++] = radial * sine;
    out[k++] = radial * cosine;
  }
  if (powers_.edges) {
    const double contact = t > 0.0 ? 1.0 : 0.0;
    out[k++] = contact * sine;
    out[k++] = contact * cosine;
    out[k] = contact;
  }
}

void ChipTable::cumulated(double azimuth, Values& out) const noexcept { look_up(nodes_, azimuth, false, out); }

void ChipTable::cumulated_twice(double azimuth, Values& out) const noexcept { look_up(twice_, azimuth, true, out); }

void ChipTable::look_up(const std::vector<double>& nodes, double azimuth, bool odd_sines, Values& out) const noexcept {
  const double at = coordinate_of(std::abs(azimuth)) * static_cast<double>(grid_.cells);
  const auto cell = std::min(static_cast<std::size_t>(at), grid_.cells - 1);
  const double x = at - static_cast<double>(cell);
  const double y = 1.0 - x;
  // Value and slope at both nodes.
  const double v0 = y * y * (1.0 + 2.0 * x);
  const double s0 = x * y * y;
  const double v1 = x * x * (3.0 - 2.0 * x);
  const double s1 = -x * x * y;
  const double* left = nodes.data() + cell * size_ * 2;
  const double* right = left + size_ * 2;
  for (std::size_t k = 0; k < size_; ++k) {
    out[k] = v0 * left[2 * k] + s0 * left[2 * k + 1] + v1 * right[2 * k] + s1 * right[2 * k + 1];
  }
  if (azimuth >= 0.0) return;
  // Integrals over a sine are even, all others odd; integrated once more it is the other way round.
  const double sine = odd_sines ? -1.0 : 1.0;
  const auto turn = [&out, sine](std::size_t k) {
    out[k] *= sine;
    out[k + 1] *= -sine;
  };
  turn(0);
  out[2] *= -sine;
  std::size_t k = 3;
  if (!powers_.one_power()) {
    turn(k);
    k += 2;
  }
  if (powers_.edges) {
    turn(k);
    out[k + 2] *= -sine;
  }
}

}  // namespace shapegcode
