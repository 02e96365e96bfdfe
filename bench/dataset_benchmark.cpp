// SPDX-License-Identifier: Apache-2.0
// Measures the writer of data sets alone on one thread: episodes, HDF5 objects and bytes per
// second, by length of episode and compression. Also measures its parts, and merging. The numbers
// are those of a field that is pressed in the middle. Files go to the folder of temporary files.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <vector>

#include "io/dataset/chunk_codec.hpp"
#include "io/dataset/content_sum.hpp"
#include "io/dataset/dataset_merge.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5.hpp"

namespace tangere {
namespace {

constexpr int kBlock = 16;
constexpr std::size_t kObjects =
    12;  // per demo: three groups, actions, rewards, dones, three observations twice

// Per demo in both files: its group and next_obs, its episode and observations; three virtual
// datasets twice, flags, five and three links.
constexpr std::size_t kMergedObjects = 4 + 6 + 1 + 8;

struct Folder {
  std::string path;
  Folder() : path((std::filesystem::temp_directory_path() / "tangere-bench-XXXXXX").string()) {
    if (mkdtemp(path.data()) == nullptr) std::abort();
  }
  ~Folder() { std::filesystem::remove_all(path); }
};

DatasetLayout layout_of(std::int64_t episodes, std::int64_t rows, int side,
                        const std::string& compression) {
  DatasetLayout l;
  l.episodes = episodes;
  l.steps = rows;
  l.single = true;
  for (const char* name : {"x", "y", "z", "a", "b", "c", "d"}) l.q_names.push_back(name);
  l.v_names = l.u_names = {"x", "y", "z", "a", "b", "c"};
  l.q_units.resize(l.q_names.size(), "m");
  l.v_units.resize(l.v_names.size(), "m/s");
  SensorLayout pad;
  pad.name = "pad";
  pad.rows = pad.cols = side;
  pad.points = side * side;
  l.sensors = {pad};
  l.scene_name = "bench";
  l.scene_text = "<tangere/>";
  l.precision = "mixed";
  l.compression = compression;
  return l;
}

/// A field with a third of its points in touch, each with a little noise of its own.
std::vector<float> field(std::size_t frames, int side) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> noise(0.9F, 1.1F);
  std::vector<float> numbers;
  for (std::size_t f = 0; f < frames; ++f)
    for (int r = 0; r < side; ++r)
      for (int c = 0; c < side; ++c) {
        const double x = (r + 0.5) / side - 0.5, y = (c + 0.5) / side - 0.5,
                     depth = 0.1 - x * x - y * y;
        const auto force = static_cast<float>(std::max(0.0, depth));
        for (int k = 0; k < 3; ++k) numbers.push_back(force > 0 ? force * noise(random) : 0.0F);
      }
  return numbers;
}

/// A block of 16 episodes, used again and again.
class Block {
 public:
  explicit Block(const DatasetLayout& l) : rows_(static_cast<int>(l.rows())) {
    const auto frames = static_cast<std::size_t>(kBlock * (rows_ + 1));
    actions_.resize(static_cast<std::size_t>(kBlock * rows_) * l.u_names.size());
    values_ = {std::vector<float>(frames * l.q_names.size(), 0.25F),
               std::vector<float>(frames * l.v_names.size(), 0.5F),
               field(frames, l.sensors[0].rows)};
    for (const std::vector<float>& v : values_)
      observations_.emplace_back(std::span<const float>(v));
  }
  [[nodiscard]] EpisodeRows rows(std::int64_t first) const {
    return {first, kBlock, 0, rows_ + 1, rows_, actions_, observations_};
  }

 private:
  int rows_;
  std::vector<float> actions_;
  std::vector<std::vector<float>> values_;
  std::vector<Observation> observations_;
};

/// Measures whole shards: prepared, written, read back, synced, renamed.
void write_shards(benchmark::State& state, std::int64_t episodes, std::int64_t rows, int side,
                  const char* compression, bool sparse = false) {
  DatasetLayout l = layout_of(episodes, rows, side, compression);
  l.sparse = sparse;
  const Block block(l);
  std::uintmax_t bytes = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const Folder folder;
    state.ResumeTiming();
    DatasetWriter writer({folder.path + "/set"}, l);
    for (std::int64_t first = 0; first < episodes; first += kBlock) {
      writer.prepare(block.rows(first));
      writer.write(block.rows(first));
      writer.finish(first, {}, {});
    }
    state.PauseTiming();
    bytes = 0;
    for (const std::string& shard : writer.shards()) bytes += std::filesystem::file_size(shard);
    state.ResumeTiming();
  }
  using benchmark::Counter;
  const double made = static_cast<double>(episodes) * static_cast<double>(state.iterations());
  state.counters["episodes/s"] = Counter(made, Counter::kIsRate);
  state.counters["us/object"] =
      Counter(1e-6 * made * kObjects, Counter::kIsRate | Counter::kInvert);
  state.counters["MB/s"] = Counter(1e-6 * made * l.episode_bytes(), Counter::kIsRate);
  state.counters["of_size"] =
      static_cast<double>(bytes) / (static_cast<double>(episodes) * l.episode_bytes());
}

void short_episodes(benchmark::State& state) { write_shards(state, 4096, 5, 4, "none"); }
void long_episodes(benchmark::State& state) { write_shards(state, 256, 200, 16, "none"); }
void long_episodes_deflate(benchmark::State& state) {
  write_shards(state, 256, 200, 16, "deflate");
}
void large_fields(benchmark::State& state) { write_shards(state, 16, 20, 200, "none"); }
void large_fields_deflate(benchmark::State& state) { write_shards(state, 16, 20, 200, "deflate"); }
void large_fields_lz4(benchmark::State& state) { write_shards(state, 16, 20, 200, "lz4"); }
void large_fields_sparse(benchmark::State& state) {
  write_shards(state, 16, 20, 200, "none", true);
}
void large_fields_sparse_deflate(benchmark::State& state) {
  write_shards(state, 16, 20, 200, "deflate", true);
}
BENCHMARK(short_episodes)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(long_episodes)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(long_episodes_deflate)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(large_fields)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(large_fields_deflate)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(large_fields_lz4)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(large_fields_sparse)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(large_fields_sparse_deflate)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

/// Measures one file of links and the view for Minari, for episodes as above. Time must grow in
/// proportion to their number.
void merge(benchmark::State& state) {
  const std::int64_t episodes = state.range(0);
  const DatasetLayout l = layout_of(episodes, 5, 4, "none");
  const Block block(l);
  const Folder folder;
  {
    DatasetWriter writer({folder.path + "/set"}, l);
    for (std::int64_t first = 0; first < episodes; first += kBlock) {
      writer.write(block.rows(first));
      writer.finish(first, {}, {});
    }
  }
  const DatasetFiles dataset = find_dataset(folder.path + "/set");
  std::uint64_t bytes = 0;
  for (auto _ : state) bytes = merge_dataset(dataset, {false, true}).bytes;
  using benchmark::Counter;
  const double made = static_cast<double>(episodes) * static_cast<double>(state.iterations());
  state.counters["episodes/s"] = Counter(made, Counter::kIsRate);
  state.counters["us/object"] =
      Counter(1e-6 * made * kMergedObjects, Counter::kIsRate | Counter::kInvert);
  state.counters["bytes/episode"] = static_cast<double>(bytes) / static_cast<double>(episodes);
}
BENCHMARK(merge)
    ->RangeMultiplier(4)
    ->Range(1024, 65536)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

/// A dataset of a shard in columns: rows of all episodes one after another, in chunks of about a
/// megabyte that are written whole.
class Column {
 public:
  Column(const h5::Id& file, const char* name, h5::Dims row) : row_(std::move(row)) {
    for (const hsize_t n : row_) width_ *= n;
    most_ = std::max<hsize_t>(1, (hsize_t{1} << 20) / (width_ * sizeof(float)));
    h5::Dims none{0}, endless{H5S_UNLIMITED}, chunk{most_};
    for (h5::Dims* dims : {&none, &endless, &chunk})
      dims->insert(dims->end(), row_.begin(), row_.end());
    const h5::Id space(H5Screate_simple(int(none.size()), none.data(), endless.data()));
    const h5::Id creation = h5::without_times(H5P_DATASET_CREATE);
    H5Pset_chunk(creation.get(), int(chunk.size()), chunk.data());
    H5Pset_alloc_time(creation.get(), H5D_ALLOC_TIME_INCR);
    H5Pset_fill_time(creation.get(), H5D_FILL_TIME_NEVER);
    const h5::Id access(H5Pcreate(H5P_DATASET_ACCESS));
    H5Pset_chunk_cache(access.get(), 0, 0, 1);
    dataset_ = h5::Id(H5Dcreate2(file.get(), name, H5T_IEEE_F32LE, space.get(), H5P_DEFAULT,
                                 creation.get(), access.get()));
  }
  void append(const float* numbers, std::size_t rows) {
    while (rows > 0) {
      const std::size_t count = std::min<std::size_t>(rows, most_ - held_.size() / width_);
      if (count == most_) {
        write(numbers, count);
      } else {
        held_.insert(held_.end(), numbers, numbers + count * width_);
        if (held_.size() == most_ * width_) end();
      }
      numbers += count * width_, rows -= count;
    }
  }
  void end() {
    if (!held_.empty()) write(held_.data(), held_.size() / width_);
    held_.clear();
  }

 private:
  void write(const float* numbers, hsize_t rows) {
    h5::Dims offset(row_.size() + 1, 0), count{rows}, size{written_ + rows};
    for (h5::Dims* dims : {&count, &size}) dims->insert(dims->end(), row_.begin(), row_.end());
    offset[0] = written_;
    H5Dset_extent(dataset_.get(), size.data());
    h5::write_box<float>(dataset_, offset, count, numbers);
    written_ += rows;
  }

  h5::Dims row_;
  hsize_t width_ = 1, most_ = 1, written_ = 0;
  std::vector<float> held_;
  h5::Id dataset_;
};

/// Writes one shard of the episodes above in columns, through the library alone, with the checksums
/// of the writer of shards: read back, synced, renamed.
void make_columns(const std::string& path, const DatasetLayout& l, const Block& block) {
  PartFile part(path, false);
  h5::Id file = h5::create_file(part.path(), part.written());
  const EpisodeRows piece = block.rows(0);
  const auto side = static_cast<hsize_t>(l.sensors[0].rows);
  std::vector<Column> columns;
  columns.emplace_back(file, "q", h5::Dims{l.q_names.size()});
  columns.emplace_back(file, "v", h5::Dims{l.v_names.size()});
  columns.emplace_back(file, "pad", h5::Dims{side, side, 3});
  columns.emplace_back(file, "actions", h5::Dims{l.u_names.size()});
  const std::size_t widths[] = {l.q_names.size(), l.v_names.size(), side * side * 3,
                                l.u_names.size()};
  ContentSum sum;
  std::vector<std::int64_t> ends;
  for (std::int64_t episode = 0; episode < l.episodes; ++episode) {
    const auto e = static_cast<std::size_t>(episode % kBlock);
    for (std::size_t k = 0; k < 4; ++k) {
      const auto rows = static_cast<std::size_t>(k < 3 ? l.rows() + 1 : l.rows());
      const float* const numbers =
          (k < 3 ? std::get<std::span<const float>>(piece.observations[k]).data()
                 : piece.actions.data()) +
          e * rows * widths[k];
      sum.add(episode, k, 0, std::int64_t(rows), widths[k] * sizeof(float), numbers);
      columns[k].append(numbers, rows);
    }
    ends.push_back((episode + 1) * l.rows());
  }
  for (Column& column : columns) column.end();
  columns.clear();
  h5::Id list = h5::create_dataset<std::int64_t>(file, "episode_ends", {ends.size()});
  h5::write_box<std::int64_t>(list, {0}, {ends.size()}, ends.data());
  list.reset();
  h5::write_scalar<std::uint64_t>(file, "content_sum", sum.value());
  h5::close_file(file, part.path());
  part.compare();
  part.commit();
}

void columns(benchmark::State& state, std::int64_t episodes, std::int64_t rows, int side) {
  const DatasetLayout l = layout_of(episodes, rows, side, "none");
  const Block block(l);
  std::uintmax_t bytes = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const Folder folder;
    state.ResumeTiming();
    make_columns(folder.path + "/shard.h5", l, block);
    state.PauseTiming();
    bytes = std::filesystem::file_size(folder.path + "/shard.h5");
    state.ResumeTiming();
  }
  const double made = static_cast<double>(episodes) * static_cast<double>(state.iterations());
  state.counters["episodes/s"] = benchmark::Counter(made, benchmark::Counter::kIsRate);
  state.counters["of_size"] =
      static_cast<double>(bytes) / (static_cast<double>(episodes) * l.episode_bytes());
}
void short_columns(benchmark::State& state) { columns(state, 4096, 5, 4); }
void long_columns(benchmark::State& state) { columns(state, 256, 200, 16); }
void large_columns(benchmark::State& state) { columns(state, 16, 20, 200); }
BENCHMARK(short_columns)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(long_columns)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
BENCHMARK(large_columns)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

/// Rows [first, first + rows) of a column as a virtual dataset of a demo.
void add_view(const h5::Id& group, const char* name, const char* column, const h5::Dims& row,
              hsize_t first, hsize_t rows, hsize_t all) {
  h5::Dims dims{rows}, source{all}, offset(row.size() + 1, 0);
  for (h5::Dims* d : {&dims, &source}) d->insert(d->end(), row.begin(), row.end());
  offset[0] = first;
  const h5::Id space(H5Screate_simple(int(dims.size()), dims.data(), nullptr)),
      from(H5Screate_simple(int(source.size()), source.data(), nullptr));
  H5Sselect_hyperslab(from.get(), H5S_SELECT_SET, offset.data(), nullptr, dims.data(), nullptr);
  const h5::Id creation = h5::without_times(H5P_DATASET_CREATE);
  H5Pset_virtual(creation.get(), space.get(), "shard.h5", column, from.get());
  const h5::Id dataset(H5Dcreate2(group.get(), name, H5T_IEEE_F32LE, space.get(), H5P_DEFAULT,
                                  creation.get(), H5P_DEFAULT));
  if (dataset.get() < 0) std::abort();
}

/// Measures robomimic's file of such a shard through the library alone: the groups of each demo,
/// and views of its actions, observations and next observations. There is no view for Minari.
void merge_columns(benchmark::State& state) {
  const std::int64_t episodes = state.range(0);
  const DatasetLayout l = layout_of(episodes, 5, 4, "none");
  const Folder folder;
  make_columns(folder.path + "/shard.h5", l, Block(l));
  const auto n = static_cast<hsize_t>(episodes), rows = static_cast<hsize_t>(l.rows());
  std::uintmax_t bytes = 0;
  for (auto _ : state) {
    PartFile part(folder.path + "/robomimic.hdf5", true);
    constexpr hsize_t kDescriptions = 1 << 16;
    h5::Id file = h5::create_file(part.path(), part.written(), kDescriptions, true);
    {
      const h5::Id data = h5::create_group(file, "data");
      for (hsize_t e = 0; e < n; ++e) {
        const h5::Id demo = h5::create_group(data, "demo_" + std::to_string(e));
        h5::write_scalar<std::int64_t>(demo, "num_samples", l.rows());
        add_view(demo, "actions", "actions", {l.u_names.size()}, e * rows, rows, n * rows);
        for (const hsize_t later : {0, 1}) {
          const h5::Id below = h5::create_group(demo, later == 1 ? "next_obs" : "obs");
          const hsize_t first = e * (rows + 1) + later, all = n * (rows + 1);
          add_view(below, "q", "q", {l.q_names.size()}, first, rows, all);
          add_view(below, "v", "v", {l.v_names.size()}, first, rows, all);
          add_view(below, "pad", "pad", {4, 4, 3}, first, rows, all);
        }
      }
    }
    h5::close_file(file, part.path());
    part.commit();
    bytes = std::filesystem::file_size(folder.path + "/robomimic.hdf5");
  }
  const double made = static_cast<double>(episodes) * static_cast<double>(state.iterations());
  state.counters["episodes/s"] = benchmark::Counter(made, benchmark::Counter::kIsRate);
  state.counters["bytes/episode"] = static_cast<double>(bytes) / static_cast<double>(episodes);
}
BENCHMARK(merge_columns)
    ->RangeMultiplier(4)
    ->Range(1024, 16384)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

/// Measures the library on such a demo: the reason why the writer lays objects out itself.
void library_objects(benchmark::State& state) {
  constexpr int kDemos = 256;
  for (auto _ : state) {
    const h5::Id file = h5::create_memory_file();
    for (int demo = 0; demo < kDemos; ++demo) {
      const h5::Id group = h5::create_group(file, "demo_" + std::to_string(demo));
      for (const char* name : {"obs", "final_obs"}) {
        const h5::Id below = h5::create_group(group, name);
        for (const char* dataset : {"q", "v", "pad"})
          static_cast<void>(h5::create_dataset<float>(below, dataset, {5, 7}));
      }
      for (const char* dataset : {"actions", "rewards", "dones"})
        static_cast<void>(h5::create_dataset<float>(group, dataset, {5}));
    }
  }
  state.counters["us/object"] =
      benchmark::Counter(1e-6 * kDemos * kObjects * static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(library_objects)->Unit(benchmark::kMillisecond);

/// A chunk of 64 KiB of a pressed field.
void chunk(benchmark::State& state, const char* compression) {
  const DatasetLayout l = layout_of(16, 1, 16, compression);
  const std::vector<float> numbers = field(21, 16);
  const std::size_t bytes = numbers.size() * sizeof(float);
  std::size_t size = 0;
  for (auto _ : state)
    size = compressed(l, sizeof(float), reinterpret_cast<const unsigned char*>(numbers.data()),
                      bytes, bytes)
               .size();
  state.counters["MB/s"] = benchmark::Counter(
      1e-6 * static_cast<double>(bytes) * static_cast<double>(state.iterations()),
      benchmark::Counter::kIsRate);
  state.counters["of_size"] = static_cast<double>(size) / static_cast<double>(bytes);
}
BENCHMARK_CAPTURE(chunk, deflate, "deflate");
BENCHMARK_CAPTURE(chunk, lz4, "lz4");

void shuffling(benchmark::State& state) {
  const std::vector<float> numbers = field(21, 16);
  const std::size_t bytes = numbers.size() * sizeof(float);
  std::vector<unsigned char> out(bytes);
  for (auto _ : state) {
    shuffle(reinterpret_cast<const unsigned char*>(numbers.data()), bytes, sizeof(float), out);
    benchmark::DoNotOptimize(out.data());
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(bytes) * state.iterations());
}
BENCHMARK(shuffling);

void content_sum(benchmark::State& state) {
  const std::vector<float> numbers = field(21, 16);
  const std::size_t row = 16 * 16 * 3 * sizeof(float);
  for (auto _ : state) {
    ContentSum sum;
    sum.add(1, 2, 0, 21, row, numbers.data());
    benchmark::DoNotOptimize(sum.value());
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(21 * row) * state.iterations());
}
BENCHMARK(content_sum);

}  // namespace
}  // namespace tangere
