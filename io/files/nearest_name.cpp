// SPDX-License-Identifier: Apache-2.0
// Uses the edit distance, ignoring case.
#include "io/files/nearest_name.hpp"

#include <algorithm>
#include <cctype>
#include <vector>

namespace tangere {

namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (lower(a[i - 1]) == lower(b[j - 1]) ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({change, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

std::string nearest_name(std::string_view wrong, std::span<const std::string> candidates) {
  constexpr std::size_t kLongest = 200;  // longer words are not typing mistakes
  if (wrong.size() > kLongest) return "";
  std::string best;
  std::size_t best_distance = (wrong.size() + 1) / 2 + 1;
  for (const std::string& c : candidates) {
    if (c.size() > kLongest) continue;
    const std::size_t d = edit_distance(wrong, c);
    if (d < best_distance) best = c, best_distance = d;
  }
  if (!best.empty() || wrong.size() < 3) return best;
  const auto begun =
      std::ranges::find_if(candidates, [&](const std::string& c) { return c.starts_with(wrong); });
  return begun == candidates.end() ? "" : *begun;
}

std::string suggestion(std::string_view wrong, std::span<const std::string> candidates) {
  const std::string near = nearest_name(wrong, candidates);
  if (!near.empty()) return "; did you mean '" + near + "'?";
  if (candidates.empty()) return "";
  constexpr std::size_t kMost = 24;
  std::string list = "; expected one of ";
  for (std::size_t i = 0; i < candidates.size() && i < kMost; ++i)
    list += (i > 0 ? ", " : "") + candidates[i];
  return candidates.size() > kMost ? list + ", …" : list;
}

}  // namespace tangere
