// SPDX-License-Identifier: Apache-2.0
// Minari requires episodes numbered without gaps, one more observation than actions, and the two
// ways in which an episode ends kept apart.
#include "io/dataset/minari_view.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "engine/base/error.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kMinariVersion = "0.5.3";  // the layout that is written here
// Of an observation that the view has. Minari needs both bounds of every number, and cannot be told
// once that they are all equal: metadata.json has 22 bytes for each.
constexpr std::uint64_t kMostObserved = std::uint64_t{1} << 18;
/// Returns the id that the file gives the data set. It becomes a path, so it must be one that is
/// written: tangere/NAME-v0 or tangere/TASK/NAME-v0.
std::string stored_id(const std::string& folder, const h5::Id& scene) {
  constexpr std::string_view kBegin = "tangere/", kEnd = "-v0", kPlain = "-_";
  std::string id = h5::read_text(scene, "dataset_id");
  const bool plain = std::all_of(id.begin(), id.end(), [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '/' ||
           kPlain.find(c) != std::string_view::npos;
  });
  const auto slashes = std::count(id.begin(), id.end(), '/');
  if (!plain || !id.starts_with(kBegin) || !id.ends_with(kEnd) || slashes > 2 ||
      id.find("//") != std::string::npos || id.find("/-v0") != std::string::npos)
    throw IoError(
        fmt::format("'{}': the 'dataset_id' of its shards is '{}'; expected tangere/NAME-v0 or "
                    "tangere/TASK/NAME-v0 of letters, digits, - and _",
                    folder, id));
  return id;
}

/// Writes a number in nested lists of a given shape, because all bounds are equal.
std::string nested(const std::vector<std::uint64_t>& shape, std::size_t from,
                   const std::string& number) {
  if (from == shape.size()) return number;
  const std::string inner = nested(shape, from + 1, number);
  std::string text = "[";
  for (std::uint64_t i = 0; i < shape[from]; ++i) text += (i > 0 ? ", " : "") + inner;
  return text + "]";
}

/// Writes a Gymnasium Box as Minari reads it. Infinite bounds are bare words, which Python reads
/// but no JSON library writes.
std::string box(const DemoArray& array, const std::string& low, const std::string& high) {
  return fmt::format(R"({{"type": "Box", "dtype": "{}", "shape": [{}], "low": {}, "high": {}}})",
                     array.type == h5::NumberType::uint8     ? "uint8"
                     : array.type == h5::NumberType::int16   ? "int16"
                     : array.type == h5::NumberType::float32 ? "float32"
                                                             : "float64",
                     fmt::join(array.shape, ", "), nested(array.shape, 0, low),
                     nested(array.shape, 0, high));
}

/// Minari has no observation of JPEG files.
bool is_hidden(const DemoArray& array) {
  if (array.type == h5::NumberType::text) return true;
  std::uint64_t numbers = 1;
  for (const std::uint64_t size : array.shape) numbers *= size;
  return numbers > kMostObserved;
}

std::string bound(double value) {
  if (std::isinf(value)) return value < 0 ? "-Infinity" : "Infinity";
  return fmt::format("{}", value);
}

}  // namespace

MinariView::MinariView(const std::string& folder, const h5::Id& shard, const DemoMembers& members)
    : members_(members) {
  // Minari shows all that the file has and computes its space, so both lack what is too large.
  std::erase_if(members_.observations, [this](const DemoArray& array) {
    if (is_hidden(array)) left_out_.push_back(array.name);
    return is_hidden(array);
  });
  const h5::Id scene = h5::open_group(shard, "/scene");
  command_ = h5::read_text(h5::open_group(shard, "/"), "command");
  version_ = h5::read_text(scene, "tangere_version");
  id_ = stored_id(folder, scene);
  for (auto parts = std::count(id_.begin(), id_.end(), '/') + 3; parts > 0; --parts)
    to_folder_ += "../";
  seed_ = h5::read_number<std::uint64_t>(scene, "seed");
  if (members.is_task) {
    task_ = h5::read_text(scene, "task");
    if (H5Aexists(scene.get(), "python_class") > 0)
      python_class_ = h5::read_text(scene, "python_class");
    const std::vector<std::string> players = h5::read_texts(scene, "policies");
    if (!players.empty()) policy_ = players.front();  // a program by its own name
    for (const std::string& word :
         readings_in(h5::read_text(h5::open_group(shard, "/data"), "env_args"))) {
      const std::string name = word.substr(0, word.find('/'));
      if (std::any_of(members_.observations.begin(), members_.observations.end(),
                      [&](const DemoArray& array) { return array.name == name; }))
        readings_.push_back(word);
    }
    low_ = bound(h5::read_number<double>(scene, "action_low"));
    high_ = bound(h5::read_number<double>(scene, "action_high"));
  }
  if (members.is_task) hide_states();
  folder_ = (fs::path(folder) / "minari" / id_ / "data").string();
  std::error_code error;
  // A link on the way would lead the view, and what --overwrite removes, elsewhere.
  fs::path place = folder;
  for (const fs::path& part : fs::path("minari") / id_ / "data") {
    place /= part;
    if (fs::is_symlink(fs::symlink_status(place, error)))
      throw IoError(fmt::format("'{}' is a symbolic link; expected a folder", place.string()));
  }
  fs::create_directories(folder_, error);
  if (error)
    throw IoError(fmt::format("cannot create the folder '{}': {}", folder_, error.message()));
  file_.emplace((fs::path(folder_) / "main_data.hdf5").string(), true, true);
  file_->close();
}

/// The environment that a learner recovers shows neither q nor v. The view's observations have its
/// keys, unless nothing else was recorded.
void MinariView::hide_states() {
  const auto is_state = [](const DemoArray& array) {
    return array.name == "q" || array.name == "v";
  };
  std::vector<DemoArray>& shown = members_.observations;
  if (std::all_of(shown.begin(), shown.end(), is_state)) return;
  std::copy_if(shown.begin(), shown.end(), std::back_inserter(members_.states), is_state);
  std::erase_if(shown, is_state);
}

void MinariView::add(std::string_view file, std::span<const LinkedDemo> demos) {
  h5::Bytes out;
  for (const h5::FileMember& episode : add_minari_episodes(
           out, file_->here(), members_, to_folder_ + std::string(file), demos, count_, seed_))
    episodes_.push_back(episode);
  file_->append(out, {"episodes from episode_", count_});
  count_ += std::ssize(demos);
  for (const LinkedDemo& demo : demos) steps_ += demo.facts.rows;
}

void MinariView::commit(std::uint64_t linked) {
  file_->open(file_->append_group("episode_", std::move(episodes_), true));
  h5::write_scalar<std::int64_t>(file_->file(), "total_episodes", count_);
  h5::write_scalar<std::int64_t>(file_->file(), "total_steps", steps_);
  const std::uint64_t bytes = linked + file_->commit();
  write_text_atomically((fs::path(folder_) / "metadata.json").string(), metadata(bytes), true);
}

std::string MinariView::metadata(std::uint64_t bytes) const {
  std::string subspaces;
  for (const DemoArray& array : members_.observations)
    subspaces += fmt::format("{}{}: {}", subspaces.empty() ? "" : ", ", Json(array.name).dump(),
                             box(array, "-Infinity", "Infinity"));
  constexpr double kTenths = 1e-5;  // of a megabyte, in a byte
  Json metadata = {
      {"dataset_id", id_},
      {"data_format", "hdf5"},
      {"minari_version", kMinariVersion},
      {"total_episodes", count_},
      {"total_steps", steps_},
      {"observation_space", fmt::format(R"({{"type": "Dict", "subspaces": {{{}}}}})", subspaces)},
      {"action_space", box(members_.actions, low_, high_)},
      {"algorithm_name", policy_.empty() ? "tangere" : policy_},
      {"description", command_},
      {"dataset_size", std::round(static_cast<double>(bytes) * kTenths) / 10},
      {"requirements", Json::array({"tangere>=" + version_})},
  };
  if (!task_.empty()) {
    const std::string environment = gymnasium_environment(task_, python_class_, readings_);
    metadata["env_spec"] = environment;
    metadata["eval_env_spec"] = environment;
  }
  // A command line may hold any bytes.
  return metadata.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace tangere
