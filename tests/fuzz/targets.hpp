// SPDX-License-Identifier: Apache-2.0
// What is fuzzed: every kind of file that tangere reads, and how it reads it.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace tangere::fuzz {

struct Target {
  std::string name;
  bool hdf5 = false;
  std::string file;  ///< name of the mutant in its folder
  /// Puts the files that readers look for beside the mutant into a folder, and returns the files
  /// that mutants are made of.
  std::function<std::vector<std::string>(const std::string& folder)> prepare;
  /// Reads `file` in the folder as the command does. May throw InputError and IoError.
  std::function<void(const std::string& folder)> read;
};

/// scene, urdf, mjcf, mjcf_includes, scene_includes, table, obj, stl, ply, contact_points, layout.
std::vector<Target> text_targets();
/// shard, merged (links to shards), copied (all numbers in it), trajectory.
std::vector<Target> hdf5_targets();
/// viewed_trajectory, viewed_shard: files of a real scene, as `view` and `simulate --state-from`
/// read them.
std::vector<Target> viewed_targets();
/// The scene of those files: a pad with flaws and shear springs, on a ball whose radius
/// varies.
std::string small_scene();
/// All of them.
std::vector<Target> targets();

/// Reads one mutant. Returns false if it was refused with a documented error. Everything else that
/// happens is a finding: another exception leaves this function.
bool read_mutant(const Target& target, const std::string& folder, const std::string& bytes);

}  // namespace tangere::fuzz
