// SPDX-License-Identifier: Apache-2.0
// VectorTask in Python. tangere/gym.py makes Gymnasium's vector environment of it.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "io/files/nearest_name.hpp"
#include "python/module/arrays.hpp"
#include "python/module/batch_arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/observations.hpp"
#include "python/module/options.hpp"
#include "python/module/varying_numbers.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/run/block_reader.hpp"
#include "tasks/run/policy.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

namespace {

/// The readings that words name, "pad.sum" or "pad/1". Throws InputError for a name that no sensor
/// of the scene has.
std::vector<TimedName> readings_named(const std::vector<std::string>& words, const Task& task) {
  std::vector<TimedName> readings;
  const std::vector<std::string> sensors = sensor_names(task.model().scene());
  for (const std::string& word : words) {
    const TimedName& reading = readings.emplace_back(split_times(word));
    if (find_output(sensors, reading.name)) continue;
    const bool is_state = reading.name == "q" || reading.name == "v";
    throw InputError(fmt::format(
        "readings: no sensor has '{}'{}", reading.name,
        is_state ? fmt::format("; expected readings of the sensors {}, such as '{}.sum'. q and v "
                               "are those of state()",
                               fmt::join(sensors, ", "), sensors.empty() ? "pad" : sensors.front())
                 : suggestion(reading.name, output_names(sensors))));
  }
  return readings;
}

VectorOptions options_with(VectorOptions options, const std::vector<std::string>& readings,
                           const Task& task) {
  options.readings = readings_named(readings, task);
  return options;
}

class Environments {
 public:
  Environments(const std::string& task, const Scene& scene, int environments,
               const VectorOptions& options, const std::vector<std::string>& readings)
      : task_(make_task(task, scene)),
        vector_(*task_, environments, options_with(options, readings, *task_)),
        readout_(task_->model()),
        policies_{Policy(*task_, PolicyKind::scripted), Policy(*task_, PolicyKind::random)} {}

  void reset(const Whole<std::uint64_t>& seed, const Whole<std::int64_t>& first_episode) {
    const std::uint64_t draw = seed.value("seed");
    const std::int64_t first = first_episode.value("first_episode");
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    vector_.reset(draw, first);
  }
  void restart(const Argument<bool>& which) {
    const auto marks = numbers_of(which, {count()}, "a mask");
    const std::vector<std::uint8_t> list(marks.begin(), marks.end());
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    vector_.restart(list);
  }
  void step(const Argument<double>& actions) {
    const std::vector<double> rows = rows_of(actions, count(), spec().action.size(), "actions");
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    vector_.step(rows);
  }
  nb::dict observations(bool scaled, const std::optional<std::vector<std::string>>& keys) {
    const InUse::Turn turn(in_use_);
    return observation_arrays(spec(), vector_.observations(), count(), scaled, keys);
  }
  /// Name → (E, shape of a row).
  nb::dict readings() {
    const InUse::Turn turn(in_use_);
    nb::dict arrays;
    const std::vector<EpisodeChannel>& channels = vector_.readings();
    for (std::size_t k = 0; k < channels.size(); ++k) {
      Shape shape{count()};
      shape.insert(shape.end(), channels[k].shape.begin(), channels[k].shape.end());
      const char* const name = channels[k].name.c_str();
      if (channels[k].own_bytes() == 1)
        arrays[name] = array_of<std::uint8_t>(shape, vector_.colours(k));
      else
        arrays[name] = array_of<float>(shape, vector_.reading(k));
    }
    return arrays;
  }
  /// What readings() has.
  [[nodiscard]] std::vector<TensorSpec> reading_specs() const {
    std::vector<TensorSpec> specs;
    for (const EpisodeChannel& channel : vector_.readings()) {
      constexpr double kBrightest = 255;
      const bool colours = channel.own_bytes() == 1;
      TensorSpec& spec = specs.emplace_back();
      spec.name = channel.name;
      spec.shape = {channel.shape.begin(), channel.shape.end()};
      spec.unit = channel.unit;
      spec.meaning = channel.meaning;
      spec.low = colours ? 0 : -TensorSpec::kUnbounded;
      spec.high = colours ? kBrightest : TensorSpec::kUnbounded;
      spec.touch = channel.touch;
      spec.own_bytes = channel.own_bytes();
    }
    return specs;
  }
  /// Name → time between the readings of a window [s].
  [[nodiscard]] nb::dict windows() const {
    nb::dict seconds;
    for (const EpisodeChannel& channel : vector_.readings())
      if (channel.window > 1)
        seconds[channel.name.c_str()] =
            spec().steps_per_action / channel.window * model().timestep();
    return seconds;
  }
  Array<double> actions_of(std::size_t policy) {
    std::span<double> numbers;
    auto array = new_array<double>({count(), spec().action.size()}, numbers);
    const InUse::Turn turn(in_use_);
    policies_[policy].act(vector_, numbers);
    return array;
  }
  nb::tuple state() {
    const InUse::Turn turn(in_use_);
    const std::size_t widths[] = {as_size(task_->model().nq()), as_size(task_->model().nv()),
                                  as_size(spec().task_state)};
    std::span<double> numbers[3];
    Array<double> arrays[3];
    for (int k = 0; k < 3; ++k) arrays[k] = new_array<double>({count(), widths[k]}, numbers[k]);
    for (std::size_t e = 0; e < count(); ++e) {
      const TaskView view = vector_.view(static_cast<int>(e));
      const std::span<const double> from[] = {view.now().q, view.now().v, view.task_state};
      for (int k = 0; k < 3; ++k)
        std::copy(from[k].begin(), from[k].end(),
                  numbers[k].begin() + std::ptrdiff_t(e * widths[k]));
    }
    return nb::make_tuple(arrays[0], arrays[1], arrays[2]);
  }
  nb::tuple bodies() {
    const InUse::Turn turn(in_use_);
    return body_arrays(readout_, vector_.batch());
  }
  nb::tuple faces(const Whole<int>& environment, double half_space) {
    const InUse::Turn turn(in_use_);
    return face_arrays(vector_.batch(), environment.value("env"), half_space);
  }
  /// (E, rows, cols, 3) what a camera of the scene sees.
  Array<std::uint8_t> camera(const std::string& name) {
    const auto output = find_output(model().scene(), name + ".rgb");
    if (!output || !is_view(output->form))
      throw InputError(fmt::format("the scene has no camera '{}'", name));
    Shape shape = reading_shape(model(), *output);
    shape.insert(shape.begin(), count());
    std::span<std::uint8_t> numbers;
    auto array = new_array<std::uint8_t>(shape, numbers);
    const std::size_t width = numbers.size() / count();
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    for (int block = 0; block < vector_.batch().blocks(); ++block)
      read_field<std::uint8_t>(readout_, vector_.batch(), block, *output,
                               [&](int e) { return numbers.subspan(as_size(e) * width, width); });
    return array;
  }
  nb::dict randomized() {
    const InUse::Turn turn(in_use_);
    return randomized_arrays(vector_.batch());
  }
  Array<std::int8_t> status() {
    std::span<std::int8_t> numbers;
    auto array = new_array<std::int8_t>({count()}, numbers);
    const InUse::Turn turn(in_use_);
    for (std::size_t e = 0; e < count(); ++e)
      numbers[e] = static_cast<std::int8_t>(vector_.status(static_cast<int>(e)));
    return array;
  }
  template <class T, class From>
  Array<T> per_environment(std::span<const From> (VectorTask::*get)() const) {
    const InUse::Turn turn(in_use_);
    return array_of<T>({count()}, (vector_.*get)());
  }
  nb::dict counts() {
    const InUse::Turn turn(in_use_);
    const VectorCounts c = vector_.counts();
    nb::dict d;
    d["environment_steps"] = c.environment_steps;
    for (const auto& [name, count] : kCountNames) d[name] = c.steps.*count;
    return d;
  }

  [[nodiscard]] const TaskSpec& spec() const { return task_->spec(); }
  [[nodiscard]] const Model& model() const { return task_->model(); }
  [[nodiscard]] std::size_t count() const { return as_size(vector_.environments()); }

 private:
  std::unique_ptr<Task> task_;
  VectorTask vector_;
  Readout readout_;
  Policy policies_[2];
  InUse in_use_;
};

template <class T, class From>
auto numbers(std::span<const From> (VectorTask::*get)() const) {
  return [get](Environments& self) { return self.per_environment<T, From>(get); };
}

}  // namespace

void add_environments(nb::module_& m) {
  nb::class_<Environments>(
      m, "Environments",
      "Many environments of one task, stepped together. Environment e plays episodes first + e,\n"
      "first + e + E, … of a seed. tangere.make_vec() wraps it for Gymnasium.")
      .def(
          "__init__",
          [](Environments* self, const std::string& task, const Scene& scene,
             const Whole<int>& envs, const Whole<std::uint64_t>& seed,
             const Whole<std::int64_t>& first_episode, const std::optional<Whole<int>>& threads,
             bool autoreset, const std::vector<std::string>& readings) {
            VectorOptions options{seed.value("seed"), first_episode.value("first_episode"),
                                  threads_of(threads)};
            options.autoreset = autoreset;
            new (self) Environments(task, scene, envs.value("num_envs"), options, readings);
          },
          "task"_a, "scene"_a, "num_envs"_a, "seed"_a = 0, "first_episode"_a = 0,
          "threads"_a = nb::none(), "autoreset"_a = true, "readings"_a = std::vector<std::string>(),
          "Makes E environments and starts their episodes. `readings`: of sensors, beside what "
          "the\n"
          "task observes: 'pad.sum', or a window 'pad/1'. InputError: no such task or reading, or\n"
          "the scene does not belong to the task.")
      .def("reset", &Environments::reset, "seed"_a, "first_episode"_a = 0,
           "Starts the first episodes of a seed.")
      .def("restart", &Environments::restart, "which"_a,
           "Starts the next episode where `which`, (E) bool, is true, and leaves the others alone.")
      .def("step", &Environments::step, "actions"_a,
           "Takes one action of every environment, (E, action), clipped to its bounds. With\n"
           "autoreset, an environment whose episode has ended starts the next one instead.")
      .def("observations", &Environments::observations, "scaled"_a = true, "keys"_a = nb::none(),
           nb::sig("def observations(self, scaled: bool = True, keys: Sequence[str] | None = None) "
                   "-> dict[str, numpy.typing.NDArray[numpy.float32]]"),
           "A dict of new float32 arrays (E, …), divided by their scales if `scaled`, else in SI\n"
           "units.")
      .def("readings", &Environments::readings,
           nb::sig("def readings(self) -> dict[str, numpy.typing.NDArray]"),
           "A dict of new arrays (E, …) of the readings that were requested: float32 in SI units,\n"
           "pictures in colours uint8.")
      .def_prop_ro("reading_specs", &Environments::reading_specs, "What readings() has.")
      .def_prop_ro("windows", &Environments::windows,
                   nb::for_getter(nb::sig("def windows(self) -> dict[str, float]")),
                   "Name → time between the readings of a window [s].")
      .def("rewards", numbers<double>(&VectorTask::rewards), "(E) of the last step.")
      .def("terminated", numbers<bool>(&VectorTask::terminated), "(E) bool: the episode ended.")
      .def("truncated", numbers<bool>(&VectorTask::truncated),
           "(E) bool: out of time, or the simulation failed.")
      .def("success", numbers<bool>(&VectorTask::success), "(E) bool.")
      .def("starting", numbers<bool>(&VectorTask::starting), "(E) bool: the step was a reset.")
      .def("returns", numbers<double>(&VectorTask::returns), "(E) sums of the episodes' rewards.")
      .def("lengths", numbers<std::int64_t>(&VectorTask::lengths), "(E) actions so far.")
      .def("episodes", numbers<std::int64_t>(&VectorTask::episodes), "(E) numbers of the episodes.")
      .def("status", &Environments::status, "(E) int8, as in Batch.status.")
      .def(
          "scripted", [](Environments& self) { return self.actions_of(0); },
          "(E, action): what the task's own script would do. It may use the whole state.")
      .def(
          "random", [](Environments& self) { return self.actions_of(1); },
          "(E, action): uniform within the bounds, the same for the same seed and episode.")
      .def("state", &Environments::state,
           nb::sig("def state(self) -> tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]"),
           "q (E, nq), v (E, nv) and the task's memory (E, memory): what a robot cannot see.")
      .def("bodies", &Environments::bodies,
           nb::sig("def bodies(self) -> tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64]]"),
           "Poses (E, nb, 7) and twists (E, nb, 6), as Batch.bodies().")
      .def("faces", &Environments::faces, "env"_a, "half_space"_a = 0.0, nb::sig(kFacesSignature),
           kFacesText)
      .def("camera", &Environments::camera, "name"_a,
           "(E, rows, cols, 3): what a camera of the scene sees.")
      .def("randomized", &Environments::randomized, nb::sig(kRandomizedSignature), kRandomizedText)
      .def("counts", &Environments::counts, nb::sig("def counts(self) -> dict[str, int]"),
           "Since the last reset: environment_steps, simulation_steps, newton_iterations, and "
           "steps\n"
           "by their status: split_steps, accuracy_not_met_steps, tunnelled_steps, damped_steps "
           "and\n"
           "overlapping_steps.")
      .def_prop_ro("spec", &Environments::spec)
      .def_prop_ro("model", &Environments::model)
      .def_prop_ro("num_envs", &Environments::count);
}

}  // namespace tangere::python
