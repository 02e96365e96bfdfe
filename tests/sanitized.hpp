// SPDX-License-Identifier: Apache-2.0
// Whether a sanitizer watches this build. A sanitizer keeps freed memory and makes programs ten to
// a hundred times slower.
#pragma once

namespace tangere {

constexpr bool kSanitized = TANGERE_SANITIZED != 0;

}  // namespace tangere
