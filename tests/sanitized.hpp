// SPDX-License-Identifier: Apache-2.0
// Whether a sanitizer watches this build: it keeps memory that was given back, and takes ten to a
// hundred times as long.
#pragma once

namespace tangere {

constexpr bool kSanitized = TANGERE_SANITIZED != 0;

}  // namespace tangere
