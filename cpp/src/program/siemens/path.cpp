// State of a path: modes, frames, offsets, poles, and the moves that most blocks are. Incremental moves behind frames:
// easymanua.ls 32519 p. 729; polar coordinates 1265481 pp. 174, 175.
#include "program/siemens/path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "program/siemens/value.hpp"

namespace shapegcode::siemens {
namespace {

using dialect::axes_of;
using dialect::Complex;
using dialect::PlaneAxes;

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

std::string_view name_of(Motion motion) {
  constexpr std::array<std::string_view, 7> names = {"", "G0", "G1", "G2", "G3", "CIP", "CT"};
  return names[static_cast<std::size_t>(motion)];
}

std::string offset_word(const std::string& name) {
  const int code = std::stoi(name.substr(1));
  if (code < 500) return name;
  return fmt::format("G54.1P{}", code == 500 ? 300 : code - 500);
}

void AxisWords::set(int axis, const Coordinate& coordinate) {
  for (std::size_t k = 0; k < count_; ++k) {
    if (words_[k].first == axis) {
      words_[k].second = coordinate;
      return;
    }
  }
  words_[count_++] = {axis, coordinate};
}

const Coordinate* AxisWords::find(std::size_t axis) const {
  for (std::size_t k = 0; k < count_; ++k) {
    if (words_[k].first == static_cast<int>(axis)) return &words_[k].second;
  }
  return nullptr;
}

SiemensPath::SiemensPath(const SiemensOptions& options)
    : options_(options),
      at_(Vector3::Constant(unknown)),
      increment_(options.least_increment_mm),
      decimals_(std::max(0, static_cast<int>(std::nearbyint(-std::log10(options.least_increment_mm))))) {}

void SiemensPath::put(std::string_view text) {
  if (corner_ && !text.starts_with('(')) {
    held_.push_back({.text = std::string(text), .line = line, .file = file});
  } else {
    out.put(text, line, file);
  }
}

void SiemensPath::note(std::string_view text, std::string_view key) {
  if (!text.empty()) out.note(line, text, key);
}

void SiemensPath::name(const std::string& written, std::string_view original) {
  for (auto& [word, other] : names_) {
    if (word == written) {
      other = original;
      return;
    }
  }
  names_.emplace_back(written, original);
}

void SiemensPath::set_frame(const Frame& frame) {
  for (Eigen::Index k = 0; k < 3; ++k) {
    const double change = (frame.linear().row(k) - modes.frame.linear().row(k)).cwiseAbs().maxCoeff() +
                          std::abs(frame.offset()[k] - modes.frame.offset()[k]);
    shifted_[static_cast<std::size_t>(k)] |= change > 1e-12;
  }
  modes.frame = frame;
}

void SiemensPath::set_plane(int plane) {
  modes.plane = plane;
  polar_angle_.reset();
  write_plane(plane);
}

void SiemensPath::write_plane(int plane) {
  if (plane == plane_) return;
  plane_ = plane;
  put(fmt::format("G{}", plane));
}

void SiemensPath::set_offset(const std::string& name) {
  if (name == modes.offset) return;
  const std::string before = modes.offset;
  modes.offset = name;
  shifted_ = {true, true, true};
  put(offset_word(name));
  if (options_.work_offsets.empty() || before.empty()) {
    at_ = Vector3::Constant(unknown);
    return;
  }
  const auto zero_of = [this](const std::string& frame) {
    const auto found = options_.work_offsets.find(offset_word(frame));
    return found == options_.work_offsets.end() ? Vector3(Vector3::Zero()) : Vector3(found->second.data());
  };
  at_ = at_ + zero_of(before) - zero_of(name);
}

void SiemensPath::forget(std::string_view axes, bool is_shifted) {
  step_.reset();
  for (const char axis : axes) {
    const std::size_t k = static_cast<std::size_t>(axis - 'X') % 3;
    at_[static_cast<Eigen::Index>(k)] = unknown;
    shifted_[k] |= is_shifted;
  }
}

void SiemensPath::define_pole(int code, const Given& given) {
  const PlaneAxes axes = axes_of(modes.plane);
  Complex step;
  if (!given.polar.empty()) {
    if (given.polar.size() < 2) {
      const std::string_view alone = given.polar[0].is_angle ? "AP" : "RP";
      throw given.error(fmt::format("G{} with {} alone: AP= and RP= must be given", code, alone));
    }
    const std::size_t angle = given.polar[0].is_angle ? 0 : 1;
    const double radius = given.polar[1 - angle].value;
    const double radians = given.polar[angle].value * to_radians;
    step = Complex(radius * std::cos(radians), radius * std::sin(radians));
  } else {
    const Coordinate* first = given.axes.find(axes.first);
    const Coordinate* second = given.axes.find(axes.second);
    if (first == nullptr || second == nullptr) {
      throw given.error(fmt::format("G{}: both axes of the plane must be given, or AP= and RP=", code));
    }
    step = Complex(first->value, second->value);
  }
  const Vector3 origin = code == 110 ? modes.frame.undo(at_) : code == 111 ? Vector3(Vector3::Zero()) : pole_;
  const Complex from = dialect::in_plane(origin, modes.plane);
  if (!std::isfinite(from.real()) || !std::isfinite(from.imag())) {
    throw given.error(fmt::format("G{}: the position is not known here: the axes must be programmed before", code));
  }
  pole_ = dialect::moved_to(origin, modes.plane, from + step);
  polar_angle_.reset();
}

bool SiemensPath::quick_move(const QuickMove& quick) {
  const Motion motion = quick.code == '\0' ? modes.motion : quick.code == '0' ? Motion::g0 : Motion::g1;
  if ((motion != Motion::g0 && motion != Motion::g1) || modes.incremental || modes.is_linear || modes.feed_mode != 94 ||
      mode_ != 94 || modes.rounding_mm != 0.0 || corner_ || !modes.frame.is_shift() ||
      (motion == Motion::g1 && !quick.feed && modes.feed.value_or(0.0) == 0.0)) {
    return false;
  }
  if (quick.feed) {
    modes.feed = *quick.feed * modes.feed_unit;
    if (*modes.feed <= 0.0) return false;
  }
  modes.motion = motion;
  bool is_known = true;
  Vector3 step = Vector3::Zero();
  std::string text = motion == Motion::g0 ? "G00" : "G01";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!quick.values[axis]) continue;
    const auto k = static_cast<Eigen::Index>(axis);
    const double value = *quick.values[axis] * modes.unit + modes.frame.offset()[k];
    is_known = is_known && !std::isnan(at_[k]);
    step[k] = value - at_[k];
    at_[k] = value;
    shifted_[axis] = false;
    text += "XYZ"[axis];
    append_length(text, value);
  }
  if (motion == Motion::g1) text += feed_word(modes.feed.value_or(0.0));
  out.put(text, line, file);
  step_ = is_known ? std::optional(step) : std::nullopt;
  ++moves_;
  return true;
}

std::optional<Vector3> SiemensPath::direction() const {
  const double length = step_ ? step_->norm() : 0.0;
  return length == 0.0 ? std::nullopt : std::optional<Vector3>(*step_ / length);
}

void SiemensPath::polar_end(Given& given) {
  const PlaneAxes axes = axes_of(modes.plane);
  if (given.axes.find(axes.first) != nullptr || given.axes.find(axes.second) != nullptr) {
    throw given.error("AP=, RP= with an axis of the plane: remove one of them");
  }
  for (const PolarWord& word : given.polar) {
    if (word.is_angle && word.mode == Mode::none && modes.incremental) {
      throw error_at(word.column, "AP= in G91: it must be AP=AC( ) or AP=IC( )");
    }
    std::optional<double>& kept = word.is_angle ? polar_angle_ : polar_radius_;
    const bool is_step = word.mode == Mode::incremental;
    if (is_step && (!word.is_angle || !kept)) {
      throw error_at(word.column, fmt::format("{}=IC( ) without a value before it: it must be absolute",
                                              word.is_angle ? "AP" : "RP"));
    }
    kept = is_step ? *kept + word.value : word.value;
  }
  if (!polar_angle_ || !polar_radius_) throw given.error("AP= and RP=: both must be given, here or before");
  const double angle = *polar_angle_ * to_radians;
  const auto end = [&](std::size_t axis, double share) {
    const double value = pole_[static_cast<Eigen::Index>(axis)] + *polar_radius_ * share;
    given.axes.set(static_cast<int>(axis), {.value = value, .from_start = false, .column = given.column});
  };
  end(axes.first, std::cos(angle));
  end(axes.second, std::sin(angle));
  if (is_arc_by_centre(modes.motion) && given.centre.empty() && !given.radius) {
    for (const std::size_t axis : {axes.first, axes.second}) {
      const double value = pole_[static_cast<Eigen::Index>(axis)];
      given.centre.set(static_cast<int>(axis), {.value = value, .from_start = false, .column = given.column});
    }
  }
}

void SiemensPath::move(Given& given) {
  if (!given.polar.empty()) polar_end(given);
  const Vector3 here = modes.frame.undo(at_);
  Vector3 target = here;
  for (std::size_t k = 0; k < given.axes.size(); ++k) {
    const auto axis = static_cast<std::size_t>(given.axes.axis(k));
    const Coordinate& word = given.axes.coordinate(k);
    if (word.from_start && shifted_[axis]) {
      throw error_at(word.column,
                     fmt::format("{} incrementally after a change of its offset: whether the control adds that "
                                 "depends on a setting (SD42440, SD42442); it must be programmed absolutely before",
                                 "XYZ"[axis]));
    }
    const auto row = static_cast<Eigen::Index>(axis);
    target[row] = word.from_start ? here[row] + word.value : word.value;
    if (!word.from_start) shifted_[axis] = false;
  }
  switch (modes.motion) {
    case Motion::g0:
    case Motion::g1:
      straight(given, target);
      break;
    case Motion::none:
      throw given.error("which of G0, G1 ... is in force at the start is set in MD20150: one must be given");
    default:
      round(given, here, target);
  }
}

}  // namespace shapegcode::siemens
