// SPDX-License-Identifier: Apache-2.0
// Writes each number with the fewest digits that give the same number back.
#include "io/dataset/dataset_export.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <libdeflate.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <tuple>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/files/part_file.hpp"
#include "io/files/text_file.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

constexpr std::size_t kWidest = 64;  // most numbers of an observation in a table
constexpr std::size_t kMostNumbers = std::size_t{1} << 26;  // of a demo, which is read whole

/// One dataset of a demo, read whole.
struct Column {
  std::size_t width = 1;
  std::vector<double> values;  // (rows, width)
  bool single = false;         // float32 on disk, so fewer digits are enough
};

Column read_column(const h5::Id& group, const std::string& name) {
  const h5::Id dataset = h5::open_dataset(group, name);
  h5::Dims dims = h5::dimensions(dataset);
  Column column;
  for (std::size_t i = 1; i < dims.size(); ++i) column.width *= dims[i];
  const std::size_t numbers = (dims.empty() ? 0 : dims[0]) * column.width;
  if (numbers > kMostNumbers)
    throw IoError(fmt::format("'{}' of a demo claims {} numbers; expected at most {}", name,
                              numbers, kMostNumbers));
  column.values.resize(numbers);
  const h5::Id type(H5Dget_type(dataset.get()));
  column.single = H5Tget_class(type.get()) == H5T_FLOAT && H5Tget_size(type.get()) == sizeof(float);
  if (!column.values.empty())
    h5::read_box(dataset, h5::Dims(dims.size(), 0), dims, column.values.data());
  return column;
}

std::size_t width_of(const h5::Id& group, const std::string& name) {
  const h5::Dims dims = h5::dimensions(h5::open_dataset(group, name));
  std::size_t width = 1;
  for (std::size_t i = 1; i < dims.size(); ++i) width *= dims[i];
  return width;
}

/// Units of `width` numbers, from "N" of all, or one of each: "N, N, N, m, m, m" and, of three
/// numbers or more, "m m rad". "N m" of two numbers is one unit.
std::vector<std::string> units_of(const std::string& text, std::size_t width) {
  for (const std::string_view between : {", ", " "}) {
    std::vector<std::string> parts;
    for (std::size_t begin = 0; begin <= text.size();) {
      const std::size_t end = std::min(text.find(between, begin), text.size());
      parts.push_back(text.substr(begin, end - begin));
      begin = end + between.size();
    }
    if (parts.size() == width && (width > 2 || between.size() > 1)) return parts;
    if (between.size() > 1 && parts.size() > 1 && width % parts.size() == 0) {
      const std::size_t each = parts.size();  // such as a body, in turn
      for (std::size_t k = each; k < width; ++k) parts.push_back(parts[k - each]);
      return parts;
    }
  }
  return std::vector<std::string>(width, text);
}

class CsvExport {
 public:
  CsvExport(const std::string& path, const ExportOptions& options)
      : options_(options), part_(path, options.overwrite), facts_part_(path + ".json", true) {
    check_facts_file();
  }

  ExportResult run(const DatasetFiles& dataset) {
    std::tie(facts_.episodes, facts_.frames) = count(dataset);
    for (const std::string& path : dataset.files) {
      const h5::Id file = h5::open_file(path), data = h5::open_group(file, "data");
      const std::vector<std::int64_t> demos = chosen(data);
      if (demos.empty() && options_.episode) continue;
      check_shard(path);
      for (const std::int64_t demo : demos)
        add(h5::open_group(data, fmt::format("demo_{}", demo)), h5::open_group(file, "scene"),
            demo);
    }
    if (options_.episode && result_.rows == 0)
      throw IoError(fmt::format(
          "'{}' has no episode {}, or it failed; 'tangere info' says how many there are",
          dataset.folder.empty() ? dataset.files.front() : dataset.folder, *options_.episode));
    facts_part_.write(facts_of(dataset));
    // A table without facts is one whose units are not known; facts of another table are none.
    std::error_code none_there;
    std::filesystem::remove(facts_part_.output(), none_there);
    part_.commit();
    facts_part_.commit();
    return result_;
  }

 private:
  /// Episodes and rows of the table, so that one that is cut short can be told.
  [[nodiscard]] std::pair<std::int64_t, std::int64_t> count(const DatasetFiles& dataset) const {
    std::pair<std::int64_t, std::int64_t> counts;
    for (const std::string& path : dataset.files) {
      const h5::Id file = h5::open_file(path), data = h5::open_group(file, "data");
      for (const std::int64_t demo : chosen(data)) {
        ++counts.first;
        counts.second += h5::read_number<std::int64_t>(
            h5::open_group(data, fmt::format("demo_{}", demo)), "num_samples");
      }
    }
    return counts;
  }

  [[nodiscard]] std::vector<std::int64_t> chosen(const h5::Id& data) const {
    std::vector<std::int64_t> demos = demo_numbers(data);
    if (options_.episode)
      std::erase_if(demos, [&](std::int64_t demo) { return demo != *options_.episode; });
    return demos;
  }

  /// What lies there already must be facts of a table.
  void check_facts_file() const {
    const std::string& path = facts_part_.output();
    if (!std::filesystem::exists(path)) return;
    constexpr std::size_t kMost = std::size_t{1} << 26;
    const std::string text = read_text_file(path, kMost, "facts of a table");
    if (!options_.overwrite)
      throw IoError(fmt::format(
          "'{}' exists already; expected another name, or --overwrite to replace it", path));
    if (text.find(fmt::format("\"format\": \"{}\"", kTableFormat)) == std::string::npos)
      throw InputError(fmt::format(
          "'{}' is not what 'tangere export' writes beside a table; it is not overwritten", path));
  }

  [[nodiscard]] std::string facts_of(const DatasetFiles& dataset) {
    const h5::Id file = h5::open_file(dataset.files.front()), scene = h5::open_group(file, "scene");
    facts_.command = h5::read_text(file, "command");
    facts_.version = value_of(dataset.settings, "tangere_version");
    facts_.scene = value_of(dataset.settings, "name");
    facts_.seed = value_of(dataset.settings, "seed");
    facts_.seconds_per_frame =
        h5::read_number<double>(scene, "timestep") * h5::read_number<double>(scene, "every");
    facts_.bytes = part_.size();
    return json_of(facts_);
  }

  void write(std::string_view text) {
    facts_.crc32 = libdeflate_crc32(facts_.crc32, text.data(), text.size());
    part_.write(text);
  }

  void add_column(const std::string& name, const std::string& unit) {
    facts_.columns.push_back(name);
    facts_.units.push_back(unit);
  }
  /// `units`: of each, or fewer where an older version does not say.
  void add_columns(const std::string& prefix, const std::vector<std::string>& names,
                   const std::vector<std::string>& units) {
    for (std::size_t k = 0; k < names.size(); ++k)
      add_column(prefix + names[k], k < units.size() ? units[k] : "");
  }

  void write_header(const h5::Id& demo, const h5::Id& scene) {
    add_column("episode", "");
    add_column("row", "");
    add_columns("actions/", h5::read_texts(scene, "action_names"), texts_in(scene, "action_units"));
    add_column("rewards", "1");
    add_column("dones", "");
    const h5::Id obs = h5::open_group(demo, "obs");
    const std::vector<std::string> stored = h5::read_texts(scene, "observations"),
                                   units = texts_in(scene, "observation_units");
    for (std::size_t k = 0; k < stored.size(); ++k) {
      const std::string& name = stored[k];
      const std::size_t width = width_of(obs, name);
      if (width > kWidest || h5::has_files(h5::open_dataset(obs, name))) {
        result_.left_out.push_back(name);
        continue;
      }
      names_.push_back(name);
      if (name == "q" || name == "v") {
        add_columns(name + "/", h5::read_texts(scene, name + "_names"),
                    texts_in(scene, name + "_units"));
      } else {
        add_columns(name, width, scene, k < units.size() ? units[k] : "");
      }
    }
    for (const StoredSample& sample : stored_samples(scene, 1, 1))
      result_.left_out.push_back(sample.name);
    result_.columns = std::ssize(facts_.columns);
    write(fmt::format("{}\n", fmt::join(facts_.columns, ",")));
  }

  /// A list that older versions do not have; empty then.
  static std::vector<std::string> texts_in(const h5::Id& scene, const std::string& name) {
    if (H5Aexists(scene.get(), name.c_str()) <= 0) return {};
    return h5::read_texts(scene, name);
  }

  /// "sum/0", "sum/1" …; of a window "sum[-2]/0" … "sum[0]/0": which reading before the newest.
  /// `unit`: of all numbers, or of each in turn: "N, N, N, m, m, m".
  void add_columns(const std::string& name, std::size_t width, const h5::Id& scene,
                   const std::string& unit) {
    std::size_t readings = 1;
    for (const StoredWindow& window :
         stored_windows(scene, h5::read_number<std::int64_t>(scene, "every")))
      if (window.name == name) readings = static_cast<std::size_t>(window.readings);
    const std::size_t each = width / readings;
    const std::vector<std::string> units = units_of(unit, each);
    for (std::size_t k = 0; k < width; ++k)
      add_column(readings == 1 ? fmt::format("{}/{}", name, k)
                               : fmt::format("{}[{}]/{}", name,
                                             static_cast<std::int64_t>(k / each) -
                                                 static_cast<std::int64_t>(readings) + 1,
                                             k % each),
                 units[k % units.size()]);
  }

  void add(const h5::Id& demo, const h5::Id& scene, std::int64_t number) {
    if (facts_.columns.empty()) write_header(demo, scene);
    std::vector<Column> columns;
    for (const char* name : {"actions", "rewards", "dones"})
      columns.push_back(read_column(demo, name));
    const h5::Id obs = h5::open_group(demo, "obs");
    for (const std::string& name : names_) columns.push_back(read_column(obs, name));
    const auto rows = static_cast<std::size_t>(h5::read_number<std::int64_t>(demo, "num_samples"));
    for (const Column& column : columns)
      if (column.values.size() != rows * column.width)
        throw IoError(fmt::format(
            "demo_{}: its datasets differ in rows; 'tangere validate' says where", number));
    fmt::memory_buffer text;
    for (std::size_t row = 0; row < rows; ++row) {
      fmt::format_to(std::back_inserter(text), "{},{}", number, row);
      for (const Column& column : columns)
        for (std::size_t k = 0; k < column.width; ++k) {
          const double value = column.values[row * column.width + k];
          if (column.single) {
            fmt::format_to(std::back_inserter(text), ",{}", static_cast<float>(value));
          } else {
            fmt::format_to(std::back_inserter(text), ",{}", value);
          }
        }
      text.push_back('\n');
    }
    write({text.data(), text.size()});
    result_.rows += static_cast<std::int64_t>(rows);
  }

  const ExportOptions& options_;
  PartFile part_, facts_part_;
  TableFacts facts_;
  std::vector<std::string> names_;
  ExportResult result_;
};

}  // namespace

ExportResult export_csv(const DatasetFiles& dataset, const std::string& path,
                        const ExportOptions& options) {
  add_merged_inputs(dataset);
  if (!dataset.folder.empty() && !options.episode) check_complete(dataset);
  return CsvExport(path, options).run(dataset);
}

}  // namespace tangere
