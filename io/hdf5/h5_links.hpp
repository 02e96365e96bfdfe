// SPDX-License-Identifier: Apache-2.0
// Views: objects of one file that show numbers of another.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/hdf5/h5.hpp"

namespace tangere::h5 {

/// `file` is relative to the folder of the file that holds the link. Opening the link fails if that
/// file is missing.
void link_external(const Id& group, const std::string& name, const std::string& file,
                   const std::string& path);

/// Gives an object of a group a second name in it.
void link_again(const Id& group, const std::string& name, const std::string& as);

/// Copies a group and everything below it to another file under another name.
void copy_group(const Id& from, const std::string& name, const Id& to, const std::string& as);

/// A whole dataset of another file.
struct Source {
  std::string file;  ///< as for link_external; ".": the file of the virtual dataset itself
  std::string path;
};
/// Makes one dataset that shows `first` without its first `skipped` rows, followed by the one row
/// of `last`. `like` is the open dataset that `first` names. Reading gives NaN if a file is
/// missing.
void create_virtual(const Id& group, const std::string& name, const Id& like, const Source& first,
                    const Source& last, hsize_t skipped = 0);

/// Writes names that consist of `prefix` and a number, as byte strings of equal length, padded with
/// zeros. NumPy calls this type S.
void write_names(const Id& group, const std::string& name, const std::string& prefix,
                 const std::vector<std::int64_t>& numbers);

}  // namespace tangere::h5
