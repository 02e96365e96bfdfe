// SPDX-License-Identifier: Apache-2.0
// Access to one list that holds the numbers of many environments, the same number for each.
#pragma once

#include <span>
#include <vector>

#include "engine/base/as_size.hpp"

namespace tangere {

/// The `width` numbers of one environment.
template <class T>
std::span<T> number_row(std::vector<T>& all, int environment, std::size_t width) {
  return std::span(all).subspan(as_size(environment) * width, width);
}
template <class T>
std::span<const T> number_row(const std::vector<T>& all, int environment, std::size_t width) {
  return std::span(all).subspan(as_size(environment) * width, width);
}

template <class T>
std::span<T> number_row(std::span<T> all, int environment, std::size_t width) {
  return all.subspan(as_size(environment) * width, width);
}

}  // namespace tangere
