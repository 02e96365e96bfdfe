// SPDX-License-Identifier: Apache-2.0
// Loops over pixels are compiled for several instruction sets, and the machine's best one runs.
// Products and sums are never fused, so every set gives the same bits.
#pragma once

// Sanitizers start after the choice is made; other compilers and processors have one version.
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TANGERE_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define TANGERE_CLONES
#endif
