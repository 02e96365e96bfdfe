// SPDX-License-Identifier: Apache-2.0
// Files that a command has read. None of its outputs may replace one of them, whatever leads to it:
// an included scene, a mesh, a table, a linked shard, a hard or symbolic link.
#pragma once

#include <string>

struct stat;

namespace tangere {

/// From now on add_input() keeps what it is given. Until then it keeps nothing: a program that uses
/// the library may replace what it has read.
void keep_inputs();

/// Keeps the file by device and inode, if there is one. `path`: for messages.
void add_input(const std::string& path);
void add_input(const std::string& path, const struct stat& info);

/// Throws InputError if `output` is, or links to, a file that was kept.
void refuse_input(const std::string& output);

}  // namespace tangere
