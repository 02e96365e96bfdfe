// SPDX-License-Identifier: Apache-2.0
// Arrays between Python and C++. Inputs are converted once to the type and order that C++ reads.
// Outputs are new NumPy arrays, which also support DLPack.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/base/as_size.hpp"
#include "engine/base/error.hpp"

namespace tangere::python {

namespace nb = nanobind;

using Shape = std::vector<std::size_t>;

/// An argument: any array-like of numbers, on the CPU. Another type or order is copied; what is no
/// array, such as a list, goes through numpy.asarray.
template <class T>
struct Argument : nb::ndarray<const T, nb::c_contig, nb::device::cpu> {
  using Base = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;
  using Base::Base;
  Argument(Base array) : Base(std::move(array)) {}
};
/// A result.
template <class T>
using Array = nb::ndarray<nb::numpy, T>;

/// Returns a new array and its data pointer. Its numbers are not set. Throws InputError if
/// allocation fails.
template <class T>
Array<T> new_array(const Shape& shape, std::span<T>& numbers) {
  std::size_t size = 1;
  double bytes = sizeof(T);
  for (const std::size_t n : shape) size *= n, bytes *= static_cast<double>(n);
  constexpr double kMost = 0x1p62;
  std::unique_ptr<T[]> held;
  if (bytes < kMost) held.reset(new (std::nothrow) T[std::max<std::size_t>(size, 1)]);
  if (held == nullptr)
    throw InputError(
        fmt::format("no memory for an array ({}) of {:.0f} bytes", fmt::join(shape, ", "), bytes));
  numbers = {held.get(), size};
  nb::capsule owner(held.get(), [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return Array<T>(held.release(), shape.size(), shape.data(), owner);
}

/// Returns a new array with these numbers, converted.
template <class T, class From>
Array<T> array_of(const Shape& shape, std::span<const From> from) {
  std::span<T> to;
  Array<T> array = new_array<T>(shape, to);
  std::transform(from.begin(), from.end(), to.begin(),
                 [](const From& x) { return static_cast<T>(x); });
  return array;
}

template <class T>
Shape shape_of(const Argument<T>& array) {
  Shape shape;
  for (std::size_t i = 0; i < array.ndim(); ++i) shape.push_back(array.shape(i));
  return shape;
}

/// Returns the numbers of an argument. Throws InputError when it has another shape: "actions of
/// shape (4, 2); expected (4, 3)".
template <class T>
std::span<const T> numbers_of(const Argument<T>& array, const Shape& expected, const char* what) {
  if (shape_of(array) != expected)
    throw InputError(fmt::format("{} of shape ({}); expected ({})", what,
                                 fmt::join(shape_of(array), ", "), fmt::join(expected, ", ")));
  return {array.data(), array.size()};
}

/// The same for rows (rows, width), where one row (width) stands for all of them.
template <class T>
std::vector<T> rows_of(const Argument<T>& array, std::size_t rows, std::size_t width,
                       const char* what) {
  if (array.ndim() != 1) {
    const std::span<const T> all = numbers_of(array, {rows, width}, what);
    return {all.begin(), all.end()};
  }
  const std::span<const T> row = numbers_of(array, {width}, what);
  std::vector<T> all;
  for (std::size_t r = 0; r < rows; ++r) all.insert(all.end(), row.begin(), row.end());
  return all;
}

/// An object that one Python thread uses at a time. The GIL is free while it works, so another
/// thread could come in. It is refused with InputError.
class InUse {
 public:
  class Turn {
   public:
    explicit Turn(InUse& of) : of_(of) {
      if (of_.taken_.test_and_set())
        throw InputError("this object is in use by another thread; expected one for each thread");
    }
    ~Turn() { of_.taken_.clear(); }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    InUse& of_;
  };

 private:
  std::atomic_flag taken_;
};

}  // namespace tangere::python

namespace nanobind::detail {

template <class T>
struct type_caster<tangere::python::Argument<T>> {
  NB_TYPE_CASTER(tangere::python::Argument<T>, const_name("numpy.typing.ArrayLike"))

  bool from_python(handle source, std::uint8_t flags, cleanup_list* cleanup) noexcept {
    make_caster<typename Value::Base> caster;
    try {
      if (!holds_numbers(source)) return false;
    } catch (const python_error&) {
      return false;
    }
    const bool is_array = caster.from_python(source, flags, cleanup);
    if (!is_array && (flags & std::uint8_t(cast_flags::convert)) == 0) return false;
    try {
      if (!is_array) {
        const object array = module_::import_("numpy").attr("asarray")(
            source, std::is_same_v<T, bool> ? "bool" : "float64");
        typename Value::Base base;
        if (!try_cast(array, base)) return false;
        value = Value(std::move(base));
        return true;
      }
      value = Value(std::move(caster.value));
      return true;
    } catch (const python_error&) {
      return false;  // not numbers: nanobind raises TypeError with the argument's type
    }
  }
  /// Complex numbers would lose a part, and None would become NaN.
  static bool holds_numbers(handle source) {
    const object array = hasattr(source, "dtype")
                             ? borrow(source)
                             : module_::import_("numpy").attr("asarray")(source);
    const object kind = getattr(array.attr("dtype"), "kind", none());  // PyTorch's types have none
    return kind.is_none() ||
           std::string_view("biuf").find(cast<std::string>(kind)) != std::string_view::npos;
  }
  static handle from_cpp(const Value&, rv_policy, cleanup_list*) noexcept { return {}; }
};

}  // namespace nanobind::detail
