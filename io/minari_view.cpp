// SPDX-License-Identifier: Apache-2.0
// Minari wants episodes numbered without gaps, one more observation than actions, and both ends of an episode apart.
#include "io/minari_view.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "engine/error.hpp"
#include "io/dataset_description.hpp"
#include "io/h5_links.hpp"
#include "io/h5_listing.hpp"
#include "io/part_file.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMinariVersion = "0.5.3";   // the layout that is written here
constexpr const char* kToFolder = "../../../../"; // from …/minari/tangere/NAME-v0/data

/// Letters, digits, - and _ are what Minari accepts.
std::string dataset_name(std::string name) {
  for (char& c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    if (!plain) c = '-';
  }
  return name.empty() ? "dataset" : name;
}

/// A number in as many lists as a shape says: all bounds are the same.
std::string nested(const std::vector<hsize_t>& shape, std::size_t from, const std::string& number) {
  if (from == shape.size()) return number;
  const std::string inner = nested(shape, from + 1, number);
  std::string text = "[";
  for (hsize_t i = 0; i < shape[from]; ++i) text += (i > 0 ? ", " : "") + inner;
  return text + "]";
}

/// A Gymnasium Box as Minari writes it; infinite bounds are bare words there.
std::string box(const std::vector<hsize_t>& shape, const std::string& type, const std::string& low,
                const std::string& high) {
  return fmt::format(R"({{"type": "Box", "dtype": "{}", "shape": [{}], "low": {}, "high": {}}})", type,
                     fmt::join(shape, ", "), nested(shape, 0, low), nested(shape, 0, high));
}

std::string bound(double value) {
  if (std::isinf(value)) return value < 0 ? "-Infinity" : "Infinity";
  return fmt::format("{}", value);
}

class View {
 public:
  View(const DatasetFiles& dataset, const std::string& path, bool overwrite)
      : dataset_(dataset), part_(path, overwrite) {}
  ~View() {
    if (file_.get() >= 0) part_.empty();
  }
  View(const View&) = delete;
  View& operator=(const View&) = delete;

  void write(const std::vector<DemoPlace>& demos) {
    file_ = h5::create_file(part_.path(), hsize_t{1} << 16, true);
    for (std::size_t i = 0; i < demos.size(); ++i) add(static_cast<std::int64_t>(i), demos[i]);
    h5::write_scalar<std::int64_t>(file_, "total_episodes", static_cast<std::int64_t>(demos.size()));
    h5::write_scalar<std::int64_t>(file_, "total_steps", steps_);
    h5::close_file(file_, part_.path());
    part_.commit();
  }

  [[nodiscard]] std::string metadata(const std::string& id, std::size_t episodes, const std::string& command) const {
    std::string subspaces;
    for (const auto& [name, space] : observations_)
      subspaces += fmt::format("{}{}: {}", subspaces.empty() ? "" : ", ", json_text(name), space);
    const std::string observation = fmt::format(R"({{"type": "Dict", "subspaces": {{{}}}}})", subspaces);
    return fmt::format(
        "{{\"dataset_id\": {}, \"data_format\": \"hdf5\", \"minari_version\": \"{}\", \"total_episodes\": {}, "
        "\"total_steps\": {}, \"observation_space\": {}, \"action_space\": {}, \"algorithm_name\": {}, "
        "\"description\": {}}}\n",
        json_text(id), kMinariVersion, episodes, steps_, json_text(observation), json_text(action_),
        json_text("tangere"), json_text(command));
  }

 private:
  void add(std::int64_t number, const DemoPlace& place) {
    if (place.file != open_name_) {
      open_ = h5::open_file((fs::path(dataset_.folder) / place.file).string());
      open_name_ = place.file;
      const h5::Id scene = h5::open_group(open_, "scene");
      const std::vector<std::string> names = h5::attribute_names(scene);
      of_task_ = std::binary_search(names.begin(), names.end(), "policy");
      if (action_.empty()) find_action_bounds(scene);
    }
    const std::string path = fmt::format("/data/demo_{}", place.number), file = kToFolder + place.file;
    const h5::Id demo = h5::open_group(open_, path);
    const std::int64_t rows = h5::read_numbers<std::int64_t>(demo, "num_samples").at(0);
    const h5::Id episode = h5::create_group(file_, fmt::format("episode_{}", number));
    h5::write_scalar<std::int64_t>(episode, "id", number);
    h5::write_scalar<std::int64_t>(episode, "total_steps", rows);
    h5::write_scalar<std::int64_t>(episode, "demo", place.number);
    for (const char* name : {"actions", "rewards"}) h5::link_external(episode, name, file, path + "/" + name);
    const bool terminated = of_task_ && h5::read_numbers<std::int64_t>(demo, "terminated").at(0) != 0;
    h5::link_external(episode, terminated ? "terminations" : "truncations", file, path + "/dones");
    h5::create_flags(episode, terminated ? "truncations" : "terminations",
                     std::vector<std::int8_t>(static_cast<std::size_t>(rows), 0));
    const h5::Id observations = h5::create_group(episode, "observations"), obs = h5::open_group(demo, "obs");
    for (const std::string& name : h5::link_names(obs)) {
      const h5::Id like = h5::open_dataset(obs, name);
      h5::create_virtual(observations, name, like, {file, path + "/obs/" + name}, {file, path + "/final_obs/" + name});
      if (number == 0) observations_.emplace_back(name, space_of(like));
    }
    if (number == 0) find_action_space(h5::open_dataset(demo, "actions"));
    steps_ += rows;
  }

  static std::string space_of(const h5::Id& dataset) {
    h5::Dims shape = h5::dimensions(dataset);
    shape.erase(shape.begin());
    const h5::Id type(H5Dget_type(dataset.get()));
    return box(shape, H5Tget_size(type.get()) == sizeof(float) ? "float32" : "float64", "-Infinity", "Infinity");
  }
  void find_action_bounds(const h5::Id& scene) {
    if (!of_task_) return;
    low_ = bound(h5::read_numbers<double>(scene, "action_low").at(0));
    high_ = bound(h5::read_numbers<double>(scene, "action_high").at(0));
  }
  void find_action_space(const h5::Id& actions) {
    h5::Dims shape = h5::dimensions(actions);
    shape.erase(shape.begin());
    action_ = box(shape, "float32", low_, high_);
  }

  const DatasetFiles& dataset_;
  PartFile part_;
  h5::Id file_, open_;
  std::string open_name_, action_, low_ = "-1.0", high_ = "1.0";
  std::vector<std::pair<std::string, std::string>> observations_;  // names, spaces
  bool of_task_ = false;
  std::int64_t steps_ = 0;
};

}  // namespace

std::string write_minari_view(const DatasetFiles& dataset, const std::vector<DemoPlace>& demos, bool overwrite) {
  const h5::Id file = h5::open_file(dataset.files.front()), scene = h5::open_group(file, "scene");
  const std::string task = h5::read_text(scene, "task");
  const std::string name = dataset_name(task.starts_with("none") ? h5::read_text(scene, "name") : task);
  const std::string id = fmt::format("tangere/{}-v0", name);
  const fs::path folder = fs::path(dataset.folder) / "minari" / id / "data";
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw IoError(fmt::format("cannot create the folder '{}': {}", folder.string(), error.message()));
  View view(dataset, (folder / "main_data.hdf5").string(), overwrite);
  view.write(demos);
  write_text_atomically((folder / "metadata.json").string(),
                        view.metadata(id, demos.size(), h5::read_text(file, "command")), overwrite);
  return id;
}

}  // namespace tangere
