// SPDX-License-Identifier: Apache-2.0
// Counts are signed here, and the standard library's are not.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tangere {

/// A count or an index, not negative, as containers take it.
constexpr std::size_t as_size(std::int64_t n) { return static_cast<std::size_t>(n); }

}  // namespace tangere
