#include "program/linuxcnc/source_file.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"
#include "program/text/number_scan.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr std::array<std::pair<std::string_view, Keyword>, 16> keywords_by_text = {{
    {"", Keyword::none},
    {"sub", Keyword::sub},
    {"endsub", Keyword::endsub},
    {"call", Keyword::call},
    {"return", Keyword::returns},
    {"if", Keyword::opens_if},
    {"elseif", Keyword::elseif},
    {"else", Keyword::otherwise},
    {"endif", Keyword::endif},
    {"while", Keyword::opens_while},
    {"endwhile", Keyword::endwhile},
    {"do", Keyword::opens_do},
    {"repeat", Keyword::repeat},
    {"endrepeat", Keyword::endrepeat},
    {"break", Keyword::breaks},
    {"continue", Keyword::continues},
}};

Keyword keyword_of(std::string_view text) {
  const auto* const found = std::ranges::find(keywords_by_text, text, [](const auto& each) { return each.first; });
  return found == keywords_by_text.end() ? Keyword::other : found->second;
}

/// Line ends of one kind; CR alone is a blank to LinuxCNC.
std::string with_line_ends(std::string_view text) {
  std::string result;
  result.reserve(text.size() + 1);
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t at = std::min(text.find('\r', i), text.size());
    result += text.substr(i, at - i);
    if (at < text.size() && !text.substr(at + 1).starts_with('\n')) result += ' ';
    i = at + 1;
  }
  if (!result.ends_with('\n')) result += '\n';
  return result;
}

/// Whether text[i] begins with "call", in any case, behind blanks.
bool call_follows(std::string_view text, std::size_t i) {
  skip_spaces(text, i);
  return lowered(text.substr(i, 4)) == "call";
}

/// Behind the label that begins at text[begin]: a name, a number, or a value in brackets that CALL follows; npos: none.
std::size_t behind_label(std::string_view text, std::size_t begin) {
  std::size_t i = begin;
  if (i == text.size()) return text.npos;
  if (text[i] == '<') {
    const std::size_t end = text.find('>', i);
    return end == text.npos ? end : end + 1;
  }
  if (text[i] == '[') {
    std::size_t end = text.find(']', i);
    while (end != text.npos && !call_follows(text, end + 1)) end = text.find(']', end + 1);
    return end == text.npos ? end : end + 1;
  }
  while (i < text.size() && is_digit(text[i])) ++i;
  return i == begin ? text.npos : i;
}

/// Where a label begins: behind O, and perhaps an N word before it; npos: the line has no O word.
std::size_t label_begin(std::string_view text) {
  std::size_t i = 0;
  skip_spaces(text, i);
  if (i < text.size() && upper(text[i]) == 'N') {
    ++i;
    skip_spaces(text, i);
    const std::size_t digits = i;
    while (i < text.size() && is_digit(text[i])) ++i;
    if (i == digits) return text.npos;
    skip_spaces(text, i);
  }
  if (i == text.size() || upper(text[i]) != 'O') return text.npos;
  ++i;
  skip_spaces(text, i);
  return i;
}

std::string plain_label(std::string_view text) {
  std::string label;
  for (const char c : text) {
    if (!is_white(c)) label += lower(c);
  }
  if (is_digit(label.front())) label.erase(0, std::min(label.find_first_not_of('0'), label.size() - 1));
  return label;
}

}  // namespace

std::string_view text_of(Keyword keyword) {
  return std::ranges::find(keywords_by_text, keyword, [](const auto& each) { return each.second; })->first;
}

SourceFile::SourceFile(std::string name, std::string_view text, std::uint32_t index)
    : name_(std::move(name)), index_(index), text_(with_line_ends(text)) {
  starts_.push_back(0);
  for (std::size_t at = text_.find('\n'); at != text_.npos; at = text_.find('\n', at + 1)) starts_.push_back(at + 1);
  for (std::size_t k = 0; k < count(); ++k) find_o_line(k);
}

std::string_view SourceFile::line(std::size_t index) const noexcept {
  return std::string_view(text_).substr(starts_[index], starts_[index + 1] - 1 - starts_[index]);
}

void SourceFile::find_o_line(std::size_t line_index) {
  const std::string_view text = line(line_index);
  const std::size_t begin = label_begin(text);
  const std::size_t end = begin == text.npos ? begin : behind_label(text, begin);
  if (end == text.npos) return;
  std::size_t i = end;
  skip_spaces(text, i);
  std::size_t word_end = i;
  while (word_end < text.size() && is_letter(text[word_end])) ++word_end;
  OLine& found = o_lines_[line_index];
  found.label = plain_label(text.substr(begin, end - begin));
  found.word = lowered(text.substr(i, word_end - i));
  found.keyword = keyword_of(found.word);
  found.rest = text.substr(word_end);
  places_[found.label].push_back(line_index);
}

OLine* SourceFile::o_line(std::size_t line) noexcept {
  if (o_lines_.empty()) return nullptr;
  const auto found = o_lines_.find(line);
  return found == o_lines_.end() ? nullptr : &found->second;
}

const std::vector<std::size_t>& SourceFile::places(const std::string& label) const {
  static const std::vector<std::size_t> none;
  const auto found = places_.find(label);
  return found == places_.end() ? none : found->second;
}

std::optional<std::size_t> SourceFile::find(const std::string& label, Keyword keyword) const {
  for (const std::size_t place : places(label)) {
    if (o_lines_.at(place).keyword == keyword) return place;
  }
  return std::nullopt;
}

std::optional<std::size_t> SourceFile::after(std::size_t line, const std::string& label,
                                             std::initializer_list<Keyword> keywords) const {
  const std::vector<std::size_t>& all = places(label);
  for (auto place = std::ranges::upper_bound(all, line); place != all.end(); ++place) {
    if (std::ranges::find(keywords, o_lines_.at(*place).keyword) != keywords.end()) return *place;
  }
  return std::nullopt;
}

std::optional<std::size_t> SourceFile::before(std::size_t line, const std::string& label,
                                              std::initializer_list<Keyword> keywords) const {
  const std::vector<std::size_t>& all = places(label);
  for (auto place = std::ranges::lower_bound(all, line); place != all.begin();) {
    --place;
    if (std::ranges::find(keywords, o_lines_.at(*place).keyword) != keywords.end()) return *place;
  }
  return std::nullopt;
}

bool SourceFile::closes_do(std::size_t line, const std::string& label) const {
  const auto opening = before(line, label, {Keyword::opens_do, Keyword::opens_while, Keyword::endwhile});
  return opening && o_lines_.at(*opening).keyword == Keyword::opens_do;
}

}  // namespace shapegcode::linuxcnc
