// SPDX-License-Identifier: Apache-2.0
// What the formats say of themselves: files of JSON, of Zarr the list of the ends of episodes, of
// UniVTAC the arrays of one file of HDF5.
#include "io/export/exported_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <span>

#include "engine/base/error.hpp"
#include "io/export/json_file.hpp"
#include "io/files/text_file.hpp"
#include "io/hdf5/h5_arrays.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestList = std::size_t{1} << 32;
constexpr const char* kSeconds = "seconds_per_frame";

[[noreturn]] void damaged(const fs::path& file, const std::string& reason) {
  throw IoError(fmt::format("'{}' is damaged: {}", file.string(), reason));
}

JsonFile notes_of(const fs::path& folder, const char* name, const char* format) {
  if (!fs::is_regular_file(folder / name))
    throw IoError(
        fmt::format("'{}' has no {}: it is a {} that 'tangere export' did not write, or a part of "
                    "one; expected an export of a data set",
                    folder.string(), name, format));
  return JsonFile((folder / name).string());
}

void add_source(const JsonFile& notes, ExportedSet& set) {
  set.stored = stored_files(notes);
  if (notes.has({"command"})) set.command = notes.text({"command"});
  if (notes.has({"tangere_version"})) set.tangere_version = notes.text({"tangere_version"});
}

/// Counts files and bytes.
void add_sizes(const fs::path& path, ExportedSet& set) {
  if (fs::is_regular_file(path)) {
    set.files = 1, set.bytes = fs::file_size(path);
    return;
  }
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path))
    if (entry.is_regular_file()) ++set.files, set.bytes += entry.file_size();
}

void check_demos(const JsonFile& notes, const ExportedSet& set) {
  const std::size_t demos = notes.texts({"demos"}).size();
  if (static_cast<std::int64_t>(demos) != set.episodes)
    damaged(notes.path(), fmt::format("it names {} demos; expected {}, one for each episode", demos,
                                      set.episodes));
}

/// The frames that an export counts in two places, or as the sum of the steps of its episodes.
void check_frames(const JsonFile& notes, const ExportedSet& set, const fs::path& other) {
  if (!notes.has({"frames"})) return;
  const std::int64_t frames = notes.count({"frames"});
  if (frames != set.frames && other == notes.path())
    damaged(other, fmt::format("its episodes have {} steps; expected {}, its 'frames'", set.frames,
                               frames));
  if (frames != set.frames)
    damaged(other, fmt::format("it counts {} frames; expected {}, as '{}' does", set.frames, frames,
                               notes.path()));
}

ExportedSet read_lerobot(const fs::path& folder) {
  const JsonFile notes = notes_of(folder, "meta/tangere.json", "LeRobot data set"),
                 info((folder / "meta/info.json").string());
  ExportedSet set;
  set.format = "lerobot";
  set.title = "LeRobotDataset " + info.text({"codebase_version"});
  set.episodes = info.count({"total_episodes"});
  set.frames = info.count({"total_frames"});
  set.seconds_per_frame = notes.number({"seconds_per_action"});
  add_source(notes, set);
  check_demos(notes, set);
  check_frames(notes, set, info.path());
  for (const std::string& name : info.keys_of({"features"})) {
    ExportedArray& array = set.arrays.emplace_back();
    array.name = name;
    array.type = info.text({"features", name, "dtype"});
    array.shape = info.counts({"features", name, "shape"});
    if (notes.has({"units", name})) array.unit = notes.text({"units", name});
  }
  for (const char* name :
       {"meta/stats.json", "meta/tasks.parquet", "meta/episodes/chunk-000/file-000.parquet",
        "data/chunk-000/file-000.parquet"})
    if (!fs::is_regular_file(folder / name))
      throw IoError(fmt::format("'{}' has no {}; expected it in every LeRobot data set",
                                folder.string(), name));
  return set;
}

/// "float32" of "<f4".
std::string type_of_zarr(const JsonFile& array) {
  const std::string type = array.text({"dtype"});
  const std::map<char, const char*> words{{'f', "float"}, {'i', "int"}, {'u', "uint"}};
  if (type.size() < 3) damaged(array.path(), fmt::format("its dtype is '{}'", type));
  if (type[1] == 'b') return "bool";
  if (type[1] == 'U' || type[1] == 'S') return "text";
  const auto word = words.find(type[1]);
  if (word == words.end()) damaged(array.path(), fmt::format("its dtype is '{}'", type));
  return fmt::format("{}{}", word->second, 8 * std::atoi(type.c_str() + 2));
}

/// The frame after the last one of each episode, which the exporter stores without compression.
std::vector<std::int64_t> ends_of_zarr(const fs::path& folder) {
  const fs::path place = folder / "meta/episode_ends";
  const JsonFile about((place / ".zarray").string());
  const std::vector<std::uint64_t> shape = about.counts({"shape"});
  if (shape.size() != 1 || about.text({"dtype"}) != "<i8")
    damaged(about.path(), "expected a list of int64");
  const std::string bytes =
      read_text_file((place / "0").string(), kLargestList, "the ends of episodes");
  std::vector<std::int64_t> ends(bytes.size() / sizeof(std::int64_t));
  if (bytes.size() != shape[0] * sizeof(std::int64_t))
    damaged(place / "0",
            fmt::format("it has {} bytes; expected {} numbers of 8 bytes", bytes.size(), shape[0]));
  std::memcpy(ends.data(), bytes.data(), bytes.size());
  std::int64_t before = 0;
  for (const std::int64_t end : ends) {
    if (end <= before) damaged(place / "0", "expected ascending ends of episodes");
    before = end;
  }
  return ends;
}

ExportedSet read_zarr(const fs::path& folder) {
  const JsonFile notes = notes_of(folder, ".zattrs", "Zarr store");
  if (!notes.has({"tangere_version"}) || !fs::is_directory(folder / "data"))
    throw IoError(
        fmt::format("'{}' is a Zarr store that 'tangere export' did not write; expected "
                    "an export of a data set",
                    folder.string()));
  ExportedSet set;
  const bool is_ftp1 = fs::exists(folder / "data/sub_task_instruction");
  set.format = is_ftp1 ? "ftp1" : "zarr";
  set.title = is_ftp1 ? "Zarr with FTP-1's keys" : "Zarr, version 2 of the format";
  set.seconds_per_frame = notes.number({kSeconds});
  add_source(notes, set);
  const std::vector<std::int64_t> ends = ends_of_zarr(folder);
  set.episodes = std::ssize(ends);
  set.frames = ends.empty() ? 0 : ends.back();
  check_demos(notes, set);
  check_frames(notes, set, folder / "meta/episode_ends");
  std::vector<fs::path> places;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / "data"))
    if (entry.is_directory()) places.push_back(entry.path());
  std::sort(places.begin(), places.end());
  for (const fs::path& place : places) {
    const JsonFile about((place / ".zarray").string());
    std::vector<std::uint64_t> shape = about.counts({"shape"});
    if (shape.empty() || static_cast<std::int64_t>(shape[0]) != set.frames)
      damaged(about.path(), fmt::format("it has {} rows; expected {}, the frames of all episodes",
                                        shape.empty() ? 0 : shape[0], set.frames));
    ExportedArray array{"data/" + place.filename().string(),
                        type_of_zarr(about),
                        {shape.begin() + 1, shape.end()},
                        ""};
    if (fs::is_regular_file(place / ".zattrs")) {
      const JsonFile said((place / ".zattrs").string());
      if (said.has({"unit"})) array.unit = said.text({"unit"});
    }
    set.arrays.push_back(std::move(array));
  }
  return set;
}

ExportedSet read_univtac(const fs::path& folder) {
  const JsonFile notes = notes_of(folder, "metadata.json", "UniVTAC data set");
  if (!notes.has({"tangere_version"}) || !notes.has({"datasets"}))
    throw IoError(
        fmt::format("'{}' is a UniVTAC data set that 'tangere export' did not write; expected an "
                    "export of a data set",
                    folder.string()));
  ExportedSet set;
  set.format = "univtac", set.title = "UniVTAC, a file of HDF5 for each episode";
  set.seconds_per_frame = notes.number({kSeconds});
  add_source(notes, set);
  const std::vector<std::int64_t> steps = notes.counts_of_list({"episodes"}, "steps");
  set.episodes = std::ssize(steps);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    set.frames += steps[i];
    if (!fs::is_regular_file(folder / fmt::format("hdf5/{}.hdf5", i)))
      throw IoError(fmt::format("'{}' has no hdf5/{}.hdf5; expected {} files of episodes",
                                folder.string(), i, steps.size()));
  }
  check_frames(notes, set, notes.path());
  if (steps.empty()) return set;
  const fs::path first = folder / "hdf5/0.hdf5";
  for (const h5::ArrayFacts& facts : h5::arrays_of(first.string(), notes.texts({"datasets"}))) {
    const std::uint64_t rows = facts.dims.empty() ? 0 : facts.dims[0];
    if (facts.dims.empty() || static_cast<std::int64_t>(rows) != steps[0])
      damaged(first, fmt::format("'{}' has {} rows; expected {}", facts.name, rows, steps[0]));
    ExportedArray array{facts.name, facts.type, {facts.dims.begin() + 1, facts.dims.end()}, ""};
    if (notes.has({"units", facts.name})) array.unit = notes.text({"units", facts.name});
    set.arrays.push_back(std::move(array));
  }
  return set;
}

/// The number before a word of the title of a table, such as "2000" of " rows"; none: no such word.
std::optional<std::int64_t> counted(const std::string& title, const std::string& word) {
  const std::size_t end = title.rfind(word);
  if (end == std::string::npos || end == 0) return {};
  const std::size_t begin = title.find_last_not_of("0123456789", end - 1);
  std::int64_t count = 0;
  const char* const from = title.data() + (begin == std::string::npos ? 0 : begin + 1);
  const auto [at, error] = std::from_chars(from, title.data() + end, count);
  if (error != std::errc() || at != title.data() + end) return {};
  return count;
}

/// Rows and episodes that a table should have, and who says so.
struct TableCounts {
  std::optional<std::int64_t> rows, episodes;
  std::string source;
};

/// A table whose end is missing has fewer rows than are counted, or no end of the last line.
void check_table(const fs::path& path, std::int64_t lines, bool ends, const TableCounts& counts,
                 const ExportedSet& set) {
  if (set.frames > 0 && !ends)
    damaged(path, fmt::format("line {} does not end; expected rows that do", lines));
  if (counts.rows && counts.episodes &&
      (*counts.rows != set.frames || *counts.episodes != set.episodes))
    damaged(path, fmt::format("it has {} rows of {} episodes; expected {} of {}, as {}", set.frames,
                              set.episodes, *counts.rows, *counts.episodes, counts.source));
}

/// The file beside a table that says what it is; none where there is none.
std::optional<JsonFile> facts_of_table(const fs::path& path) {
  const std::string facts = path.string() + ".json";
  std::error_code none;
  if (!fs::is_regular_file(facts, none)) return {};
  JsonFile file(facts);
  if (!file.has({"format"}) || file.text({"format"}) != "tangere table") return {};
  return file;
}

/// Adds units and what the facts say of the data set. Returns what they count.
TableCounts add_facts(const fs::path& path, const JsonFile& facts, ExportedSet& set) {
  const std::vector<std::string> columns = facts.texts({"columns"}), units = facts.texts({"units"});
  if (columns.size() != set.arrays.size() + 2 || units.size() != columns.size())
    damaged(facts.path(),
            fmt::format("it has {} columns and {} units; expected {}, as '{}'", columns.size(),
                        units.size(), set.arrays.size() + 2, path.string()));
  for (std::size_t k = 2; k < columns.size(); ++k) {
    if (columns[k] != set.arrays[k - 2].name)
      damaged(path, fmt::format("column {} is '{}'; expected '{}', as '{}' says", k + 1,
                                set.arrays[k - 2].name, columns[k], facts.path()));
    set.arrays[k - 2].unit = units[k];
  }
  add_source(facts, set);
  set.title = fmt::format("table of {}, seed {}", facts.text({"scene"}), facts.text({"seed"}));
  set.seconds_per_frame = facts.number({kSeconds});
  set.stored = {{path.filename().string(), 1, static_cast<std::uint64_t>(facts.count({"bytes"})),
                 static_cast<std::uint64_t>(facts.count({"crc32"})), false}};
  return {facts.count({"frames"}), facts.count({"episodes"}),
          fmt::format("'{}' says", facts.path())};
}

/// A table: the names of columns, a line for each row. Of an older version a line comes first that
/// says of what.
std::optional<ExportedSet> read_table(const fs::path& path) {
  constexpr std::string_view kBegin = "episode,row,", kOlder = "# ";
  std::ifstream file(path, std::ios::binary);
  std::array<char, kBegin.size()> first{};  // a file of another kind may have no lines
  file.read(first.data(), first.size());
  const std::string_view start(first.data(), static_cast<std::size_t>(file.gcount()));
  const bool is_older = start.starts_with(kOlder) && path.extension() == ".csv";
  if (start != kBegin && !is_older) return {};
  file.seekg(0);
  std::string title, names;
  if (is_older) std::getline(file, title);
  if (!std::getline(file, names) || !names.starts_with(kBegin)) return {};
  ExportedSet set;
  set.format = "csv", set.title = is_older ? "table of " + title.substr(kOlder.size()) : "table";
  for (std::size_t begin = kBegin.size(); begin <= names.size();) {
    const std::size_t end = std::min(names.find(',', begin), names.size());
    set.arrays.push_back({names.substr(begin, end - begin), "number", {}, ""});
    begin = end + 1;
  }
  TableCounts counts{counted(title, " rows"), counted(title, " episodes"), "its first line says"};
  if (const std::optional<JsonFile> facts = facts_of_table(path))
    counts = add_facts(path, *facts, set);
  const auto columns = std::ssize(set.arrays) + 2;
  std::string line, last;
  bool ends = true;
  std::int64_t number = is_older ? 3 : 2;
  for (; std::getline(file, line); ++number) {
    ends = !file.eof();
    if (std::count(line.begin(), line.end(), ',') + 1 != columns || line.empty())
      damaged(path, fmt::format("line {} has {} columns; expected {}", number,
                                std::count(line.begin(), line.end(), ',') + 1, columns));
    const std::string episode = line.substr(0, line.find(','));
    if (episode != last) ++set.episodes, last = episode;
    ++set.frames;
  }
  check_table(path, number - 1, ends, counts, set);
  return set;
}

/// Whether a folder has shards, and so is a data set whatever else lies there.
bool has_shards(const fs::path& folder) {
  std::error_code none;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, none))
    if (entry.path().filename().string().starts_with("shard-")) return true;
  return false;
}

}  // namespace

std::optional<ExportedSet> find_export(const std::string& path) {
  const fs::path place(path);
  std::error_code none;
  std::optional<ExportedSet> set;
  if (has_shards(place)) return {};
  if (fs::is_directory(place / ".parts", none))
    throw IoError(fmt::format(
        "'{}' is an export that is not complete; 'tangere export … --resume' goes on with it",
        path));
  if (fs::is_regular_file(place / "meta/info.json", none)) {
    set = read_lerobot(place);
  } else if (fs::is_regular_file(place / ".zgroup", none)) {
    set = read_zarr(place);
  } else if (fs::is_directory(place / "hdf5", none)) {
    set = read_univtac(place);
  } else if (fs::is_regular_file(place, none)) {
    set = read_table(place);
  }
  if (!set) return set;
  set->folder = (set->format == "csv" ? place.parent_path() : place).string();
  check_sizes(set->folder, set->stored);
  add_sizes(place, *set);
  return set;
}

}  // namespace tangere
