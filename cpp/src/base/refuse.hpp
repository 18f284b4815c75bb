// Errors for invalid values, and their messages.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>

#include "shapegcode/error.hpp"

namespace shapegcode::detail {

/// What a message may hold.
using MessageValue = std::variant<std::string_view, std::int64_t, std::uint64_t, double>;

template <class Value>
MessageValue message_value(const Value& value) {
  if constexpr (std::convertible_to<Value, std::string_view>) {
    return std::string_view(value);
  } else if constexpr (std::same_as<Value, double>) {
    return value;
  } else {
    static_assert(std::integral<Value> && !std::same_as<Value, bool> && !std::same_as<Value, char>);
    if constexpr (std::signed_integral<Value>) {
      return static_cast<std::int64_t>(value);
    } else {
      return static_cast<std::uint64_t>(value);
    }
  }
}

/// A text in which {} stands for the next value, and {:g} or {:.10g} for a double in the form of printf; the compiler
/// refuses one that does not go with the values.
template <class... Values>
class MessagePattern {
 public:
  consteval MessagePattern(const char* text) : text_(text) {
    constexpr std::array<bool, sizeof...(Values) + 1> is_double = {std::is_same_v<Values, double>..., false};
    std::size_t value = 0;
    for (std::size_t i = text_.find('{'); i != std::string_view::npos; i = text_.find('{', i)) {
      const std::size_t end = text_.find('}', i);
      if (end == std::string_view::npos || value == sizeof...(Values)) throw "a value is missing";
      const std::string_view form = text_.substr(i + 1, end - i - 1);
      const bool is_general = form.starts_with(':') && form.ends_with('g');
      if (!form.empty() && !(is_general && is_double[value])) throw "not a form of this value";
      ++value;
      i = end;
    }
    if (value != sizeof...(Values)) throw "more values than the text has places for";
  }
  [[nodiscard]] std::string_view text() const noexcept { return text_; }

 private:
  std::string_view text_;
};

/// The text with the values in it. {} of a double is the shortest text that reads back as the same number.
[[nodiscard]] std::string message_of(std::string_view pattern, std::span<const MessageValue> values);

template <class... Values>
[[nodiscard]] std::string message(MessagePattern<std::type_identity_t<Values>...> pattern, const Values&... values) {
  return message_of(pattern.text(), std::array<MessageValue, sizeof...(Values)>{message_value(values)...});
}

/// Throws Error(argument) with that message.
template <class... Values>
[[noreturn]] void refuse(MessagePattern<std::type_identity_t<Values>...> pattern, const Values&... values) {
  throw Error(ErrorKind::argument, message<Values...>(pattern, values...));
}

}  // namespace shapegcode::detail
