// SPDX-License-Identifier: Apache-2.0
// Names to indices while a scene is compiled.
#pragma once

#include <string>
#include <unordered_map>

#include "engine/base/error.hpp"

namespace tangere {

/// Maps names of one kind of thing to indices. A second use of a name is an error.
class NameIndex {
 public:
  void add(const std::string& kind, const std::string& name, int index, const Source& source) {
    if (!index_.emplace(name, index).second)
      throw InputError(source.prefix() + kind + " name '" + name + "' is used twice");
  }
  [[nodiscard]] int find(const std::string& kind, const std::string& name,
                         const Source& source) const {
    const auto it = index_.find(name);
    if (it == index_.end())
      throw InputError(source.prefix() + "no " + kind + " is named '" + name + "'");
    return it->second;
  }

 private:
  std::unordered_map<std::string, int> index_;
};

}  // namespace tangere
