// SPDX-License-Identifier: Apache-2.0
// The files are small, so that a change often meets a description and seldom a number.
#include <filesystem>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_export.hpp"
#include "io/dataset/dataset_files.hpp"
#include "io/dataset/dataset_merge.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/picture/tactile_plot.hpp"
#include "io/trajectory/saved_state.hpp"
#include "io/trajectory/trajectory_file.hpp"
#include "tests/files.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kEpisodes = 20;  // one whole block, and a part of one
constexpr const char* kMerged = "robomimic.hdf5";
constexpr const char* kFirst = "shard-00000.h5";

/// Two shards in `folder`.
void write_shards(const std::string& folder, const std::string& compression, bool sparse) {
  DatasetLayout layout = testing::dataset_layout(kEpisodes);
  layout.shards = 2;
  layout.compression = compression;
  layout.sparse = sparse;
  DatasetWriter writer({folder}, layout);
  testing::write_block(writer, layout, 0, {testing::failure(3)});
  testing::write_block(writer, layout, 16);
}

/// `attempt` may refuse; what comes after it is to be tried too. Returns whether it refused.
bool refuses(const std::function<void()>& attempt) {
  try {
    attempt();
    return false;
  } catch (const InputError&) {
  } catch (const IoError&) {
  }
  return true;
}

/// validate, info and export of one file. Throws IoError when one of them refuses.
void read_dataset(const std::string& path) {
  const DatasetFiles files = find_dataset(path);
  bool refused = !examine_dataset(files).problems.empty();
  refused |= refuses([&] { summarise(files); });
  refused |= refuses([&] { export_csv(files, path + ".csv", {std::nullopt, true}); });
  if (refused) throw IoError("refused");
}

/// And what merge makes of the folder, whose other shard may have other settings.
void read_shard(const std::string& folder) {
  refuses([&] { merge_dataset(find_dataset(folder), {false, true}); });
  read_dataset(folder + "/" + kFirst);
}

void read_trajectory(const std::string& path) {
  bool refused = refuses([&] { read_state(path, std::nullopt); });
  const TrajectoryReader file(path);
  static_cast<void>(drawable_sensors(file));
  refused |= refuses([&] { render_tactile_svg(file, {}); });
  if (refused) throw IoError("refused");
}

std::vector<std::string> shards(const std::string& folder) {
  std::vector<std::string> corpus;
  for (const auto& [compression, sparse] :
       {std::pair{"deflate", true}, std::pair{"lz4", true}, std::pair{"none", false}}) {
    fs::remove_all(folder);
    write_shards(folder, compression, sparse);
    corpus.push_back(file_bytes(folder + "/" + kFirst));
  }
  return corpus;
}

std::vector<std::string> merged(const std::string& folder, bool copy) {
  fs::remove_all(folder);
  write_shards(folder, "none", false);
  merge_dataset(find_dataset(folder), {copy, true});
  return {file_bytes(folder + "/" + kMerged)};
}

std::vector<std::string> trajectories(const std::string& folder) {
  const Recording recording = testing::recording();
  const std::string path = folder + "/run.h5";
  TrajectoryFile file(path, recording, true);
  testing::write_run(file, recording);
  file.commit();
  return {file_bytes(path)};
}

}  // namespace

std::vector<Target> hdf5_targets() {
  const auto read_merged = [](const std::string& folder) { read_dataset(folder + "/" + kMerged); };
  return {{"shard", true, kFirst, shards, read_shard},
          {"merged", true, kMerged, [](const auto& f) { return merged(f, false); }, read_merged},
          {"copied", true, kMerged, [](const auto& f) { return merged(f, true); }, read_merged},
          {"trajectory", true, "run.h5", trajectories,
           [](const std::string& folder) { read_trajectory(folder + "/run.h5"); }}};
}

}  // namespace tangere::fuzz
