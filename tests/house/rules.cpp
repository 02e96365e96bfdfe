// SPDX-License-Identifier: Apache-2.0
// Checks line by line. The preprocessor also reads includes by line, so no parser is needed.
#include "tests/house/rules.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>

namespace tangere::house {
namespace fs = std::filesystem;
namespace {
using Names = std::set<std::string, std::less<>>;

struct Folder {
  Names may_include;        ///< folders
  Names foreign_libraries;  ///< that belong elsewhere: beginnings of the names between < and >
};

/// A folder whose own folders have rows has no row itself, because each source is in one of them.
/// In a row, "kernels" stands for all of its folders.
const std::map<std::string, Folder, std::less<>>& folders() {
  static const Names of_kernels{"Eigen",    "tbb", "oneapi", "hdf5",     "H5",
                                "tinyxml2", "CLI", "fmt",    "nlohmann", "png"};
  static const Names of_engine{"hdf5", "H5", "tinyxml2", "CLI", "nlohmann", "png"};
  static const Names of_tasks{"hdf5", "H5", "tinyxml2", "CLI", "nlohmann", "xsimd", "png"};
  static const Names of_apps{"hdf5", "H5", "tinyxml2", "xsimd", "png"};
  static const Names of_io{"CLI", "tbb", "oneapi", "xsimd"};
  static const std::map<std::string, Folder, std::less<>> table{
      {"kernels/numbers", {{}, of_kernels}},
      {"kernels/contact", {{"kernels/numbers"}, of_kernels}},
      {"kernels/tactile", {{"kernels/contact", "kernels/numbers"}, of_kernels}},
      {"kernels/step", {{"kernels/tactile", "kernels/contact", "kernels/numbers"}, of_kernels}},
      {"kernels/reverse",
       {{"kernels/step", "kernels/tactile", "kernels/contact", "kernels/numbers"}, of_kernels}},
      {"kernels/shear",
       {{"kernels/reverse", "kernels/step", "kernels/tactile", "kernels/contact",
         "kernels/numbers"},
        of_kernels}},
      {"kernels/layer", {{"kernels/contact", "kernels/numbers"}, of_kernels}},
      {"kernels/table", {{"kernels"}, of_kernels}},
      {"engine/base", {{}, of_engine}},
      {"engine/scene", {{"engine/base", "kernels"}, of_engine}},
      {"engine/model", {{"engine/scene", "engine/base", "kernels"}, of_engine}},
      {"engine/layer", {{"engine/model", "engine/scene", "engine/base", "kernels"}, of_engine}},
      {"engine/step",
       {{"engine/layer", "engine/model", "engine/scene", "engine/base", "kernels"}, of_engine}},
      {"engine/picture", {{"engine/model", "engine/scene", "engine/base", "kernels"}, of_engine}},
      {"engine/sense",
       {{"engine/picture", "engine/step", "engine/layer", "engine/model", "engine/scene",
         "engine/base", "kernels"},
        of_engine}},
      {"engine/derivative",
       {{"engine/sense", "engine/picture", "engine/step", "engine/layer", "engine/model",
         "engine/scene", "engine/base", "kernels"},
        of_engine}},
      {"engine/rows", {{"engine/step", "engine/model", "engine/scene", "engine/base"}, of_engine}},
      {"tasks/catalogue", {{"engine", "kernels"}, of_tasks}},
      {"tasks/run", {{"tasks/catalogue", "engine", "kernels"}, of_tasks}},
      {"tasks/gradients", {{"tasks/run", "tasks/catalogue", "engine", "kernels"}, of_tasks}},
      {"tasks/calibration", {{"engine", "kernels"}, of_tasks}},
      {"tasks/accuracy",
       {{"tasks/gradients", "tasks/run", "tasks/catalogue", "engine", "kernels"}, of_tasks}},
      {"tasks/stress", {{"tasks/run", "engine", "kernels"}, of_tasks}},
      {"tasks/effects", {{"tasks/run", "engine", "kernels"}, of_tasks}},
      {"io/files", {{"engine"}, of_io}},
      {"io/scene", {{"io/files", "engine", "kernels"}, of_io}},
      {"io/robot", {{"io/scene", "io/files", "engine"}, of_io}},
      {"io/hdf5", {{"io/files", "engine"}, of_io}},
      {"io/trajectory", {{"io/hdf5", "io/files", "engine"}, of_io}},
      {"io/dataset", {{"io/trajectory", "io/scene", "io/hdf5", "io/files", "engine"}, of_io}},
      {"io/export", {{"io/hdf5", "io/files", "engine"}, of_io}},
      {"io/picture", {{"io/trajectory", "io/files", "engine"}, of_io}},
      {"io/view",
       {{"io/picture", "io/dataset", "io/trajectory", "io/scene", "io/hdf5", "io/files", "engine"},
        of_io}},
      {"apps", {{"tasks", "io", "engine", "kernels"}, of_apps}},
      {"python/module", {{"tasks", "io", "engine", "kernels"}, of_apps}},
      {"cmake", {{}, {}}},
      {"bench", {{"tasks", "io", "engine", "kernels"}, {}}},
      {"tests", {{"apps", "tasks", "io", "engine", "kernels"}, {}}},
      {"examples", {{"apps", "tasks", "io", "engine"}, {"xsimd", "hdf5", "H5", "tinyxml2"}}}};
  return table;
}

struct Include {
  int line;
  bool quoted;
  std::string name;
};

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::vector<Include> includes_of(const std::string& text) {
  static const std::regex pattern(R"re(^\s*#\s*include\s*(["<])([^">]+)[">])re");
  std::vector<Include> found;
  int number = 0;
  for (const std::string& line : lines_of(text)) {
    ++number;
    std::smatch match;
    if (line.find("include") != std::string::npos && std::regex_search(line, match, pattern))
      found.push_back({number, match[1] == "\"", match[2]});
  }
  return found;
}

std::string top_of(std::string_view path) { return std::string(path.substr(0, path.find('/'))); }
/// The row of folders() that a file belongs to: "engine/model", "apps"; "" if there is none.
std::string folder_of(std::string_view path) {
  std::string top = top_of(path);
  if (folders().contains(top)) return top;
  const std::string folder(path.substr(0, path.find('/', std::min(top.size() + 1, path.size()))));
  return folders().contains(folder) ? folder : "";
}
bool may_include(const std::string& from, const std::string& to) {
  const Names& names = folders().at(from).may_include;
  return from == to || names.contains(to) || names.contains(top_of(to));
}
bool ends_with_any(std::string_view path, std::initializer_list<std::string_view> ends) {
  return std::any_of(ends.begin(), ends.end(),
                     [&](std::string_view end) { return path.ends_with(end); });
}
bool is_cpp(std::string_view path) { return ends_with_any(path, {".cpp", ".hpp", ".h", ".c"}); }
bool is_script(std::string_view path) {
  const std::string_view name = path.substr(path.rfind('/') + 1);
  return ends_with_any(path, {".cmake", ".cmake.in", ".sh", ".py", ".js"}) ||
         name == "CMakeLists.txt" || name.starts_with("run-") || name == "dev" || path == ".ci/run";
}

/// The file that a quoted include names; "" if there is none.
std::string resolve(const Tree& tree, const std::string& from, const std::string& name) {
  if (tree.contains(name)) return name;
  const std::string beside = from.substr(0, from.rfind('/') + 1) + name;
  return tree.contains(beside) ? beside : "";
}

constexpr const char* kUmbrella = "apps/tangere.hpp";

/// A header and all project files that it includes, directly or not.
Names headers_behind(const Tree& tree, const std::string& path) {
  std::vector<std::string> waiting{path};
  Names seen{path};
  while (!waiting.empty()) {
    const std::string from = waiting.back();
    waiting.pop_back();
    const auto file = tree.find(from);
    if (file == tree.end()) continue;
    for (const Include& include : includes_of(file->second)) {
      const std::string target = include.quoted ? resolve(tree, from, include.name) : "";
      if (!target.empty() && seen.insert(target).second) waiting.push_back(target);
    }
  }
  return seen;
}

/// Everything between < and > in a file and in all project files that it includes.
Names libraries_behind(const Tree& tree, const std::string& path) {
  std::vector<std::string> waiting{path};
  Names seen{path}, libraries;
  while (!waiting.empty()) {
    const std::string at = waiting.back();
    waiting.pop_back();
    for (const Include& include : includes_of(tree.find(at)->second)) {
      const std::string target = include.quoted ? resolve(tree, at, include.name) : "";
      if (!include.quoted) libraries.insert(include.name);
      if (!target.empty() && seen.insert(target).second) waiting.push_back(target);
    }
  }
  return libraries;
}

bool is_tested_source(std::string_view path) {
  return path.ends_with(".cpp") &&
         Names{"kernels", "engine", "tasks", "io", "apps"}.contains(top_of(path));
}

void check_quoted(const Tree& tree, const std::string& path, const Include& include,
                  std::vector<Violation>& found) {
  const std::string target = resolve(tree, path, include.name);
  if (target.empty()) {
    found.push_back(
        {path, include.line, "includes \"" + include.name + "\", which is no file of the project"});
    return;
  }
  const std::string from = folder_of(path), to = folder_of(target);
  if (!may_include(from, to))
    found.push_back(
        {path, include.line, from + " must not include " + to + " (\"" + include.name + "\")"});
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const Violation& violation) {
  out << violation.file;
  if (violation.line > 0) out << ':' << violation.line;
  return out << ": " << violation.message;
}

Tree read_tree(const fs::path& root) {
  Tree tree;
  const auto add = [&](const fs::path& path) {
    const std::string name = path.lexically_relative(root).generic_string();
    if (!is_cpp(name) && !is_script(name) &&
        !ends_with_any(name, {".md", ".txt", ".xml", ".json", ".ipynb", ".svg", ".png", ".csv"}))
      return;
    std::ifstream file(path, std::ios::binary);
    tree[name] = std::string(std::istreambuf_iterator<char>(file), {});
    if (!file) throw std::runtime_error("cannot read " + path.string());
  };
  for (auto entry = fs::recursive_directory_iterator(root);
       entry != fs::recursive_directory_iterator(); ++entry) {
    const std::string name = entry->path().filename().string();
    const bool generated = entry.depth() == 0 && (name == "build" || name == "out");
    if (entry->is_directory() && (name.starts_with('.') || name == "__pycache__" || generated))
      entry.disable_recursion_pending();
    else if (entry->is_regular_file())
      add(entry->path());
  }
  if (fs::exists(root / ".ci/run")) add(root / ".ci/run");
  return tree;
}

std::vector<Violation> check_includes(const Tree& tree) {
  std::vector<Violation> found;
  for (const auto& [path, text] : tree) {
    if (!is_cpp(path)) continue;
    const auto folder = folders().find(folder_of(path));
    if (folder == folders().end()) {
      found.push_back(
          {path, 0,
           "sources in a folder that tests/house/rules.cpp does not know; add it to the table"});
      continue;
    }
    for (const Include& include : includes_of(text)) {
      if (include.quoted) {
        check_quoted(tree, path, include, found);
        continue;
      }
      for (const std::string& library : folder->second.foreign_libraries)
        if (include.name.starts_with(library))
          found.push_back(
              {path, include.line, folder->first + " must not include <" + include.name + ">"});
    }
  }
  return found;
}

std::vector<Violation> check_kernel_includes(const Tree& tree) {
  static const Names harmless{"array",       "cfloat",      "cmath",          "cstddef", "cstdint",
                              "cstring",     "immintrin.h", "limits",         "new",     "span",
                              "type_traits", "utility",     "xsimd/xsimd.hpp"};
  std::vector<std::string> waiting;
  for (const auto& [path, text] : tree)
    if (path.starts_with("kernels/table/") && path.ends_with("_part.hpp")) waiting.push_back(path);
  if (waiting.empty()) return {{"kernels/table", 0, "has no part that is compiled once per set"}};
  std::set<std::string> seen(waiting.begin(), waiting.end());
  std::vector<Violation> found;
  while (!waiting.empty()) {
    const std::string path = waiting.back();
    waiting.pop_back();
    for (const Include& include : includes_of(tree.find(path)->second)) {
      const std::string target = include.quoted ? resolve(tree, path, include.name) : "";
      if (!target.empty() && seen.insert(target).second) waiting.push_back(target);
      if (!include.quoted && !harmless.contains(include.name))
        found.push_back(
            {path, include.line,
             "compiled once per instruction set, so it must not include <" + include.name + ">"});
    }
  }
  return found;
}

std::vector<Violation> check_public_headers(const Tree& tree) {
  if (!tree.contains(kUmbrella)) return {{kUmbrella, 0, "is missing"}};
  std::vector<Violation> found;
  for (const std::string& path : headers_behind(tree, kUmbrella)) {
    for (const Include& include : includes_of(tree.at(path))) {
      if (include.quoted && !tree.contains(include.name))
        found.push_back(
            {path, include.line, "includes " + include.name + ", which does not exist"});
      else if (!include.quoted && include.name.find_first_of("./") != std::string::npos)
        found.push_back({path, include.line, "is installed, and needs <" + include.name + ">"});
    }
  }
  return found;
}

std::vector<Violation> check_private_headers(const Tree& tree) {
  // What knows the arrays of a compiled model is private to the engine, and so are kernels.
  const std::string arrays = "engine/model/compiled_model.hpp";
  const Names installed = headers_behind(tree, kUmbrella);
  std::vector<Violation> found;
  for (const auto& [path, text] : tree) {
    const std::string from = top_of(path);
    if (!is_cpp(path) || from == "engine" || from == "kernels" || from == "tests" ||
        from == "bench" || from == "cmake")
      continue;
    for (const Include& include : includes_of(text)) {
      const std::string target = include.quoted ? resolve(tree, path, include.name) : "";
      const std::string to = top_of(target);
      if (installed.contains(target) || (to != "engine" && to != "kernels")) continue;
      if (to == "kernels" || headers_behind(tree, target).contains(arrays))
        found.push_back(
            {path, include.line, "includes \"" + target + "\", which is private to " + to});
    }
  }
  return found;
}

std::vector<Violation> check_heavy_headers(const Tree& tree) {
  // Each costs the compiler up to four seconds. Values: sources of a folder that may reach it.
  static const std::map<std::string, std::map<std::string, int>> allowed{
      {"CLI/", {{"apps", 1}}},
      {"Eigen/",
       {{"engine/derivative", 1},
        {"engine/step", 1},
        {"tasks/calibration", 3},
        {"tasks/catalogue", 1},
        {"tasks/gradients", 1}}},
      {"hdf5.h", {{"io/hdf5", 10}, {"io/dataset", 11}, {"io/trajectory", 6}, {"io/view", 4}}},
      {"nlohmann/json.hpp", {{"apps", 34}, {"io/dataset", 2}, {"io/export", 1}, {"io/view", 1}}},
      {"tbb/flow_graph.h", {{"tasks/run", 1}}},
      {"regex", {}},
      {"iostream", {}}};
  std::map<std::pair<std::string, std::string>, int> count;  // header, folder
  std::vector<Violation> found;
  for (const auto& [path, text] : tree) {
    if (!is_tested_source(path)) continue;
    const std::string folder = folder_of(path);
    const Names libraries = libraries_behind(tree, path);
    for (const auto& [header, folders] : allowed) {
      const auto reached = libraries.lower_bound(header);
      if (reached == libraries.end() || !reached->starts_with(header)) continue;
      const auto most = folders.find(folder);
      const int sources = ++count[{header, folder}],
                limit = most == folders.end() ? 0 : most->second;
      if (sources == limit + 1)
        found.push_back({path, 0,
                         "one source too many of " + folder + " to reach <" + *reached +
                             ">, which takes long to compile; allowed: " + std::to_string(limit)});
    }
  }
  return found;
}

std::vector<Violation> check_own_headers(const Tree& tree) {
  static const std::map<std::string, std::string> shared{
      {"apps/bench.cpp", "a subcommand: apps/command.hpp"},
      {"apps/calibrate.cpp", "a subcommand: apps/command.hpp"},
      {"apps/export.cpp", "a subcommand: apps/command.hpp"},
      {"apps/generate.cpp", "a subcommand: apps/command.hpp"},
      {"apps/gradcheck.cpp", "a subcommand: apps/command.hpp"},
      {"apps/accuracy.cpp", "a subcommand: apps/command.hpp"},
      {"apps/skin.cpp", "a subcommand: apps/command.hpp"},
      {"apps/stress.cpp", "a subcommand: apps/command.hpp"},
      {"apps/identify.cpp", "a subcommand: apps/command.hpp"},
      {"apps/import.cpp", "a subcommand: apps/command.hpp"},
      {"apps/info.cpp", "a subcommand: apps/command.hpp"},
      {"apps/inspect.cpp", "a subcommand: apps/command.hpp"},
      {"apps/main.cpp", "a program"},
      {"apps/merge.cpp", "a subcommand: apps/command.hpp"},
      {"apps/plot.cpp", "a subcommand: apps/command.hpp"},
      {"apps/simulate.cpp", "a subcommand: apps/command.hpp"},
      {"apps/validate.cpp", "a subcommand: apps/command.hpp"},
      {"apps/view.cpp", "a subcommand: apps/command.hpp"},
      {"engine/picture/mesh_view.cpp", "a part of scene_view.hpp"},
      {"engine/scene/schema_elements.cpp", "a part of schema.hpp"},
      {"io/hdf5/h5_values.cpp", "a part of h5.hpp"},
      {"io/view/view_dataset.cpp", "a part of view_source.hpp"},
      {"io/view/view_trajectory.cpp", "a part of view_source.hpp"},
      {"io/scene/scene_bodies.cpp", "a part of scene_sections.hpp"},
      {"io/scene/scene_end_effectors.cpp", "a part of scene_sections.hpp"},
      {"io/scene/scene_joints.cpp", "a part of scene_sections.hpp"},
      {"io/scene/scene_runs.cpp", "a part of scene_sections.hpp"},
      {"io/scene/scene_sensors.cpp", "a part of scene_sections.hpp"},
      {"io/scene/scene_transmissions.cpp", "a part of scene_sections.hpp"},
      {"tasks/gradients/loss_check.cpp", "a part of gradient_check.hpp"},
      {"tasks/gradients/return_check.cpp", "a part of gradient_check.hpp"}};
  std::vector<Violation> found;
  for (const auto& [path, text] : tree) {
    // Every task is declared in task_list.hpp.
    const bool is_part = shared.contains(path) || path.starts_with("io/robot/mjcf_") ||
                         path.starts_with("tasks/catalogue/");
    if (!is_tested_source(path) || is_part) continue;
    const std::string header = path.substr(0, path.size() - 3) + "hpp";
    if (!tree.contains(header))
      found.push_back(
          {path, 0,
           "has no header " + header + "; expected one, or a reason in tests/house/rules.cpp"});
  }
  return found;
}

namespace {
/// A source and its header are one room: "engine/model/shapes". Values: rooms that it includes.
using Rooms = std::map<std::string, Names, std::less<>>;
Rooms rooms_of(const Tree& tree) {
  static const Names tops{"kernels", "engine", "tasks", "io", "apps", "python"};
  Rooms rooms;
  for (const auto& [path, text] : tree) {
    if (!is_cpp(path) || !tops.contains(top_of(path))) continue;
    const std::string room = path.substr(0, path.rfind('.'));
    rooms[room];
    for (const Include& include : includes_of(text)) {
      const std::string target = include.quoted ? resolve(tree, path, include.name) : "";
      const std::string other = target.substr(0, target.rfind('.'));
      if (!target.empty() && other != room) rooms[room].insert(other);
    }
  }
  return rooms;
}

/// Finds the rooms that reach each other, by Tarjan's algorithm.
class Circles {
 public:
  explicit Circles(const Rooms& rooms) : rooms_(rooms) {
    for (const auto& [room, others] : rooms)
      if (!seen_.contains(room)) visit(room);
  }
  std::set<Names> found;

 private:
  int visit(const std::string& room) {  // NOLINT(misc-no-recursion)
    const int own = seen_[room] = static_cast<int>(seen_.size());
    int lowest = own;
    waiting_.push_back(room);
    if (const auto at = rooms_.find(room); at != rooms_.end())
      for (const std::string& other : at->second) {
        if (!seen_.contains(other)) {
          lowest = std::min(lowest, visit(other));
        } else if (std::find(waiting_.begin(), waiting_.end(), other) != waiting_.end()) {
          lowest = std::min(lowest, seen_[other]);
        }
      }
    if (lowest < own) return lowest;
    const auto first = std::find(waiting_.begin(), waiting_.end(), room);
    if (waiting_.end() - first > 1) found.emplace(first, waiting_.end());
    waiting_.erase(first, waiting_.end());
    return lowest;
  }
  const Rooms& rooms_;
  std::map<std::string, int, std::less<>> seen_;
  std::vector<std::string> waiting_;
};

std::string listed(const Names& rooms) {
  std::string text;
  for (const std::string& room : rooms) text += (text.empty() ? "" : ", ") + room;
  return text;
}

}  // namespace

std::vector<Violation> check_circles(const Tree& tree) {
  // Of a listed pair, one is a part of the other in a file of its own.
  static const std::set<Names> allowed{
      {"engine/derivative/dual_stage", "engine/derivative/dual_stage_impl"},
      {"engine/sense/readout", "engine/sense/readout_impl"},
      {"io/picture/scene_plot", "io/picture/projection"},
      {"io/robot/robot_import", "io/robot/robot_pads"},
      {"io/robot/robot_node", "io/robot/mjcf_include"},
      {"io/scene/scene_node", "io/scene/included_file"},
      {"tasks/accuracy/accuracy_run", "tasks/accuracy/gradient_run"},
  };
  const Rooms rooms = rooms_of(tree);
  const std::set<Names> found = Circles(rooms).found;
  std::vector<Violation> violations;
  for (const Names& circle : found)
    if (!allowed.contains(circle))
      violations.push_back({*circle.begin(), 0,
                            "includes in a circle: " + listed(circle) +
                                "; give what they share a header of its own"});
  for (const Names& circle : allowed)
    if (!found.contains(circle) && std::all_of(circle.begin(), circle.end(), [&](const auto& room) {
          return rooms.contains(room);
        }))
      violations.push_back({*circle.begin(), 0,
                            "is listed as a circle, but is none: " + listed(circle) +
                                "; take it off the list in tests/house/rules.cpp"});
  return violations;
}

constexpr std::ptrdiff_t kMostColumns = 100, kMostScriptColumns = 120;  // shell and CMake

/// Characters of a line: bytes of UTF-8 that begin one. Marks above letters (U+0300 to U+036F) take
/// no column; their first byte is 0xCC or 0xCD.
static std::ptrdiff_t columns_of(const std::string& line) {
  return std::count_if(line.begin(), line.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte & 0xC0U) != 0x80U && byte != 0xCCU && byte != 0xCDU;
  });
}

/// Complains about a line that has too many columns.
static void check_columns(const std::string& path, int number, const std::string& line,
                          std::ptrdiff_t most, std::vector<Violation>& found) {
  if (const std::ptrdiff_t columns = columns_of(line); columns > most)
    found.push_back(
        {path, number, std::to_string(columns) + " columns, at most " + std::to_string(most)});
}

/// Finds names that begin with of_ or by_ outside of texts: they say a relation and no quantity.
static void check_names(const std::string& path, int number, const std::string& line,
                        std::vector<Violation>& found) {
  static const std::regex kRelation("(^|[^A-Za-z0-9_\"])((of|by)_[a-z]\\w*)");
  if (std::smatch match; std::regex_search(line, match, kRelation))
    found.push_back({path, number, "'" + match.str(2) + "'; expected the name of a quantity"});
}

std::vector<Violation> check_sources(const Tree& tree) {
  constexpr std::size_t kMostLines = 600;
  std::vector<Violation> found;
  for (const auto& [path, text] : tree) {
    if (!is_cpp(path) && !is_script(path)) continue;
    const std::vector<std::string> lines = lines_of(text);
    if (lines.size() > kMostLines)
      found.push_back(
          {path, 0,
           std::to_string(lines.size()) + " lines, at most " + std::to_string(kMostLines)});
    // Scripts may start with "#!" and an instruction to a tool.
    const std::size_t head = is_cpp(path) ? 1 : 3;
    const auto spdx =
        std::find_if(lines.begin(), lines.begin() + std::ptrdiff_t(std::min(head, lines.size())),
                     [](const std::string& line) {
                       return line.find("SPDX-License-Identifier: Apache-2.0") != std::string::npos;
                     });
    if (spdx == lines.begin() + std::ptrdiff_t(std::min(head, lines.size())))
      found.push_back({path, 1, "has no line 'SPDX-License-Identifier: Apache-2.0' at its head"});
    const bool narrow = is_cpp(path) || ends_with_any(path, {".js", ".py"});
    for (std::size_t i = 0; i < lines.size(); ++i)
      check_columns(path, static_cast<int>(i) + 1, lines[i],
                    narrow ? kMostColumns : kMostScriptColumns, found);
    if (is_cpp(path) && top_of(path) != "tests" && top_of(path) != "examples")
      for (std::size_t i = 0; i < lines.size(); ++i)
        check_names(path, static_cast<int>(i) + 1, lines[i], found);
    if (is_cpp(path) && (lines.size() < 2 || !lines[1].starts_with("//")))
      found.push_back({path, 2, "expected a comment that says why the file exists"});
  }
  return found;
}

/// The folder whose README.md speaks of a source: its own. The folders of an area of the tests
/// mirror those of the sources, and each example is one project. So the page of the area speaks for
/// the former, and that of `examples` for the latter.
static std::string documented_by(const std::string& path) {
  const std::string top = top_of(path);
  if (top == "examples") return top;
  const std::size_t end =
      top == "tests" ? path.find('/', std::min(top.size() + 1, path.size())) : path.rfind('/');
  return path.substr(0, end == std::string::npos ? top.size() : end);
}

std::vector<Violation> check_documents(const Tree& tree) {
  std::vector<Violation> found;
  Names top;
  for (const auto& [path, text] : tree)
    if (path.find('/') != std::string::npos && !path.starts_with('.')) {
      top.insert(top_of(path));
      if (is_cpp(path) || ends_with_any(path, {".py", ".js"})) top.insert(documented_by(path));
    }
  for (const std::string& folder : top) {
    const auto readme = tree.find(folder + "/README.md");
    if (readme == tree.end())
      found.push_back({folder, 0, "has no README.md"});
    else if (lines_of(readme->second).size() < 3)
      found.push_back({readme->first, 0, "says nothing"});
  }
  static const std::regex link(R"re(\]\(([^)#\s]+)[^)]*\))re");
  for (const auto& [path, text] : tree) {
    if (!path.ends_with(".md")) continue;
    int number = 0;
    for (const std::string& line : lines_of(text)) {
      ++number;
      if (line.starts_with('|')) check_columns(path, number, line, kMostColumns, found);
      for (std::sregex_iterator match(line.begin(), line.end(), link), end; match != end; ++match) {
        const std::string target = (*match)[1];
        if (target.find("://") != std::string::npos || target.starts_with("mailto:")) continue;
        std::string there =
            (fs::path(path).parent_path() / target).lexically_normal().generic_string();
        while (there.ends_with('/')) there.pop_back();
        const auto at = tree.lower_bound(there);
        const bool folder = at != tree.end() && at->first.starts_with(there + "/");
        const bool extensionless = there == "LICENSE" || there.starts_with(".");
        if (!tree.contains(there) && !folder && !extensionless)
          found.push_back({path, number, "links to " + target + ", which does not exist"});
      }
    }
  }
  return found;
}

}  // namespace tangere::house
