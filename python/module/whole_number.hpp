// SPDX-License-Identifier: Apache-2.0
// Integers from Python. One that does not fit its type is an InputError; nanobind would print the
// signatures of all constructors.
#pragma once

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <limits>
#include <string>

#include "engine/base/error.hpp"

namespace tangere::python {

/// An argument: any Python or NumPy integer.
template <class T>
struct Whole {
  T number = 0;
  std::string too_large;  ///< its digits, if it does not fit T

  /// Throws InputError if it does not fit. `name`: of the argument.
  [[nodiscard]] T value(const char* name) const {
    if (!too_large.empty())
      throw InputError(fmt::format("{} {}; expected a whole number from {} to {}", name, too_large,
                                   std::numeric_limits<T>::min(), std::numeric_limits<T>::max()));
    return number;
  }
};

}  // namespace tangere::python

namespace nanobind::detail {

template <class T>
struct type_caster<tangere::python::Whole<T>> {
  NB_TYPE_CASTER(tangere::python::Whole<T>, const_name("int"))

  bool from_python(handle source, std::uint8_t, cleanup_list*) noexcept {
    if (PyFloat_Check(source.ptr())) return false;
    const object index = steal(PyNumber_Index(source.ptr()));
    if (!index.is_valid()) {
      PyErr_Clear();
      return false;
    }
    value = {};
    if (try_cast(index, value.number)) return true;
    PyErr_Clear();
    try {
      value.too_large = str(index).c_str();
    } catch (const std::exception&) {  // more digits than Python turns into text
      PyErr_Clear();
      value.too_large = "of thousands of digits";
    }
    return true;
  }
  static handle from_cpp(const Value& whole, rv_policy policy, cleanup_list* cleanup) noexcept {
    return make_caster<T>::from_cpp(whole.number, policy, cleanup);
  }
};

}  // namespace nanobind::detail
