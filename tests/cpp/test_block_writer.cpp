#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "shapegcode/program.hpp"
#include "shapegcode/write.hpp"

using shapegcode::BlockMark;
using shapegcode::FittedBlock;
using shapegcode::FittedKind;
using shapegcode::Program;
using shapegcode::read_program;
using shapegcode::Segment;
using shapegcode::SegmentKind;
using shapegcode::Vector3;
using shapegcode::write_blocks;
using shapegcode::WriterOptions;
using shapegcode::WrittenBlocks;

namespace {

using Position = std::array<std::int64_t, 3>;

FittedBlock line(Position end, std::int64_t feed, std::uint32_t first = 0, std::uint32_t periods = 1) {
  return {end, 0, feed, first, periods, FittedKind::line, 2};
}

FittedBlock arc(Position end, std::int64_t radius, std::int64_t feed, FittedKind kind, std::uint8_t normal) {
  return {end, radius, feed, 0, 1, kind, normal};
}

BlockMark mark(std::uint32_t period, std::int32_t number, std::string comment = "") {
  return {period, number, std::move(comment)};
}

std::string text_of(const std::vector<FittedBlock>& blocks, const std::vector<BlockMark>& marks = {},
                    const WriterOptions& options = {}) {
  return write_blocks(blocks, {0, 0, 0}, marks, options).text;
}

}  // namespace

TEST_CASE("block writer: only what changes is written") {
  CHECK(text_of({line({12, 0, 0}, 1480), line({50, 0, 0}, 4470), line({123, -5, 0}, 4470),
                 line({123, 0, 250}, 60000)}) == "X.012F148.\nX.05F447.\nX.123Y-.005\nY0.Z.25F6000.\n");
}

TEST_CASE("block writer: a feed below ten keeps a digit behind the point") {
  CHECK(text_of({line({1, 0, 0}, 50), line({2, 0, 0}, 55), line({3, 0, 0}, 100)}) ==
        "X.001F5.0\nX.002F5.5\nX.003F10.\n");
}

TEST_CASE("block writer: arcs in their plane, G codes where they change") {
  const std::vector<FittedBlock> blocks = {
      line({20000, 0, 0}, 60000),
      arc({20300, 2, 0}, 20002, 37770, FittedKind::counter_clockwise, 2),
      arc({20600, 9, 0}, 19998, 37770, FittedKind::counter_clockwise, 2),
      arc({20900, 0, 0}, 20000, 37770, FittedKind::clockwise, 2),
      line({21000, 0, 0}, 37770),
      arc({21000, 500, 500}, 500, 37770, FittedKind::clockwise, 0),
      arc({21500, 500, 1000}, 500, 37770, FittedKind::clockwise, 1),
      line({22000, 500, 1000}, 37770),
  };
  const WrittenBlocks written = write_blocks(blocks, {0, 0, 0}, {}, WriterOptions{});
  CHECK(written.text ==
        "X20.F6000.\n"
        "G03X20.3Y.002R20.002F3777.\n"
        "X20.6Y.009R19.998\n"
        "G02X20.9Y0.R20.\n"
        "G01X21.\n"
        "G19G02Y.5Z.5R.5\n"
        "G18X21.5Z1.R.5\n"
        "G01X22.\n");
  CHECK(written.motion == 1);
  CHECK(written.plane == 18);
  // The plane of the original counts.
  WriterOptions options;
  options.plane = 18;
  const WrittenBlocks other = write_blocks(std::vector<FittedBlock>{blocks[6]}, {21000, 500, 500}, {}, options);
  CHECK(other.text == "G02X21.5Z1.R.5F3777.\n");
  CHECK(other.motion == 2);
  CHECK(other.plane == 18);
}

TEST_CASE("block writer: incremental words are differences of the rounded positions") {
  WriterOptions options;
  options.incremental = true;
  const std::vector<FittedBlock> blocks = {line({1012, 5, 0}, 1480), line({1050, 5, 0}, 1480),
                                           arc({1100, 0, 0}, 300, 1480, FittedKind::clockwise, 2)};
  CHECK(write_blocks(blocks, {1000, 5, 0}, {}, options).text == "X.012F148.\nX.038\nG02X.05Y-.005R.3\n");
}

TEST_CASE("block writer: inch words have four decimals, line ends as asked for, G09 on the last block") {
  WriterOptions options;
  options.position_decimals = 4;
  options.feed_decimals = 2;
  options.line_end = std::string("\r\n");
  options.exact_stop_at_end = true;
  CHECK(text_of({line({12, 0, 0}, 148), line({10050, 0, 0}, 447)}, {}, options) == "X.0012F1.48\r\nG09X1.005F4.47\r\n");
}

TEST_CASE("block writer: comments before their block, N words in order on blocks of their own") {
  const std::vector<FittedBlock> blocks = {line({100, 0, 0}, 1000, 0, 10), line({200, 0, 0}, 1000, 10, 10),
                                           line({300, 0, 0}, 1000, 20, 10)};
  CHECK(text_of(blocks, {mark(0, -1, "(FIRST)"), mark(10, 20), mark(20, 30, "(THIRD)")}) ==
        "(FIRST)\nX.1F100.\nN20X.2\n(THIRD)\nN30X.3\n");
  // Two at one place: the second goes to the next block. Those left over stand alone.
  CHECK(text_of(blocks, {mark(10, 20), mark(10, 25), mark(10, 26), mark(10, 27, "(LATE)")}) ==
        "X.1F100.\nN20X.2\nN25X.3\nN26\n(LATE)\nN27\n");
  // Between two borders: at the block behind.
  CHECK(text_of(blocks, {mark(5, 20)}) == "X.1F100.\nN20X.2\nX.3\n");
  CHECK(text_of({}, {mark(0, 5, "(ONLY)")}) == "(ONLY)\nN5\n");
  CHECK(text_of({}).empty());
}

TEST_CASE("block writer: every N word and comment is written once, in order, whatever the marks") {
  std::mt19937 generator(4);
  for (int round = 0; round < 300; ++round) {
    std::uniform_int_distribution<std::uint32_t> small(0, 8);
    std::vector<FittedBlock> blocks;
    std::uint32_t period = 0;
    for (std::uint32_t i = small(generator); i > 0; --i) {
      const std::uint32_t periods = 1 + small(generator);
      blocks.push_back(line({static_cast<std::int64_t>(100 + period), 0, 0}, 1000, period, periods));
      period += periods;
    }
    std::vector<BlockMark> marks;
    std::uint32_t at = 0;
    std::string expected;
    for (std::uint32_t i = 0; i < small(generator) + 1; ++i) {
      at += small(generator) / 2;
      const bool numbered = small(generator) > 3;
      const std::string comment = small(generator) > 4 || !numbered ? "(C" + std::to_string(i) + ")" : "";
      marks.push_back(mark(at, numbered ? static_cast<std::int32_t>(10 + i) : -1, comment));
      expected += comment + (numbered ? "N" + std::to_string(10 + i) : "");
    }
    std::string found;
    const std::string text = text_of(blocks, marks);
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '(') {
        const std::size_t close = text.find(')', i);
        found += text.substr(i, close + 1 - i);
        i = close;
      } else if (text[i] == 'N') {
        found += 'N';
        while (i + 1 < text.size() && text[i + 1] >= '0' && text[i + 1] <= '9') found += text[++i];
      }
    }
    CHECK(found == expected);
  }
}

TEST_CASE("block writer: what is written is read back to the increment, in G90 and G91, mm and inch, three planes") {
  std::mt19937_64 generator(12);
  std::uniform_int_distribution<std::int64_t> step(-2000, 2000);
  std::uniform_int_distribution<std::int64_t> feed(10, 60000);
  std::uniform_int_distribution<int> pick(0, 9);
  for (const bool incremental : {false, true}) {
    for (const bool inch : {false, true}) {
      const double unit = inch ? 25.4 : 1.0;
      const int decimals = inch ? 4 : 3;
      const double increment = unit * (inch ? 1e-4 : 1e-3);
      const Position start = {1000, -2000, 3000};
      std::vector<FittedBlock> blocks;
      Position at = start;
      for (int i = 0; i < 2000; ++i) {
        FittedBlock block;
        block.end = at;
        while (block.end == at) {
          block.end = {at[0] + step(generator), at[1] + step(generator),
                       pick(generator) < 3 ? at[2] + step(generator) : at[2]};
        }
        block.feed = pick(generator) < 5 && i > 0 ? blocks.back().feed : feed(generator);
        if (pick(generator) < 4) {
          block.kind = pick(generator) < 5 ? FittedKind::clockwise : FittedKind::counter_clockwise;
          block.normal = static_cast<std::uint8_t>(pick(generator) % 3);
          const auto a = static_cast<std::size_t>((block.normal + 1) % 3);
          const auto b = static_cast<std::size_t>((block.normal + 2) % 3);
          const double chord =
              std::hypot(static_cast<double>(block.end[a] - at[a]), static_cast<double>(block.end[b] - at[b]));
          block.radius = static_cast<std::int64_t>(std::ceil(chord)) + 100;
          if (chord < 50.0) block.kind = FittedKind::line;
        }
        blocks.push_back(block);
        at = block.end;
      }
      WriterOptions options;
      options.position_decimals = decimals;
      options.incremental = incremental;
      const WrittenBlocks written = write_blocks(blocks, start, {}, options);
      const std::string head = std::string("%\nG17 G94 ") + (inch ? "G20" : "G21") + " G90 G00 " +
                               (inch ? "X.1 Y-.2 Z.3" : "X1. Y-2. Z3.") + "\nG01" + (incremental ? " G91" : "") + "\n";
      const Program program = read_program(head + written.text + "M30\n%\n");
      REQUIRE(program.regions.size() == 1);
      const auto& path = *program.regions[0]->path;
      REQUIRE(path.size() == blocks.size());
      CHECK(program.final_state.motion == written.motion);
      CHECK(program.final_state.plane == written.plane);
      int wrong = 0;
      std::size_t longest = 0;
      for (std::size_t from = 0; from < written.text.size();) {
        const std::size_t end = written.text.find('\n', from);
        longest = std::max(longest, end - from);
        from = end + 1;
      }
      CHECK(longest <= 60);
      for (std::size_t i = 0; i < blocks.size(); ++i) {
        const Segment& segment = path[i];
        const FittedBlock& block = blocks[i];
        for (std::size_t k = 0; k < 3; ++k) {
          const double expected = static_cast<double>(block.end[k]) * increment;
          if (std::abs(segment.end_mm[static_cast<Eigen::Index>(k)] - expected) > 1e-7) ++wrong;
        }
        if (std::abs(segment.feed_mm_per_s - static_cast<double>(block.feed) * 0.1 * unit / 60.0) > 1e-9) ++wrong;
        if ((segment.kind == SegmentKind::arc) != (block.kind != FittedKind::line)) ++wrong;
        if (block.kind != FittedKind::line) {
          if (std::abs(segment.start_radius_mm - static_cast<double>(block.radius) * increment) > 1e-6) ++wrong;
          if ((segment.sweep_rad > 0.0) != (block.kind == FittedKind::counter_clockwise)) ++wrong;
          if (segment.normal != block.normal || std::abs(segment.sweep_rad) > std::numbers::pi / 2) ++wrong;
        }
      }
      CHECK(wrong == 0);
    }
  }
}
