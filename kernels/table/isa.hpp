// SPDX-License-Identifier: Apache-2.0
// The name of the instruction set in use, for people and files.
#pragma once

#include "kernels/table/kernel_table.hpp"

namespace tangere::kernels {

/// "avx512", "avx2", "sse2" or "scalar".
inline const char* active_isa_name() { return active_kernels().name; }

}  // namespace tangere::kernels
