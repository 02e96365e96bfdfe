// SPDX-License-Identifier: Apache-2.0
// Metadata for learners: the environment of a data set, scales of observations, and which of them
// are privileged or touch. It is JSON text, which robomimic and Minari store unchanged.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/dataset_layout.hpp"
#include "io/scene/included_texts.hpp"

namespace tangere {

/// Returns the Gymnasium name of a task: "box_pushing" → "tangere/BoxPushing-v0".
std::string environment_id(const std::string& task);

/// `env_args` of robomimic: {"env_name", "type", "env_kwargs", "env_version"}. For a scene alone
/// the name is the scene's, and there are no arguments. Arguments of a task of the catalogue have
/// the readings of sensors that are stored beside what it observes.
std::string robomimic_environment(const DatasetLayout& layout);

/// `env_spec` of Minari: Gymnasium's EnvSpec of a task whose observations are those of the files,
/// in SI units. `python_class`: DatasetLayout::python_class. `readings`: those of readings_in()
/// that the environment shows beside them.
std::string gymnasium_environment(const std::string& task, const std::string& python_class = "",
                                  const std::vector<std::string>& readings = {});

/// The readings of sensors, "pad.sum" or "pad/1", that robomimic_environment() names; none for
/// another text.
std::vector<std::string> readings_in(const std::string& environment);

/// {KEY: number, or list over the last axis} of every stored observation that declares a scale, in
/// the observation's unit. Other observations have the scale 1.
std::string observation_scale(const DatasetLayout& layout);

/// [KEY, …] of the stored observations that a robot could not measure: q, v, motions of bodies, and
/// what a task declares as privileged. Numbers of q and v of DatasetLayout::actuated are measured.
std::string privileged_observations(const DatasetLayout& layout);

/// [KEY, …] of the stored observations that are touch, DatasetLayout::touch().
std::string touch_observations(const DatasetLayout& layout);

/// What a table of `tangere export` says in the file beside it.
struct TableFacts {
  std::string command, version, scene, seed;  ///< of the data set
  double seconds_per_frame = 0;
  std::int64_t episodes = 0, frames = 0;
  std::vector<std::string> columns, units;  ///< of each column; the unit may be empty
  std::uint64_t bytes = 0;
  std::uint32_t crc32 = 0;  ///< of the bytes of the table
};
std::string json_of(const TableFacts& facts);
/// `format` of them, which tells them from other files of JSON.
inline constexpr const char* kTableFormat = "tangere table";

/// Texts of included files as a JSON object, and from one. Throws IoError for another text.
std::string json_of(const IncludedTexts& texts);
IncludedTexts included_texts_in(const std::string& json);

/// Writes names as such a list.
std::string name_list(const std::vector<std::string>& names);

/// Returns the names in such a list; nothing for another text.
std::optional<std::vector<std::string>> names_in(const std::string& list);

}  // namespace tangere
