// SPDX-License-Identifier: Apache-2.0
// TaskTape in Python. tangere/torch.py and tangere/jax.py make differentiable functions of it.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "python/module/arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/observations.hpp"
#include "python/module/options.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/gradients/task_tape.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

namespace {

/// Observations go out and their derivatives come in as one row (n) for each environment, divided
/// by the scales or not.
class Tape {
 public:
  Tape(const std::string& task, const Scene& scene, int environments, const TapeOptions& options,
       std::uint64_t seed, std::int64_t first_episode, bool scaled)
      : task_(make_task(task, scene)), tape_(*task_, environments, options, seed, first_episode) {
    for (const TensorSpec& tensor : spec().observations)
      for (std::size_t i = 0; i < tensor.size(); ++i)
        factor_.push_back(scaled ? 1 / scale_of(tensor, i) : 1);
  }

  void reset(const Whole<std::uint64_t>& seed, const Whole<std::int64_t>& first_episode) {
    const std::uint64_t draw = seed.value("seed");
    const std::int64_t first = first_episode.value("first_episode");
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape_.reset(draw, first);
  }
  void step(const Argument<double>& actions) {
    const std::vector<double> rows = rows_of(actions, count(), spec().action.size(), "actions");
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape_.step(rows);
  }
  void check_step(const Argument<double>& actions) {
    const std::vector<double> rows = rows_of(actions, count(), spec().action.size(), "actions");
    const InUse::Turn turn(in_use_);
    tape_.check_step(rows);
  }
  Array<double> observations() {
    const InUse::Turn turn(in_use_);
    const std::span<const double> from = tape_.observations();
    std::span<double> to;
    auto array = new_array<double>({count(), factor_.size()}, to);
    for (std::size_t i = 0; i < to.size(); ++i) to[i] = from[i] * factor_[i % factor_.size()];
    return array;
  }
  Array<double> reverse(const Argument<double>& observation_bar,
                        const Argument<double>& reward_bar) {
    const std::vector<double> o = unscaled(observation_bar);
    const std::span<const double> r = numbers_of(reward_bar, {count()}, "derivatives by rewards");
    std::span<double> action_bar;
    auto array = new_array<double>({count(), spec().action.size()}, action_bar);
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape_.reverse({o, r}, action_bar);
    return array;
  }
  nb::tuple reverse_start(const Argument<double>& observation_bar) {
    const std::vector<double> o = unscaled(observation_bar);
    std::span<double> q, v;
    const std::size_t nv = as_size(task_->model().nv());
    auto q_bar = new_array<double>({count(), nv}, q), v_bar = new_array<double>({count(), nv}, v);
    {
      const InUse::Turn turn(in_use_);
      const nb::gil_scoped_release free;
      tape_.reverse_start({o}, {q, v});
    }
    return nb::make_tuple(q_bar, v_bar);
  }
  void begin_reverse() {
    const InUse::Turn turn(in_use_);
    tape_.begin_reverse();
  }
  template <class T, class From>
  Array<T> per_environment(std::span<const From> (TaskTape::*get)() const, std::size_t width) {
    const InUse::Turn turn(in_use_);
    return array_of<T>(width == 0 ? Shape{count()} : Shape{count(), width}, (tape_.*get)());
  }

  [[nodiscard]] const TaskSpec& spec() const { return task_->spec(); }
  [[nodiscard]] const Model& model() const { return task_->model(); }
  [[nodiscard]] std::size_t count() const { return as_size(tape_.environments()); }
  [[nodiscard]] std::int64_t taken() {
    const InUse::Turn turn(in_use_);
    return tape_.taken();
  }

 private:
  std::vector<double> unscaled(const Argument<double>& observation_bar) {
    const auto given =
        numbers_of(observation_bar, {count(), factor_.size()}, "derivatives by observations");
    std::vector<double> o(given.begin(), given.end());
    for (std::size_t i = 0; i < o.size(); ++i) o[i] *= factor_[i % factor_.size()];
    return o;
  }

  std::unique_ptr<Task> task_;
  TaskTape tape_;
  std::vector<double> factor_;  // (observation)
  InUse in_use_;
};

}  // namespace

void add_tapes(nb::module_& m) {
  nb::class_<Tape>(
      m, "TaskTape",
      "Episodes of a task on tape, for back-propagation through time. Environment e plays episode\n"
      "first_episode + e, once. tangere.torch.Tape joins it to PyTorch, tangere.jax.Tape to JAX.")
      .def(
          "__init__",
          [](Tape* self, const std::string& task, const Scene& scene, const Whole<int>& envs,
             const Whole<std::int64_t>& actions, const Whole<std::uint64_t>& seed,
             const Whole<std::int64_t>& first_episode, const std::optional<Whole<int>>& threads,
             bool scaled, const std::string& precision, double tape_bytes) {
            TapeOptions options;
            options.precision = precision_named(precision);
            options.length = actions.value("actions");
            options.threads = threads_of(threads);
            options.tape_bytes = tape_bytes;
            new (self) Tape(task, scene, envs.value("num_envs"), options, seed.value("seed"),
                            first_episode.value("first_episode"), scaled);
          },
          "task"_a, "scene"_a, "num_envs"_a, "actions"_a = 0, "seed"_a = 0, "first_episode"_a = 0,
          "threads"_a = nb::none(), "scaled"_a = true, "precision"_a = "mixed",
          "tape_bytes"_a = 1e9,
          "`actions`: of an episode, at most; 0: the task's horizon. `scaled`: observations are\n"
          "divided by their scales. `precision`: in which tactile fields are computed, 'mixed' or\n"
          "'double'. `tape_bytes`: limit for the tapes [bytes]; longer episodes are\n"
          "played again from checkpoints on the way back. InputError: a number is out of range.")
      .def("reset", &Tape::reset, "seed"_a, "first_episode"_a = 0,
           "Starts episodes and clears the tape.")
      .def("step", &Tape::step, "actions"_a,
           "Takes one action (E, action) of every environment whose episode goes on. InputError:\n"
           "another shape, an action that is not finite, or one too many.")
      .def("check_step", &Tape::check_step, "actions"_a,
           "Raises the InputError that step() would raise for these actions, and takes none.")
      .def("observations", &Tape::observations, "(E, n) float64: all keys, one after the other.")
      .def(
          "rewards", [](Tape& t) { return t.per_environment<double>(&TaskTape::rewards, 0); },
          "(E) of the last step, 0 where the episode had ended.")
      .def(
          "alive", [](Tape& t) { return t.per_environment<bool>(&TaskTape::alive, 0); },
          "(E) bool: the action was taken.")
      .def(
          "terminated", [](Tape& t) { return t.per_environment<bool>(&TaskTape::terminated, 0); },
          "(E) bool: the episode has ended.")
      .def(
          "truncated", [](Tape& t) { return t.per_environment<bool>(&TaskTape::truncated, 0); },
          "(E) bool: out of time, or the simulation failed.")
      .def(
          "success", [](Tape& t) { return t.per_environment<bool>(&TaskTape::success, 0); },
          "(E) bool.")
      .def(
          "q",
          [](Tape& t) { return t.per_environment<double>(&TaskTape::q, as_size(t.model().nq())); },
          "(E, nq) coordinates now.")
      .def(
          "v",
          [](Tape& t) { return t.per_environment<double>(&TaskTape::v, as_size(t.model().nv())); },
          "(E, nv) velocities now.")
      .def("reverse", &Tape::reverse, "observation_bar"_a, "reward_bar"_a,
           "Reverses the last step that is not reversed yet: takes derivatives of a loss by its\n"
           "observations (E, n) and rewards (E), returns those by its actions (E, action), all "
           "that\n"
           "passes through this step and later ones. 0 beyond an action's bounds.")
      .def("reverse_start", &Tape::reverse_start, "observation_bar"_a,
           nb::sig("def reverse_start(self, observation_bar: numpy.typing.ArrayLike) -> "
                   "tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64]]"),
           "Ends the reverse pass: takes derivatives by the first observations (E, n), returns\n"
           "those by the first states, (E, nv) by q along the dofs of v, and by v.")
      .def("begin_reverse", &Tape::begin_reverse, "Begins another reverse pass over the tape.")
      .def_prop_ro("taken", &Tape::taken, "Actions on the tape.")
      .def_prop_ro("spec", &Tape::spec)
      .def_prop_ro("model", &Tape::model)
      .def_prop_ro("num_envs", &Tape::count);
}

}  // namespace tangere::python
