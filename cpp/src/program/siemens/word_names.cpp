#include "program/siemens/word_names.hpp"

#include <array>
#include <unordered_map>

#include "program/siemens/scanner.hpp"

namespace shapegcode::siemens {
namespace {

struct CodeName {
  int number;
  WordId id;
};

constexpr std::array<CodeName, 34> codes = {
    {{0, WordId::g0},     {1, WordId::g1},     {2, WordId::g2},     {3, WordId::g3},     {4, WordId::g4},
     {9, WordId::g9},     {17, WordId::g17},   {18, WordId::g18},   {19, WordId::g19},   {25, WordId::g25},
     {26, WordId::g26},   {53, WordId::g53},   {60, WordId::g60},   {64, WordId::g64},   {70, WordId::g70},
     {71, WordId::g71},   {74, WordId::g74},   {75, WordId::g75},   {90, WordId::g90},   {91, WordId::g91},
     {93, WordId::g93},   {94, WordId::g94},   {95, WordId::g95},   {110, WordId::g110}, {111, WordId::g111},
     {112, WordId::g112}, {153, WordId::g153}, {641, WordId::g641}, {642, WordId::g641}, {643, WordId::g641},
     {644, WordId::g641}, {645, WordId::g641}, {700, WordId::g700}, {710, WordId::g710}}};

WordId code_id(std::string_view digits) {
  if (digits.size() > 3 || (digits.size() > 1 && digits[0] == '0')) return WordId::other;
  int number = 0;
  for (const char c : digits) number = 10 * number + (c - '0');
  if ((number >= 54 && number <= 57) || number == 500 || (number >= 505 && number <= 599)) return WordId::work_offset;
  for (const CodeName& each : codes) {
    if (each.number == number) return each.id;
  }
  return WordId::other;
}

WordId letter_id(char letter) {
  constexpr std::string_view letters = "XYZIJKFMSTDPABCUVW";
  constexpr std::array<WordId, 18> ids = {
      WordId::x,      WordId::y,      WordId::z,      WordId::i,      WordId::j,      WordId::k,
      WordId::f,      WordId::m,      WordId::s,      WordId::t,      WordId::d,      WordId::p,
      WordId::rotary, WordId::rotary, WordId::rotary, WordId::rotary, WordId::rotary, WordId::rotary};
  const std::size_t at = letters.find(letter);
  return at == std::string_view::npos ? WordId::other : ids[at];
}

const std::unordered_map<std::string_view, WordId>& long_names() {
  static const std::unordered_map<std::string_view, WordId> names = {
      {"I1", WordId::i1},         {"J1", WordId::j1},           {"K1", WordId::k1},          {"CR", WordId::cr},
      {"AR", WordId::ar},         {"TURN", WordId::turn},       {"AP", WordId::ap},          {"RP", WordId::rp},
      {"RND", WordId::rnd},       {"CHR", WordId::chr},         {"CHF", WordId::chf},        {"RNDM", WordId::rndm},
      {"SPOS", WordId::spos},     {"SPOSA", WordId::sposa},     {"RPL", WordId::rpl},        {"CIP", WordId::cip},
      {"CT", WordId::ct},         {"FLIN", WordId::flin},       {"FNORM", WordId::fnorm},    {"SUPA", WordId::supa},
      {"CALL", WordId::call},     {"EXTCALL", WordId::extcall}, {"RET", WordId::ret},        {"TRANS", WordId::trans},
      {"ATRANS", WordId::atrans}, {"ROT", WordId::rot},         {"AROT", WordId::arot},      {"SCALE", WordId::scale},
      {"ASCALE", WordId::ascale}, {"MIRROR", WordId::mirror},   {"AMIRROR", WordId::amirror}};
  return names;
}

}  // namespace

WordId word_id(std::string_view name) {
  if (name.size() == 1) return letter_id(name[0]);
  if (name.empty()) return WordId::other;
  if (name[0] == 'G' && is_digits(name.substr(1))) return code_id(name.substr(1));
  if (name.size() == 2 && (name[0] == 'M' || name[0] == 'S') && is_digit(name[1])) return WordId::spindle_word;
  const auto found = long_names().find(name);
  return found == long_names().end() ? WordId::other : found->second;
}

}  // namespace shapegcode::siemens
