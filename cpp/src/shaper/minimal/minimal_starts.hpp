#pragma once

#include <vector>

#include "shaper/minimal/minimal_system.hpp"

namespace shapegcode::minimal {

/// Range of a search, in radians of the fastest mode, and its limits.
struct Region {
  double limit = 0.0;        ///< largest phase of the last tap
  double max_abs_sum = 0.0;  ///< of the amplitudes
  double apart = 0.0;        ///< smallest phase between two taps; closer ones are one tap
};

[[nodiscard]] bool accepts(const Region& region, const Taps& taps);

/// Distinct solutions, each with how often it was found.
class Collection {
 public:
  Collection(const System& system, const Region& region) : system_(system), region_(region) {}

  /// Counts an isolated solution that the region accepts; false for anything else.
  bool add(const Taps& taps);
  /// How many were found fewer than `hits` times.
  [[nodiscard]] int rarer_than(int hits) const;
  [[nodiscard]] std::vector<Taps> taps() const;

 private:
  struct Entry {
    Taps taps;
    int hits;
  };

  const System& system_;
  Region region_;
  std::vector<Entry> entries_;  ///< ascending in the last phase
};

/// What the many starts found and how sure that is.
struct StartCounts {
  int starts = 0;
  int converged = 0;   ///< to a solution that the region accepts
  int found_once = 0;  ///< solutions that a single start found
};

/// Newton from many starts, until every solution was found three times over or `max_starts` are used up. Then from each
/// solution's mirror image, which is another one where nothing is damped and a good start where little is.
StartCounts search_from_starts(const System& system, const Region& region, int max_starts, Collection& collection);

}  // namespace shapegcode::minimal
