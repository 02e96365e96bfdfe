// SPDX-License-Identifier: Apache-2.0
// The rules of the house that a program can check: the direction of includes, and what every folder
// and file must have.
#pragma once

#include <filesystem>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace tangere::house {

/// Maps paths from the project's root ("engine/model/model.hpp") to contents. Tests put violations
/// into trees made by hand.
using Tree = std::map<std::string, std::string, std::less<>>;

struct Violation {
  std::string file;
  int line = 0;  ///< from 1 on; 0: the whole file or folder
  std::string message;
};
std::ostream& operator<<(std::ostream& out, const Violation& violation);

/// Reads every source and text file below `root`, except hidden folders, build/ and out/. Throws
/// std::runtime_error for a file that cannot be read.
Tree read_tree(const std::filesystem::path& root);

/// kernels ← engine ← tasks, io ← apps, bench, tests: project includes point left, name an existing
/// file, and name it from the root (or beside the including file). Libraries stay in the folders
/// that own them.
std::vector<Violation> check_includes(const Tree& tree);

/// Code that is compiled once per instruction set (kernels/table/*_part.hpp and all that it
/// includes) uses no type whose functions the linker might merge across instruction sets:
/// containers, strings, streams, functions.
std::vector<Violation> check_kernel_includes(const Tree& tree);

/// Headers that cmake/install.cmake installs include only each other and the standard library.
std::vector<Violation> check_public_headers(const Tree& tree);

/// Private headers are only included in their own folder. tasks, io, apps and examples see only the
/// headers of engine and kernels that cmake/install.cmake installs. Tests and benchmarks may look
/// inside.
std::vector<Violation> check_private_headers(const Tree& tree);
/// Only as many sources of a folder as the table in rules.cpp allows reach a header that takes long
/// to compile. Tests and benchmarks are exempt.
std::vector<Violation> check_heavy_headers(const Tree& tree);

/// A source of the libraries and the command has a header of its own name or a listed reason.
std::vector<Violation> check_own_headers(const Tree& tree);

/// A source with its header is a room. Rooms do not include each other in a circle, but for listed
/// ones.
std::vector<Violation> check_circles(const Tree& tree);

/// SPDX line first, then a comment that says why the file exists; at most 600 lines. In C++, Python
/// and JavaScript, at most 100 columns; in shell and CMake, at most 120. Names of C++ outside of
/// tests and examples do not begin with of_ or by_.
std::vector<Violation> check_sources(const Tree& tree);

/// Every folder with sources has a README.md, its own or, below tests and examples, that of the
/// folder above. Links in Markdown files lead to files that exist. Tables have at most 100 columns.
std::vector<Violation> check_documents(const Tree& tree);

}  // namespace tangere::house
