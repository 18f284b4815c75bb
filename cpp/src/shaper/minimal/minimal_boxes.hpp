#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "shaper/minimal/minimal_starts.hpp"
#include "shaper/minimal/minimal_system.hpp"

// Search for all possible shapers. The range of times is divided into boxes. In each, the linearisation of
// minimal_system.hpp with a bound on its second-order remainder shows in which part of the box solutions can lie, if
// any: the box is discarded, or shrinks quadratically to a solution, or is halved. Bounds are on derivatives, evaluated
// in floating point; they ignore rounding (1e-16).

namespace shapegcode::minimal {

/// What the boxes decided.
struct BoxCounts {
  std::int64_t boxes = 0;       ///< looked at
  std::int64_t unresolved = 0;  ///< too small to halve on, neither empty nor shrunk onto a solution
  double decided_up_to = 0.0;   ///< last phase (rad) up to which every box was decided
};

class BoxSearch {
 public:
  BoxSearch(const System& system, const Region& region, std::int64_t max_boxes, Collection& collection)
      : system_(system), region_(region), max_boxes_(max_boxes), collection_(collection) {}

  /// Slice after slice of the last phase, so that a search that runs out of boxes has decided the short shapers.
  [[nodiscard]] BoxCounts run();

 private:
  enum class Verdict : std::uint8_t { empty, solved, open };

  struct Box {
    Phases centre;
    Phases half;
  };

  /// Phases of a cluster of taps whose boxes touch, or of a single one.
  struct Cluster {
    double low;
    double high;
    bool moves;  ///< false: the first tap alone, which stays at zero
  };
  using Clusters = std::array<Cluster, max_modes + 1>;

  [[nodiscard]] bool settle(double low, double high);
  void halve(const Box& box);
  [[nodiscard]] Verdict look(Box& box);
  [[nodiscard]] bool out_of_order(const Box& box) const;
  /// True if the box holds no solution. Otherwise cuts off what of it cannot hold one; `left` is the share of its
  /// volume that stays.
  [[nodiscard]] bool shrink(Box& box, double& left) const;
  /// How far the linearisation's solution `x` can be off within the box, given the magnitudes of the inverse; false if
  /// the amplitudes are too large throughout.
  [[nodiscard]] bool bound(const Box& box, const Vector& x, const Square& magnitude, Vector& reach) const;
  /// Taps that come together act, to second order, as one tap and its derivative. These are fewer unknowns than there
  /// are conditions: true if the least-squares solution leaves more than the second-order rest can account for.
  [[nodiscard]] bool clusters_hold_none(const Box& box) const;
  [[nodiscard]] int clusters_of(const Box& box, Clusters& clusters) const;

  const System& system_;
  Region region_;
  std::int64_t max_boxes_;
  Collection& collection_;
  BoxCounts counts_;
  std::vector<Box> stack_;
};

}  // namespace shapegcode::minimal
