// SPDX-License-Identifier: Apache-2.0
// The names are those of the Python package, tangere.gym.
#include "io/dataset/learner_notes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kGymnasium = 2;  // robomimic's number for environments of Gym

/// Names come from scene files and may hold any bytes.
std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Of a task of the catalogue. A task in Python says itself which readings it shows.
std::vector<std::string> stored_readings(const DatasetLayout& layout) {
  std::vector<std::string> words;
  if (!layout.task || !layout.python_class.empty()) return words;
  for (const EpisodeChannel& channel : layout.channels()) {
    if (channel.kind != EpisodeChannel::Kind::reading || !channel.requested) continue;
    words.push_back(channel.window == 1
                        ? channel.name
                        : fmt::format("{}/{}", channel.name, layout.every / channel.window));
  }
  return words;
}

}  // namespace

std::string environment_id(const std::string& task) {
  std::string words;
  bool begins = true;
  for (const char c : task) {
    if (c != '_') words += begins && c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    begins = c == '_';
  }
  return "tangere/" + words + "-v0";
}

std::string robomimic_environment(const DatasetLayout& layout) {
  Json arguments = Json::object();
  if (layout.task)
    arguments["task"] = layout.python_class.empty() ? layout.task->name : layout.python_class;
  if (const std::vector<std::string> readings = stored_readings(layout); !readings.empty())
    arguments["readings"] = readings;
  Json environment = {
      {"env_name", layout.task ? environment_id(layout.task->name) : layout.scene_name},
      {"type", kGymnasium},
      {"env_kwargs", std::move(arguments)}};
  if (layout.task) environment["env_version"] = layout.version;
  return text_of(environment);
}

std::vector<std::string> readings_in(const std::string& environment) {
  const Json all = Json::parse(environment, nullptr, false);
  std::vector<std::string> words;
  if (!all.is_object()) return words;
  const auto arguments = all.find("env_kwargs");
  if (arguments == all.end() || !arguments->is_object()) return words;
  const auto readings = arguments->find("readings");
  if (readings == arguments->end() || !readings->is_array()) return words;
  for (const Json& word : *readings)
    if (word.is_string()) words.push_back(word.get<std::string>());
  return words;
}

std::string gymnasium_environment(const std::string& task, const std::string& python_class,
                                  const std::vector<std::string>& readings) {
  const bool in_python = !python_class.empty();
  Json arguments = {{"task", in_python ? python_class : task}};
  if (!in_python) arguments["normalise"] = false;
  if (!readings.empty()) arguments["readings"] = readings;
  return text_of(
      {{"id", environment_id(task)},
       {"entry_point", in_python ? "tangere.scene_env:SceneEnv" : "tangere.gym:make_env"},
       {"reward_threshold", nullptr},
       {"nondeterministic", false},
       {"max_episode_steps", nullptr},
       {"order_enforce", true},
       {"disable_env_checker", false},
       {"kwargs", arguments},
       {"additional_wrappers", Json::array()},
       {"vector_entry_point", nullptr}});
}

std::string observation_scale(const DatasetLayout& layout) {
  Json scales = Json::object();
  const std::vector<std::string> stored = layout.observation_names();
  if (layout.task)
    for (const TensorSpec& tensor : layout.task->observations) {
      if (tensor.scale.empty() ||
          std::find(stored.begin(), stored.end(), tensor.name) == stored.end())
        continue;
      scales[tensor.name] =
          tensor.scale.size() == 1 ? Json(tensor.scale.front()) : Json(tensor.scale);
    }
  return text_of(scales);
}

std::string privileged_observations(const DatasetLayout& layout) {
  std::vector<std::string> hidden = {"q", "v", "bodies"};
  for (const std::string& body : layout.body_names) hidden.push_back("bodies." + body);
  std::vector<std::string> shown;
  if (layout.task)
    for (const TensorSpec& tensor : layout.task->observations)
      (tensor.privileged ? hidden : shown).push_back(tensor.name);
  const auto is_in = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  std::vector<std::string> names;
  for (const std::string& name : layout.observation_names())
    if (is_in(hidden, name) && !is_in(shown, name)) names.push_back(name);
  return name_list(names);
}

std::string name_list(const std::vector<std::string>& names) { return text_of(Json(names)); }

std::string touch_observations(const DatasetLayout& layout) {
  const std::vector<std::string> stored = layout.observation_names();
  std::vector<std::string> names;
  for (const std::size_t k : layout.touch()) names.push_back(stored[k]);
  return name_list(names);
}

std::string json_of(const TableFacts& facts) {
  const Json json{{"format", kTableFormat},
                  {"command", facts.command},
                  {"tangere_version", facts.version},
                  {"scene", facts.scene},
                  {"seed", facts.seed},
                  {"seconds_per_frame", facts.seconds_per_frame},
                  {"episodes", facts.episodes},
                  {"frames", facts.frames},
                  {"columns", facts.columns},
                  {"units", facts.units},
                  {"bytes", facts.bytes},
                  {"crc32", facts.crc32}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string json_of(const IncludedTexts& texts) { return text_of(Json(texts)); }

IncludedTexts included_texts_in(const std::string& json) {
  const Json found = Json::parse(json, nullptr, false);
  IncludedTexts texts;
  if (found.is_object())
    for (const auto& [place, text] : found.items())
      if (text.is_string()) texts[place] = text.get<std::string>();
  if (!found.is_object() || texts.size() != found.size())
    throw IoError("'included' of /scene is no JSON object of texts: the file is damaged");
  return texts;
}

std::optional<std::vector<std::string>> names_in(const std::string& list) {
  const Json names = Json::parse(list, nullptr, false);
  const bool strings = names.is_array() && std::all_of(names.begin(), names.end(),
                                                       [](const Json& n) { return n.is_string(); });
  if (!strings) return std::nullopt;
  return names.get<std::vector<std::string>>();
}

}  // namespace tangere
