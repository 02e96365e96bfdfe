// SPDX-License-Identifier: Apache-2.0
// Lists the contents of an unknown file: names of links and attributes, values as text.
#pragma once

#include <string>
#include <vector>

#include "io/hdf5/h5.hpp"

namespace tangere::h5 {

/// Names of a group's links, sorted. Throws IoError.
std::vector<std::string> link_names(const Id& group);
std::size_t link_count(const Id& group);
/// Names of an object's attributes, sorted. Throws IoError.
std::vector<std::string> attribute_names(const Id& object);
/// Returns elements separated by ", ", numbers in the fewest digits that give them back. Throws
/// IoError.
std::string attribute_text(const Id& object, const std::string& name);
/// Returns the type of a dataset's numbers: "float32", "uint8", "bool", "files of up to 9 bytes".
std::string type_text(const Id& dataset);
/// Whether a link leads to a dataset, not to a group.
[[nodiscard]] bool is_dataset(const Id& parent, const std::string& name);

}  // namespace tangere::h5
