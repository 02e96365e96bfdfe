// SPDX-License-Identifier: Apache-2.0
// Whether a sanitizer watches this build: for tests whose size or whose bound says nothing there.
#pragma once

namespace tangere {

constexpr bool kSanitized = TANGERE_SANITIZED != 0;

}  // namespace tangere
