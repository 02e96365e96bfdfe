// SPDX-License-Identifier: Apache-2.0
// An OBJ file has one element a line, whose kind is its first word.
#include "io/scene/obj_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "io/files/word_reader.hpp"
#include "io/scene/polygons.hpp"

namespace tangere {
namespace {

using WordList = std::vector<std::string_view>;

/// Names, normals, textures, groups, materials, levels of detail, curves, points and lines: nothing
/// of the surface. The last row has words that no standard names and that programs write.
const WordList kSkippedWords = {
    "vt",       "vn",         "vp",        "o",      "g",      "s",      "mg",    "l",
    "p",        "usemtl",     "mtllib",    "usemap", "maplib", "lod",    "bevel", "c_interp",
    "d_interp", "shadow_obj", "trace_obj", "ctech",  "stech",  "cstype", "deg",   "bmat",
    "step",     "curv",       "curv2",     "parm",   "trim",   "hole",   "scrv",  "sp",
    "end",      "con",        "res",       "vw",     "t",      "vc"};
/// Parts of a surface, or whole files, that are not read.
const WordList kShapes = {"surf", "bsp", "bzp", "cdc", "cdp", "call", "csh"};

bool contains(const WordList& words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

/// Returns the index of a face's corner "7", "7/1", "7//2" or "-1". Files count from 1, or
/// backwards from the latest vertex.
int corner(const WordReader& file, std::string_view word, std::size_t vertices) {
  const long n = file.integer(word.substr(0, word.find('/')), "the number of a vertex");
  const long index = n > 0 ? n - 1 : static_cast<long>(vertices) + n;
  if (n == 0 || index < 0 || index >= static_cast<long>(vertices))
    file.fail(fmt::format("vertex {}; expected one of the {} before this line", n, vertices));
  return static_cast<int>(index);
}

}  // namespace

RawMesh read_obj(const std::string& path) {
  WordReader file(path, LineEnd::joined);
  RawMesh mesh;
  std::vector<int> corners;
  while (file.next()) {
    const WordList& words = file.words;
    if (words[0] == "v") {
      if (words.size() < 4)
        file.fail(fmt::format("a vertex of {} numbers; expected x y z", words.size() - 1));
      mesh.positions.push_back({file.position(1), file.position(2), file.position(3)});
    } else if (words[0] == "f" || words[0] == "fo") {  // fo: of old files
      if (words.size() < 4)
        file.fail(fmt::format("a face of {} vertices; expected three or more", words.size() - 1));
      corners.clear();
      for (std::size_t k = 1; k < words.size(); ++k)
        corners.push_back(corner(file, words[k], mesh.positions.size()));
      const std::string fault = cut_polygon(mesh.positions, corners, mesh.triangles);
      if (!fault.empty() && mesh.fault.empty())
        mesh.fault = fmt::format("{} a face of {} corners has {}; expected a polygon", file.place(),
                                 corners.size(), fault);
    } else if (contains(kShapes, words[0])) {
      file.fail(
          fmt::format("'{}', a free-form surface or another file; expected a surface of "
                      "vertices and faces",
                      words[0]));
    } else if (!contains(kSkippedWords, words[0])) {
      file.fail(fmt::format("'{}'; expected v, f or another element of an OBJ file",
                            words[0].substr(0, 40)));
    }
  }
  return mesh;
}

}  // namespace tangere
