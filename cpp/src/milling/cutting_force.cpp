#include "shapegcode/milling/force.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "milling/azimuth.hpp"
#include "milling/checks.hpp"
#include "milling/revolution.hpp"

namespace shapegcode {

namespace {

using detail::check_positive;
using detail::half_pi;
using detail::refuse;

constexpr double arc_slack_rad = 1e-9;
constexpr double same_end_rad = 1e-9;
constexpr double parts_per_overhang = 10.0;  // of a load on the beam
constexpr double max_turns = 1000.0;         // of a flute around the tool
constexpr double largest_angle_rad = 1e9;    // beyond it too little is left of an angle within one turn

bool same(const ToolBeam& a, const ToolBeam& b) {
  return a.overhang_mm == b.overhang_mm && a.fluted_length_mm == b.fluted_length_mm &&
         a.effective_diameter_mm == b.effective_diameter_mm && a.shank_diameter_mm == b.shank_diameter_mm &&
         a.young_modulus_gpa == b.young_modulus_gpa && a.holder_n_per_um == b.holder_n_per_um &&
         a.spindle_n_per_um == b.spindle_n_per_um;
}

// For loads weighted by their height.
void prepare(FluteSet& set) {
  for (ChipTable& table : set.tables) table.prepare_twice();
}

// Cuts into parts so short that the beam's influence is nearly a straight line along each: the one through its Gauss
// points, under which an even load of any cubic has no error.
template <class Influence>
void weighted_parts(std::span<const EngagedPart> arcs, double overhang_mm, const Influence& influence,
                    std::vector<EngagedPart>& parts) {
  parts.clear();
  for (const EngagedPart& arc : arcs) {
    const double height = arc.top_mm - arc.bottom_mm;
    const int count = std::max(1, static_cast<int>(std::ceil(height * parts_per_overhang / overhang_mm)));
    for (int i = 0; i < count; ++i) {
      EngagedPart part = arc;
      part.bottom_mm = arc.bottom_mm + height * i / count;
      part.top_mm = arc.bottom_mm + height * (i + 1) / count;
      part.centre_mm = 0.5 * (part.bottom_mm + part.top_mm);
      const double side = (part.top_mm - part.bottom_mm) * 0.5 / std::numbers::sqrt3;
      const double low = influence(part.centre_mm - side);
      const double high = influence(part.centre_mm + side);
      part.weight = 0.5 * (low + high);
      part.slope_per_mm = 0.5 * (high - low) / side;
      parts.push_back(part);
    }
  }
}

void check_angle(double turned_rad) {
  if (!(std::abs(turned_rad) <= largest_angle_rad)) {
    refuse("the spindle has turned by {} rad, limit {:g}", turned_rad, largest_angle_rad);
  }
}

double sum_of(const ChipTable::Values& by, const ChipTable::Values& integrals, std::size_t size) {
  double sum = 0.0;
  for (std::size_t k = 0; k < size; ++k) sum += by[k] * integrals[k];
  return sum;
}

}  // namespace

void check(const CuttingCoefficients& c) {
  const auto number = [](double value, const char* what, const char* unit) {
    if (!(std::isfinite(value) && value >= 0.0)) refuse("{} is {}{}, must be at least 0", what, value, unit);
  };
  number(c.specific_n_per_mm2, "specific cutting force", " N/mm2");
  number(c.ratio, "ratio of radial to tangential force", "");
  number(c.tangential_edge_n_per_mm, "tangential edge force", " N/mm");
  number(c.radial_edge_n_per_mm, "radial edge force", " N/mm");
  for (const double exponent : {c.specific_exponent, c.specific_exponent + c.ratio_exponent}) {
    if (!(std::isfinite(exponent) && exponent > -1.0)) {
      refuse(
          "exponent of the specific cutting force is {} (radial: sum of both), must be above -1: the force would not "
          "grow with the chip",
          exponent);
    }
  }
}

Eigen::Vector2d machine_frame(const Eigen::Vector2d& tool_frame, double direction_rad) noexcept {
  const double c = std::cos(direction_rad);
  const double s = std::sin(direction_rad);
  return {tool_frame.x() * c - tool_frame.y() * s, tool_frame.x() * s + tool_frame.y() * c};
}

struct MillingForce::Impl {
  EndMill tool;
  CuttingCoefficients coefficients;
  double rev_per_min;
  SpindleSense sense;
  bool local;     // chip thickness in the power laws
  bool runout;    // flutes differ
  double mirror;  // of y: -1 for a counter-clockwise spindle
  ChipPowers powers;
  FluteSet set;

  // The engagement and feed that the tables and sums below belong to.
  std::vector<EngagedArc> arcs;
  std::vector<EngagedPart> parts;  // of the arcs, as a clockwise spindle sees them
  double mean_cosine = 0.0;        // of the engagement
  double feed_per_tooth = 0.0;
  bool built = false;
  Revolution revolution;
  bool bent_built = false;
  ToolBeam bent_beam;
  Revolution bent;
  std::vector<EngagedPart> weighted;

  Impl(EndMill t, CuttingCoefficients c, double rpm, SpindleSense s)
      : tool(std::move(t)),
        coefficients(c),
        rev_per_min(rpm),
        sense(s),
        local(c.thickness == ChipThickness::local),
        runout(std::any_of(tool.runout_mm.begin(), tool.runout_mm.end(),
                           [&](double value) { return value != tool.runout_mm.front(); })),
        mirror(s == SpindleSense::clockwise ? 1.0 : -1.0),
        powers{Power(local ? 1.0 + c.specific_exponent : 1.0),
               Power(local ? 1.0 + c.specific_exponent + c.ratio_exponent : 1.0),
               c.tangential_edge_n_per_mm > 0.0 || c.radial_edge_n_per_mm > 0.0} {
    set.flutes = tool.flutes;
    set.pitch_rad = 2.0 * std::numbers::pi / tool.flutes;
    set.lag_rad_per_mm = std::tan(tool.helix_rad) / tool.radius_mm();
    if (!runout) set.tables.emplace_back(powers, ChipProfile(), 1.0, false);
  }

  // Takes an engagement and feed; false: nothing is cut.
  bool take(std::span<const EngagedArc> engagement, double feed_mm_per_min) {
    if (!(feed_mm_per_min >= 0.0 && std::isfinite(feed_mm_per_min))) {
      refuse("feed is {} mm/min, must be 0 or above", feed_mm_per_min);
    }
    if (!detail::same_arcs(engagement, arcs)) {
      for (const EngagedArc& arc : engagement) check_arc(arc);  // before anything is changed
      parts.clear();
      take_arcs(engagement);
      arcs.assign(engagement.begin(), engagement.end());
      built = false;
      bent_built = false;
    }
    const double per_tooth = feed_mm_per_min / (rev_per_min * tool.flutes);
    if (parts.empty() || !(per_tooth > 0.0)) return false;
    if (per_tooth == feed_per_tooth) return true;
    feed_per_tooth = per_tooth;
    if (runout) {
      set.tables.clear();
      for (int flute = 0; flute < tool.flutes; ++flute) {
        set.tables.emplace_back(powers, ChipProfile(tool.runout_mm, flute), per_tooth, true);
      }
      built = false;
      bent_built = false;
    }
    return true;
  }

  void check_arc(const EngagedArc& arc) const {
    const bool fits = arc.from_rad >= -half_pi - arc_slack_rad && arc.to_rad <= half_pi + arc_slack_rad &&
                      arc.bottom_mm >= 0.0 && arc.from_rad <= arc.to_rad && arc.bottom_mm <= arc.top_mm &&
                      std::isfinite(arc.top_mm);
    if (!fits) {
      refuse("engaged arc {} ... {} rad, height {} ... {} mm, must rise within -pi/2 ... pi/2 and above the tip",
             arc.from_rad, arc.to_rad, arc.bottom_mm, arc.top_mm);
    }
    const double turns = set.lag_rad_per_mm * arc.top_mm / (2.0 * std::numbers::pi);
    if (turns > max_turns) {
      refuse("a flute winds {:g} times around the tool up to {} mm, limit {}", turns, arc.top_mm, max_turns);
    }
  }

  void take_arcs(std::span<const EngagedArc> engagement) {
    double cosine = 0.0;
    double extent = 0.0;
    for (const EngagedArc& arc : engagement) {
      const bool mirrored = mirror < 0.0;
      const double from = std::max(mirrored ? -arc.to_rad : arc.from_rad, -half_pi);
      const double to = std::min(mirrored ? -arc.from_rad : arc.to_rad, half_pi);
      const double height = arc.top_mm - arc.bottom_mm;
      if (!(to > from) || !(height > 0.0)) continue;
      join({from, to, arc.bottom_mm, arc.top_mm});
      cosine += height * (std::sin(to) - std::sin(from));
      extent += height * (to - from);
    }
    mean_cosine = extent > 0.0 ? cosine / extent : 0.0;
    if (mean_cosine <= 0.0) parts.clear();  // too narrow to tell from nothing
  }

  // Layers of a material model that meet the tool alike are one part.
  void join(const EngagedPart& part) {
    for (EngagedPart& below : parts) {
      if (below.top_mm == part.bottom_mm && std::abs(below.from_rad - part.from_rad) < same_end_rad &&
          std::abs(below.to_rad - part.to_rad) < same_end_rad) {
        below.top_mm = part.top_mm;
        return;
      }
    }
    parts.push_back(part);
  }

  [[nodiscard]] ChipMix mix() const {
    const double specific = coefficients.specific_n_per_mm2;
    double tangential = specific;
    double radial = specific * coefficients.ratio;
    if (!local) {
      const double mean = feed_per_tooth * mean_cosine;
      tangential *= std::pow(mean, coefficients.specific_exponent);
      radial *= std::pow(mean, coefficients.specific_exponent + coefficients.ratio_exponent);
    }
    if (!runout) {  // tables of a unit chip
      tangential *= std::pow(feed_per_tooth, powers.tangential.exponent());
      radial *= std::pow(feed_per_tooth, powers.radial.exponent());
    }
    ChipMix m;
    const auto put = [&m](std::size_t sine, std::size_t cosine, double along, double across) {
      m.x[sine] -= along;
      m.y[cosine] += along;
      m.x[cosine] -= across;
      m.y[sine] -= across;
    };
    put(0, 1, tangential, 0.0);
    m.tangential[2] = tangential;
    std::size_t k = 3;
    if (powers.one_power()) {
      put(0, 1, 0.0, radial);
    } else {
      put(3, 4, 0.0, radial);
      k = 5;
    }
    if (powers.edges) {
      put(k, k + 1, coefficients.tangential_edge_n_per_mm, coefficients.radial_edge_n_per_mm);
      m.tangential[k + 2] = coefficients.tangential_edge_n_per_mm;
    }
    return m;
  }

  // Mean over the revolution: each element of an arc's height passes it once with each flute.
  [[nodiscard]] ChipTable::Values mean_integrals() const {
    ChipTable::Values sum{};
    ChipTable::Values low;
    ChipTable::Values high;
    const double share = static_cast<double>(tool.flutes) / static_cast<double>(set.tables.size());
    for (const ChipTable& table : set.tables) {
      for (const EngagedPart& part : parts) {
        table.cumulated(part.from_rad, low);
        table.cumulated(part.to_rad, high);
        const double weight = share * (part.top_mm - part.bottom_mm) / (2.0 * std::numbers::pi);
        for (std::size_t k = 0; k < table.size(); ++k) sum[k] += weight * (high[k] - low[k]);
      }
    }
    return sum;
  }

  [[nodiscard]] double peak_chip_mm() const {
    double chip = 0.0;
    for (const EngagedPart& part : parts) {
      const double ahead = std::clamp(0.0, part.from_rad, part.to_rad);  // where cos is largest
      for (const ChipTable& table : set.tables) {
        chip = std::max(chip, table.chip_mm(ahead) * (runout ? 1.0 : feed_per_tooth));
      }
    }
    return chip;
  }

  [[nodiscard]] ForceFigures figures(std::span<const EngagedArc> engagement, double feed, bool with_flutes) {
    ForceFigures f;
    if (!take(engagement, feed)) return f;
    if (!built) {
      revolution.build(set, parts, parts);
      built = true;
    }
    const ChipMix m = mix();
    const Revolution::Figures over = revolution.mix(m, with_flutes);
    const ChipTable::Values mean = mean_integrals();
    const std::size_t size = set.tables.front().size();
    const double radius_m = tool.radius_mm() * 1e-3;
    f.mean_n = {sum_of(m.x, mean, size), mirror * sum_of(m.y, mean, size)};
    f.mean_resultant_n = over.mean_resultant;
    f.peak_resultant_n = over.peak_resultant;
    f.peak_flute_n = over.peak_flute;
    f.mean_torque_nm = radius_m * sum_of(m.tangential, mean, size);
    f.peak_torque_nm = radius_m * over.peak_tangential;
    f.mean_power_w = f.mean_torque_nm * rev_per_min * std::numbers::pi / 30.0;
    f.peak_chip_mm = peak_chip_mm();
    return f;
  }

  // Integrals of one flute in some parts, its tip at an azimuth (clockwise sense) that may be turns away.
  [[nodiscard]] ChipTable::Values flute_integrals(std::span<const EngagedPart> of, int flute, double azimuth) const {
    constexpr double turn = 2.0 * std::numbers::pi;
    const ChipTable& table = set.tables[set.tables.size() == 1 ? 0 : static_cast<std::size_t>(flute)];
    ChipTable::Values sum{};
    for (const EngagedPart& part : of) {
      const double lag_top = set.lag_rad_per_mm * part.top_mm;
      const double lag_bottom = set.lag_rad_per_mm * part.bottom_mm;
      const auto first = static_cast<int>(std::ceil((part.from_rad - lag_top - azimuth) / turn));
      const auto last = static_cast<int>(std::floor((part.to_rad - lag_bottom - azimuth) / turn));
      for (int k = first; k <= last; ++k) set.add(part, table, azimuth + turn * k, sum);
    }
    return sum;
  }

  // Clockwise: the flutes' azimuths fall as the spindle turns, each a pitch behind the one ahead.
  [[nodiscard]] double tip_azimuth(int flute, double turned_rad) const {
    return std::remainder(flute * set.pitch_rad - turned_rad, 2.0 * std::numbers::pi);
  }

  [[nodiscard]] Eigen::Vector2d weighted_force(std::span<const EngagedPart> of, const ChipMix& m,
                                               double turned_rad) const {
    Eigen::Vector2d force = Eigen::Vector2d::Zero();
    const std::size_t size = set.tables.front().size();
    for (int flute = 0; flute < tool.flutes; ++flute) {
      const ChipTable::Values sum = flute_integrals(of, flute, tip_azimuth(flute, turned_rad));
      force += Eigen::Vector2d(sum_of(m.x, sum, size), mirror * sum_of(m.y, sum, size));
    }
    return force;
  }

  void check_below_clamp(double overhang_mm) const {
    for (const EngagedPart& part : parts) {
      if (part.top_mm > overhang_mm) {
        refuse("engagement reaches {} mm above the tip, the tool's overhang is {} mm", part.top_mm, overhang_mm);
      }
    }
  }
};

MillingForce::MillingForce(EndMill tool, CuttingCoefficients coefficients, double spindle_rev_per_min,
                           SpindleSense sense) {
  check(tool);
  check(coefficients);
  check_positive(spindle_rev_per_min, "spindle speed", "1/min");
  impl_ = std::make_unique<Impl>(std::move(tool), coefficients, spindle_rev_per_min, sense);
}

MillingForce::~MillingForce() = default;
MillingForce::MillingForce(MillingForce&&) noexcept = default;
MillingForce& MillingForce::operator=(MillingForce&&) noexcept = default;

const EndMill& MillingForce::tool() const noexcept { return impl_->tool; }
const CuttingCoefficients& MillingForce::coefficients() const noexcept { return impl_->coefficients; }
double MillingForce::spindle_rev_per_min() const noexcept { return impl_->rev_per_min; }
SpindleSense MillingForce::sense() const noexcept { return impl_->sense; }
double MillingForce::feed_per_tooth_mm(double feed_mm_per_min) const noexcept {
  return feed_mm_per_min / (impl_->rev_per_min * impl_->tool.flutes);
}

ForceFigures MillingForce::figures(std::span<const EngagedArc> arcs, double feed_mm_per_min) {
  return impl_->figures(arcs, feed_mm_per_min, true);
}

ForceFigures MillingForce::quick_figures(std::span<const EngagedArc> arcs, double feed_mm_per_min) {
  return impl_->figures(arcs, feed_mm_per_min, false);
}

ForceCurve MillingForce::curve(std::span<const EngagedArc> arcs, double feed_mm_per_min, int angles) {
  if (angles < 1) refuse("angles of a revolution are {}, must be at least 1", angles);
  ForceCurve curve;
  curve.turned_rad.resize(angles);
  for (int i = 0; i < angles; ++i) curve.turned_rad[i] = 2.0 * std::numbers::pi * i / angles;
  curve.force_n.setZero(angles, 2);
  curve.torque_nm.setZero(angles);
  const int flutes = impl_->tool.flutes;
  curve.flute_n.assign(static_cast<std::size_t>(flutes), Eigen::MatrixX2d::Zero(angles, 2));
  if (!impl_->take(arcs, feed_mm_per_min)) return curve;
  const ChipMix m = impl_->mix();
  const std::size_t size = impl_->set.tables.front().size();
  const double radius_m = impl_->tool.radius_mm() * 1e-3;
  for (int i = 0; i < angles; ++i) {
    for (int flute = 0; flute < flutes; ++flute) {
      const double azimuth = impl_->tip_azimuth(flute, curve.turned_rad[i]);
      const ChipTable::Values sum = impl_->flute_integrals(impl_->parts, flute, azimuth);
      const Eigen::RowVector2d force(sum_of(m.x, sum, size), impl_->mirror * sum_of(m.y, sum, size));
      curve.flute_n[static_cast<std::size_t>(flute)].row(i) = force;
      curve.force_n.row(i) += force;
      curve.torque_nm[i] += radius_m * sum_of(m.tangential, sum, size);
    }
  }
  return curve;
}

double MillingForce::peak_deflection_um(std::span<const EngagedArc> arcs, double feed_mm_per_min,
                                        const ToolBeam& beam) {
  Impl& impl = *impl_;
  if (!impl.take(arcs, feed_mm_per_min)) return 0.0;
  if (!impl.bent_built || !same(beam, impl.bent_beam)) {
    check(beam);
    impl.check_below_clamp(beam.overhang_mm);
    weighted_parts(
        impl.parts, beam.overhang_mm, [&](double z) { return compliance_um_per_n(beam, 0.0, z); }, impl.weighted);
    prepare(impl.set);
    impl.bent.build(impl.set, impl.parts, impl.weighted);
    impl.bent_beam = beam;
    impl.bent_built = true;
  }
  return impl.bent.mix(impl.mix(), false).peak_resultant;
}

Eigen::Vector2d MillingForce::deflection_um(std::span<const EngagedArc> arcs, double feed_mm_per_min, double turned_rad,
                                            double height_mm, const ToolBeam& beam) {
  check(beam);
  check_angle(turned_rad);
  if (!std::isfinite(height_mm)) refuse("height above the tip is {} mm, must be finite", height_mm);
  Impl& impl = *impl_;
  if (!impl.take(arcs, feed_mm_per_min)) return Eigen::Vector2d::Zero();
  impl.check_below_clamp(beam.overhang_mm);
  std::vector<EngagedPart> weighted;
  weighted_parts(
      impl.parts, beam.overhang_mm, [&](double z) { return compliance_um_per_n(beam, height_mm, z); }, weighted);
  prepare(impl.set);
  return impl.weighted_force(weighted, impl.mix(), turned_rad);
}

Eigen::Vector2d MillingForce::force_centre_mm(std::span<const EngagedArc> arcs, double feed_mm_per_min,
                                              double turned_rad, double overhang_mm) {
  check_positive(overhang_mm, "overhang of the tool", "mm");
  check_angle(turned_rad);
  const double none = std::numeric_limits<double>::quiet_NaN();
  Impl& impl = *impl_;
  if (!impl.take(arcs, feed_mm_per_min)) return {none, none};
  impl.check_below_clamp(overhang_mm);
  const ChipMix m = impl.mix();
  const Eigen::Vector2d force = impl.weighted_force(impl.parts, m, turned_rad);
  std::vector<EngagedPart> weighted;
  weighted_parts(
      impl.parts, 0.25 * overhang_mm, [&](double z) { return overhang_mm - z; }, weighted);
  prepare(impl.set);
  const Eigen::Vector2d moment = impl.weighted_force(weighted, m, turned_rad);
  return {force.x() != 0.0 ? moment.x() / force.x() : none, force.y() != 0.0 ? moment.y() / force.y() : none};
}

}  // namespace shapegcode
