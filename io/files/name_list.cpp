// SPDX-License-Identifier: Apache-2.0
// Names are few, so a search for each is cheap.
#include "io/files/name_list.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/error.hpp"

namespace tangere {

std::vector<std::string> split_names(const std::string& what, const std::string& list) {
  std::vector<std::string> names;
  for (std::size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
    end = list.find(',', begin);
    names.push_back(list.substr(begin, end == std::string::npos ? end : end - begin));
    if (names.back().empty())
      throw InputError(fmt::format("{} '{}'; expected names separated by commas", what, list));
    if (std::count(names.begin(), names.end(), names.back()) > 1)
      throw InputError(fmt::format("{} '{}': '{}' is listed twice; expected each name once", what,
                                   list, names.back()));
  }
  return names;
}

}  // namespace tangere
