#include "program/linuxcnc/plain_lines.hpp"

#include "program/text/characters.hpp"
#include "program/text/number_scan.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr std::size_t most_characters = 9;  // digits and a point: no more digits than FANUC's reader takes

bool is_digit_at(std::string_view text, std::size_t i) noexcept { return i < text.size() && is_digit(text[i]); }

char letter_at(std::string_view text, std::size_t i) noexcept { return i < text.size() ? upper(text[i]) : '\0'; }

/// Reads N and its digits; 0: there is no N; none: N0, or N without digits or with too many.
std::optional<std::size_t> scan_n_word(std::string_view text, std::size_t& i) noexcept {
  if (letter_at(text, i) != 'N') return 0;
  const std::size_t begin = ++i;
  std::size_t number = 0;
  for (; is_digit_at(text, i); ++i) number = 10 * number + static_cast<std::size_t>(text[i] - '0');
  if (number == 0 || i - begin > most_characters) return std::nullopt;
  skip_spaces(text, i);
  return number;
}

/// The number of G0 to G3 at text[i], behind which `i` stands then; -1: another word, or none.
int scan_motion(std::string_view text, std::size_t& i) noexcept {
  if (letter_at(text, i) != 'G') return -1;
  std::size_t k = i + 1;
  if (is_digit_at(text, k) && text[k] == '0' && is_digit_at(text, k + 1)) ++k;
  if (!is_digit_at(text, k) || text[k] > '3') return -1;
  const int motion = text[k] - '0';
  ++k;
  if (k < text.size() && (is_digit(text[k]) || text[k] == '.')) return -1;
  i = k;
  return motion;
}

/// The number behind a letter at text[i], and the blanks around it; none: it is no number of these lines.
std::optional<double> scan_value(std::string_view text, std::size_t& i) noexcept {
  ++i;
  skip_spaces(text, i);
  const bool has_sign = i < text.size() && (text[i] == '-' || text[i] == '+');
  const bool is_negative = has_sign && text[i] == '-';
  i += has_sign ? 1 : 0;
  const std::size_t begin = i;
  const ScannedNumber number = scan_number(text, i);
  const bool goes_on = i < text.size() && text[i] == '.';
  if (number.digits == 0 || goes_on || i - begin > most_characters) return std::nullopt;
  skip_spaces(text, i);
  return is_negative ? -number.value : number.value;
}

class PlainScanner {
 public:
  PlainScanner(std::string_view text, std::size_t begin, bool with_arcs, std::span<const std::uint8_t> n_counts)
      : text_(text), begin_(begin), with_arcs_(with_arcs), n_counts_(n_counts) {}

  PlainLines scan() {
    found_.end = begin_;
    while (scan_line()) {
    }
    return found_;
  }

 private:
  struct Line {
    std::array<std::optional<double>, 3> axes;
    std::array<double, 3> sums{};
    std::array<bool, 3> centres{};
    std::optional<double> feed;
  };

  bool scan_line() {
    std::size_t i = found_.end;
    skip_spaces(text_, i);
    const std::optional<std::size_t> n_word = scan_n_word(text_, i);
    if (!n_word || (*n_word > 0 && !is_kept(*n_word))) return false;
    const bool has_g = letter_at(text_, i) == 'G';
    const int motion = has_g ? scan_motion(text_, i) : -1;
    const bool is_arc = motion > 1;
    if ((has_g && motion < 0) || (is_arc && !with_arcs_)) return false;
    skip_spaces(text_, i);
    Line line = {.axes = {}, .sums = found_.sum, .centres = {}, .feed = {}};
    if (!scan_axes(i, line) || (is_arc && !scan_centres(i, line))) return false;
    if (letter_at(text_, i) == 'F' && !(line.feed = scan_value(text_, i))) return false;
    if (i >= text_.size() || text_[i] != '\n') return false;
    take(line, has_g, motion, i + 1);
    if (*n_word > 0) found_.n_words.push_back(static_cast<std::uint32_t>(*n_word));
    return true;
  }

  bool is_kept(std::size_t n_word) const noexcept { return n_word < n_counts_.size() && n_counts_[n_word] == 1; }

  bool scan_axes(std::size_t& i, Line& line) const noexcept {
    const std::size_t begin = i;
    for (char letter = letter_at(text_, i); letter >= 'X' && letter <= 'Z'; letter = letter_at(text_, i)) {
      const auto axis = static_cast<std::size_t>(letter - 'X');
      line.axes[axis] = scan_value(text_, i);
      if (!line.axes[axis]) return false;
      line.sums[axis] += *line.axes[axis];
    }
    return i > begin;
  }

  bool scan_centres(std::size_t& i, Line& line) const noexcept {
    const std::size_t begin = i;
    for (char letter = letter_at(text_, i); letter >= 'I' && letter <= 'K'; letter = letter_at(text_, i)) {
      if (!scan_value(text_, i)) return false;
      line.centres[static_cast<std::size_t>(letter - 'I')] = true;
    }
    return i > begin;
  }

  void take(const Line& line, bool has_g, int motion, std::size_t end) noexcept {
    if (found_.count++ == 0) found_.begins_with_g = has_g;
    found_.end = end;
    found_.sum = line.sums;
    if (has_g) found_.last_motion = motion;
    if (line.feed) found_.last_feed = line.feed;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (line.axes[axis]) found_.last[axis] = line.axes[axis];
      if (line.centres[axis]) found_.last_centre[axis] = found_.count;
    }
  }

  std::string_view text_;
  std::size_t begin_;
  bool with_arcs_;
  std::span<const std::uint8_t> n_counts_;
  PlainLines found_;
};

}  // namespace

PlainLines scan_plain_lines(std::string_view text, std::size_t begin, bool with_arcs,
                            std::span<const std::uint8_t> n_counts) {
  return PlainScanner(text, begin, with_arcs, n_counts).scan();
}

bool begins_with_motion(std::string_view text, std::size_t begin) noexcept {
  skip_spaces(text, begin);
  return scan_n_word(text, begin).has_value() && scan_motion(text, begin) >= 0;
}

std::string with_points(std::string_view lines) {
  constexpr std::string_view with_unit = "XYZIJKF";
  std::string result;
  result.reserve(lines.size() + lines.size() / 8);
  for (std::size_t i = 0; i < lines.size();) {
    const char letter = lines[i++];
    result += letter;
    if (with_unit.find(upper(letter)) == with_unit.npos) continue;
    const std::size_t begin = i;
    skip_spaces(lines, i);
    i += i < lines.size() && (lines[i] == '-' || lines[i] == '+') ? 1 : 0;
    const bool has_digits = is_digit_at(lines, i);
    while (is_digit_at(lines, i)) ++i;
    result += lines.substr(begin, i - begin);
    if (has_digits && (i == lines.size() || lines[i] != '.')) result += '.';
  }
  return result;
}

}  // namespace shapegcode::linuxcnc
