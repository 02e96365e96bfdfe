// SPDX-License-Identifier: Apache-2.0
// The program's own path is that of /proc/self/exe; a module's that of the binary with this code.
#include "io/scene/scene_folders.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>

#include "engine/base/error.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

fs::path binary_with(const void* code) {
  Dl_info info{};
  return dladdr(code, &info) != 0 && info.dli_fname != nullptr ? info.dli_fname : "";
}

/// Names of the files in the folder in which `name` would lie, with its own folder before them.
std::vector<std::string> neighbours(const fs::path& folder, const fs::path& name) {
  std::error_code none;
  std::vector<std::string> out;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / name.parent_path(), none))
    out.push_back((name.parent_path() / entry.path().filename()).string());
  std::ranges::sort(out);
  return out;
}

}  // namespace

std::vector<fs::path> shipped_scenes() {
  std::error_code none;
  std::vector<fs::path> out;
  static const char kHere = 0;
  for (const fs::path& binary : {fs::read_symlink("/proc/self/exe", none), binary_with(&kHere)})
    for (const char* const from : {"scenes", "../share/tangere/scenes", "../../scenes"}) {
      const fs::path folder = (binary.parent_path() / from).lexically_normal();
      if (binary.has_parent_path() && fs::is_directory(folder / "sensors", none) &&
          std::ranges::count(out, folder) == 0)
        out.push_back(folder);
    }
  return out;
}

std::string find_scene_file(const std::string& name, std::span<const fs::path> folders) {
  std::error_code none;
  for (const fs::path& folder : folders) {
    const fs::path path = (folder / name).lexically_normal();
    if (fs::exists(path, none)) return path.string();
  }
  if (fs::path(name).is_absolute() || folders.size() == 1)
    return (folders[0] / name).lexically_normal().string();
  std::string places;
  std::vector<std::string> others;
  for (const fs::path& folder : folders) {
    places += fmt::format("{}'{}'", places.empty() ? "" : ", ",
                          folder.empty() ? std::string(".") : folder.string());
    std::ranges::copy(neighbours(folder, name), std::back_inserter(others));
  }
  throw IoError(fmt::format("'{}' is in none of {}; expected a file in one of them{}", name, places,
                            suggestion(name, others)));
}

}  // namespace tangere
