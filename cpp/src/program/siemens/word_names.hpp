#pragma once

#include <cstdint>
#include <string_view>

namespace shapegcode::siemens {

/// Words by their names; what stands behind them decides whether they are codes or addresses.
// clang-format off
enum class WordId : std::uint8_t {
  other,
  x, y, z, i, j, k, i1, j1, k1, cr, ar, turn, ap, rp, f, rnd, chr, chf, rndm, m, s, t, d, spos, sposa, spindle_word,
  rotary, p, rpl,
  g0, g1, g2, g3, cip, ct, g17, g18, g19, g90, g91, g70, g71, g700, g710, g93, g94, g95, flin, fnorm, g9, g60, g64,
  g641, work_offset, g53, g153, supa, g4, g110, g111, g112, g74, g75, g25, g26, call, extcall, ret,
  trans, atrans, rot, arot, scale, ascale, mirror, amirror,
};
// clang-format on

/// `spindle_word` is M or S and a digit, `g641` each of G641 to G645.
[[nodiscard]] WordId word_id(std::string_view name);

/// 0 to 2 of X, Y, Z (I, J, K; I1, J1, K1); -1: another word.
[[nodiscard]] constexpr int index_from(WordId id, WordId first) {
  const int found = static_cast<int>(id) - static_cast<int>(first);
  return found >= 0 && found < 3 ? found : -1;
}

[[nodiscard]] constexpr bool is_between(WordId id, WordId first, WordId last) { return id >= first && id <= last; }
[[nodiscard]] constexpr bool is_frame(WordId id) { return is_between(id, WordId::trans, WordId::amirror); }
[[nodiscard]] constexpr bool is_of_the_machine(WordId id) { return is_between(id, WordId::g53, WordId::supa); }

}  // namespace shapegcode::siemens
