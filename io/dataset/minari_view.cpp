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
#include "io/files/part_file.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kMinariVersion = "0.5.3";  // the layout that is written here
// Of an observation that the view has. Minari needs both bounds of every number, and cannot be told
// once that they are all equal: metadata.json has 22 bytes for each.
constexpr std::uint64_t kMostNumbers = std::uint64_t{1} << 18;
constexpr const char* kToFolder = "../../../../";  // from …/minari/tangere/NAME-v0/data

/// Keeps letters, digits, - and _, which are all that Minari accepts.
std::string dataset_name(std::string name) {
  for (char& c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_';
    if (!plain) c = '-';
  }
  return name.empty() ? "dataset" : name;
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
                     array.type == h5::NumberType::float32 ? "float32" : "float64",
                     fmt::join(array.shape, ", "), nested(array.shape, 0, low),
                     nested(array.shape, 0, high));
}

bool too_large(const DemoArray& array) {
  std::uint64_t numbers = 1;
  for (const std::uint64_t size : array.shape) numbers *= size;
  return numbers > kMostNumbers;
}

std::string bound(double value) {
  if (std::isinf(value)) return value < 0 ? "-Infinity" : "Infinity";
  return fmt::format("{}", value);
}

}  // namespace

MinariView::MinariView(const std::string& folder, const h5::Id& shard, const DemoMembers& members)
    : members_(members) {
  // Minari shows whatever the file has and looks for its space, so both lack what is too large.
  std::erase_if(members_.observations, [this](const DemoArray& array) {
    if (too_large(array)) left_out_.push_back(array.name);
    return too_large(array);
  });
  const h5::Id scene = h5::open_group(shard, "/scene");
  command_ = h5::read_text(h5::open_group(shard, "/"), "command");
  const std::string task = h5::read_text(scene, "task");
  id_ = fmt::format("tangere/{}-v0",
                    dataset_name(task.starts_with("none") ? h5::read_text(scene, "name") : task));
  seed_ = h5::read_number<std::uint64_t>(scene, "seed");
  if (members.of_task) {
    low_ = bound(h5::read_number<double>(scene, "action_low"));
    high_ = bound(h5::read_number<double>(scene, "action_high"));
  }
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

void MinariView::add(std::string_view file, std::span<const LinkedDemo> demos) {
  h5::Bytes out;
  for (const h5::FileMember& episode :
       add_minari_episodes(out, file_->here(), members_, fmt::format("{}{}", kToFolder, file),
                           demos, count_, seed_))
    episodes_.push_back(episode);
  file_->append(out, {"episodes from episode_", count_});
  count_ += std::ssize(demos);
  for (const LinkedDemo& demo : demos) steps_ += demo.facts.rows;
}

void MinariView::commit() {
  file_->open(file_->append_group("episode_", std::move(episodes_), true));
  h5::write_scalar<std::int64_t>(file_->file(), "total_episodes", count_);
  h5::write_scalar<std::int64_t>(file_->file(), "total_steps", steps_);
  file_->commit();
  write_text_atomically((fs::path(folder_) / "metadata.json").string(), metadata(), true);
}

std::string MinariView::metadata() const {
  std::string subspaces;
  for (const DemoArray& array : members_.observations)
    subspaces += fmt::format("{}{}: {}", subspaces.empty() ? "" : ", ", Json(array.name).dump(),
                             box(array, "-Infinity", "Infinity"));
  const Json metadata = {
      {"dataset_id", id_},
      {"data_format", "hdf5"},
      {"minari_version", kMinariVersion},
      {"total_episodes", count_},
      {"total_steps", steps_},
      {"observation_space", fmt::format(R"({{"type": "Dict", "subspaces": {{{}}}}})", subspaces)},
      {"action_space", box(members_.actions, low_, high_)},
      {"algorithm_name", "tangere"},
      {"description", command_},
  };
  // A command line may hold any bytes.
  return metadata.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace tangere
