// SPDX-License-Identifier: Apache-2.0
// External links to whole demos: thousands of shards make one small file.
#include "io/dataset_merge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "engine/error.hpp"
#include "io/dataset_description.hpp"
#include "io/h5_links.hpp"
#include "io/h5_listing.hpp"
#include "io/minari_view.hpp"
#include "io/part_file.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr hsize_t kDescriptionBlock = hsize_t{1} << 16;
constexpr std::size_t kValidShare = 10;  // one demo in ten is kept for validation

/// SplitMix64: which demos are for validation looks random and is the same for everybody.
std::uint64_t scramble(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

/// Writes the file; numbers stay where they are unless they are to be copied.
class Merger {
 public:
  Merger(const std::string& path, const MergeOptions& options) : options_(options), part_(path, options.overwrite) {}
  ~Merger() {
    if (file_.get() >= 0) part_.empty();
  }
  Merger(const Merger&) = delete;
  Merger& operator=(const Merger&) = delete;

  MergeResult merge(const DatasetFiles& dataset) {
    file_ = h5::create_file(part_.path(), kDescriptionBlock);
    data_ = h5::create_group(file_, "data");
    failed_ = h5::create_group(file_, "failed");
    describe(dataset.files.front());
    for (const std::string& shard : dataset.files) add(shard);
    write_masks();
    h5::write_scalar<std::int64_t>(data_, "total", rows_);
    h5::write_scalar<std::uint64_t>(file_, "content_sum", sum_);
    data_.reset();
    failed_.reset();
    h5::close_file(file_, part_.path());
    result_.bytes = fs::file_size(part_.path());
    part_.commit();
    result_.file = part_.output();
    return result_;
  }
  [[nodiscard]] const std::vector<DemoPlace>& demos() const { return demos_; }

 private:
  void describe(const std::string& shard) {
    const h5::Id from = h5::open_file(shard);
    for (const char* name : {"format", "command"}) h5::write_attribute(file_, name, h5::read_text(from, name));
    const auto number = [&](const char* name) { return h5::read_numbers<std::int64_t>(from, name).at(0); };
    h5::write_scalar<std::int64_t>(file_, "format_version", number("format_version"));
    for (const char* name : {"dataset_episodes", "dataset_shards"})
      h5::write_scalar<std::int64_t>(file_, name, number(name));
    h5::write_scalar<std::int64_t>(file_, "first_episode", 0);
    h5::write_scalar<std::int64_t>(file_, "episodes", number("dataset_episodes"));
    h5::write_attribute(data_, "env_args", h5::read_text(h5::open_group(from, "data"), "env_args"));
    h5::copy_group(from, "scene", file_, "scene");
  }

  void add(const std::string& shard) {
    const h5::Id from = h5::open_file(shard);
    const h5::Id data = h5::open_group(from, "data"), failed = h5::open_group(from, "failed");
    const std::string name = fs::path(shard).filename();
    for (const std::int64_t number : demo_numbers(data)) {
      put(data, data_, fmt::format("demo_{}", number), name, "/data/");
      demos_.push_back({number, options_.copy ? fs::path(part_.output()).filename().string() : name});
      ++result_.demos;
    }
    for (const std::string& episode : h5::link_names(failed)) {
      put(failed, failed_, episode, name, "/failed/");
      ++result_.failed;
    }
    rows_ += h5::read_numbers<std::int64_t>(data, "total").at(0);
    sum_ += h5::read_numbers<std::uint64_t>(from, "content_sum").at(0);  // modulo 2⁶⁴, as within a shard
  }

  void put(const h5::Id& from, const h5::Id& to, const std::string& name, const std::string& file,
           const std::string& group) {
    if (options_.copy) {
      h5::copy_group(from, name, to, name);
    } else {
      h5::link_external(to, name, file, group + name);
    }
  }

  void write_masks() {
    std::vector<std::pair<std::uint64_t, std::int64_t>> order;
    for (const DemoPlace& demo : demos_)
      order.emplace_back(scramble(static_cast<std::uint64_t>(demo.number)), demo.number);
    std::sort(order.begin(), order.end());
    const std::size_t few = order.size() < 2 ? 0 : std::max<std::size_t>(1, order.size() / kValidShare);
    std::vector<std::int64_t> valid, train;
    for (std::size_t i = 0; i < order.size(); ++i) (i < few ? valid : train).push_back(order[i].second);
    const h5::Id masks = h5::create_group(file_, "mask");
    for (auto* list : {&train, &valid}) {
      std::sort(list->begin(), list->end());
      std::vector<std::string> names;
      for (const std::int64_t number : *list) names.push_back(fmt::format("demo_{}", number));
      h5::write_names(masks, list == &train ? "train" : "valid", names);
    }
    result_.train = static_cast<std::int64_t>(train.size());
    result_.valid = static_cast<std::int64_t>(valid.size());
  }

  const MergeOptions& options_;
  PartFile part_;
  h5::Id file_, data_, failed_;
  std::vector<DemoPlace> demos_;
  std::int64_t rows_ = 0;
  std::uint64_t sum_ = 0;
  MergeResult result_;
};

}  // namespace

MergeResult merge_dataset(const DatasetFiles& dataset, const MergeOptions& options) {
  if (dataset.folder.empty())
    throw IoError(fmt::format("'{}' is a file; expected the folder of its shards", dataset.files.front()));
  check_complete(dataset);
  Merger merger((fs::path(dataset.folder) / "robomimic.hdf5").string(), options);
  MergeResult result = merger.merge(dataset);
  if (merger.demos().empty()) return result;  // Minari has no way to say that there is nothing
  result.minari_id = write_minari_view(dataset, merger.demos(), options.overwrite);
  result.minari = (fs::path(dataset.folder) / "minari" / result.minari_id).string();
  return result;
}

}  // namespace tangere
