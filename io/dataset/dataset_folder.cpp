// SPDX-License-Identifier: Apache-2.0
// Removes everything under the lock, merged files before shards.
#include "io/dataset/dataset_folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>

#include "engine/base/error.hpp"
#include "io/files/input_files.hpp"
#include "io/files/part_file.hpp"

namespace tangere {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kPart = ".part";

[[noreturn]] void fail(const std::string& operation, const std::string& path, int error) {
  throw IoError(fmt::format("cannot {} '{}': {}", operation, path, std::strerror(error)));
}

/// Matches names like "shard-00042.h5" followed by `suffix`.
bool is_shard(const std::string& name, const std::string& suffix) {
  constexpr std::string_view kBegin = "shard-";
  if (!name.starts_with(kBegin) || !name.ends_with(suffix)) return false;
  if (name.size() <= kBegin.size() + suffix.size()) return false;
  return std::all_of(name.begin() + kBegin.size(),
                     name.end() - static_cast<std::ptrdiff_t>(suffix.size()),
                     [](char c) { return c >= '0' && c <= '9'; });
}

/// Places of views for Minari: NAME-v0 and TASK/NAME-v0 below the folder, which may be missing.
std::vector<fs::path> views_in(const fs::path& folder) {
  std::vector<fs::path> views;
  std::error_code none_there;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, none_there)) {
    views.push_back(entry.path());
    if (entry.is_symlink()) continue;
    for (const fs::directory_entry& inner : fs::directory_iterator(entry.path(), none_there))
      if (!inner.is_symlink() && inner.path().filename() != "data") views.push_back(inner.path());
  }
  return views;
}

}  // namespace

DatasetFolder::DatasetFolder(std::string path, ExistingShards existing, bool shared,
                             FolderPatience patience)
    : path_(std::move(path)), existing_(existing), shared_(shared), patience_(std::move(patience)) {
  std::error_code error;
  created_ = fs::create_directory(path_, error);
  if (error && error != std::errc::file_exists)
    throw IoError(fmt::format("cannot create the folder '{}': {}{}", path_, error.message(),
                              error == std::errc::no_such_file_or_directory
                                  ? "; expected its parent folder to be there"
                                  : ""));
  if (!fs::is_directory(path_))
    throw IoError(
        fmt::format("'{}' exists and is not a folder; expected a folder for shards", path_));
  if (access(path_.c_str(), W_OK | X_OK) != 0) fail("write into", path_, errno);
  hold();
  if (!shared_ && existing == ExistingShards::refuse && !shards().empty())
    throw IoError(
        fmt::format("'{}' has shards already; give --overwrite to replace them, or --resume to "
                    "keep them and make the rest",
                    path_));
  if (existing == ExistingShards::replace)
    for (const std::vector<std::string>& replaced : {shards(), merged_files()})
      std::for_each(replaced.begin(), replaced.end(), refuse_input);
  clean();
}

DatasetFolder::~DatasetFolder() {
  // Another process may be about to write into a shared folder.
  if (created_ && !shared_) rmdir(path_.c_str());  // fails if it is not empty
}

void DatasetFolder::hold() {
  lock_.emplace(path_);
  if (shared_ ? lock_->take(FolderLock::Kind::shared, patience_.to_share)
              : lock_->take(FolderLock::Kind::alone, patience_.to_be_alone))
    return;
  throw IoError(
      fmt::format("cannot write into '{}': another process is writing shards there{}; start again "
                  "when it has ended",
                  path_, shared_ ? " and does not share the folder, or merges them" : ""));
}

void DatasetFolder::let_go() {
  if (shared_) lock_->let_go();
}

bool DatasetFolder::hold_alone() {
  return !shared_ || lock_->take(FolderLock::Kind::alone, patience_.to_be_alone);
}

void DatasetFolder::clean() {
  // Takes the .part over and drops it. If another process is writing it, that is an error.
  const auto remove = [](const std::string& part) {
    const PartFile stale(part.substr(0, part.size() - kPart.size()), true);
  };
  if (!shared_)
    for (const char* kind : {".h5", ".h5.spill"})
      for (const std::string& part : files_ending(fmt::format("{}{}", kind, kPart))) remove(part);
  // Nobody merges while this process holds the folder, so these files are from a merge that was
  // killed. At most, another process cleans up after it, too.
  for (const std::string& part : merged_files(std::string(kPart))) {
    try {
      remove(part);
    } catch (const IoError&) {
      if (!shared_) throw;
    }
  }
}

std::vector<std::string> DatasetFolder::files_ending(const std::string& suffix) const {
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(path_))
    if (is_shard(entry.path().filename().string(), suffix)) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

/// Names the files as in io/dataset/dataset_merge.hpp and io/dataset/minari_view.hpp, if they
/// exist. robomimic's file comes last.
std::vector<std::string> DatasetFolder::merged_files(const std::string& suffix) const {
  std::vector<std::string> files;
  for (const fs::path& view : views_in(fs::path(path_) / "minari" / "tangere"))
    for (const char* name :
         {"main_data.hdf5", "metadata.json"})  // removed first: without it there is no data set
      files.push_back((view / "data" / name).string());
  files.push_back((fs::path(path_) / "robomimic.hdf5").string());
  for (std::string& file : files) file += suffix;
  std::erase_if(files, [](const std::string& file) { return !fs::is_regular_file(file); });
  return files;
}

std::string DatasetFolder::shard_path(std::int64_t shard) const {
  return (fs::path(path_) / fmt::format("shard-{:05}.h5", shard)).string();
}

double DatasetFolder::free_bytes() const {
  double bytes = static_cast<double>(fs::space(path_).available);
  if (existing_ != ExistingShards::replace || shared_) return bytes;
  for (const std::string& file : shards()) bytes += static_cast<double>(fs::file_size(file));
  return bytes;
}

void DatasetFolder::remove_old_shards(std::int64_t count) {
  if (existing_ != ExistingShards::replace) return;
  std::vector<std::string> files = shards();
  if (shared_) {
    std::set<std::string> ours;
    for (std::int64_t shard = 0; shard < count; ++shard) ours.insert(shard_path(shard));
    std::erase_if(files, [&](const std::string& file) { return ours.contains(file); });
  }
  for (const std::string& merged : merged_files()) files.push_back(merged);
  std::reverse(files.begin(), files.end());
  for (const std::string& file : files)
    if (unlink(file.c_str()) != 0 && errno != ENOENT)
      fail("remove", file, errno);  // gone: other processes that share it remove it, too
  const fs::path views = fs::path(path_) / "minari" / "tangere";
  std::vector<fs::path> emptied;
  for (const fs::path& view : views_in(views))
    emptied.insert(emptied.end(), {view / "data", view, view.parent_path()});
  emptied.insert(emptied.end(), {views, views.parent_path()});
  for (const fs::path& folder : emptied) rmdir(folder.c_str());  // fails if it is not empty
}

}  // namespace tangere
