// SPDX-License-Identifier: Apache-2.0
// Links to the members of demos: thousands of shards make one small file.
#include "io/dataset/dataset_merge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/dataset/demo_links.hpp"
#include "io/dataset/grown_file.hpp"
#include "io/dataset/label_sum.hpp"
#include "io/dataset/minari_view.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5_links.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBatch = 16;  // demos that are laid out together
// Descriptions that were used are evicted in shards as they are by default. In larger ones, or in
// copying, the library would take longer for each the more there are.
constexpr std::int64_t kFewEpisodes = 4096;
constexpr std::size_t kValidShare = 10;  // one demo in ten is kept for validation

/// SplitMix64: the demos for validation are pseudorandom and the same in every copy.
std::uint64_t scramble(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

/// Properties by which a demo is assigned to masks.
struct MaskedDemo {
  std::int64_t number = 0;
  std::optional<EpisodeEnd> end;  // of a task
  bool touches = false, valid = false;
};

/// Writes both; numbers stay where they are unless they are to be copied.
class Merger {
 public:
  Merger(const DatasetFiles& dataset, const MergeOptions& options)
      : dataset_(dataset),
        options_(options),
        file_((fs::path(dataset.folder) / "robomimic.hdf5").string(), options.overwrite,
              options.copy) {}

  MergeResult merge() {
    describe(dataset_.files.front());
    if (options_.copy)
      copied_ = h5::create_group(file_.file(), "data");
    else
      file_.close();
    for (const std::string& shard : dataset_.files) add(shard);
    if (!options_.copy) {
      const std::uint64_t data = file_.append_group("demo_", std::move(linked_));
      file_.open();
      h5::link_object(file_.file(), "data", data);
    }
    complete();
    copied_.reset();
    // The view comes first: as long as the merged file is missing, a view is replaced without
    // --overwrite.
    result_.bytes = file_.commit([this](const std::string& part) {
      check_stop();
      if (options_.copy) check_copy(part);
      if (view_) view_->commit(options_.copy ? fs::file_size(part) : shard_bytes_);
    });
    result_.file = file_.output();
    if (view_) {  // without a demo there is none: Minari has no way to say that there is nothing
      result_.minari_id = view_->id();
      result_.minari_left_out = view_->left_out();
      result_.minari = (fs::path(dataset_.folder) / "minari" / view_->id()).string();
    }
    return result_;
  }

  /// Thrown to end a merge on request.
  struct Stopped {};

 private:
  void check_stop() const {
    if (options_.stop && options_.stop()) throw Stopped();
  }

  void describe(const std::string& shard) {
    const h5::Id from = h5::open_file(shard);
    for (const char* name : {"format", "command"})
      h5::write_attribute(file_.file(), name, h5::read_text(from, name));
    const auto number = [&](const char* name) { return h5::read_number<std::int64_t>(from, name); };
    h5::write_scalar<std::int64_t>(file_.file(), "format_version", number("format_version"));
    if (number("format_version") > kUnlabelledFormat) labels_ = 0;
    for (const char* name : {"dataset_episodes", "dataset_shards"})
      h5::write_scalar<std::int64_t>(file_.file(), name, number(name));
    h5::write_scalar<std::int64_t>(file_.file(), "first_episode", 0);
    h5::write_scalar<std::int64_t>(file_.file(), "episodes", number("dataset_episodes"));
    few_each_ = number("dataset_episodes") <= kFewEpisodes * std::ssize(dataset_.files);
    const h5::Id scene = h5::open_group(from, "scene");
    if (!h5::read_text(scene, "task").starts_with("none"))
      policies_ = h5::read_texts(scene, "policies");
    if (H5Aexists(from.get(), "description_sum") > 0)
      description_ = h5::read_number<std::uint64_t>(from, "description_sum");
    env_args_ = h5::read_text(h5::open_group(from, "data"), "env_args");
    h5::copy_group(from, "scene", file_.file(), "scene");
  }

  /// Reads the copy whole. If it is damaged, a shard most likely was damaged, and the error names
  /// that shard.
  void check_copy(const std::string& part) const {
    try {
      check_shard(part);
    } catch (const IoError&) {
      for (const std::string& shard : dataset_.files) check_shard(shard);
      throw;
    }
  }

  void add(const std::string& shard) {
    sample_shard(shard);
    shard_bytes_ += fs::file_size(shard);
    const h5::Id from = h5::open_file(shard, !options_.copy && few_each_);
    const h5::Id data = h5::open_group(from, "data"), failed = h5::open_group(from, "failed");
    const std::string name = fs::path(shard).filename();
    std::vector<LinkedDemo> batch;
    for (const std::int64_t number : demo_numbers(data)) {
      check_stop();
      batch.push_back(described(shard, data, number));
      const DemoFacts& facts = batch.back().facts;
      demos_.push_back({number, facts.end, facts.touching.value_or(0) > 0});
      if (batch.size() == kBatch) put(data, name, batch);
    }
    put(data, name, batch);
    for (const std::string& episode : h5::link_names(failed)) failed_.push_back({name, episode});
    rows_ += h5::read_number<std::int64_t>(data, "total");
    add_steps(steps_, stored_steps(from));
    sum_ += h5::read_number<std::uint64_t>(from, "content_sum");  // modulo 2⁶⁴, as within a shard
    if (labels_) *labels_ += h5::read_number<std::uint64_t>(from, "label_sum");  // the same
  }

  LinkedDemo described(const std::string& shard, const h5::Id& data, std::int64_t number) {
    try {
      const h5::Id demo = h5::open_group(data, fmt::format("demo_{}", number));
      if (!members_) members_ = members_of(demo);
      LinkedDemo linked{number, facts_of(demo, *members_)};
      check_members(demo, *members_, linked.facts);
      return linked;
    } catch (const IoError& error) {
      throw IoError(fmt::format("'{}' is damaged: demo_{}: {}", shard, number, error.what()));
    }
  }

  /// Empties the batch.
  void put(const h5::Id& data, const std::string& shard, std::vector<LinkedDemo>& batch) {
    if (batch.empty()) return;
    if (options_.copy) {
      for (const LinkedDemo& demo : batch) {
        check_stop();
        try_copy(data, shard, demo);
      }
    } else {
      h5::Bytes out;
      for (const h5::FileMember& group : add_demo_links(out, file_.here(), *members_, shard, batch))
        linked_.push_back(group);
      file_.append(out, {"links from demo_", batch.front().number});
    }
    if (!view_) view_.emplace(dataset_.folder, data, *members_);
    view_->add(options_.copy ? fs::path(file_.output()).filename().string() : shard, batch);
    batch.clear();
  }

  void try_copy(const h5::Id& data, const std::string& shard, const LinkedDemo& demo) {
    try {
      copy(data, demo);
    } catch (const IoError&) {
      check_shard((fs::path(dataset_.folder) / shard).string());  // says more if that is why
      throw;
    }
  }

  void copy(const h5::Id& data, const LinkedDemo& demo) {
    const std::string name = fmt::format("demo_{}", demo.number), path = "/data/" + name;
    h5::copy_group(data, name, copied_, name);
    const h5::Id made = h5::open_group(copied_, name), next = h5::create_group(made, "next_obs");
    for (const DemoArray& array : members_->observations)
      if (array.type != h5::NumberType::text)  // as links
        h5::create_virtual(next, array.name, h5::open_dataset(made, "obs/" + array.name),
                           {".", path + "/obs/" + array.name},
                           {".", path + "/final_obs/" + array.name}, 1);
    const h5::Id obs = h5::open_group(made, "obs");
    for (const auto& [of, plain] : members_->plain_names) {
      const DemoArray& array = members_->observations[of];
      h5::link_again(obs, array.name, plain);
      if (array.type != h5::NumberType::text) h5::link_again(next, array.name, plain);
    }
  }

  void complete() {
    const h5::Id data = h5::open_group(file_.file(), "data"),
                 failed = h5::create_group(file_.file(), "failed");
    h5::write_attribute(data, "env_args", env_args_);
    h5::write_scalar<std::int64_t>(data, "total", rows_);
    std::string open;
    h5::Id shard;
    for (const auto& [file, episode] : failed_) {
      if (!options_.copy) {
        h5::link_external(failed, episode, file, "/failed/" + episode);
        continue;
      }
      if (file != open) shard = h5::open_file((fs::path(dataset_.folder) / file).string());
      open = file;
      h5::copy_group(h5::open_group(shard, "failed"), episode, failed, episode);
    }
    write_masks();
    if (steps_) write_steps(file_.file(), *steps_);
    h5::write_scalar<std::uint64_t>(file_.file(), "content_sum", sum_);
    if (labels_) h5::write_scalar<std::uint64_t>(file_.file(), "label_sum", *labels_);
    if (description_)
      h5::write_scalar<std::uint64_t>(file_.file(), "description_sum", *description_);
    result_.demos = std::ssize(demos_);
    result_.failed = std::ssize(failed_);
    result_.steps = steps_;
  }

  /// Filter keys of robomimic: demos to train on and to validate, those with contact, those
  /// that solved the task, and, if several policies played, the demos of each.
  void write_masks() {
    std::vector<std::pair<std::uint64_t, std::size_t>> order;
    for (std::size_t i = 0; i < demos_.size(); ++i)
      order.emplace_back(scramble(static_cast<std::uint64_t>(demos_[i].number)), i);
    std::sort(order.begin(), order.end());
    const std::size_t few =
        order.size() < 2 ? 0 : std::max<std::size_t>(1, order.size() / kValidShare);
    for (std::size_t i = 0; i < few; ++i) demos_[order[i].second].valid = true;
    const h5::Id masks = h5::create_group(file_.file(), "mask");
    const auto write = [&](const std::string& name, const auto& has) {
      std::vector<std::int64_t> list;
      for (const MaskedDemo& demo : demos_)
        if (has(demo)) list.push_back(demo.number);
      h5::write_names(masks, name, "demo_", list);
      std::vector<std::string> names;
      for (const std::int64_t number : list) names.push_back(fmt::format("demo_{}", number));
      h5::write_scalar<std::uint64_t>(h5::open_dataset(masks, name), kMaskSum, sum_of_names(names));
      return std::ssize(list);
    };
    const auto write_parts = [&](const std::string& name, const auto& has) {
      write("train_" + name, [&](const MaskedDemo& demo) { return !demo.valid && has(demo); });
      write("valid_" + name, [&](const MaskedDemo& demo) { return demo.valid && has(demo); });
      return write(name, has);
    };
    result_.train = write("train", [](const MaskedDemo& demo) { return !demo.valid; });
    result_.valid = write("valid", [](const MaskedDemo& demo) { return demo.valid; });
    if (!stored_touch(h5::open_group(file_.file(), "scene")).empty())
      result_.touching =
          write_parts("touching", [](const MaskedDemo& demo) { return demo.touches; });
    if (policies_.empty()) return;
    result_.successes =
        write_parts("success", [](const MaskedDemo& demo) { return demo.end->success; });
    for (std::size_t k = 0; k < policies_.size() && policies_.size() > 1; ++k)
      write(policies_[k], [k](const MaskedDemo& demo) {
        return static_cast<std::size_t>(demo.end->policy) == k;
      });
  }

  const DatasetFiles& dataset_;
  const MergeOptions& options_;
  GrownFile file_;
  h5::Id copied_;  // group of demos
  std::string env_args_;
  std::optional<std::uint64_t> description_;  // description_sum of the shards
  std::optional<std::uint64_t> labels_;       // label_sum of the shards; none: they have none
  bool few_each_ = false;                     // episodes in a shard
  std::optional<DemoMembers> members_;
  std::optional<MinariView> view_;
  std::vector<MaskedDemo> demos_;                            // ascending
  std::vector<std::string> policies_;                        // of a task
  std::vector<h5::FileMember> linked_;                       // groups of demos
  std::vector<std::pair<std::string, std::string>> failed_;  // shard, episode
  std::optional<EpisodeSteps> steps_ = EpisodeSteps();
  std::int64_t rows_ = 0;
  std::uint64_t sum_ = 0, shard_bytes_ = 0;
  MergeResult result_;
};

}  // namespace

MergeResult merge_dataset(const DatasetFiles& dataset, const MergeOptions& options) {
  if (dataset.folder.empty())
    throw IoError(
        fmt::format("'{}' is a file; expected the folder of its shards", dataset.files.front()));
  check_complete(dataset);
  try {
    return Merger(dataset, options).merge();
  } catch (const Merger::Stopped&) {
    MergeResult nothing;
    nothing.stopped = true;
    return nothing;
  }
}

}  // namespace tangere
