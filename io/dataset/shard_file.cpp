// SPDX-License-Identifier: Apache-2.0
// A block has the descriptions of its demos, then indexes of chunks if there are any, then the
// numbers, demo by demo.
#include "io/dataset/shard_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "io/dataset/dataset_description.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/dataset/shard_check.hpp"

namespace tangere {
namespace {

constexpr std::size_t kMostHeld = std::size_t{64} << 20;
constexpr const char* kSpill = ".spill";
constexpr std::array<unsigned char, 4096> kZeros{};  // behind JPEG files

template <class T>
std::span<const unsigned char> bytes_of(std::span<const T> numbers) {
  return {reinterpret_cast<const unsigned char*>(numbers.data()), numbers.size_bytes()};
}

}  // namespace

ShardFile::ShardFile(const std::string& path, const DatasetLayout& layout, const DemoFormat& format,
                     EpisodeRange range, bool overwrite, std::size_t& held_bytes)
    : layout_(layout),
      format_(format),
      first_episode_(range.first),
      end_(range.end),
      unfinished_((range.end - range.first + kShardBlock - 1) / kShardBlock),
      next_(range.first),
      sizes_vary_(has_chunks(layout) || layout.has_jpeg()),
      held_bytes_(held_bytes),
      part_(path, overwrite),
      placed_(part_),
      no_rewards_(static_cast<std::size_t>(layout.rows()), 0.0F),
      dones_(no_rewards_.size(), 0) {
  dones_.back() = 1;
  describe();
}

void ShardFile::describe() {
  file_ = h5::create_file(part_.path(), part_.written());
  describe_dataset(file_, layout_);
  h5::write_scalar<std::int64_t>(file_, "first_episode", first_episode_);
  h5::write_scalar<std::int64_t>(file_, "episodes", end_ - first_episode_);
  h5::close_file(file_, part_.path());
  texts_ = h5::aligned(part_.size());
  const h5::Bytes texts = format_.texts();
  placed_.add(texts_, texts.all(), {"texts of demos"});
  placed_.flush();
  begin_ = free_ = texts_ + texts.size();
}

ShardFile::Block& ShardFile::block_of(const EpisodeRows& rows) {
  const auto [found, is_new] = blocks_.try_emplace(rows.first_episode);
  Block& block = found->second;
  if (!is_new) return block;
  const std::size_t varied = layout_.randomized_names.size();
  for (int e = 0; e < rows.episodes; ++e) {
    Demo& demo = block.demos.emplace_back();
    demo.facts.rows = rows_of_episode(layout_, rows, e);
    const auto i = static_cast<std::size_t>(e);
    if (!rows.ends.empty()) demo.facts.end = rows.ends[i];
    // Pieces that do not come from the engine may leave out what varied.
    demo.facts.randomized.assign(varied, 0);
    if (!rows.randomized.empty())
      std::copy_n(rows.randomized.begin() + static_cast<std::ptrdiff_t>(i * varied), varied,
                  demo.facts.randomized.begin());
    demo.facts.gains = picture_gains(layout_.gained, layout_.seed, rows.first_episode + e);
    if (!format_.touch().empty()) demo.facts.touching = 0;
    demo.addresses.resize(format_.datasets(), h5::kNowhere);
    demo.rows.resize(format_.datasets());
    demo.chunks.resize(format_.datasets());
    demo.pictures.resize(format_.datasets());
    demo.widths.resize(format_.datasets(), 1);
  }
  if (!waits()) give_place(block, rows.first_episode);
  return block;
}

/// Demos of a scene have one size, so the place of a block follows from its number. Blocks of a
/// task come in ascending order.
void ShardFile::give_place(Block& block, std::int64_t first_episode) {
  const std::uint64_t demo_bytes = format_.header_bytes() + format_.data_bytes(layout_.rows());
  const auto before = static_cast<std::uint64_t>(first_episode - first_episode_);
  block.base = layout_.task ? free_ : begin_ + before * demo_bytes;
  std::uint64_t at = block.base + block.demos.size() * format_.header_bytes();
  for (Demo& demo : block.demos)
    for (std::size_t k = 0; k < format_.datasets(); ++k) {
      demo.addresses[k] = at;
      at += h5::aligned(static_cast<std::uint64_t>(format_.rows_of(k, demo.facts.rows)) *
                        format_.row_bytes(k));
    }
  free_ = std::max(free_, at);
}

void ShardFile::write(const EpisodeRows& rows, PreparedPiece prepared) {
  Block& block = block_of(rows);
  for (int e = 0; e < rows.episodes; ++e) {
    const auto i = static_cast<std::size_t>(e);
    block.demos[i].sum.add(prepared.sums[i]);
    if (block.demos[i].facts.touching) *block.demos[i].facts.touching += prepared.touching[i];
    write_slices(block, rows, e);
  }
  placed_.flush();
  hold(block, rows.first_episode, prepared);
}

void ShardFile::write_slices(Block& block, const EpisodeRows& rows, int episode) {
  Demo& demo = block.demos[static_cast<std::size_t>(episode)];
  const std::vector<PieceSlice> slices = slices_of(format_, rows, episode, demo.facts.rows);
  for (std::size_t k = 0; k < format_.datasets(); ++k) {
    const PieceSlice& slice = slices[k];
    const BytesOf what{format_.title(k), rows.first_episode + episode};
    if (!waits()) {
      const std::span<const unsigned char> same = constant(k, demo.facts.rows);
      if (same.empty())
        placed_.add(
            demo.addresses[k] + static_cast<std::uint64_t>(slice.first) * slice.rows.row_bytes,
            slice.bytes(), what);
      else if (rows.first_row == 0)
        placed_.add(demo.addresses[k], same, what);
    } else if (format_.chunk_rows(k, demo.facts.rows) == 0 && !format_.as_jpeg(k) &&
               slice.rows.rows > 0) {
      const std::span<const unsigned char> bytes = slice.bytes();
      demo.rows[k].push_back(hold({bytes.begin(), bytes.end()}, what));
    }
  }
}

/// Returns numbers that follow from R; nothing for other datasets.
std::span<const unsigned char> ShardFile::constant(std::size_t dataset, std::int64_t rows) const {
  const auto count = static_cast<std::size_t>(rows);
  if (dataset == DemoFormat::kDones) return bytes_of(std::span(dones_).last(count));
  if (dataset == DemoFormat::kRewards && !layout_.task)
    return bytes_of(std::span(no_rewards_).first(count));
  return {};
}

void ShardFile::hold(Block& block, std::int64_t first_episode, PreparedPiece& prepared) {
  for (PreparedChunk& chunk : prepared.chunks) {
    const BytesOf what{format_.title(chunk.dataset), first_episode + chunk.episode};
    const auto bytes = static_cast<std::uint32_t>(chunk.bytes.size());
    block.demos[static_cast<std::size_t>(chunk.episode)].chunks[chunk.dataset].push_back(
        {{chunk.first, 0, bytes}, hold(std::move(chunk.bytes), what)});
  }
  for (PreparedPictures& some : prepared.pictures) {
    const BytesOf what{format_.title(some.dataset), first_episode + some.episode};
    Demo& demo = block.demos[static_cast<std::size_t>(some.episode)];
    for (std::size_t k = 0; k < some.files.size(); ++k) {
      demo.widths[some.dataset] =
          std::max(demo.widths[some.dataset], static_cast<std::uint32_t>(some.files[k].size()));
      demo.pictures[some.dataset].push_back(
          {some.first + static_cast<std::int64_t>(k), hold(std::move(some.files[k]), what)});
    }
  }
}

/// The spill file loses its name at once, so that a run that is killed leaves nothing.
ShardFile::Held ShardFile::hold(std::vector<unsigned char> bytes, const BytesOf& what) {
  Held held;
  held.size = bytes.size();
  if (held_bytes_ + held.size <= kMostHeld) {
    held_bytes_ += held.size;
    held.bytes = std::move(bytes);
    return held;
  }
  if (!spill_) {
    spill_.emplace(part_.output() + kSpill, true);
    std::filesystem::remove(spill_->path());
  }
  held.spilled = spill_->size();
  const NamedBytes all{bytes, what};
  spill_->write_at(held.spilled, {&all, 1});
  spilled_bytes_ += held.size;
  return held;
}

/// Adds held bytes to the queue of the file.
void ShardFile::place(std::uint64_t address, Held& held, const BytesOf& what) {
  held_bytes_ -= held.bytes.size();
  if (held.spilled == h5::kNowhere) return placed_.add(address, held.bytes, what);
  std::vector<unsigned char>& bytes = read_back_.emplace_back(held.size);
  spill_->read_at(held.spilled, bytes);
  spilled_bytes_ -= held.size;
  placed_.add(address, bytes, what);
}

void ShardFile::finish(std::int64_t first_episode, std::span<const FailedEpisode> failures,
                       const EpisodeSteps& steps) {
  steps_ += steps;
  Block& block = blocks_.at(first_episode);
  for (const FailedEpisode& failure : failures) {
    Demo& demo = block.demos[static_cast<std::size_t>(failure.episode - first_episode)];
    demo.failed = true;
    failures_.push_back(failure);
    facts_of_failures_[failure.episode] = demo.facts;
  }
  block.finished = true;
  --unfinished_;
  if (!waits()) {
    close_block(block, first_episode, {});
    blocks_.erase(first_episode);
    return;
  }
  for (auto next = blocks_.find(next_); next != blocks_.end() && next->second.finished;
       next = blocks_.find(next_)) {
    give_place_to_held(next->second);
    blocks_.erase(next);
    next_ += kShardBlock;
  }
}

/// Places everything in the order of the file, in few large writes.
void ShardFile::give_place_to_held(Block& block) {
  block.base = free_;
  std::size_t indexes = 0;
  for (const Demo& demo : block.demos)
    for (std::size_t k = 0; k < format_.datasets(); ++k)
      indexes += h5::chunk_index_bytes(demo.chunks[k].size(), format_.rank(k));
  const std::uint64_t first_index = block.base + block.demos.size() * format_.header_bytes();
  std::uint64_t at = first_index + indexes;
  h5::Bytes index;
  for (Demo& demo : block.demos)
    for (std::size_t k = 0; k < format_.datasets(); ++k) {
      demo.addresses[k] = at;
      const std::int64_t rows = format_.chunk_rows(k, demo.facts.rows);
      if (rows == 0) {
        at += h5::aligned(static_cast<std::uint64_t>(format_.rows_of(k, demo.facts.rows)) *
                          (format_.as_jpeg(k) ? demo.widths[k] : format_.row_bytes(k)));
        continue;
      }
      std::vector<h5::FileChunk> places;
      for (Chunk& chunk : demo.chunks[k]) {
        chunk.place.address = at;
        at = h5::aligned(at + chunk.held.size);
        places.push_back(chunk.place);
      }
      demo.addresses[k] = h5::add_chunk_index(index, first_index, places, format_.rank(k),
                                              static_cast<std::uint64_t>(rows));
    }
  free_ = at;
  close_block(block, next_, index);
}

void ShardFile::write_held(Block& block, std::int64_t first_episode) {
  for (std::size_t e = 0; e < block.demos.size(); ++e) {
    Demo& demo = block.demos[e];
    for (std::size_t k = 0; k < format_.datasets(); ++k) {
      const BytesOf what{format_.title(k), first_episode + static_cast<std::int64_t>(e)};
      placed_.add(demo.addresses[k], constant(k, demo.facts.rows), what);
      std::uint64_t at = demo.addresses[k];
      for (Held& rows : demo.rows[k]) {
        place(at, rows, what);
        at += rows.size;
      }
      for (Chunk& chunk : demo.chunks[k]) place(chunk.place.address, chunk.held, what);
      write_pictures(demo, k, what);
    }
    if (read_back_.empty()) continue;
    placed_.flush();
    read_back_.clear();
  }
  if (spilled_bytes_ == 0) spill_.reset();
}

/// Every row has the bytes of the largest file. Zeros fill the others.
void ShardFile::write_pictures(Demo& demo, std::size_t dataset, const BytesOf& what) {
  const std::uint64_t width = demo.widths[dataset];
  for (Picture& picture : demo.pictures[dataset]) {
    std::uint64_t at = demo.addresses[dataset] + static_cast<std::uint64_t>(picture.row) * width;
    const std::uint64_t end = at + width;
    place(at, picture.held, what);
    for (at += picture.held.size; at < end;) {
      const std::uint64_t part = std::min<std::uint64_t>(end - at, kZeros.size());
      placed_.add(at, std::span(kZeros).first(part), what);
      at += part;
    }
  }
}

void ShardFile::close_block(Block& block, std::int64_t first_episode, const h5::Bytes& indexes) {
  h5::Bytes descriptions;
  for (std::size_t e = 0; e < block.demos.size(); ++e) {
    const Demo& demo = block.demos[e];
    const std::uint64_t group =
        format_.describe(descriptions, block.base, demo.facts, demo.addresses, demo.widths, texts_);
    if (demo.failed) continue;  // its bytes stay, but no link leads to them
    members_.push_back({first_episode + static_cast<std::int64_t>(e), group});
    rows_ += demo.facts.rows;
    sum_.add(demo.sum);
    labels_.add_demo(members_.back().number, DemoAttributes(demo.facts).all());
  }
  descriptions.add(indexes.all());
  placed_.add(block.base, descriptions.all(), {"descriptions from demo_", first_episode});
  if (waits()) write_held(block, first_episode);
  placed_.flush();
}

void ShardFile::record_failures() {
  std::sort(failures_.begin(), failures_.end(),
            [](const FailedEpisode& a, const FailedEpisode& b) { return a.episode < b.episode; });
  const h5::Id failed = h5::create_group(file_, "failed");
  for (const FailedEpisode& failure : failures_) {
    const h5::Id group = h5::create_group(failed, fmt::format("episode_{}", failure.episode));
    h5::write_scalar<std::int64_t>(group, "step", failure.step);
    h5::write_scalar<std::int8_t>(group, "status", static_cast<std::int8_t>(failure.status));
    h5::write_attribute(group, "reason", to_string(failure.status));
    h5::write_list<double>(group, "q", failure.q);
    h5::write_list<double>(group, "v", failure.v);
    const DemoFacts& facts = facts_of_failures_[failure.episode];
    if (facts.end) h5::write_scalar<std::int64_t>(group, "policy", facts.end->policy);
    if (!facts.randomized.empty()) h5::write_list<double>(group, "randomized", facts.randomized);
    if (!facts.gains.empty()) h5::write_list<double>(group, "picture_gains", facts.gains);
    labels_.add_failed(failure.episode, group);
  }
}

/// `data`: the address of the group of demos.
void ShardFile::complete_description(std::uint64_t data) {
  file_ = h5::change_file(part_.path(), part_.written());
  h5::link_object(file_, "data", data);
  const h5::Id group = h5::open_group(file_, "data");
  h5::write_attribute(group, "env_args", robomimic_environment(layout_));
  h5::write_scalar<std::int64_t>(group, "total", rows_);
  record_failures();
  write_steps(file_, steps_);
  labels_.add(steps_);
  h5::write_scalar<std::uint64_t>(file_, "label_sum", labels_.value());
  h5::write_scalar<std::uint64_t>(file_, "content_sum", sum_.value());
  try {
    h5::write_scalar<std::uint64_t>(file_, "description_sum", description_sum(file_));
  } catch (const IoError&) {
    part_.compare();  // says more if the disk has lost what was written
    throw;
  }
}

void ShardFile::commit() {
  h5::Bytes out;
  const std::uint64_t data = h5::add_large_group(out, free_, "demo_", std::move(members_));
  placed_.add(free_, out.all(), {"names of demos"});
  placed_.flush();
  placed_.end_at(free_ + out.size());
  complete_description(data);
  h5::close_file(file_, part_.path());
  part_.compare();
  sample_shard(part_.path());
  part_.commit();
}

}  // namespace tangere
