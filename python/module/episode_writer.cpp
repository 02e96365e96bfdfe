// SPDX-License-Identifier: Apache-2.0
// Data sets of tasks that are written in Python: the library's writer, which gets blocks of whole
// episodes. python/tangere/_scene_data.py plays them.
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <optional>

#include "engine/base/precision.hpp"
#include "io/dataset/dataset_from_model.hpp"
#include "io/dataset/dataset_merge.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/workers.hpp"
#include "kernels/table/isa.hpp"
#include "python/module/arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/whole_number.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

namespace {

/// Episode, first step that failed, status, and the state before it.
using Failure =
    std::tuple<std::int64_t, std::int64_t, int, std::vector<double>, std::vector<double>>;

ExistingShards existing_named(const std::string& name) {
  if (name == "refuse") return ExistingShards::refuse;
  if (name == "replace") return ExistingShards::replace;
  if (name == "keep") return ExistingShards::keep;
  throw InputError(fmt::format("existing '{}'; expected refuse, replace or keep", name));
}

/// Throws InputError for what no file can hold.
DatasetLayout layout_of(const Model& model, const TaskSpec& task, std::int64_t episodes,
                        std::uint64_t seed, const PlayedBy& played_by,
                        const std::vector<std::string>& readings) {
  constexpr std::int64_t kMostEpisodes = 1'000'000'000;
  if (episodes < 1 || episodes > kMostEpisodes)
    throw InputError(fmt::format("{} episodes; expected 1 to {}", episodes, kMostEpisodes));
  if (!task.observations.empty()) task.check();  // of q and v alone there is nothing more to check
  DatasetLayout layout;
  layout.task = task;
  layout.played_by = played_by;
  layout.episodes = episodes;
  layout.steps = std::int64_t{task.horizon} * task.steps_per_action;
  layout.every = task.steps_per_action;
  layout.seed = seed;
  if (!readings.empty()) {  // beside everything else
    layout.record = {{"q"}, {"v"}};
    for (const TensorSpec& tensor : task.observations) layout.record.push_back({tensor.name});
    for (const std::string& word : readings) layout.record.push_back(split_times(word));
  }
  layout.precision = to_string(Precision::mixed);
  layout.single = true;
  layout.version = TANGERE_VERSION;
  layout.instruction_set = kernels::active_isa_name();
  return dataset_layout_from(model, Stepper(model), layout);
}

/// The numbers of an observation. `held` keeps its array.
template <class T>
std::span<const T> observed(const nb::object& array, const Shape& shape,
                            std::vector<nb::object>& held, const char* type) {
  nb::ndarray<const T, nb::c_contig, nb::device::cpu> given;
  if (!nb::try_cast(array, given))
    throw InputError(fmt::format("an observation that is no array of {}", type));
  held.push_back(nb::cast(given));
  return numbers_of(Argument<T>(given), shape, "an observation");
}

/// Keeps the GIL while it calls HDF5. h5py may share the library, whose calls then end in Python:
/// two threads that hold one lock each and need the other one would wait for ever.
class EpisodeWriter {
 public:
  EpisodeWriter(const std::string& folder, DatasetLayout layout, ExistingShards existing)
      : folder_(folder), layout_(std::move(layout)) {
    writer_.emplace(DatasetOutput{folder, existing, {}}, layout_);
    for (const EpisodeChannel& channel : layout_.channels()) {
      shapes_.emplace_back(channel.shape.begin(), channel.shape.end());
      own_bytes_.push_back(channel.own_bytes());
    }
  }

  [[nodiscard]] std::vector<std::string> observation_names() const {
    std::vector<std::string> names;
    for (const EpisodeChannel& channel : layout_.channels()) names.push_back(channel.name);
    return names;
  }

  [[nodiscard]] std::vector<std::pair<std::int64_t, std::int64_t>> missing() {
    std::vector<std::pair<std::int64_t, std::int64_t>> ranges;
    for (const EpisodeRange& range : open().missing()) ranges.emplace_back(range.first, range.end);
    return ranges;
  }

  void write(const Whole<std::int64_t>& first, const Argument<float>& actions,
             const std::vector<nb::object>& observations, const Argument<float>& rewards,
             const Argument<double>& randomized, const Argument<std::int64_t>& lengths,
             const Argument<double>& returns, const Argument<bool>& terminated,
             const Argument<bool>& success, const std::vector<Failure>& failures,
             const std::array<std::int64_t, 3>& steps);
  nb::dict finish();
  void close() { writer_.reset(); }

 private:
  DatasetWriter& open() {
    if (!writer_) throw InputError("a data set that is closed; expected a new one");
    return *writer_;
  }

  std::string folder_;
  DatasetLayout layout_;
  std::vector<Shape> shapes_;           // of a row of each observation
  std::vector<std::size_t> own_bytes_;  // EpisodeChannel::own_bytes()
  std::optional<DatasetWriter> writer_;
};

void EpisodeWriter::write(const Whole<std::int64_t>& first, const Argument<float>& actions,
                          const std::vector<nb::object>& observations,
                          const Argument<float>& rewards, const Argument<double>& randomized,
                          const Argument<std::int64_t>& lengths, const Argument<double>& returns,
                          const Argument<bool>& terminated, const Argument<bool>& success,
                          const std::vector<Failure>& failures,
                          const std::array<std::int64_t, 3>& steps) {
  DatasetWriter& writer = open();
  const std::size_t n = lengths.size(), most = as_size(layout_.rows());
  EpisodeRows piece;
  piece.first_episode = first.value("first_episode");
  constexpr std::size_t kBlock = 16;
  if (piece.first_episode < 0 || piece.first_episode % std::int64_t{kBlock} != 0 || n < 1 ||
      n > kBlock || piece.first_episode + std::int64_t(n) > layout_.episodes)
    throw InputError(fmt::format("{} episodes from {} on; expected a block of {} of 0 to {}", n,
                                 piece.first_episode, kBlock, layout_.episodes - 1));
  piece.episodes = static_cast<int>(n);
  piece.rows = static_cast<int>(most) + 1;
  piece.action_rows = static_cast<int>(most);
  piece.actions = numbers_of(actions, {n, most, layout_.action_names().size()}, "actions");
  piece.rewards = numbers_of(rewards, {n, most}, "rewards");
  piece.randomized =
      numbers_of(randomized, {n, layout_.randomized_names.size()}, "randomized numbers");
  if (observations.size() != shapes_.size())
    throw InputError(
        fmt::format("{} observations; expected {}", observations.size(), shapes_.size()));
  std::vector<Observation> rows;
  std::vector<nb::object> held;
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    Shape shape{n, most + 1};
    shape.insert(shape.end(), shapes_[k].begin(), shapes_[k].end());
    if (own_bytes_[k] == 1)
      rows.emplace_back(observed<std::uint8_t>(observations[k], shape, held, "uint8"));
    else if (own_bytes_[k] == 2)
      rows.emplace_back(observed<std::int16_t>(observations[k], shape, held, "int16"));
    else
      rows.emplace_back(observed<float>(observations[k], shape, held, "float32"));
  }
  piece.observations = rows;
  const auto total = numbers_of(returns, {n}, "returns");
  const auto ended = numbers_of(terminated, {n}, "terminated"),
             solved = numbers_of(success, {n}, "success");
  std::vector<EpisodeEnd> ends;
  for (std::size_t e = 0; e < n; ++e) {
    ends.push_back({lengths.data()[e], total[e], ended[e], solved[e]});
    if (ends[e].length < 1 || as_size(ends[e].length) > most)
      throw InputError(
          fmt::format("an episode of {} actions; expected 1 to {}", ends[e].length, most));
  }
  piece.ends = ends;
  std::vector<FailedEpisode> failed;
  for (const auto& [episode, step, status, q, v] : failures)
    failed.push_back({episode, step, static_cast<StepStatus>(status), q, v});
  writer.write(piece);
  writer.finish(piece.first_episode, failed, {steps[0], steps[1], steps[2]});
}

nb::dict EpisodeWriter::finish() {
  DatasetWriter& writer = open();
  nb::dict made;
  made["output"] = folder_;
  made["shards"] = writer.shards();
  made["kept"] = writer.kept();
  MergeResult merged;
  MergeOptions replace;
  replace.overwrite = true;  // links of an earlier run may lead to other shards
  if (writer.complete()) merged = merge_dataset(find_dataset(folder_), replace);
  if (!writer.obstacle().empty()) made["not_merged"] = writer.obstacle();
  close();
  made["merged"] = merged.file;
  made["minari_id"] = merged.minari_id;
  made["minari_left_out"] = merged.minari_left_out;
  return made;
}

}  // namespace

void add_episode_writer(nb::module_& m) {
  nb::class_<EpisodeWriter>(
      m, "EpisodeWriter",
      "Writes a data set of a task that is not in the catalogue, block after block of 16 whole\n"
      "episodes. tangere.data.generate() plays them.")
      .def(
          "__init__",
          [](EpisodeWriter* self, const Model& model, const TaskSpec& task,
             const std::string& folder, const Whole<std::int64_t>& episodes,
             const Whole<std::uint64_t>& seed, const std::string& policy, const std::string& player,
             const std::string& python_class, const std::string& command,
             const std::string& existing, const std::string& compression,
             const std::string& pictures, bool sparse, const std::string& set_name,
             const Whole<std::int64_t>& shards, const std::vector<std::string>& readings) {
            if (player != policy) check_policy_name("the policy", player);
            DatasetLayout layout = layout_of(model, task, episodes.value("episodes"),
                                             seed.value("seed"), {policy, {player}}, readings);
            layout.python_class = python_class;
            layout.command = command;
            layout.compression = compression;
            layout.jpeg_quality = jpeg_quality_named(pictures);
            layout.sparse = sparse;
            layout.set_name = set_name;
            layout.shards = shards.value("shards");
            new (self) EpisodeWriter(folder, std::move(layout), existing_named(existing));
          },
          "model"_a, "task"_a, "folder"_a, "episodes"_a, "seed"_a, "policy"_a, "player"_a,
          "python_class"_a, "command"_a, "existing"_a = "refuse", "compression"_a = "none",
          "pictures"_a = "raw", "sparse"_a = true, "set_name"_a = "", "shards"_a = 0,
          "readings"_a = std::vector<std::string>(),
          "Creates the folder. `policy`: as requested; `player`: the name of the one that plays.\n"
          "`python_class`: \"MODULE:CLASS\" of the task. `command`: what makes the data set "
          "again.\n"
          "`readings`: of sensors, beside what the task observes: 'pad.sum', 'pad/5'.\n"
          "`existing`: 'refuse' shards that are there, 'replace' or 'keep' them. The others are\n"
          "options of `tangere generate`; shards 0: as many as fit. InputError: no\n"
          "file can hold a name, or kept shards have other settings. IoError: the folder cannot "
          "be\n"
          "written, is in use, has shards, or the disk has no room.")
      .def("missing", &EpisodeWriter::missing,
           "Ranges [first, end) of episodes to write, in whole blocks of 16 except the last.")
      .def_prop_ro("observation_names", &EpisodeWriter::observation_names,
                   "Names of the observations in the order in which `write` takes them.")
      .def("write", &EpisodeWriter::write, "first_episode"_a, "actions"_a, "observations"_a,
           "rewards"_a, "randomized"_a, "lengths"_a, "returns"_a, "terminated"_a, "success"_a,
           "failures"_a, "steps"_a,
           "Writes n episodes from a multiple of 16 on: 16, fewer at the end. Blocks come in\n"
           "ascending order. Of at most H actions: `actions` (n, H, na), `observations` of q, v "
           "and\n"
           "the task (n, H + 1, …), `rewards` (n, H), each float32 (pictures: uint8, int16) and\n"
           "with anything after the end\n"
           "of an episode; `randomized` (n, k) float64; `lengths`, `returns`, `terminated`,\n"
           "`success` (n); `failures`: (episode, first step, status, q, v) of each that failed;\n"
           "`steps`: taken, tunnelled and overlapping ones of all. InputError: another shape.\n"
           "IoError: it cannot be written.")
      .def("finish", &EpisodeWriter::finish, nb::sig("def finish(self) -> dict[str, object]"),
           "Merges the shards and closes the data set. Returns paths and names of what was made.")
      .def("close", &EpisodeWriter::close,
           "Ends the work. Shards that are not complete are removed.");
  m.def(
      "worker_from_environment",
      [] {
        const Worker worker = worker_from_environment();
        return std::make_tuple(worker.index, worker.count, worker.source);
      },
      "Which of the processes that a scheduler has started this one is, as `tangere generate`\n"
      "reads it: (index, count, the variables that say so). InputError names a variable that does\n"
      "not fit.");
}

}  // namespace tangere::python
