// SPDX-License-Identifier: Apache-2.0
// The instruction set in use: its name, for people and files, and the width of its registers.
#pragma once

namespace tangere::kernels {

/// "avx512", "avx2", "sse2" or "scalar": the best one that the machine runs, or the one named by
/// the environment variable TANGERE_ISA when the program started.
const char* active_isa_name();

/// Returns how many doubles a register of the instruction set in use holds: 8, 4, 2, or 1.
int active_register_width();

/// Returns "", or why the kernels cannot be used: TANGERE_ISA names a set that was not built or
/// does not run here, or the processor runs none of those that were built. Models refuse to be
/// compiled then, and programs check it at start.
const char* isa_error();

}  // namespace tangere::kernels
