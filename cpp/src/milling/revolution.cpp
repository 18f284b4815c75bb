#include "milling/revolution.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "milling/azimuth.hpp"

namespace shapegcode {

namespace {

constexpr double panel_rad = 8.0 / 180.0 * std::numbers::pi;  // of Simpson's rule, two steps each
constexpr double brief_rad = 1.0 / 180.0 * std::numbers::pi;  // between kinks: a straight line will do
constexpr double same_kink_rad = 1e-6;
// A weighted load over less azimuth than this acts at its middle.
constexpr double short_rad = 1e-2;

}  // namespace

void FluteSet::add(const EngagedPart& part, const ChipTable& table, double azimuth,
                   ChipTable::Values& sum) const noexcept {
  ChipTable::Values upper;
  if (straight(part)) {
    const double middle_mm = 0.5 * (part.bottom_mm + part.top_mm);
    const double at = azimuth + lag_rad_per_mm * middle_mm;
    if (at < part.from_rad || at > part.to_rad) return;
    table.density(at, upper);
    const double weight =
        (part.weight + part.slope_per_mm * (middle_mm - part.centre_mm)) * (part.top_mm - part.bottom_mm);
    for (std::size_t k = 0; k < table.size(); ++k) sum[k] += weight * upper[k];
    return;
  }
  const double low = std::max(part.from_rad, azimuth + lag_rad_per_mm * part.bottom_mm);
  const double high = std::min(part.to_rad, azimuth + lag_rad_per_mm * part.top_mm);
  if (!(high > low)) return;
  ChipTable::Values lower;
  table.cumulated(low, lower);
  table.cumulated(high, upper);
  add_section(part, table, azimuth, {low, high, lower, upper}, sum);
}

void FluteSet::add_section(const EngagedPart& part, const ChipTable& table, double azimuth, const FluteSection& section,
                           ChipTable::Values& sum) const noexcept {
  const auto [low, high, lower, upper] = section;
  const double share = 1.0 / lag_rad_per_mm;
  if (part.slope_per_mm == 0.0) {
    const double weight = part.weight * share;
    for (std::size_t k = 0; k < table.size(); ++k) sum[k] += weight * (upper[k] - lower[k]);
    return;
  }
  const auto weight_at = [&](double p) {
    return part.weight + part.slope_per_mm * ((p - azimuth) * share - part.centre_mm);
  };
  if (high - low < short_rad) {
    const double weight = weight_at(0.5 * (low + high)) * share;
    for (std::size_t k = 0; k < table.size(); ++k) sum[k] += weight * (upper[k] - lower[k]);
    return;
  }
  // By parts: the weight is a straight line.
  ChipTable::Values lower_twice;
  ChipTable::Values upper_twice;
  table.cumulated_twice(low, lower_twice);
  table.cumulated_twice(high, upper_twice);
  const double at_low = weight_at(low) * share;
  const double at_high = weight_at(high) * share;
  const double slope = part.slope_per_mm * share * share;
  for (std::size_t k = 0; k < table.size(); ++k) {
    sum[k] += at_high * upper[k] - at_low * lower[k] - slope * (upper_twice[k] - lower_twice[k]);
  }
}

void Revolution::place_angles(const FluteSet& set, std::span<const EngagedPart> arcs) {
  kinks_.clear();
  const auto note = [&](double angle) {
    const double turns = std::floor(angle / set.pitch_rad);
    kinks_.push_back(std::clamp(angle - turns * set.pitch_rad, 0.0, set.pitch_rad));
  };
  for (const EngagedPart& arc : arcs) {
    if (set.straight(arc)) {
      const double lag = set.lag_rad_per_mm * 0.5 * (arc.bottom_mm + arc.top_mm);
      note(arc.from_rad - lag);
      note(arc.to_rad - lag);
      continue;
    }
    for (const double z : {arc.bottom_mm, arc.top_mm}) {
      note(arc.from_rad - set.lag_rad_per_mm * z);
      note(arc.to_rad - set.lag_rad_per_mm * z);
    }
  }
  std::sort(kinks_.begin(), kinks_.end());
  // Kinks that are nearly the same are one, with no angle between them; a section leads from its last to the next's
  // first.
  section_ends_.clear();
  for (std::size_t i = 0; i < kinks_.size(); ++i) {
    const double next = i + 1 < kinks_.size() ? kinks_[i + 1] : kinks_.front() + set.pitch_rad;
    if (next - kinks_[i] >= same_kink_rad) section_ends_.emplace_back(kinks_[i], next);
  }

  angle_.clear();
  weight_.clear();
  sections_.clear();
  for (const auto& [first, last] : section_ends_) {
    sections_.push_back(angle_.size());
    const double length = last - first;
    const bool brief = length < brief_rad;
    const auto steps = brief ? 1 : 2 * static_cast<std::size_t>(std::ceil(length / panel_rad));
    const double step = length / static_cast<double>(steps);
    for (std::size_t k = 0; k <= steps; ++k) {
      const bool end = k == 0 || k == steps;
      const double inwards = k == 0 ? detail::inside_rad : (k == steps ? -detail::inside_rad : 0.0);
      angle_.push_back(first + step * static_cast<double>(k) + inwards);
      weight_.push_back(step / (brief ? 2.0 : 3.0) * (end ? 1.0 : (k % 2 == 1 ? 4.0 : 2.0)) / set.pitch_rad);
    }
  }
  sections_.push_back(angle_.size());
}

// What the flutes of a kind have in a part, pass by pass.
void Revolution::add(const FluteSet& set, const EngagedPart& part, std::size_t kind) {
  const ChipTable& table = set.tables[kind];
  const std::size_t n = angle_.size();
  const double lag = set.lag_rad_per_mm;
  const bool straight = set.straight(part);
  const double first_angle = angle_.front();
  const double last_angle = angle_.back();
  const auto first = static_cast<int>(std::ceil((part.from_rad - lag * part.top_mm - last_angle) / set.pitch_rad));
  const auto last = static_cast<int>(std::floor((part.to_rad - lag * part.bottom_mm - first_angle) / set.pitch_rad));
  ChipTable::Values at_from;
  ChipTable::Values at_to;
  if (!straight) {
    table.cumulated(part.from_rad, at_from);
    table.cumulated(part.to_rad, at_to);
  }
  ChipTable::Values lower;
  ChipTable::Values upper;
  for (int pass = first; pass <= last; ++pass) {
    const int turned = pass % set.flutes;
    const auto column = static_cast<std::size_t>(turned < 0 ? turned + set.flutes : turned);
    double* to = flute_.data() + (kind * flutes_ + column) * size_ * n;
    for (std::size_t j = 0; j < n; ++j) {
      const double azimuth = angle_[j] + pass * set.pitch_rad;
      if (straight) {
        ChipTable::Values value{};
        set.add(part, table, azimuth, value);
        for (std::size_t k = 0; k < size_; ++k) to[k * n + j] += value[k];
        continue;
      }
      const double tip = azimuth + lag * part.bottom_mm;
      const double top = azimuth + lag * part.top_mm;
      const bool tip_inside = tip > part.from_rad;
      const bool top_inside = top < part.to_rad;
      if (tip >= part.to_rad || top <= part.from_rad) continue;
      if (tip_inside) table.cumulated(tip, lower);
      if (top_inside) table.cumulated(top, upper);
      const ChipTable::Values& low = tip_inside ? lower : at_from;
      const ChipTable::Values& high = top_inside ? upper : at_to;
      ChipTable::Values value{};
      set.add_section(part, table, azimuth,
                      {tip_inside ? tip : part.from_rad, top_inside ? top : part.to_rad, low, high}, value);
      for (std::size_t k = 0; k < size_; ++k) to[k * n + j] += value[k];
    }
  }
}

void Revolution::build(const FluteSet& set, std::span<const EngagedPart> arcs, std::span<const EngagedPart> parts) {
  size_ = set.tables.front().size();
  flutes_ = static_cast<std::size_t>(set.flutes);
  kinds_ = set.tables.size();
  pitch_ = set.pitch_rad;
  place_angles(set, arcs);
  const std::size_t n = angle_.size();
  const std::size_t block = size_ * n;
  flute_.assign(kinds_ * flutes_ * block, 0.0);
  total_.assign(kinds_ * block, 0.0);
  if (n == 0) return;
  for (std::size_t kind = 0; kind < kinds_; ++kind) {
    for (const EngagedPart& part : parts) add(set, part, kind);
  }
  // Turned on by a pitch, flute i stands where its column i + turn is; flutes of one kind are all the first.
  for (std::size_t turn = 0; turn < kinds_; ++turn) {
    double* to = total_.data() + turn * block;
    for (std::size_t i = 0; i < flutes_; ++i) {
      const std::size_t kind = kinds_ == 1 ? 0 : i;
      const double* from = flute_.data() + (kind * flutes_ + (i + turn) % flutes_) * block;
      for (std::size_t k = 0; k < block; ++k) to[k] += from[k];
    }
  }
}

void Revolution::weigh(const double* integrals, const ChipTable::Values& by, std::vector<double>& out) const {
  const std::size_t n = angle_.size();
  out.assign(n, 0.0);
  for (std::size_t k = 0; k < size_; ++k) {
    if (by[k] == 0.0) continue;
    const double factor = by[k];
    const double* from = integrals + k * n;
    for (std::size_t j = 0; j < n; ++j) out[j] += factor * from[j];
  }
}

// Largest value on the grid or of a parabola through three neighbours of one section.
double Revolution::peak(const std::vector<double>& values) const noexcept {
  double largest = 0.0;
  for (const double value : values) largest = std::max(largest, value);
  const double worth_a_look = 0.98 * largest;
  double found = largest;
  for (std::size_t s = 0; s + 1 < sections_.size(); ++s) {
    for (std::size_t j = sections_[s] + 1; j + 1 < sections_[s + 1]; ++j) {
      if (values[j] < worth_a_look) continue;
      const double slope = 0.5 * (values[j + 1] - values[j - 1]);
      const double bend = values[j + 1] - 2.0 * values[j] + values[j - 1];
      if (bend < 0.0 && std::abs(slope) <= -bend) found = std::max(found, values[j] - 0.5 * slope * slope / bend);
    }
  }
  return found;
}

Revolution::Figures Revolution::mix(const ChipMix& mix, bool with_flutes) {
  Figures figures;
  const std::size_t n = angle_.size();
  const std::size_t block = size_ * n;
  magnitude_.resize(n);
  for (std::size_t turn = 0; turn < kinds_; ++turn) {
    weigh(total_.data() + turn * block, mix.x, x_);
    weigh(total_.data() + turn * block, mix.y, y_);
    weigh(total_.data() + turn * block, mix.tangential, t_);
    for (std::size_t j = 0; j < n; ++j) magnitude_[j] = std::sqrt(x_[j] * x_[j] + y_[j] * y_[j]);
    for (std::size_t j = 0; j < n; ++j) {
      figures.mean_resultant += weight_[j] * magnitude_[j] / static_cast<double>(kinds_);
    }
    figures.peak_resultant = std::max(figures.peak_resultant, peak(magnitude_));
    figures.peak_tangential = std::max(figures.peak_tangential, peak(t_));
  }
  if (!with_flutes) return figures;
  for (std::size_t column = 0; column < kinds_ * flutes_; ++column) {
    weigh(flute_.data() + column * block, mix.x, x_);
    weigh(flute_.data() + column * block, mix.y, y_);
    for (std::size_t j = 0; j < n; ++j) magnitude_[j] = std::sqrt(x_[j] * x_[j] + y_[j] * y_[j]);
    figures.peak_flute = std::max(figures.peak_flute, peak(magnitude_));
  }
  return figures;
}

}  // namespace shapegcode
