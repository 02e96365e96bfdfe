// SPDX-License-Identifier: Apache-2.0
// The rules of the house that a program can check: which way includes point, what every folder and
// file must have.
#pragma once

#include <filesystem>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace tangere::house {

/// Path from the project's root ("engine/model/model.hpp") → contents. Tests plant violations in
/// trees made by hand.
using Tree = std::map<std::string, std::string, std::less<>>;

struct Violation {
  std::string file;
  int line = 0;  ///< 1 …; 0: the file or folder as a whole
  std::string message;
};
std::ostream& operator<<(std::ostream& out, const Violation& violation);

/// Every source and text file below `root`, without hidden folders, build/ and out/. Throws
/// std::runtime_error on a file that cannot be read.
Tree read_tree(const std::filesystem::path& root);

/// kernels ← engine ← tasks, io ← apps, bench, tests: project includes point left, name a file that
/// exists, and name it from the root (or beside the including file); libraries stay in the folders
/// that own them.
std::vector<Violation> check_includes(const Tree& tree);

/// What is compiled once per instruction set (kernels/table/*_part.hpp and all it includes) uses no
/// type whose functions the linker might merge across instruction sets: containers, strings,
/// streams, functions.
std::vector<Violation> check_kernel_includes(const Tree& tree);

/// Headers that cmake/install.cmake installs include each other and the standard library, nothing
/// else.
std::vector<Violation> check_public_headers(const Tree& tree);

/// Nobody outside includes a private header: of engine and kernels, io, tasks, apps and examples
/// see what cmake/install.cmake installs. Tests and benchmarks may look inside.
std::vector<Violation> check_private_headers(const Tree& tree);
/// No more sources of a folder reach a header that takes long to compile than the table in
/// rules.cpp allows; tests and benchmarks are free.
std::vector<Violation> check_heavy_headers(const Tree& tree);

/// A source of the libraries and the command has a header of its own name, or a reason not to.
std::vector<Violation> check_own_headers(const Tree& tree);

/// SPDX line first, then a comment that says why the file exists; at most 600 lines.
std::vector<Violation> check_sources(const Tree& tree);

/// Every folder at the top has a README.md, and links in Markdown files lead to files that exist.
std::vector<Violation> check_documents(const Tree& tree);

}  // namespace tangere::house
