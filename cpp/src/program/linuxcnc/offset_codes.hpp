// Private: offsets of LinuxCNC in FANUC's words: G10, G28, G30, G43, G49, G52, G53, G92.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "program/linuxcnc/interpreter_state.hpp"
#include "program/linuxcnc/word_values.hpp"

namespace shapegcode::linuxcnc {

/// Changes offsets in the state and writes what FANUC's reader must know of it.
class OffsetCodes {
 public:
  OffsetCodes(State& state, std::function<void(const std::string&)> put) : state_(state), put_(std::move(put)) {}

  /// G43, G43.1, G49.
  void length(int code, const WordValues& values);
  /// G10, G28, G30, G52, G92.
  void one_shot(int code, const WordValues& values);
  /// Axis words of G53 in the program's coordinates; none: written as FANUC's G53, as no offset is known.
  [[nodiscard]] std::optional<WordValues> in_program(const WordValues& values, bool is_rapid);

 private:
  void put_in_absolute(const std::string& text);
  void forget(const WordValues& values);
  void dynamic_length(const WordValues& values);
  void reference(int code, const WordValues& values);
  void local(const WordValues& values);
  void set_position(const WordValues& values);
  /// G92.1, G92.2, G92.3.
  void set_offsets(int code);
  /// The axis words of the G92 that sets these offsets.
  [[nodiscard]] std::string words_to_offsets(int code, const Triple& wanted) const;
  void data(const WordValues& values);
  void tool_data(const WordValues& values, std::int64_t number);
  /// The offset with which the position has this value.
  [[nodiscard]] double offset_so_that(std::size_t axis, double value);

  State& state_;
  std::function<void(const std::string&)> put_;
};

}  // namespace shapegcode::linuxcnc
