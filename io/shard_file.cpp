// SPDX-License-Identifier: Apache-2.0
// The layout that robomimic's loader reads (docs/datasets.md).
#include "io/shard_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "io/dataset_description.hpp"

namespace tangere {
namespace {

constexpr std::int64_t kBlockEpisodes = 16;
constexpr hsize_t kDescriptionBlock = hsize_t{1} << 20;

h5::Dims with_rows(std::int64_t rows, const std::vector<std::uint64_t>& shape) {
  h5::Dims dims{static_cast<hsize_t>(rows)};
  dims.insert(dims.end(), shape.begin(), shape.end());
  return dims;
}

std::size_t numbers_of(const h5::Dims& dims) {
  std::size_t numbers = 1;
  for (const hsize_t n : dims) numbers *= n;
  return numbers;
}

/// `chunk`: rows of a chunk, 0: contiguous.
h5::Id create(const h5::Id& group, const std::string& name, const h5::Dims& dims, bool single, std::int64_t chunk = 0) {
  h5::Storage storage{{}, false, true};
  if (chunk > 0) {
    storage = {dims, true, false};
    storage.chunk[0] = std::min(dims[0], static_cast<hsize_t>(chunk));
  }
  return single ? h5::create_dataset<float>(group, name, dims, storage)
                : h5::create_dataset<double>(group, name, dims, storage);
}

/// Rows [first, first + dims[0]) of a dataset; none when dims hold no numbers.
template <class T>
void put(const h5::Id& dataset, std::int64_t first, const h5::Dims& dims, const T* data) {
  if (numbers_of(dims) == 0) return;
  h5::Dims offset(dims.size(), 0);
  offset[0] = static_cast<hsize_t>(first);
  h5::write_box<T>(dataset, offset, dims, data);
}

}  // namespace

ShardFile::ShardFile(const std::string& path, const DatasetLayout& layout,
                     EpisodeRange range, bool overwrite)
    : layout_(layout),
      first_episode_(range.first),
      end_(range.end),
      created_(range.first),
      unfinished_((range.end - range.first + kBlockEpisodes - 1) / kBlockEpisodes),
      names_(layout.observation_names()),
      shapes_(layout.observation_shapes()),
      rows_of_chunks_(chunk_rows(layout)),
      part_(path, overwrite),
      file_(h5::create_file(part_.path(), kDescriptionBlock)) {
  try {
    describe();
  } catch (...) {
    part_.empty();
    throw;
  }
}

ShardFile::~ShardFile() {
  // On a full disk the library can only close its file once there is room again.
  if (file_.get() >= 0) part_.empty();
}

void ShardFile::describe() {
  describe_dataset(file_, layout_);
  h5::write_scalar<std::int64_t>(file_, "first_episode", first_episode_);
  h5::write_scalar<std::int64_t>(file_, "episodes", end_ - first_episode_);
  data_ = h5::create_group(file_, "data");
  h5::write_attribute(data_, "env_args",
                      fmt::format(R"({{"env_name": {}, "type": 2, "env_kwargs": {{}}}})",
                                  json_text(layout_.scene_name)));
  static_cast<void>(h5::create_group(file_, "failed"));
}

void ShardFile::create_block(std::int64_t first_episode, std::span<const EpisodeEnd> ends) {
  Block& block = blocks_[first_episode];
  const std::int64_t end = std::min(first_episode + kBlockEpisodes, end_);
  for (std::int64_t episode = first_episode; episode < end; ++episode)
    block.push_back(
        create_demo(episode, ends.empty() ? nullptr : &ends[static_cast<std::size_t>(episode - first_episode)]));
}

ShardFile::Demo ShardFile::create_demo(std::int64_t episode, const EpisodeEnd* end) {
  // An episode that failed in its first action has no row; it will be removed.
  const std::int64_t rows = end != nullptr ? std::max<std::int64_t>(1, end->length) : layout_.rows();
  h5::Id group = h5::create_group(data_, fmt::format("demo_{}", episode));
  h5::write_scalar<std::int64_t>(group, "num_samples", rows);
  if (end != nullptr) {
    h5::write_scalar<double>(group, "return", end->total);
    h5::write_scalar<std::int8_t>(group, "terminated", end->terminated ? 1 : 0);
    h5::write_scalar<std::int8_t>(group, "success", end->success ? 1 : 0);
  }
  // Its room, to be filled when the block comes: blocks before it must not show in the file.
  if (!layout_.randomized_names.empty())
    h5::write_list<double>(group, "randomized", std::vector<double>(layout_.randomized_names.size(), 0));
  Demo demo;
  demo.length = rows;
  demo.actions = create(group, "actions", with_rows(rows, {layout_.action_names().size()}), true);
  const std::vector<float> rewards(static_cast<std::size_t>(rows), 0.0F);
  const h5::Dims list{rewards.size()};
  demo.rewards = create(group, "rewards", list, true);
  if (end == nullptr) put(demo.rewards, 0, list, rewards.data());
  std::vector<std::int8_t> dones(rewards.size(), 0);
  dones.back() = 1;
  h5::create_flags(group, "dones", dones);
  const h5::Id obs = h5::create_group(group, "obs"), last = h5::create_group(group, "final_obs");
  for (std::size_t k = 0; k < names_.size(); ++k) {
    demo.obs.push_back(create(obs, names_[k], with_rows(rows, shapes_[k]), layout_.single, rows_of_chunks_[k]));
    demo.final_obs.push_back(
        create(last, names_[k], with_rows(1, shapes_[k]), layout_.single, compresses_last(k) ? 1 : 0));
  }
  demo.group = std::move(group);
  create_gradients(demo);
  return demo;
}

void ShardFile::create_gradients(Demo& demo) const {
  for (const GradientArray& array : layout_.gradients) {
    const h5::Dims once(array.shape.begin(), array.shape.end());
    demo.gradients.push_back(create(demo.group, array.name, array.by_row ? with_rows(demo.length, array.shape) : once, false));
    h5::write_attribute(demo.gradients.back(), "meaning", array.meaning);
  }
}

void ShardFile::write_gradients(Demo& demo, const EpisodeRows& rows, int episode) const {
  for (std::size_t k = 0; k < rows.gradients.size(); ++k) {
    const GradientArray& array = layout_.gradients[k];
    const std::size_t each = rows.gradients[k].size() / static_cast<std::size_t>(rows.episodes);
    const double* from = rows.gradients[k].data() + static_cast<std::size_t>(episode) * each;
    h5::Dims dims(array.shape.begin(), array.shape.end());
    if (array.by_row) dims = with_rows(demo.length, array.shape);
    put(demo.gradients[k], 0, dims, from);
    // Among names in their order, as who reads the file finds them.
    const auto before = std::count_if(layout_.gradients.begin(), layout_.gradients.end(),
                                      [&](const GradientArray& other) { return other.name < array.name; });
    const auto count = static_cast<std::int64_t>(dims[0]);
    demo.sum.add(rows.first_episode + episode, names_.size() + 2 + static_cast<std::size_t>(before), 0, count,
                 numbers_of(dims) / dims[0] * sizeof(double), from);
  }
}

void ShardFile::write_randomized(Demo& demo, const EpisodeRows& rows, int episode) const {
  const std::size_t count = layout_.randomized_names.size();
  if (count == 0 || rows.first_row != 0) return;
  const auto values = rows.randomized.subspan(static_cast<std::size_t>(episode) * count, count);
  demo.randomized.assign(values.begin(), values.end());
  h5::replace_list(demo.group, "randomized", values);
}

bool ShardFile::compresses_last(std::size_t name) const {
  const std::size_t bytes = numbers_of(with_rows(1, shapes_[name])) * (layout_.single ? sizeof(float) : sizeof(double));
  return rows_of_chunks_[name] > 0 && compresses_last_row(bytes);
}

void ShardFile::write(const EpisodeRows& rows, std::span<const CompressedChunk> chunks) {
  for (; created_ <= rows.first_episode; created_ += kBlockEpisodes) create_block(created_, rows.ends);
  Block& block = blocks_.at(rows.first_episode);
  const std::size_t nu = layout_.action_names().size();
  for (int e = 0; e < rows.episodes; ++e) {
    Demo& demo = block[static_cast<std::size_t>(e)];
    const std::int64_t taken = std::min<std::int64_t>(rows.action_rows, demo.length - rows.first_row);
    const float* from = rows.actions.data() + static_cast<std::size_t>(e) * static_cast<std::size_t>(rows.action_rows) * nu;
    put(demo.actions, rows.first_row, h5::Dims{static_cast<hsize_t>(taken), nu}, from);
    demo.sum.add(rows.first_episode + e, 0, rows.first_row, taken, nu * sizeof(float), from);
    write_randomized(demo, rows, e);
    if (!rows.ends.empty()) write_rewards(demo, rows, e);
    for (std::size_t name = 0; name < names_.size(); ++name) write_observation(demo, rows, e, name);
    write_gradients(demo, rows, e);
  }
  for (const CompressedChunk& chunk : chunks) {
    const Demo& demo = block[static_cast<std::size_t>(chunk.episode)];
    h5::Dims offset(shapes_[chunk.name].size() + 1, 0);
    offset[0] = static_cast<hsize_t>(chunk.row);
    h5::write_chunk(chunk.last ? demo.final_obs[chunk.name] : demo.obs[chunk.name], offset, chunk.bytes);
  }
}

void ShardFile::write_rewards(Demo& demo, const EpisodeRows& rows, int episode) {
  const float* from = rows.rewards.data() + static_cast<std::size_t>(episode) * static_cast<std::size_t>(rows.action_rows);
  put(demo.rewards, 0, h5::Dims{static_cast<hsize_t>(demo.length)}, from);
  demo.sum.add(rows.first_episode + episode, names_.size() + 1, 0, demo.length, sizeof(float), from);
}

void ShardFile::write_observation(Demo& demo, const EpisodeRows& rows, int episode,
                                  std::size_t name) {
  std::visit(
      [&](const auto& values) {
        const std::size_t width = numbers_of(with_rows(1, shapes_[name]));
        const auto all = static_cast<std::size_t>(rows.rows);
        const auto* from = values.data() + static_cast<std::size_t>(episode) * all * width;
        const std::int64_t taken = std::min<std::int64_t>(rows.action_rows, demo.length - rows.first_row);
        const bool last = rows.rows > taken;
        if (rows_of_chunks_[name] == 0) put(demo.obs[name], rows.first_row, with_rows(taken, shapes_[name]), from);
        if (last && !compresses_last(name))
          put(demo.final_obs[name], 0, with_rows(1, shapes_[name]), from + static_cast<std::size_t>(taken) * width);
        demo.sum.add(rows.first_episode + episode, name + 1, rows.first_row, taken + (last ? 1 : 0),
                     width * sizeof *from, from);
      },
      rows.observations[name]);
}

void ShardFile::finish(std::int64_t first_episode, std::span<const FailedEpisode> failures) {
  const auto block = blocks_.find(first_episode);
  for (const FailedEpisode& failure : failures) {
    // What was written of it is to disappear.
    Demo& demo = block->second[static_cast<std::size_t>(failure.episode - first_episode)];
    demo.sum = {};
    demo.length = 0;
    failures_.push_back(failure);
    randomized_of_failures_[failure.episode] = std::move(demo.randomized);
  }
  for (const Demo& demo : block->second) {
    sum_.add(demo.sum);
    rows_ += demo.length;
  }
  blocks_.erase(block);
  --unfinished_;
}

void ShardFile::record_failures() {
  std::sort(failures_.begin(), failures_.end(),
            [](const FailedEpisode& a, const FailedEpisode& b) { return a.episode < b.episode; });
  const h5::Id failed = h5::open_group(file_, "failed");
  for (const FailedEpisode& failure : failures_) {
    h5::remove_link(data_, fmt::format("demo_{}", failure.episode));
    const h5::Id group = h5::create_group(failed, fmt::format("episode_{}", failure.episode));
    h5::write_scalar<std::int64_t>(group, "step", failure.step);
    h5::write_scalar<std::int8_t>(group, "status", static_cast<std::int8_t>(failure.status));
    h5::write_attribute(group, "reason", to_string(failure.status));
    h5::write_list<double>(group, "q", failure.q);
    h5::write_list<double>(group, "v", failure.v);
    const std::vector<double>& randomized = randomized_of_failures_[failure.episode];
    if (!randomized.empty()) h5::write_list<double>(group, "randomized", randomized);
  }
}

void ShardFile::commit() {
  record_failures();
  h5::write_scalar<std::int64_t>(data_, "total", rows_);
  h5::write_scalar<std::uint64_t>(file_, "content_sum", sum_.value());
  data_.reset();
  h5::close_file(file_, part_.path());
  static_cast<void>(check_shard(part_.path()));
  part_.commit();
}

}  // namespace tangere
