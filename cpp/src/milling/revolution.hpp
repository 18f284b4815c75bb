// Forces of all flutes over one revolution of the spindle, as sums of the integrals in ChipTable.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "milling/chip_table.hpp"

namespace shapegcode {

/// Part of the engagement, seen with a clockwise spindle. Its force counts `weight` times at `centre_mm`, and
/// `slope_per_mm` more for each mm above.
struct EngagedPart {
  double from_rad;
  double to_rad;
  double bottom_mm;
  double top_mm;
  double weight = 1.0;
  double slope_per_mm = 0.0;
  double centre_mm = 0.0;
};

/// What the integrals of ChipTable come to: force along x and y and at the circumference, per integral.
struct ChipMix {
  ChipTable::Values x{};
  ChipTable::Values y{};
  ChipTable::Values tangential{};
};

/// What of a flute is in a part: from azimuth `low` to `high`, with the integrals of ChipTable at both.
struct FluteSection {
  double low;
  double high;
  const ChipTable::Values& lower;
  const ChipTable::Values& upper;
};

/// The helix of the flutes. Tables: one for all flutes, or one for each.
struct FluteSet {
  int flutes = 1;
  double pitch_rad = 0.0;
  double lag_rad_per_mm = 0.0;  ///< of the helix: azimuth that a point lies behind the tip, by its height
  std::vector<ChipTable> tables;

  /// Too little lag to tell from none: the element at the middle stands for all.
  [[nodiscard]] bool straight(const EngagedPart& part) const noexcept {
    return lag_rad_per_mm * (part.top_mm - part.bottom_mm) < 1e-6;
  }
  /// Adds the force over a section of a part, the flute's tip at `azimuth`.
  void add_section(const EngagedPart& part, const ChipTable& table, double azimuth, const FluteSection& section,
                   ChipTable::Values& sum) const noexcept;
  /// Adds what a flute whose tip stands at `azimuth` has in a part.
  void add(const EngagedPart& part, const ChipTable& table, double azimuth, ChipTable::Values& sum) const noexcept;
};

/// The integrals on a grid of angles that ends where a flute's tip or top enters or leaves an arc, kept so that they
/// can be mixed for any feed.
class Revolution {
 public:
  struct Figures {
    double mean_resultant = 0.0;
    double peak_resultant = 0.0;
    double peak_flute = 0.0;
    double peak_tangential = 0.0;
  };

  /// `arcs` give the angles, `parts` of them the forces.
  void build(const FluteSet& set, std::span<const EngagedPart> arcs, std::span<const EngagedPart> parts);
  [[nodiscard]] Figures mix(const ChipMix& mix, bool with_flutes);

 private:
  void place_angles(const FluteSet& set, std::span<const EngagedPart> arcs);
  void add(const FluteSet& set, const EngagedPart& part, std::size_t kind);
  [[nodiscard]] double peak(const std::vector<double>& values) const noexcept;
  void weigh(const double* integrals, const ChipTable::Values& by, std::vector<double>& out) const;

  std::size_t size_ = 0;    // integrals
  std::size_t flutes_ = 0;  // passes of one flute over the revolution, a pitch apart
  std::size_t kinds_ = 0;   // different flutes
  double pitch_ = 0.0;
  std::vector<double> kinks_;
  std::vector<std::pair<double, double>> section_ends_;
  std::vector<double> angle_;          // of the tip of the first flute, within a pitch
  std::vector<double> weight_;         // of Simpson's rule
  std::vector<std::size_t> sections_;  // first angle of each section between kinks, and the end
  std::vector<double> flute_;          // [kind][pass][integral][angle]
  std::vector<double> total_;          // [turn by a pitch][integral][angle]
  std::vector<double> x_;
  std::vector<double> y_;
  std::vector<double> t_;
  std::vector<double> magnitude_;
};

}  // namespace shapegcode
