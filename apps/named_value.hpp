// SPDX-License-Identifier: Apache-2.0
// Words of options that stand for one of a few values: "--precision mixed".
#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "engine/base/error.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere::apps {

/// Returns the value whose to_string() is `name`. Throws InputError otherwise, with `what` it
/// should be and the nearest name.
template <class Value>
Value named_value(const std::string& what, const std::string& name, std::span<const Value> values) {
  std::vector<std::string> names;
  for (const Value value : values) {
    names.emplace_back(to_string(value));
    if (names.back() == name) return value;
  }
  throw InputError("unknown " + what + " '" + name + "'" + suggestion(name, names));
}

/// Does the same for a list: named_value("precision", name, {Precision::f64, Precision::mixed}).
template <class Value>
Value named_value(const std::string& what, const std::string& name,
                  std::initializer_list<Value> values) {
  return named_value(what, name, std::span<const Value>(values.begin(), values.size()));
}

}  // namespace tangere::apps
