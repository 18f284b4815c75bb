// Blocks of one purpose: frames, poles, dwells, fixed points.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "program/siemens/block_words.hpp"
#include "program/siemens/run.hpp"

namespace shapegcode::siemens {
namespace {

/// Values of X, Y, Z and RPL, in the order of their words.
struct FrameValues {
  std::array<std::optional<double>, 3> axes;
  std::optional<double> angle;
  std::size_t count = 0;
};

Frame frame_of(WordId kind, const FrameValues& values, int plane, std::uint32_t column) {
  if (kind == WordId::trans) {
    Vector3 offset;
    for (std::size_t k = 0; k < 3; ++k) offset[static_cast<Eigen::Index>(k)] = values.axes[k].value_or(0.0);
    return {Eigen::Matrix3d::Identity(), offset};
  }
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  if (kind == WordId::mirror || kind == WordId::scale) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (!values.axes[k]) continue;
      const double factor = kind == WordId::mirror ? -1.0 : *values.axes[k];
      if (kind == WordId::scale && factor <= 0.0) throw error_at(column, "SCALE: factors must be more than 0");
      linear(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)) = factor;
    }
    return {linear, Vector3::Zero()};
  }
  if (values.count != 1) {
    throw error_at(column, "ROT about several axes is not read: RPL= or one axis is expected");
  }
  Eigen::Index axis = 19 - plane;
  double angle = 0.0;
  if (values.angle) {
    axis = static_cast<Eigen::Index>(dialect::axes_of(plane).normal);
    angle = *values.angle;
  } else {
    for (std::size_t k = 0; k < 3; ++k) {
      if (!values.axes[k]) continue;
      axis = static_cast<Eigen::Index>(k);
      angle = *values.axes[k];
    }
  }
  const double radians = angle * to_radians;
  const Eigen::Index first = (axis + 1) % 3;
  const Eigen::Index second = (axis + 2) % 3;
  linear(first, first) = std::cos(radians);
  linear(first, second) = -std::sin(radians);
  linear(second, first) = std::sin(radians);
  linear(second, second) = std::cos(radians);
  return {linear, Vector3::Zero()};
}

bool is_one_of(WordId id, std::initializer_list<WordId> ids) { return std::ranges::find(ids, id) != ids.end(); }

}  // namespace

void BlockWords::frame(const Words& words) {
  const Word& head = words[0];
  const bool adds = (static_cast<int>(head.id) - static_cast<int>(WordId::trans)) % 2 == 1;
  const auto kind = static_cast<WordId>(static_cast<int>(head.id) - (adds ? 1 : 0));
  FrameValues values;
  for (auto word = words.begin() + 1; word != words.end(); ++word) {
    const int axis = index_from(word->id, WordId::x);
    if (!word->value || (axis < 0 && word->id != WordId::rpl)) {
      throw word->error(fmt::format("{} in a block of {}: it must be in a separate block", word->name, head.name));
    }
    if (word->mode != Mode::none) {
      throw word->error(fmt::format("{}={}( ) in a block of {}: a value is expected", word->name,
                                    word->mode == Mode::absolute ? "AC" : "IC", head.name));
    }
    const double value = kind == WordId::trans ? length(*word) : number_of_word(*word);
    std::optional<double>& kept = axis < 0 ? values.angle : values.axes[static_cast<std::size_t>(axis)];
    values.count += kept ? 0 : 1;
    kept = value;
  }
  if (values.angle && kind != WordId::rot) {
    throw head.error(fmt::format("RPL= is an angle: ROT or AROT must come before it, not {}", head.name));
  }
  const Frame made = values.count > 0 ? frame_of(kind, values, path_.modes.plane, head.column) : Frame();
  path_.set_frame(adds ? path_.modes.frame.then(made) : made);
}

void BlockWords::special(const Word& word, const Words& words) {
  std::vector<const Word*> others;
  for (const Word& each : words) {
    if (each.name != word.name) others.push_back(&each);
  }
  switch (word.id) {
    case WordId::g25:
    case WordId::g26:
      path_.note(fmt::format("{} is left out: limits of the working area and the spindle change no programmed path",
                             word.name),
                 word.name);
      break;
    case WordId::g4:
      dwell(others);
      break;
    case WordId::g74:
    case WordId::g75:
      reference(word, others);
      break;
    default:
      pole(words[0], word, others);
  }
}

void BlockWords::pole(const Word& first, const Word& code, std::span<const Word* const> others) {
  Given given;
  given.column = first.column;
  for (const Word* word : others) {
    const int axis = index_from(word->id, WordId::x);
    if (axis >= 0 && word->value && word->mode != Mode::incremental) {
      given.axes.set(axis, {.value = length(*word), .from_start = false, .column = word->column});
    } else if ((word->id == WordId::ap || word->id == WordId::rp) && word->value) {
      polar_word(*word, Mode::none, given);
    } else if (!is_one_of(word->id, {WordId::g17, WordId::g18, WordId::g19, WordId::g90, WordId::g91})) {
      throw word->error(fmt::format("{} with {}: axes of the plane or AP= and RP= is expected", word->name, code.name));
    }
  }
  path_.define_pole(110 + static_cast<int>(code.id) - static_cast<int>(WordId::g110), given);
}

void BlockWords::dwell(std::span<const Word* const> others) {
  for (const Word* word : others) {
    double seconds = 0.0;
    if (word->id == WordId::f && word->value) {
      seconds = number_of_word(*word);
    } else if ((word->name == "S" || word->name == "S1") && word->value) {
      if (!(spindle_ > 0.0)) {
        throw word->error("G4 S counts turns of the spindle: S must be programmed before");
      }
      seconds = number_of_word(*word) * 60.0 / spindle_;
    } else {
      throw word->error(fmt::format("{} with G4: only F in seconds or S in revolutions is expected", word->name));
    }
    if (seconds < 0.0) throw word->error(fmt::format("G4 {}{:g}: it must be 0 or more", word->name, seconds));
    path_.put("G04X" + dialect::number_text(rounded_to(seconds, 4)));
  }
  if (others.empty()) throw error_at(1, "G4 without F or S: one of them must be given");
}

void BlockWords::reference(const Word& code, std::span<const Word* const> others) {
  std::string axes;
  for (const Word* word : others) {
    const std::string_view name = word->name;
    const bool is_axis =
        !name.empty() && name[0] >= 'X' && name[0] <= 'Z' && (name.size() == 1 || name.substr(1) == "1");
    if (is_axis && word->value) {
      axes += name[0];
    } else if (word->name != "FP" &&
               !is_one_of(word->id, {WordId::g0, WordId::g90, WordId::g91, WordId::g53, WordId::g153, WordId::supa})) {
      throw word->error(
          fmt::format("{} with {}: only the axes that move there may be in this block", word->name, code.name));
    }
  }
  std::string sorted = axes;
  std::ranges::sort(sorted);
  const std::string_view written = code.id == WordId::g74 ? "G28" : "G30";
  std::string text(written);
  for (const char axis : sorted) {
    text += axis;
    text += "0.";
  }
  path_.put("G91");
  path_.put(text);
  path_.put("G90");
  path_.forget(axes);
  path_.note(fmt::format("{} is written as {}", code.name, written), code.name);
}

}  // namespace shapegcode::siemens
