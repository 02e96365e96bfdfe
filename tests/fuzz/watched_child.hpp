// SPDX-License-Identifier: Apache-2.0
// Reads mutants in a child process and says what became of it: HDF5 crashes on some damage, by its
// own fault, and a fuzzer has to go on.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace tangere::fuzz {

struct ChildEnd {
  std::uint64_t done = 0;      ///< mutants that were read whole
  std::uint64_t accepted = 0;  ///< of them, without an error
  bool crashed = false;        ///< the mutant after those ended the child
  bool slow = false;           ///< because it took longer than 10 s
  bool leaked = false;         ///< some of the mutants, which all were read, left memory behind
  std::string finding;         ///< why that is our fault; empty if the HDF5 library did it
};

/// Calls read(first), read(first + 1) … up to `end` in a child. `read` returns whether its mutant
/// was accepted; an exception, more than 10 s or 1 GB for one mutant, a sanitizer's report and a
/// crash end the child. It is a finding unless the innermost function that is neither the system's
/// nor the sanitizer's belongs to HDF5; of leaks, unless that holds for every one. A call of HDF5
/// that computes for half a second ends the child as well, and is none.
ChildEnd run_in_watched_child(std::uint64_t first, std::uint64_t end,
                              const std::function<bool(std::uint64_t)>& read);

}  // namespace tangere::fuzz
