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
#include "io/dataset/dataset_merge.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/shard_check.hpp"
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
    size =
        compressed(l, reinterpret_cast<const unsigned char*>(numbers.data()), bytes, bytes).size();
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
