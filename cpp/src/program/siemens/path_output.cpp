// Writing of moves for FANUC: feeds, arcs in parts, blocks of linear feed, corners. FLIN 662833 p. 458; chamfers 679150
// pp. 193, 194.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "program/siemens/path.hpp"
#include "program/siemens/value.hpp"

namespace shapegcode::siemens {
namespace {

using dialect::Complex;
using dialect::number_text;
using dialect::PathElement;

constexpr double linear_feed_error_mm = 0.0005;  // of blocks of constant feed in the place of one whose feed is linear
constexpr double most_linear_blocks = 1e7;
// Of one arc of the plain program: its rounded ends tell it from a small one.
constexpr double largest_sweep_rad = 1.5 * std::numbers::pi;
constexpr double tangent_rad = 0.05 * to_radians;  // two blocks that meet at less have no corner

std::string_view name_of_corner(CornerKind kind) {
  return kind == CornerKind::rounding ? "RND" : kind == CornerKind::chamfer_width ? "CHR" : "CHF";
}

/// The centre as near as possible that has both rounded ends at one radius; itself where that is far.
Complex centre_between(Complex centre, Complex start, Complex end) {
  const double chord = std::abs(end - start);
  if (chord < 0.01) return centre;
  const Complex along = (end - start) / chord;
  const double off = ((centre - 0.5 * (start + end)) * std::conj(along)).real();
  return std::abs(off) > 0.002 ? centre : centre - off * along;
}

/// I, J, K of a centre, by its axes.
std::string centre_words(int plane, Complex spoke) {
  const dialect::PlaneAxes axes = dialect::axes_of(plane);
  std::string words;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axis == axes.normal) continue;
    words += "IJK"[axis];
    words += number_text(rounded_to(axis == axes.first ? spoke.real() : spoke.imag(), 5));
  }
  return words;
}

}  // namespace

void SiemensPath::write_element(const PathElement& element, const Given& given, const Axes& moved) {
  const bool is_rapid = modes.motion == Motion::g0;
  end_corner(element, element.direction_at(0.0), is_rapid, moved);
  bool known = true;
  for (std::size_t k = 0; k < 3; ++k) {
    known = known && (!moved[k] || std::isfinite(element.start[static_cast<Eigen::Index>(k)]));
  }
  const auto [kind, size] = given.corner.value_or(std::pair(CornerKind::rounding, modes.rounding_mm));
  if (!is_rapid && known && size > 0.0) {
    corner_ = HeldCorner{.element = element, .kind = kind, .size = size, .is_modal = !given.corner};
  } else if (size < 0.0 || (size > 0.0 && given.corner)) {
    throw given.error(fmt::format("{}={:g}: it must be more than 0, in a block with a feed whose start is known",
                                  name_of_corner(kind), size));
  }
  if (is_rapid) {
    std::string text = given.exact ? "G09G00" : "G00";
    append_axes(text, element.end, moved);
    put(text);
  } else {
    write_cut(element, given, moved, known);
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    if (moved[k]) at_[row] = element.end[row];
  }
  step_ = known ? std::optional<Vector3>(element.direction_at(1.0)) : std::nullopt;
  ++moves_;
}

void SiemensPath::write_cut(const PathElement& element, const Given& given, const Axes& moved, bool known) {
  const double feed = constant_feed(given, known ? element.length_mm() : std::nan(""));
  const std::optional<LinearFeed> linear = linear_feed(element, given, feed, known);
  if (const int mode = modes.feed_mode == 95 ? 95 : 94; mode != mode_) {
    mode_ = mode;
    feed_.clear();
    put(fmt::format("G{}", mode));
  }
  if (element.centre) write_plane(element.plane);
  if (linear) {
    write_linear(element, *linear, moved, given.exact);
  } else {
    write_part(element, moved, given.exact, feed, 0.0);
  }
  write_plane(modes.plane);  // a circle through three points has its own
}

void SiemensPath::write_linear(const PathElement& element, const LinearFeed& feed, const Axes& moved, bool exact) {
  const double length = element.length_mm();
  const auto count = static_cast<double>(feed.count);
  double begin = 0.0;
  for (std::size_t k = 1; k <= feed.count; ++k) {
    const double time = feed.slope * feed.time_min * static_cast<double>(k) / count;
    const double end = k == feed.count ? 1.0 : feed.start * std::expm1(time) / feed.slope / length;
    const bool is_whole = begin == 0.0 && end == 1.0;
    write_part(is_whole ? element : element.part(begin, end), moved, exact, 0.0, feed.time_min / count);
    begin = end;
  }
}

void SiemensPath::write_part(const PathElement& part, const Axes& moved, bool exact, double feed, double time_min) {
  const double sweep = std::abs(part.sweep_rad);
  if (!std::isfinite(sweep)) throw too_large();
  const double count = sweep <= largest_sweep_rad ? 1.0 : std::ceil(sweep / std::numbers::pi);
  for (double k = 0.0; k < count; k += 1.0) {
    const PathElement piece = count == 1.0 ? part : part.part(k / count, (k + 1.0) / count);
    if (time_min > 0.0) {
      const double length =
          piece.centre ? piece.length_mm() : Vector3(on_grid(piece.end) - on_grid(piece.start)).norm();
      if (length == 0.0) continue;
      feed = length * count / time_min;
    }
    write_piece(piece, moved, exact, feed);
  }
}

void SiemensPath::write_piece(const PathElement& piece, const Axes& moved, bool exact, double feed) {
  std::string_view code = "G01";
  std::string words;
  if (piece.centre) {
    const Complex centre = dialect::in_plane(*piece.centre, piece.plane);
    const double radius = std::abs(dialect::in_plane(piece.start, piece.plane) - centre);
    if (radius * std::abs(piece.sweep_rad) >= 3.0 * increment_) {
      code = piece.sweep_rad > 0.0 ? "G03" : "G02";
      const Complex begin = dialect::in_plane(on_grid(piece.start), piece.plane);
      const Complex end = dialect::in_plane(on_grid(piece.end), piece.plane);
      words = centre_words(piece.plane, centre_between(centre, begin, end) - begin);
    }
  }
  std::string text = exact ? "G09" : "";
  text += code;
  append_axes(text, piece.end, moved);
  text += words;
  text += feed_word(feed);
  put(text);
}

std::optional<SiemensPath::LinearFeed> SiemensPath::linear_feed(const PathElement& element, const Given& given,
                                                                double feed, bool known) {
  if (!modes.is_linear || !given.has_feed || modes.feed_mode != 94 || !given.start_feed || *given.start_feed == feed) {
    return std::nullopt;
  }
  const double start = *given.start_feed;
  const double length = element.length_mm();
  if (start <= 0.0 || !known || length <= 0.0) {
    throw given.error(
        fmt::format("FLIN from F{:g}: the feed before it must be more than 0, and the start known", start));
  }
  LinearFeed found{.start = start, .slope = (feed - start) / length};
  found.time_min = std::log(feed / start) / found.slope;
  const double acceleration = std::max(feed, start) * std::abs(found.slope);  // mm/min²
  const double count = std::ceil(found.time_min / std::sqrt(8.0 * linear_feed_error_mm / acceleration));
  if (!(count < most_linear_blocks)) throw too_large();
  found.count = count < 1.0 ? 1 : static_cast<std::size_t>(count);
  note("FLIN: the feed is linear along the path of a block; it is read as blocks of constant feed, within 0.5 um",
       "FLIN");
  return found;
}

double SiemensPath::constant_feed(const Given& given, double length_mm) const {
  if (modes.feed.value_or(0.0) <= 0.0) {
    throw given.error(
        fmt::format("{} without a feed: F must be programmed before, more than 0", name_of(modes.motion)));
  }
  if (modes.feed_mode != 93) return *modes.feed;
  if (!given.has_feed) throw given.error("G93 without F: every block with a feed must contain one");
  if (std::isnan(length_mm)) {
    throw given.error("G93 and a start that is not known: its axes must be programmed before");
  }
  return std::max(*modes.feed * length_mm, 1e-4);
}

std::string SiemensPath::feed_word(double feed) {
  std::string text = number_text(feed);
  if (text == feed_) return {};
  feed_ = text;
  return "F" + text;
}

Vector3 SiemensPath::on_grid(const Vector3& value) const {
  return value.unaryExpr([this](double each) { return std::nearbyint(each / increment_) * increment_; });
}

void SiemensPath::append_length(std::string& text, double value) const {
  const double steps = std::nearbyint(value / increment_);
  if (!std::isfinite(steps)) throw too_large();
  const std::size_t begin = text.size();
  fmt::format_to(std::back_inserter(text), "{:#.{}f}", steps * increment_, decimals_);
  text.erase(text.find_last_not_of('0') + 1);
  if (std::string_view(text).substr(begin) == "-0.") text.erase(begin, 1);
}

void SiemensPath::append_axes(std::string& text, const Vector3& end, const Axes& moved) const {
  for (std::size_t k = 0; k < 3; ++k) {
    if (!moved[k]) continue;
    text += "XYZ"[k];
    append_length(text, end[static_cast<Eigen::Index>(k)]);
  }
}

void SiemensPath::end_corner(const PathElement& element, const Vector3& ahead, bool is_rapid, const Axes& moved) {
  if (!corner_) return;
  const dialect::PlaneAxes axes = dialect::axes_of(modes.plane);
  const Vector3 behind = corner_->element.direction_at(1.0);
  const bool in_plane = (!element.centre || element.plane == modes.plane) && !moved[axes.normal] &&
                        std::abs(behind[static_cast<Eigen::Index>(axes.normal)]) < 1e-9;
  if (is_rapid || !in_plane || held_.size() != 1) {
    if (!corner_->is_modal) {
      throw error_at(1,
                     fmt::format("{}={:g} in line {}: a move with a feed in the same plane must follow",
                                 name_of_corner(corner_->kind), corner_->size, held_.empty() ? line : held_[0].line));
    }
    release();
    return;
  }
  const auto first = static_cast<Eigen::Index>(axes.first);
  const auto second = static_cast<Eigen::Index>(axes.second);
  const double angle = std::acos(std::clamp(behind[first] * ahead[first] + behind[second] * ahead[second], -1.0, 1.0));
  if (angle > tangent_rad) {
    double size = corner_->size;
    // Its length; FANUC's word is that along the blocks.
    if (corner_->kind == CornerKind::chamfer_length) size /= 2.0 * std::cos(angle / 2.0);
    held_[0].text += corner_->kind == CornerKind::rounding ? ",R" : ",C";
    held_[0].text += number_text(rounded_to(size, 5));
  }
  release();
}

void SiemensPath::release() {
  corner_.reset();
  for (const HeldLine& each : held_) out.put(each.text, each.line, each.file);
  held_.clear();
}

}  // namespace shapegcode::siemens
