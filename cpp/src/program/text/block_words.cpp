#include "program/text/block_words.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode::detail {

// A table.  NOLINTNEXTLINE(readability-function-size)
Group group_of(int g_tenths) noexcept {
  switch (g_tenths) {
    case 0:
    case 10:
    case 20:
    case 30:
    case 330:
      return Group::motion;
    case 170:
    case 180:
    case 190:
      return Group::plane;
    case 900:
    case 910:
      return Group::distance;
    case 930:
    case 940:
    case 950:
      return Group::feed_mode;
    case 200:
    case 210:
      return Group::units;
    case 400:
    case 410:
    case 420:
      return Group::compensation;
    case 430:
    case 440:
    case 490:
      return Group::length_offset;
    case 730:
    case 740:
    case 760:
    case 800:
    case 810:
    case 820:
    case 830:
    case 840:
    case 850:
    case 860:
    case 870:
    case 880:
    case 890:
      return Group::cycle;
    case 980:
    case 990:
      return Group::cycle_return;
    case 540:
    case 550:
    case 560:
    case 570:
    case 580:
    case 590:
    case 541:
      return Group::coordinates;
    case 610:
    case 620:
    case 630:
    case 640:
      return Group::exact_stop;
    case 40:   // dwell
    case 100:  // offsets by program
    case 90:   // exact stop, one block
    case 280:  // reference return
    case 300:
    case 520:  // local coordinates
    case 530:  // machine coordinates
    case 920:  // coordinate setting
      return Group::none;
    case 150:
    case 160:
      return Group::polar;
    case 500:
    case 510:
      return Group::scaling;
    case 501:
    case 511:
      return Group::mirror;
    case 680:
    case 690:
      return Group::rotation;
    case 121:  // polar interpolation
    case 131:
    case 431:
    case 434:
    case 435:
      return Group::foreign;
    case 50:  // high-speed modes
    case 51:
    case 54:
    case 80:
    case 220:  // stroke check
    case 230:
    case 250:  // spindle fluctuation
    case 260:
    case 960:
    case 970:
      return Group::harmless;
    case 110:
    case 270:
    case 290:
    case 310:
      return Group::unknown_position;
    case 650:
    case 660:
    case 661:
    case 670:
      return Group::call;
    case 71:
      return Group::refused;
    default:
      return Group::invalid;
  }
}

std::string g_code_name(int g_tenths) {
  const int tenths = g_tenths % 10;
  return tenths != 0 ? fmt::format("G{}.{}", g_tenths / 10, tenths) : fmt::format("G{}", g_tenths / 10);
}

namespace {

constexpr std::uint32_t whole_number_letters = letter_mask("MSTNOHDL");

void add_g_code(const Word& word, std::uint32_t line, BlockWords& words) {
  const double tenths = word.value * 10.0;
  const int code = static_cast<int>(std::lround(tenths));
  if (word.value < 0.0) {
    throw alarm_error(6, fmt::format("minus sign in G code G{}", word.value), line, word.column);
  }
  if (std::abs(tenths - code) > 1e-6) {
    throw alarm_error(10, fmt::format("unknown G code G{}", word.value), line, word.column);
  }
  if (words.g_count == static_cast<int>(words.g_tenths.size())) {
    throw Error(ErrorKind::program, fmt::format("more than {} G codes in a block", words.g_tenths.size()), line,
                word.column);
  }
  const auto at = static_cast<std::size_t>(words.g_count++);
  words.g_tenths[at] = code;
  words.g_column[at] = word.column;
  words.g_group[at] = group_of(code);
  words.groups |= group_bit(words.g_group[at]);
}

}  // namespace

void sort_words(const Block& block, std::uint32_t line, BlockWords& words) {
  words.present = 0;
  words.g_count = 0;
  words.groups = 0;
  words.m_count = 0;
  words.corner = nullptr;
  words.duplicate = nullptr;
  words.fractional = nullptr;
  words.negative = nullptr;
  for (const Word& word : block) {
    if (word.letter >= 'A' && word.letter <= 'Z' && ((whole_number_letters >> (word.letter - 'A')) & 1U) != 0) {
      words.fractional = word.has_point && words.fractional == nullptr ? &word : words.fractional;
      words.negative = word.value < 0.0 && words.negative == nullptr ? &word : words.negative;
    }
    switch (word.letter) {
      case 'G':
        add_g_code(word, line, words);
        break;
      case 'M':
        if (words.m_count == static_cast<int>(words.m_codes.size())) {
          throw Error(ErrorKind::program, "more than 6 M codes in a block", line, word.column);
        }
        words.m_codes[static_cast<std::size_t>(words.m_count++)] = static_cast<int>(word.value);
        words.present |= 1U << ('M' - 'A');
        words.by_letter['M' - 'A'] = &word;
        break;
      case '<':
      case '>':
        if (words.corner != nullptr) {
          throw alarm_error(53, "two corner words ,R ,C in one block", line, word.column);
        }
        words.corner = &word;
        break;
      default: {
        const auto index = static_cast<std::size_t>(word.letter - 'A');
        if ((words.present >> index) & 1U) {
          words.duplicate = words.duplicate != nullptr ? words.duplicate : &word;
        }
        words.present |= 1U << index;
        words.by_letter[index] = &word;
      }
    }
  }
}

}  // namespace shapegcode::detail
