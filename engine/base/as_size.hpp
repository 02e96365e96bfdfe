// SPDX-License-Identifier: Apache-2.0
// Converts counts, which are signed here, to the unsigned ones of the standard library.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tangere {

/// Returns a count or an index, which must not be negative, in the type of containers.
constexpr std::size_t as_size(std::int64_t n) { return static_cast<std::size_t>(n); }

}  // namespace tangere
