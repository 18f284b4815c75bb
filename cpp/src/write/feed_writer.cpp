#include "shapegcode/write.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <numbers>
#include <string_view>
#include <utility>

#include "program/text/lexer.hpp"
#include "program/text/number_format.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr double same_position_mm = 1e-6;
constexpr int max_feed_decimals = 4;
constexpr double largest_sweep_by_radius = 0.5 * std::numbers::pi;
constexpr std::size_t longest_line = 100000;  // the reader has held the program's own limit already

using Increments = std::array<std::int64_t, axis_count>;

// One line of a region, and its segments.
struct SourceLine {
  std::string_view text;      // without its line end
  std::string_view line_end;  // as it stands
  std::uint32_t number = 0;
  std::size_t first = 0;  // segment
  std::size_t count = 0;
  bool incremental = false;
};

bool is_g(const Word& word, double value) noexcept { return word.letter == 'G' && word.value == value; }

// Calls `use(line, block)` for each line of a region.
template <typename Use>
void for_each_line(const Program& program, const Region& region, Use use) {
  const Segments segments = region.path->segments();
  std::string_view rest = std::string_view(program.text).substr(region.text_begin, region.text_end - region.text_begin);
  bool incremental = region.entry.distance == 91;
  std::size_t segment = 0;
  Block block;
  for (std::uint32_t number = region.first_line; !rest.empty(); ++number) {
    const std::size_t newline = rest.find('\n');
    const std::size_t length = newline == std::string_view::npos ? rest.size() : newline + 1;
    std::size_t visible = newline == std::string_view::npos ? rest.size() : newline;
    while (visible > 0 && rest[visible - 1] == '\r') {
      --visible;
    }
    SourceLine line{rest.substr(0, visible), rest.substr(visible, length - visible), number, segment, 0, false};
    rest.remove_prefix(length);
    while (segment < segments.size() && region.path->line(segment) == number) {
      ++segment;
      ++line.count;
    }
    scan_block(line.text, number, longest_line, block);
    for (const Word& word : block) {
      incremental = is_g(word, 91.0) || (incremental && !is_g(word, 90.0));
    }
    line.incremental = incremental;
    use(std::as_const(line), std::as_const(block));
  }
}

// Words that a part of a block may hold; any other one could act once, or twice.
bool is_plain(const Word& word) noexcept {
  constexpr std::string_view letters = "NFXYZIJR";
  constexpr std::array<double, 9> modal_codes = {1.0, 2.0, 3.0, 17.0, 40.0, 64.0, 90.0, 91.0, 94.0};
  return word.letter == 'G' ? std::find(modal_codes.begin(), modal_codes.end(), word.value) != modal_codes.end()
                            : letters.find(word.letter) != std::string_view::npos;
}

bool divisible(const SourceLine& line, const Block& block, const Segment& segment, const FeedWriterOptions& options) {
  // Each part of a block with an exact stop would stop.
  if (line.count != 1 || segment.stop_at_end || block.optional_skip || block.macro ||
      !std::all_of(block.begin(), block.end(), is_plain)) {
    return false;
  }
  if (segment.kind == SegmentKind::arc &&
      (segment.normal != 2 || segment.start_radius_mm <= 2.0 * options.increment_mm)) {
    return false;
  }
  for (const Word& word : block) {
    const int axis = word.letter - 'X';
    if (axis < 0 || axis >= axis_count) {
      continue;
    }
    const double from = line.incremental ? segment.start_mm[axis] : 0.0;
    // A position in other coordinates, or one whose number was read in another way.
    if (std::abs(word.value * options.unit_mm + from - segment.end_mm[axis]) > same_position_mm) {
      return false;
    }
  }
  return true;
}

class Writer {
 public:
  Writer(const Program& program, const Region& region, std::span<const FeedStretch> sections,
         const FeedWriterOptions& options)
      : path_(*region.path), region_(region), sections_(sections), options_(options), line_end_(program.line_end) {
    modal_feed_ = options.modal_feed > 0.0 ? options.modal_feed : region.entry.feed;
  }

  void write(const SourceLine& line, const Block& block) {
    if (line.count == 0) {
      write_without_move(line, block);
      return;
    }
    const double begin = path_.distance_mm(line.first);
    const double end = path_.distance_mm(line.first + line.count);
    std::vector<double> ends;
    std::vector<double> feeds;
    while (section_ + 1 < sections_.size() && sections_[section_].end_mm <= begin + same_position_mm) {
      ++section_;
    }
    feeds.push_back(sections_[section_].feed_mm_per_min);
    for (std::size_t k = section_; k + 1 < sections_.size() && sections_[k].end_mm < end - same_position_mm; ++k) {
      ends.push_back(sections_[k].end_mm - begin);
      feeds.push_back(sections_[k + 1].feed_mm_per_min);
    }
    if (!ends.empty() && !divisible(line, block, path_[line.first], options_)) {
      throw Error(ErrorKind::argument,
                  fmt::format("a feed changes within line {}, which cannot be divided", line.number));
    }
    ends.push_back(end - begin);
    write_parts(line, block, ends, feeds);
  }

  RefedRegion finish() {
    if (options_.restore_feed && !same_feed(modal_feed_, region_.exit.feed)) {
      if (!result_.text.empty() && result_.text.back() != '\n') {
        result_.text += line_end_;
      }
      append_feed_word(region_.exit.feed);
      result_.text += line_end_;
      modal_feed_ = region_.exit.feed;
    }
    result_.modal_feed = modal_feed_;
    return std::move(result_);
  }

 private:
  static bool same_feed(double a, double b) noexcept { return std::abs(a - b) <= 1e-9 * std::abs(a); }

  // With as many decimals as the number has: a feed that stays may have more than the scheduler's.
  void append_feed_word(double feed) {
    int decimals = 0;
    double scaled = feed;
    while (decimals < max_feed_decimals && std::abs(scaled - std::round(scaled)) > 1e-6) {
      scaled *= 10.0;
      ++decimals;
    }
    append_feed(result_.text, std::llround(scaled), decimals);
  }

  void end_line(const SourceLine& line) {
    result_.text += line.line_end;
    ++line_count_;
  }

  // A feed for moves that now say their own. A block with a position needs its feed even where nothing moves.
  void write_without_move(const SourceLine& line, const Block& block) {
    const auto is_position = [](const Word& word) { return std::string_view("XYZIJK").find(word.letter) < 6; };
    if (std::any_of(block.begin(), block.end(), is_position)) {
      for (const Word& word : block) {
        modal_feed_ = word.letter == 'F' ? word.value : modal_feed_;
      }
      result_.text += line.text;
      end_line(line);
      return;
    }
    const std::size_t before = result_.text.size();
    bool removed = false;
    std::size_t at = 0;
    for (const Word& word : block) {
      if (word.letter == 'F') {
        result_.text += line.text.substr(at, word.column - 1 - at);
        at = word.end;
        removed = true;
      }
    }
    result_.text += line.text.substr(at);
    const bool blank = result_.text.find_first_not_of(" \t", before) == std::string::npos;
    if (removed && blank) {
      result_.text.resize(before);
      return;
    }
    end_line(line);
  }

  void write_parts(const SourceLine& line, const Block& block, const std::vector<double>& ends,
                   const std::vector<double>& feeds) {
    const Segment& segment = path_[line.first];
    const bool whole = ends.size() == 1;
    Increments position = increments(segment.start_mm);
    for (std::size_t k = 0; k < ends.size(); ++k) {
      const bool last = k + 1 == ends.size();
      const Increments end = increments(last ? segment.end_mm : point_at(segment, ends[k]));
      result_.lines.push_back(line_count_);
      ++result_.blocks;
      const double sweep = std::abs(segment.sweep_rad) * (ends[k] - (k > 0 ? ends[k - 1] : 0.0)) / ends.back();
      const BlockPart part{segment, line.incremental, position, end, feeds[k] / options_.unit_mm, sweep};
      if (k == 0) {
        write_first(line, block, part, whole);
      } else {
        write_further(block, part);
      }
      modal_feed_ = part.feed;
      position = end;
      if (last) {
        end_line(line);
      } else {
        result_.text += line_end_;
        ++line_count_;
      }
    }
  }

  struct BlockPart {
    const Segment& segment;
    bool incremental;
    Increments start;
    Increments end;
    double feed;  // as a word
    double sweep_rad;
  };

  [[nodiscard]] Increments increments(const Vector3& position_mm) const {
    Increments result{};
    for (int axis = 0; axis < axis_count; ++axis) {
      result[static_cast<std::size_t>(axis)] = std::llround(position_mm[axis] / options_.increment_mm);
    }
    return result;
  }

  void append_position(const BlockPart& part, std::size_t axis) {
    append_decimal(result_.text, part.end[axis] - (part.incremental ? part.start[axis] : 0),
                   options_.position_decimals);
  }

  // The words of the original, but for feed and, of a first part, the end.
  void write_first(const SourceLine& line, const Block& block, const BlockPart& part, bool whole) {
    std::size_t at = 0;
    std::size_t behind_words = 0;  // where an F may stand: before comments
    bool has_feed = false;
    std::array<bool, axis_count> written{};
    std::string& text = result_.text;
    for (const Word& word : block) {
      const bool is_axis = word.letter >= 'X' && word.letter <= 'Z';
      const bool replaced = word.letter == 'F' || (!whole && (is_axis || word.letter == 'R'));
      text += line.text.substr(at, (replaced ? word.column - 1 : word.end) - at);
      at = word.end;
      if (word.letter == 'F') {
        append_feed_word(part.feed);
        has_feed = true;
      } else if (replaced && is_axis) {
        text += word.letter;
        const auto axis = static_cast<std::size_t>(word.letter - 'X');
        append_position(part, axis);
        written[axis] = true;
      } else if (replaced) {
        append_radius(std::abs(word.value), part);
      }
      behind_words = text.size();
    }
    std::string added;
    std::swap(added, text);
    if (!whole) {
      append_missing_axes(part, written);
    }
    if (!has_feed && !same_feed(part.feed, modal_feed_)) {
      append_feed_word(part.feed);
    }
    std::swap(added, text);
    text.insert(behind_words, added);
    text += line.text.substr(at);
  }

  void write_further(const Block& block, const BlockPart& part) {
    append_missing_axes(part, {});
    for (const Word& word : block) {
      if (word.letter == 'R') {
        append_radius(std::abs(word.value), part);
      } else if (word.letter == 'I' || word.letter == 'J') {
        append_centre(part);
        break;
      }
    }
    if (!same_feed(part.feed, modal_feed_)) {
      append_feed_word(part.feed);
    }
  }

  void append_missing_axes(const BlockPart& part, const std::array<bool, axis_count>& written) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      if (!written[axis] && part.end[axis] != part.start[axis]) {
        result_.text += static_cast<char>('X' + axis);
        append_position(part, axis);
      }
    }
  }

  // Where an arc turns far, the increment by which its end is rounded moves the centre that R stands for.
  void append_radius(double radius, const BlockPart& part) {
    if (part.sweep_rad > largest_sweep_by_radius) {
      append_centre(part);
      return;
    }
    result_.text += 'R';
    append_decimal(result_.text, std::llround(radius * std::pow(10.0, options_.position_decimals)),
                   options_.position_decimals);
  }

  void append_centre(const BlockPart& part) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const std::int64_t centre =
          std::llround(part.segment.centre_mm[static_cast<Eigen::Index>(axis)] / options_.increment_mm);
      const std::int64_t value = options_.absolute_centres ? centre : centre - part.start[axis];
      if (value != 0 || options_.absolute_centres || axis == 0) {
        result_.text += static_cast<char>('I' + axis);
        append_decimal(result_.text, value, options_.position_decimals);
      }
    }
  }

  const Path& path_;
  const Region& region_;
  std::span<const FeedStretch> sections_;
  const FeedWriterOptions& options_;
  std::string_view line_end_;
  double modal_feed_ = 0.0;  // as a word
  std::size_t section_ = 0;
  std::uint32_t line_count_ = 0;
  RefedRegion result_;
};

}  // namespace

bool feeds_per_minute(const Program& program, const Region& region) {
  bool everywhere = true;
  double mode = region.entry.feed_mode;
  double units = region.entry.units;
  for_each_line(program, region, [&](const SourceLine& line, const Block& block) {
    for (const Word& word : block) {
      if (is_g(word, 93.0) || is_g(word, 94.0) || is_g(word, 95.0)) {
        mode = word.value;
      } else if (is_g(word, 20.0) || is_g(word, 21.0)) {
        units = word.value;
      }
    }
    everywhere = everywhere && (line.count == 0 || (mode == 94.0 && units == region.exit.units));
  });
  return everywhere && mode == 94.0 && units == region.exit.units;
}

std::vector<bool> divisible_segments(const Program& program, const Region& region, const FeedWriterOptions& options) {
  std::vector<bool> result(region.path->size(), false);
  for_each_line(program, region, [&](const SourceLine& line, const Block& block) {
    if (line.count == 1) {
      result[line.first] = divisible(line, block, (*region.path)[line.first], options);
    }
  });
  return result;
}

RefedRegion write_feeds(const Program& program, const Region& region, std::span<const FeedStretch> sections,
                        const FeedWriterOptions& options) {
  if (!covers(sections, region.path->length_mm())) {
    throw Error(ErrorKind::argument,
                fmt::format("the sections of a feed schedule must cover the region's path of {:g} mm",
                            region.path->length_mm()));
  }
  Writer writer(program, region, sections, options);
  for_each_line(program, region, [&](const SourceLine& line, const Block& block) { writer.write(line, block); });
  return writer.finish();
}

}  // namespace shapegcode
