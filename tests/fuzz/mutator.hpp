// SPDX-License-Identifier: Apache-2.0
// Changes files a little, as a seed says. What one seed does to one corpus never changes, so that a
// finding can be made again.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace tangere::fuzz {

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : engine_(seed) {}

  /// One of the texts with one to four changes: bytes, lines, numbers such as 1e15 or nan, pieces
  /// of another text.
  std::string text(const std::vector<std::string>& corpus);
  /// One of the HDF5 files with one to six changes: bits, fields of eight bytes, runs, a
  /// truncation. Half of them lie behind one of the format's signatures, where the descriptions
  /// are.
  std::string hdf5(const std::vector<std::string>& corpus);

 private:
  std::size_t below(std::size_t n);  ///< 0 … n - 1; 0 for n = 0
  const std::string& one_of(const std::vector<std::string>& texts);
  void change_text(std::string& text, const std::vector<std::string>& corpus);
  void change_lines(std::string& text);
  void replace_number(std::string& text);
  void change_hdf5(std::string& bytes);
  std::size_t place_in(const std::string& bytes);

  std::mt19937_64 engine_;
};

}  // namespace tangere::fuzz
