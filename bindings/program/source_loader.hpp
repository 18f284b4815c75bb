// Programs in other files, for which a reader asks Python.
#pragma once

#include <pybind11/stl.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "shapegcode/program.hpp"

namespace shapegcode::bindings {

/// Calls back into Python, which gives (name, bytes) or None, from a reading that has let go of the interpreter lock. A
/// file's name may hold what is no UTF-8: that is escaped, as by `shown_name` in Python.
template <class Key>
std::function<std::optional<SourceText>(Key)> source_loader(pybind11::object loader) {
  if (loader.is_none()) return {};
  // The last copy may go while the lock is not held.
  const std::shared_ptr<pybind11::object> callable(new pybind11::object(std::move(loader)), [](pybind11::object* held) {
    const pybind11::gil_scoped_acquire acquire;
    delete held;
  });
  return [callable](const Key& key) -> std::optional<SourceText> {
    const pybind11::gil_scoped_acquire acquire;
    const pybind11::object result = (*callable)(key);
    if (result.is_none()) return std::nullopt;
    const auto [name, text] = result.cast<std::pair<pybind11::str, pybind11::bytes>>();
    const pybind11::bytes shown = name.attr("encode")("utf-8", "backslashreplace");
    return SourceText{static_cast<std::string>(shown), static_cast<std::string>(text)};
  };
}

}  // namespace shapegcode::bindings
