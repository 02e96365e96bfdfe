// SPDX-License-Identifier: Apache-2.0
// A tape of any scene in Python. tangere/simulation.py makes a differentiable function of it.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "engine/derivative/number_gradients.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/step/displacement.hpp"
#include "python/module/arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/options.hpp"
#include "python/module/varying_numbers.hpp"
#include "tasks/catalogue/scene_task.hpp"
#include "tasks/gradients/task_tape.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

namespace {

class SceneTape {
 public:
  SceneTape(const Scene& scene, const std::vector<std::string>& names, int every, int environments,
            const TapeOptions& options)
      : names_(names),
        task_(with_varying(scene, names), every, static_cast<int>(options.length)),
        tape_(task_, environments, options) {
    const NumberGradients numbers(model());
    for (const std::string& name : names) {
      const auto at = std::ranges::find(numbers.infos(), name, &NumberInfo::name);
      if (at == numbers.infos().end())
        throw InputError(fmt::format("'{}' has no derivative; expected another number", name));
      rows_.push_back(as_size(at - numbers.infos().begin()));
      varying_.push_back(as_size(randomization_of(model().scene(), at->number)));
    }
    numbers_ = as_size(numbers.count());
  }

  void reset(const Whole<std::uint64_t>& seed, const std::optional<Argument<double>>& q,
             const std::optional<Argument<double>>& v,
             const std::optional<Argument<double>>& numbers) {
    const std::uint64_t draw = seed.value("seed");
    std::vector<double> q0, v0, given;
    if (q) q0 = rows_of(*q, count(), nq(), "q");
    if (v) v0 = rows_of(*v, count(), nv(), "v");
    if (numbers) given = rows_of(*numbers, count(), names_.size(), "numbers");
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    draw_numbers(draw, given);
    tape_.reset(draw, 0);
    for (std::size_t e = 0; e < count() && (q || v); ++e) {
      const auto own = [&](const std::vector<double>& all, std::span<const double> drawn,
                           std::size_t n) {
        return all.empty() ? drawn.subspan(e * n, n) : std::span(all).subspan(e * n, n);
      };
      const auto qe = own(q0, tape_.q(), nq()), ve = own(v0, tape_.v(), nv());
      const std::vector<double> at(qe.begin(), qe.end()), rate(ve.begin(), ve.end());
      tape_.displace(static_cast<int>(e), at, rate);
    }
    first_q_.assign(tape_.q().begin(), tape_.q().end());
  }
  void step(const Argument<double>& controls) {
    const std::vector<double> rows = rows_of(controls, count(), as_size(model().nu()), "controls");
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape_.step(rows);
  }
  Array<double> observations() {
    const InUse::Turn turn(in_use_);
    return array_of<double>({count(), width()}, tape_.observations());
  }
  Array<std::int8_t> status() {
    const InUse::Turn turn(in_use_);
    std::vector<std::int8_t> all;
    for (int e = 0; e < tape_.environments(); ++e)
      all.push_back(static_cast<std::int8_t>(tape_.status(e)));
    return array_of<std::int8_t>({count()}, std::span<const std::int8_t>(all));
  }
  Array<double> reverse(const Argument<double>& observation_bar) {
    const auto o = numbers_of(observation_bar, {count(), width()}, "derivatives by readings");
    std::span<double> action_bar;
    auto array = new_array<double>({count(), as_size(model().nu())}, action_bar);
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape_.reverse({o}, action_bar);
    return array;
  }
  nb::tuple reverse_start(const Argument<double>& observation_bar) {
    const auto o = numbers_of(observation_bar, {count(), width()}, "derivatives by readings");
    std::span<double> q, v, numbers;
    auto q_bar = new_array<double>({count(), nq()}, q),
         v_bar = new_array<double>({count(), nv()}, v),
         number_bar = new_array<double>({count(), names_.size()}, numbers);
    {
      const InUse::Turn turn(in_use_);
      const nb::gil_scoped_release free;
      std::vector<double> along(v.size()), all(names_.empty() ? 0 : count() * numbers_);
      tape_.reverse_start({o}, along, v, all);
      std::ranges::fill(q, 0.0);
      for (std::size_t e = 0; e < count(); ++e) {
        add_by_coordinates(model(), std::span(first_q_).subspan(e * nq(), nq()),
                           std::span<const double>(along).subspan(e * nv(), nv()),
                           q.subspan(e * nq(), nq()));
        for (std::size_t k = 0; k < names_.size(); ++k)
          numbers[e * names_.size() + k] = all[e * numbers_ + rows_[k]];
      }
    }
    return nb::make_tuple(q_bar, v_bar, number_bar);
  }
  void begin_reverse() {
    const InUse::Turn turn(in_use_);
    tape_.begin_reverse();
  }
  /// (E, names) numbers of each environment in SI units.
  Array<double> numbers() {
    const InUse::Turn turn(in_use_);
    std::vector<double> all;
    for (std::size_t e = 0; e < count(); ++e)
      for (const std::size_t k : varying_) all.push_back(drawn_[e * varying_count() + k]);
    return array_of<double>({count(), names_.size()}, std::span<const double>(all));
  }

  [[nodiscard]] const TaskSpec& spec() const { return task_.spec(); }
  [[nodiscard]] const Model& model() const { return task_.model(); }
  [[nodiscard]] std::size_t count() const { return as_size(tape_.environments()); }
  [[nodiscard]] std::int64_t taken() const { return tape_.taken(); }

 private:
  [[nodiscard]] std::size_t nq() const { return as_size(model().nq()); }
  [[nodiscard]] std::size_t nv() const { return as_size(model().nv()); }
  [[nodiscard]] std::size_t width() const { return spec().observation_size(); }
  [[nodiscard]] std::size_t varying_count() const { return model().scene().randomizations.size(); }

  /// Draws all numbers that vary, and sets those that are given, (E, names) or empty.
  void draw_numbers(std::uint64_t seed, const std::vector<double>& given) {
    if (varying_count() == 0) return;
    drawn_.clear();
    const Batch batch(model(), tape_.environments(), seed);
    for (int e = 0; e < tape_.environments(); ++e)
      for (std::size_t k = 0; k < varying_count(); ++k)
        drawn_.push_back(batch.randomized_value(e, static_cast<int>(k)));
    for (std::size_t e = 0; e < count() && !given.empty(); ++e)
      for (std::size_t k = 0; k < names_.size(); ++k)
        drawn_[e * varying_count() + varying_[k]] = given[e * names_.size() + k];
    task_.set_varying(drawn_);
  }

  std::vector<std::string> names_;
  SceneTask task_;
  TaskTape tape_;
  std::size_t numbers_ = 0;
  std::vector<std::size_t> rows_, varying_;  ///< (names) in derivatives, and among what varies
  std::vector<double> drawn_, first_q_;
  InUse in_use_;
};

}  // namespace

void add_scene_tapes(nb::module_& m) {
  nb::class_<SceneTape>(
      m, "SceneTape",
      "A scene on tape, for back-propagation through time: tangere.torch.Simulation joins it to\n"
      "PyTorch. Environment e has the draws of episode e of the seed.")
      .def(
          "__init__",
          [](SceneTape* self, const Scene& scene, const Whole<int>& envs, const Whole<int>& steps,
             const Whole<int>& every, const std::vector<std::string>& numbers,
             const std::optional<Whole<int>>& threads, const std::string& precision,
             double tape_bytes) {
            TapeOptions options;
            options.precision = precision_named(precision);
            options.length = steps.value("steps");
            options.threads = threads_of(threads);
            options.tape_bytes = tape_bytes;
            options.parameters = !numbers.empty();
            new (self) SceneTape(scene, numbers, every.value("every"), envs.value("envs"), options);
          },
          "scene"_a, "envs"_a, "steps"_a, "every"_a = 1, "numbers"_a = std::vector<std::string>{},
          "threads"_a = nb::none(), "precision"_a = "double", "tape_bytes"_a = 1e9,
          "`steps`: calls of step() at most. `every`: steps of the simulation in each. `numbers`:\n"
          "names of numbers of the scene (Scene.vary) that environments may have of their own.\n"
          "InputError: a number is out of range, or a name is unknown or has no derivative.")
      .def("reset", &SceneTape::reset, "seed"_a = 0, "q"_a = nb::none(), "v"_a = nb::none(),
           "numbers"_a = nb::none(),
           "Starts anew and clears the tape. `q` (E, nq), `v` (E, nv) and `numbers`\n"
           "(E, names) take the place of what the scene draws; one row stands for all.")
      .def("step", &SceneTape::step, "controls"_a, "Takes the controls (E, nu) of `every` steps.")
      .def("observations", &SceneTape::observations,
           "(E, n) float64: q, v, end effectors and fields, one after the other.")
      .def("status", &SceneTape::status, "(E) int8: StepStatus of the last steps.")
      .def("numbers", &SceneTape::numbers, "(E, names) numbers of the environments, in SI units.")
      .def(
          "reverse", &SceneTape::reverse, "observation_bar"_a,
          "Reverses the last step() that is not reversed yet: takes derivatives of a loss by what\n"
          "it read (E, n), returns those by its controls (E, nu).")
      .def("reverse_start", &SceneTape::reverse_start, "observation_bar"_a,
           nb::sig("def reverse_start(self, observation_bar: numpy.typing.ArrayLike) -> "
                   "tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64]]"),
           "Ends the reverse pass: takes derivatives by the first readings (E, n), returns those\n"
           "by q (E, nq), v (E, nv) and numbers (E, names) of the start.")
      .def("begin_reverse", &SceneTape::begin_reverse, "Begins another reverse pass.")
      .def_prop_ro("taken", &SceneTape::taken, "Calls of step() on the tape.")
      .def_prop_ro("spec", &SceneTape::spec)
      .def_prop_ro("model", &SceneTape::model)
      .def_prop_ro("envs", &SceneTape::count);
}

}  // namespace tangere::python
