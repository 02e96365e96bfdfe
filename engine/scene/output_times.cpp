// SPDX-License-Identifier: Apache-2.0
// A slash parts name and times: no name in a file may have one.
#include "engine/scene/output_times.hpp"

#include <charconv>

#include "engine/base/error.hpp"

namespace tangere {

std::string to_string(const OutputTimes& times) {
  if (times.final) return "/final";
  return times.every > 0 ? "/" + std::to_string(times.every) : "";
}

TimedName split_times(const std::string& word) {
  constexpr std::int64_t kMost = 1'000'000'000;
  const std::size_t slash = word.rfind('/');
  if (slash == std::string::npos) return {word, {}};
  TimedName split{word.substr(0, slash), {}};
  const std::string when = word.substr(slash + 1);
  const char* const end = when.data() + when.size();
  split.times.final = when == "final";
  const auto [at, error] = std::from_chars(when.data(), end, split.times.every);
  const bool number =
      error == std::errc() && at == end && split.times.every >= 1 && split.times.every <= kMost;
  if (!split.times.final && !number)
    throw InputError("'" + word + "': expected '" + split.name + "', '" + split.name +
                     "/10' for every 10th step (1 to 10⁹), or '" + split.name +
                     "/final' for the end of the run");
  return split;
}

}  // namespace tangere
