#include "shapegcode/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <iterator>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "compare/align.hpp"
#include "compare/cut_difference.hpp"
#include "compare/events.hpp"
#include "program/interpret/input_rules.hpp"

namespace shapegcode {
namespace detail {
namespace {

constexpr std::size_t nobody = static_cast<std::size_t>(-1);
constexpr double same_end_mm = 0.01;    // of a cut: shaping moves no end, rounding by an increment
constexpr double noticeable_mm = 1e-4;  // a tenth of the least increment
constexpr double likely_length = 0.1;   // corners that are cut shorten a path
constexpr double likely_length_mm = 1.0;
constexpr std::size_t looked_ahead = 64;  // for a partner among what is left
constexpr std::size_t worth_a_thread = 10'000;
constexpr std::size_t max_pairs = 4'000'000;  // looked at for what stands elsewhere

std::size_t of_kind(ComparedKind kind) noexcept { return static_cast<std::size_t>(kind); }

std::string position_text(const Vector3& position) {
  return fmt::format("X{:.3f} Y{:.3f} Z{:.3f}", position[0] + 0.0, position[1] + 0.0, position[2] + 0.0);
}

// Results of two functions, run in parallel if that is faster.
template <typename One, typename Other>
auto both(const One& one, const Other& other, std::size_t moves) {
  auto other_value = std::async(moves < worth_a_thread ? std::launch::deferred : std::launch::async, other);
  auto one_value = one();
  return std::make_pair(std::move(one_value), other_value.get());
}

// Where something stands in the source.
struct SourceLine {
  std::uint32_t line = 0;
  std::string file;
};

class Comparer {
 public:
  Comparer(const Program& original, const Program& emitted, const ComparisonOptions& options)
      : programs_{&original, &emitted}, joint_path_mm_(options.joint_path_mm) {
    std::tie(events_[0], events_[1]) =
        both([&] { return read_events(original, options); }, [&] { return read_events(emitted, options); },
             std::max(original.move_count, emitted.move_count));
    const bool inch = events_[0].units == 20 || events_[1].units == 20;
    const bool other_units = events_[0].units != events_[1].units;
    // An axis that a block does not name stays where a cut has left it: rounded.
    same_position_mm_ = 0.6 * min_increment(options.reader, 21) +
                        (inch ? 0.5 * mm_per_inch * min_increment(options.reader, 20) : 0.0) +
                        (other_units ? 1e-3 : 0.0);
  }

  ProgramComparison compare() {
    count();
    units();
    partners_[0].assign(all(0).size(), nobody);
    partners_[1].assign(all(1).size(), nobody);
    const auto equal = [this](std::size_t a, std::size_t b) { return same(all(0)[a], all(1)[b]); };
    Matches matches = Alignment(all(0).size(), all(1).size(), equal).matches();
    for (const auto& [a, b] : matches) {
      partners_[0][a] = b;
      partners_[1][b] = a;
    }
    find_elsewhere([](const Event& event) { return event.kind == ComparedKind::cuts; });
    matches.emplace_back(all(0).size(), all(1).size());
    pair_what_is_left(matches);
    find_elsewhere([](const Event&) { return true; });
    list(matches);
    return std::move(result_);
  }

 private:
  [[nodiscard]] const std::vector<Event>& all(std::size_t side) const noexcept { return events_[side].all; }
  [[nodiscard]] const Cut& cut(std::size_t side, const Event& event) const noexcept {
    return events_[side].cuts[event.cut];
  }

  void count() {
    for (const Event& event : all(0)) ++result_.counts[of_kind(event.kind)].original;
    for (const Event& event : all(1)) ++result_.counts[of_kind(event.kind)].emitted;
  }

  void units() {
    if (events_[0].units_line > 0 && events_[1].units_line > 0 && events_[0].units != events_[1].units) {
      add(ComparedKind::units, source(0, events_[0].units_line), source(1, events_[1].units_line),
          fmt::format("G{}", events_[0].units), fmt::format("G{}", events_[1].units));
    }
  }

  [[nodiscard]] bool same(const Event& a, const Event& b) const {
    if (a.kind != b.kind || a.optional != b.optional || a.word != b.word) {
      return false;
    }
    if (a.kind == ComparedKind::cuts) {
      return (a.cut == no_cut) == (b.cut == no_cut) && (a.cut == no_cut || likely_same(cut(0, a), cut(1, b)));
    }
    // An axis that neither names stays where something before has left it, and that is reported there.
    const int named = a.named | b.named;
    const bool shaped = a.cut != no_cut || b.cut != no_cut;
    if (!shaped && (a.known & named) != (b.known & named)) {
      return false;
    }
    const double limit = shaped ? same_end_mm : same_position_mm_;
    for (std::size_t i = 0; i < a.position_mm.size(); ++i) {
      const bool counts = (((a.known & b.known & (shaped ? 7 : named)) >> i) & 1) != 0;
      if (counts && std::abs(a.position_mm[i] - b.position_mm[i]) > limit) {
        return false;
      }
    }
    return true;
  }

  // Whether they are meant to be the same cut: how far apart their paths are is another question.
  [[nodiscard]] bool likely_same(const Cut& a, const Cut& b) const {
    return (a.start_mm - b.start_mm).norm() <= same_end_mm && (a.end_mm - b.end_mm).norm() <= same_end_mm &&
           (likely_length_of(a, b) || joint_mm(a, b).has_value());
  }

  static bool likely_length_of(const Cut& a, const Cut& b) {
    return std::abs(a.length_mm - b.length_mm) <= likely_length_mm + likely_length * a.length_mm;
  }

  // Many small corners that are cut may take away any share of a length: then the paths themselves decide.
  [[nodiscard]] std::optional<double> joint_mm(const Cut& a, const Cut& b) const {
    const auto [found, is_new] = joint_.try_emplace({&a, &b});
    if (is_new) found->second = joint_distance_mm(a, b, joint_path_mm_);
    return found->second;
  }

  // What has no partner in its place, but the same stands elsewhere.
  template <typename Wanted>
  void find_elsewhere(const Wanted& wanted) {
    std::array<std::vector<std::size_t>, 2> left;
    for (std::size_t side = 0; side < 2; ++side) {
      for (std::size_t i = 0; i < all(side).size(); ++i) {
        if (partners_[side][i] == nobody && wanted(all(side)[i])) left[side].push_back(i);
      }
    }
    if (left[0].size() * left[1].size() > max_pairs) {
      return;
    }
    for (const std::size_t a : left[0]) {
      const auto found = std::ranges::find_if(
          left[1], [&](std::size_t b) { return partners_[1][b] == nobody && same(all(0)[a], all(1)[b]); });
      if (found != left[1].end()) {
        partners_[0][a] = *found;
        partners_[1][*found] = a;
        elsewhere_.push_back(a);
      }
    }
    std::ranges::sort(elsewhere_);
  }

  // Between two matches: what is of one kind has changed from the one to the other.
  void pair_what_is_left(const Matches& matches) {
    std::size_t a = 0;
    std::size_t b = 0;
    for (const auto& [next_a, next_b] : matches) {
      for (; a < next_a; ++a) {
        if (partners_[0][a] != nobody) continue;
        const std::size_t end = std::min(next_b, b + looked_ahead);
        for (std::size_t k = b; k < end; ++k) {
          if (partners_[1][k] == nobody && all(0)[a].kind == all(1)[k].kind) {
            partners_[0][a] = k;
            partners_[1][k] = a;
            b = k + 1;
            break;
          }
        }
      }
      a = next_a + 1;
      b = next_b + 1;
    }
  }

  void list(const Matches& matches) {
    std::size_t a = 0;
    std::size_t b = 0;
    for (const auto& [next_a, next_b] : matches) {
      const bool last = next_a == all(0).size();
      if (last && ends_early(a, b)) {
        return;
      }
      for (; a < next_a; ++a) first_has(a);
      for (; b < next_b; ++b) second_has(b);
      if (!last) {
        both_have(all(0)[next_a], all(1)[next_b]);
      }
      a = next_a + 1;
      b = next_b + 1;
    }
  }

  void first_has(std::size_t a) {
    const Event& event = all(0)[a];
    const std::size_t partner = partners_[0][a];
    if (partner == nobody) {
      add(event.kind, source(0, event), {}, describe(0, event), "");
    } else if (std::ranges::binary_search(elsewhere_, a)) {
      const Event& other = all(1)[partner];
      add(ComparedKind::order, source(0, event), source(1, other), describe(0, event), describe(1, other));
      if (event.cut != no_cut) compare_cuts(event, other);
    } else {
      both_have(event, all(1)[partner]);
    }
  }

  void second_has(std::size_t b) {
    if (partners_[1][b] == nobody) {
      add(all(1)[b].kind, {}, source(1, all(1)[b]), "", describe(1, all(1)[b]));
    }
  }

  // Behind the last thing that both have: only one of the programs goes on.
  bool ends_early(std::size_t a, std::size_t b) {
    const std::array<std::size_t, 2> from = {a, b};
    std::array<std::size_t, 2> lone = {0, 0};
    for (std::size_t side = 0; side < 2; ++side) {
      for (std::size_t i = from[side]; i < all(side).size(); ++i) lone[side] += partners_[side][i] == nobody ? 1U : 0U;
    }
    if ((lone[0] == 0) == (lone[1] == 0)) {
      return false;
    }
    const std::size_t goes_on = lone[0] > 0 ? 0 : 1;
    const std::size_t ends = 1 - goes_on;
    for (std::size_t i = a; i < all(0).size(); ++i) {
      if (partners_[0][i] != nobody) first_has(i);
    }
    const auto missing = std::find(partners_[goes_on].begin() + static_cast<std::ptrdiff_t>(from[goes_on]),
                                   partners_[goes_on].end(), nobody);
    const Event& event = all(goes_on)[static_cast<std::size_t>(missing - partners_[goes_on].begin())];
    std::array<SourceLine, 2> lines;
    std::array<std::string, 2> texts;
    lines[goes_on] = source(goes_on, event);
    lines[ends] = source(ends, events_[ends].last_line);
    texts[goes_on] = fmt::format("{}{}", describe(goes_on, event),
                                 lone[goes_on] > 1 ? fmt::format(", and {} more", lone[goes_on] - 1) : "");
    texts[ends] = fmt::format("ends early at line {}", lines[ends].line);
    add(ComparedKind::end, lines[0], lines[1], texts[0], texts[1]);
    return true;
  }

  // What stands in the same place of both.
  void both_have(const Event& a, const Event& b) {
    if (a.cut != no_cut && b.cut != no_cut) {
      if (a.kind == ComparedKind::cuts ? compare_cuts(a, b) : true) {
        unchanged(a.kind);
      }
    } else if (a.kind == ComparedKind::rapids && (a.cut == no_cut) != (b.cut == no_cut) && same(a, b)) {
      add(ComparedKind::shaped_rapids, source(0, a), source(1, b), describe(0, a), describe(1, b));
    } else if (!same(a, b)) {
      add(a.kind, source(0, a), source(1, b), describe(0, a), describe(1, b));
    } else {
      unchanged(a.kind);
      if (a.feed_mm_per_s != b.feed_mm_per_s) {
        add_feeds(source(0, a), source(1, b), a.feed_mm_per_s, b.feed_mm_per_s);
      }
    }
  }

  void unchanged(ComparedKind kind) { ++result_.counts[of_kind(kind)].unchanged; }

  // False where it is not the same cut.
  bool compare_cuts(const Event& a, const Event& b) {
    const Cut& ours = cut(0, a);
    const Cut& theirs = cut(1, b);
    const SourceLine from = source(0, a);
    const SourceLine to = source(1, b);
    compare_modes(ours, theirs, from, to);
    if (ours.moves != theirs.moves) {
      add(ComparedKind::blocks, from, to, fmt::format("{} blocks", ours.moves), fmt::format("{} blocks", theirs.moves));
    }
    if (const auto feeds = feed_difference(ours, theirs)) {
      add_feeds(feeds->original_line > 0 ? source(0, feeds->original_line) : from,
                feeds->emitted_line > 0 ? source(1, feeds->emitted_line) : to, feeds->original_mm_per_s,
                feeds->emitted_mm_per_s);
    }
    if (!same_moves(ours, theirs)) {
      compare_paths(a, b);
    }
    const bool is_same = likely_length_of(ours, theirs) || joint_mm(ours, theirs).has_value();
    if (!is_same) {
      add(ComparedKind::cuts, from, to, describe(0, a), describe(1, b));
    }
    return is_same;
  }

  void compare_paths(const Event& a, const Event& b) {
    const Cut& ours = cut(0, a);
    const Cut& theirs = cut(1, b);
    if (!likely_length_of(ours, theirs)) {
      if (const auto joint = joint_mm(ours, theirs)) {
        result_.path_mm = std::max(result_.path_mm, *joint);
        add_path(source(0, a), source(1, b), a, *joint);
        return;
      }
    }
    const auto [forth, back] = both([&] { return path_distance(ours, theirs); },
                                    [&] { return path_distance(theirs, ours); }, std::max(ours.moves, theirs.moves));
    const double distance = std::max(forth.distance_mm, back.distance_mm);
    result_.path_mm = std::max(result_.path_mm, distance);
    if (distance <= noticeable_mm) {
      return;
    }
    const bool in_first = forth.distance_mm >= back.distance_mm;
    add_path(in_first ? source(0, forth.line) : source(0, a), in_first ? source(1, b) : source(1, back.line), a,
             distance);
  }

  void add_path(const SourceLine& from, const SourceLine& to, const Event& a, double distance_mm) {
    add(ComparedKind::path, from, to, describe(0, a), fmt::format("path within {:.3g} um", distance_mm * 1e3),
        distance_mm);
  }

  void compare_modes(const Cut& ours, const Cut& theirs, const SourceLine& from, const SourceLine& to) {
    if (ours.exact_stops != theirs.exact_stops) {
      add(ComparedKind::modal, from, to, fmt::format("{} exact stops", ours.exact_stops),
          fmt::format("{} exact stops", theirs.exact_stops));
    }
    const std::pair<CutModes, CutModes> pair(ours.modes, theirs.modes);
    if (ours.modes == theirs.modes) {
      unchanged(ComparedKind::modal);
    } else if (pair != reported_modes_) {
      const auto text = [](const CutModes& modes) {
        return fmt::format("G{} G{} G{} G{} G{}", modes.plane, modes.distance, modes.feed_mode, modes.exact_stop,
                           modes.cycle_return);
      };
      add(ComparedKind::modal, from, to, text(ours.modes), text(theirs.modes));
    }
    reported_modes_ = pair;
    ++result_.counts[of_kind(ComparedKind::modal)].original;
    ++result_.counts[of_kind(ComparedKind::modal)].emitted;
  }

  [[nodiscard]] SourceLine source(std::size_t side, const Event& event) const {
    return event.call == nullptr ? source(side, event.line) : source(side, event.call->origin);
  }
  [[nodiscard]] SourceLine source(std::size_t side, std::uint32_t line) const {
    const auto& origins = programs_[side]->origins;
    return line == 0 || line > origins.size() ? SourceLine{line, ""} : source(side, origins[line - 1]);
  }
  [[nodiscard]] SourceLine source(std::size_t side, const LineOrigin& origin) const {
    return {origin.line, programs_[side]->files[origin.file]};
  }

  void add(ComparedKind kind, const SourceLine& from, const SourceLine& to, std::string original, std::string emitted,
           double distance_mm = 0.0) {
    const auto with_file = [](std::string text, const SourceLine& at) {
      return at.file.empty() || text.empty() ? text : fmt::format("{} ({})", text, at.file);
    };
    result_.differences.push_back({kind, from.line, to.line, with_file(std::move(original), from),
                                   with_file(std::move(emitted), to), distance_mm});
  }

  void add_feeds(const SourceLine& from, const SourceLine& to, double original_mm_per_s, double emitted_mm_per_s) {
    const auto text = [](double feed) { return fmt::format("{:.6g} mm/min", feed * 60.0); };
    add(ComparedKind::feeds, from, to, text(original_mm_per_s), text(emitted_mm_per_s));
  }

  [[nodiscard]] std::string describe(std::size_t side, const Event& event) const {
    std::string text = event.optional ? "/ " : "";
    if (event.kind == ComparedKind::cuts && event.cut != no_cut) {
      const Cut& of = cut(side, event);
      return text + fmt::format("cut of {:.3f} mm from {} to {}", of.length_mm, position_text(of.start_mm),
                                position_text(of.end_mm));
    }
    text += event.word;
    if (event.kind == ComparedKind::dwells) {
      return text + fmt::format(" {:g} s", event.position_mm[0]);
    }
    for (std::size_t i = 0; i < event.position_mm.size(); ++i) {
      if (((event.known >> i) & 1) != 0) text += fmt::format(" {}{:.3f}", "XYZR"[i], event.position_mm[i] + 0.0);
    }
    return event.cut == no_cut ? text : text + " as cutting moves";
  }

  std::array<const Program*, 2> programs_;
  std::array<Events, 2> events_;
  std::array<std::vector<std::size_t>, 2> partners_;  // of each event, in the other program
  std::vector<std::size_t> elsewhere_;                // of the first program, ascending
  std::pair<CutModes, CutModes> reported_modes_;
  double same_position_mm_ = 0.0;
  double joint_path_mm_ = 0.0;
  mutable std::map<std::pair<const Cut*, const Cut*>, std::optional<double>> joint_;
  ProgramComparison result_;
};

}  // namespace
}  // namespace detail

ProgramComparison compare_programs(const Program& original, const Program& emitted, const ComparisonOptions& options) {
  return detail::Comparer(original, emitted, options).compare();
}

}  // namespace shapegcode
