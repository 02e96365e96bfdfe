// SPDX-License-Identifier: Apache-2.0
// A tape of any scene in Python. tangere/simulation.py makes a differentiable function of it.
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <numeric>

#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/scene/scene_faults.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/variable_numbers.hpp"
#include "engine/step/displacement.hpp"
#include "python/module/arrays.hpp"
#include "python/module/batch_arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/options.hpp"
#include "python/module/varying_numbers.hpp"
#include "tasks/catalogue/scene_task.hpp"
#include "tasks/gradients/task_tape.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

namespace {

/// What SceneTape keeps of its arguments: a change of points compiles the scene again.
struct TapeArguments {
  Scene scene;
  std::vector<std::string> parameters;
  std::optional<std::vector<std::string>> readings;
  int every;
  int environments;
  TapeOptions options;
};

/// Whether a number that has a derivative is the same in all environments: contact points follow
/// from a size, and <randomize> does not know every number.
bool is_shared(const Scene& scene, const std::string& name) {
  for (const SceneNumber& number : variable_numbers(scene)) {
    if (name_of(number) != name) continue;
    if (number.owner != NumberOwner::body || number.field == NumberField::density) return false;
    try {
      Scene other = scene;
      let_vary(other, number);
      static_cast<void>(Model(other));
      return false;
    } catch (const InputError&) {
      return true;
    }
  }
  const NumberGradients numbers{Model(scene)};
  return std::ranges::count(numbers.infos(), name, &NumberInfo::name) > 0;
}

std::vector<std::string> own_names(const Scene& scene, std::vector<std::string> names) {
  std::erase_if(names, [&](const std::string& name) { return is_shared(scene, name); });
  return names;
}

/// A compiled scene, its tape, and where its parameters are.
struct TapedScene {
  TapedScene(const Scene& scene, const TapeArguments& a)
      : task(with_varying(scene, own_names(scene, a.parameters)), a.every,
             static_cast<int>(a.options.length), a.readings),
        tape(task, a.environments, a.options) {
    const NumberGradients numbers(task.model());
    for (const std::string& name : a.parameters) {
      if (std::ranges::count(a.parameters, name) > 1)
        throw InputError(fmt::format("parameter '{}' is listed twice; expected it once", name));
      const auto at = std::ranges::find(numbers.infos(), name, &NumberInfo::name);
      if (at == numbers.infos().end())
        throw InputError(fmt::format("'{}' has no derivative; expected another number", name));
      rows.push_back(as_size(at - numbers.infos().begin()));
      varying.push_back(randomization_of(task.model().scene(), at->number));
      addresses.push_back(at->number);
    }
    number_count = as_size(numbers.count());
  }

  SceneTask task;
  TaskTape tape;
  std::size_t number_count = 0;   ///< by which there are derivatives
  std::vector<std::size_t> rows;  ///< (parameters) among these
  std::vector<int> varying;       ///< (parameters) among what varies; -1: the same in all
  std::vector<SceneNumber> addresses;
};

class SceneTape {
 public:
  explicit SceneTape(TapeArguments arguments)
      : arguments_(std::move(arguments)),
        taped_(std::make_unique<TapedScene>(arguments_.scene, arguments_)) {
    draw_numbers(0, {}, {});
    first_q_.assign(tape().q().begin(), tape().q().end());
  }

  void reset(const Whole<std::uint64_t>& seed, const std::optional<Argument<double>>& q,
             const std::optional<Argument<double>>& v,
             const std::optional<Argument<double>>& parameters,
             const std::optional<Argument<double>>& points,
             const std::optional<NamedValues>& randomized, bool record) {
    const std::uint64_t draw = seed.value("seed");
    std::vector<double> q0, v0, given, moved;
    if (q) q0 = rows_of(*q, count(), nq(), "q");
    if (v) v0 = rows_of(*v, count(), nv(), "v");
    if (parameters) given = rows_of(*parameters, count(), names().size(), "parameters");
    if (points) {
      const auto all = numbers_of(*points, {point_count(), kPointNumbers}, "points");
      moved.assign(all.begin(), all.end());
      if (!std::ranges::all_of(moved, [](double x) { return std::isfinite(x); }))
        throw InputError("points by numbers that are not finite; expected finite ones");
    }
    const std::vector<std::vector<double>> drawn = rows_of_varying(randomized);
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    compile_with(moved, shared_values(given));
    draw_numbers(draw, given, drawn);
    tape().reset(draw, 0, record);
    if (q || v) {
      if (!q) q0.assign(tape().q().begin(), tape().q().end());
      if (!v) v0.assign(tape().v().begin(), tape().v().end());
      check_state(model(), q0, v0);
      normalise_quaternions(q0);
      tape().displace(q0, v0);
    }
    first_q_.assign(tape().q().begin(), tape().q().end());
  }
  void step(const Argument<double>& controls) {
    const std::vector<double> rows = rows_of(controls, count(), as_size(model().nu()), "controls");
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape().step(rows);
  }
  void check_step(const Argument<double>& controls) {
    const std::vector<double> rows = rows_of(controls, count(), as_size(model().nu()), "controls");
    const InUse::Turn turn(in_use_);
    tape().check_step(rows);
  }
  Array<double> observations() {
    std::span<double> to;
    auto array = new_array<double>({count(), width()}, to);
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape().get_observations(to);
    return array;
  }
  Array<std::int8_t> status() {
    const InUse::Turn turn(in_use_);
    std::vector<std::int8_t> all;
    for (int e = 0; e < tape().environments(); ++e)
      all.push_back(static_cast<std::int8_t>(tape().status(e)));
    return array_of<std::int8_t>({count()}, std::span<const std::int8_t>(all));
  }
  Array<double> reverse(const Argument<double>& observation_bar) {
    const auto o = numbers_of(observation_bar, {count(), width()}, "derivatives by readings");
    std::span<double> action_bar;
    auto array = new_array<double>({count(), as_size(model().nu())}, action_bar);
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    tape().reverse({o}, action_bar);
    return array;
  }
  nb::tuple reverse_start(const Argument<double>& observation_bar) {
    const auto o = numbers_of(observation_bar, {count(), width()}, "derivatives by readings");
    std::span<double> q, v, parameters, points;
    auto q_bar = new_array<double>({count(), nq()}, q),
         v_bar = new_array<double>({count(), nv()}, v),
         parameter_bar = new_array<double>({count(), names().size()}, parameters),
         point_bar = new_array<double>({point_count(), kPointNumbers}, points);
    {
      const InUse::Turn turn(in_use_);
      const nb::gil_scoped_release free;
      const std::size_t numbers = taped_->number_count;
      std::vector<double> along(v.size()), all(names().empty() ? 0 : count() * numbers),
          each(arguments_.options.points ? count() * points.size() : 0);
      tape().reverse_start({o}, along, v, all, each);
      std::ranges::fill(q, 0.0);
      std::ranges::fill(points, 0.0);
      for (std::size_t e = 0; e < count(); ++e) {
        add_by_coordinates(model(), std::span(first_q_).subspan(e * nq(), nq()),
                           std::span<const double>(along).subspan(e * nv(), nv()),
                           q.subspan(e * nq(), nq()));
        for (std::size_t k = 0; k < names().size(); ++k)
          parameters[e * names().size() + k] = all[e * numbers + taped_->rows[k]];
        if (!each.empty()) add_points(e, std::span(each).subspan(e * points.size()), points);
      }
    }
    return nb::make_tuple(q_bar, v_bar, parameter_bar, point_bar);
  }
  void begin_reverse() {
    const InUse::Turn turn(in_use_);
    tape().begin_reverse();
  }
  /// (E, names) parameters of each environment in SI units.
  Array<double> parameters() {
    const InUse::Turn turn(in_use_);
    std::vector<double> all;
    for (std::size_t e = 0; e < count(); ++e)
      for (std::size_t k = 0; k < names().size(); ++k) all.push_back(parameter(e, k));
    return array_of<double>({count(), names().size()}, std::span<const double>(all));
  }

  [[nodiscard]] const TaskSpec& spec() const { return taped_->task.spec(); }
  [[nodiscard]] const Model& model() const { return taped_->task.model(); }
  [[nodiscard]] std::size_t count() const { return as_size(arguments_.environments); }
  [[nodiscard]] std::int64_t taken() const { return taped_->tape.taken(); }
  [[nodiscard]] std::size_t point_count() const {
    return arguments_.options.points ? as_size(tactile_points(model())) : 0;
  }

 private:
  [[nodiscard]] TaskTape& tape() { return taped_->tape; }
  [[nodiscard]] const std::vector<std::string>& names() const { return arguments_.parameters; }
  [[nodiscard]] std::size_t nq() const { return as_size(model().nq()); }
  [[nodiscard]] std::size_t nv() const { return as_size(model().nv()); }
  [[nodiscard]] std::size_t width() const { return spec().observation_size(); }
  [[nodiscard]] std::size_t varying_count() const { return model().scene().randomizations.size(); }

  [[nodiscard]] double parameter(std::size_t environment, std::size_t k) const {
    const int at = taped_->varying[k];
    return at < 0 ? number_in(model().scene(), taped_->addresses[k])
                  : drawn_[environment * varying_count() + as_size(at)];
  }

  /// Returns the values of parameters that are the same in all environments, from (E, names) or
  /// empty. Throws InputError where they differ.
  std::vector<double> shared_values(const std::vector<double>& given) const {
    std::vector<double> shared;
    for (std::size_t k = 0; k < names().size() && !given.empty(); ++k) {
      if (taped_->varying[k] >= 0) continue;
      shared.push_back(given[k]);
      for (std::size_t e = 1; e < count(); ++e)
        if (const double other = given[e * names().size() + k]; other != shared.back())
          throw InputError(
              fmt::format("'{}' of {} and {}; expected one value: it is the same in "
                          "all environments",
                          names()[k], shared.back(), other));
    }
    return shared;
  }

  /// Sets the scene's own numbers to `shared`, in order.
  void set_shared(Scene& scene, const std::vector<double>& shared) const {
    std::size_t next = 0;
    for (std::size_t k = 0; k < names().size() && next < shared.size(); ++k) {
      if (taped_->varying[k] >= 0) continue;
      const SceneNumber& number = taped_->addresses[k];
      if (const std::string fault = varying_value_fault(number, shared[next]); !fault.empty())
        throw InputError("'" + names()[k] + "': " + fault);
      number_in(scene, number) = shared[next++];
    }
  }

  /// Compiles the scene again where the points' own numbers, (points, 7) or empty for none, or
  /// `shared` differ from those of the last reset.
  void compile_with(std::vector<double> moved, const std::vector<double>& shared) {
    if (std::ranges::all_of(moved, [](double x) { return x == 0; })) moved.clear();
    if (moved == moved_ && shared == shared_) return;
    Scene scene = arguments_.scene;
    set_shared(scene, shared);
    std::span<const double> left = moved;
    for (std::size_t s = 0; s < scene.sensors.size() && !left.empty(); ++s) {
      const std::size_t numbers = kPointNumbers * as_size(model().sensors()[s].points);
      add_to_points(scene.sensors[s], left.first(numbers));
      for (const TactilePoint& point : scene.sensors[s].points)
        if (std::ranges::any_of(point.factors, [](double x) { return x < 0; }))
          throw InputError(
              fmt::format("a point of '{}' with a negative coefficient; expected a "
                          "change that leaves 0 or more",
                          scene.sensors[s].name));
      left = left.subspan(numbers);
    }
    taped_ = std::make_unique<TapedScene>(scene, arguments_);
    moved_ = std::move(moved);
    shared_ = shared;
  }

  /// Adds an environment's derivatives by its points' own numbers to those by the change of the
  /// scene's. That change is of factors, so it is in proportion to a coefficient that varies.
  void add_points(std::size_t environment, std::span<const double> own,
                  std::span<double> points) const {
    const Scene& scene = model().scene();
    std::size_t at = 0;
    for (std::size_t s = 0; s < scene.sensors.size(); ++s) {
      std::array<double, kPointNumbers> scale;
      scale.fill(1);
      for (int k = 0; k < kPointNumbers - 3; ++k) {
        const SceneNumber number{NumberOwner::tactile, coefficient_field(k), scene.sensors[s].name};
        const int varying = randomization_of(scene, number);
        const double nominal = scene.sensors[s].coefficients[as_size(k)];
        if (varying >= 0 && nominal != 0)
          scale[as_size(3 + k)] =
              drawn_[environment * varying_count() + as_size(varying)] / nominal;
      }
      for (int p = 0; p < model().sensors()[s].points; ++p)
        for (std::size_t k = 0; k < scale.size(); ++k, ++at) points[at] += scale[k] * own[at];
    }
  }

  /// Returns (E) of each number that varies; empty where it is drawn. Throws InputError for a name
  /// that does not vary.
  std::vector<std::vector<double>> rows_of_varying(const std::optional<NamedValues>& values) const {
    std::vector<std::vector<double>> rows(varying_count());
    if (!values) return rows;
    const std::vector<std::string> varying = varying_names(model().scene());
    for (const auto& [name, given] : *values) {
      const auto at = std::ranges::find(varying, name);
      if (at == varying.end())
        throw InputError(
            fmt::format("no number of the scene that varies is named '{}'; expected "
                        "one of {}",
                        name, fmt::join(varying, ", ")));
      std::vector<double>& row = rows[as_size(at - varying.begin())];
      if (given.size() == 1) {
        row.assign(count(), given.data()[0]);
      } else {
        const auto all = numbers_of(given, {count()}, name.c_str());
        row.assign(all.begin(), all.end());
      }
    }
    return rows;
  }

  /// Throws InputError for a parameter that the scene could not have.
  void check_drawn(Batch& batch) const {
    std::vector<int> environments(count()), numbers;
    std::iota(environments.begin(), environments.end(), 0);
    for (int k = 0; k < static_cast<int>(varying_count()); ++k)
      if (batch.is_parameter(k)) numbers.push_back(k);
    std::vector<double> values;
    for (std::size_t e = 0; e < count(); ++e)
      for (const int k : numbers) values.push_back(drawn_[e * varying_count() + as_size(k)]);
    batch.set_randomized_values(environments, numbers, values);
  }

  void normalise_quaternions(std::span<double> q) const {
    const auto names = model().q_names();
    for (std::size_t i = 0; i < q.size(); ++i) {
      if (!names[i % names.size()].ends_with(".qw")) continue;
      const double length = std::hypot(std::hypot(q[i], q[i + 1]), std::hypot(q[i + 2], q[i + 3]));
      if (std::abs(length - 1) < 1e-15) continue;
      for (std::size_t k = 0; k < 4; ++k) q[i + k] /= length;
    }
  }

  /// Draws all numbers that vary, and sets those that are given: parameters, (E, names) or empty,
  /// and others, each (E) or empty.
  void draw_numbers(std::uint64_t seed, const std::vector<double>& given,
                    const std::vector<std::vector<double>>& others) {
    if (varying_count() == 0) return;
    drawn_.clear();
    Batch batch(model(), arguments_.environments, seed);
    for (int e = 0; e < arguments_.environments; ++e)
      for (std::size_t k = 0; k < varying_count(); ++k)
        drawn_.push_back(batch.randomized_value(e, static_cast<int>(k)));
    for (std::size_t k = 0; k < others.size(); ++k)
      for (std::size_t e = 0; e < others[k].size(); ++e)
        drawn_[e * varying_count() + k] = others[k][e];
    for (std::size_t e = 0; e < count() && !given.empty(); ++e)
      for (std::size_t k = 0; k < names().size(); ++k)
        if (const int at = taped_->varying[k]; at >= 0)
          drawn_[e * varying_count() + as_size(at)] = given[e * names().size() + k];
    if (!given.empty() || !others.empty()) check_drawn(batch);
    taped_->task.set_varying(drawn_);
  }

  TapeArguments arguments_;
  std::unique_ptr<TapedScene> taped_;
  std::vector<double> drawn_, first_q_;
  std::vector<double> moved_;   ///< (points, 7) of the compiled scene; empty: none
  std::vector<double> shared_;  ///< parameters that are the same in all; empty: the scene's
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
             const Whole<int>& every, const std::optional<std::vector<std::string>>& readings,
             const std::vector<std::string>& parameters, bool points,
             const std::optional<Whole<int>>& threads, const std::string& precision,
             double tape_bytes) {
            TapeOptions options;
            options.precision = precision_named(precision);
            options.length = steps.value("steps");
            options.threads = threads_of(threads);
            options.tape_bytes = tape_bytes;
            options.parameters = !parameters.empty();
            options.points = points;
            new (self) SceneTape({scene, parameters, readings, every.value("every"),
                                  envs.value("num_envs"), options});
          },
          "scene"_a, "num_envs"_a, "steps"_a, "every"_a = 1, "readings"_a = nb::none(),
          "parameters"_a = std::vector<std::string>{}, "points"_a = false, "threads"_a = nb::none(),
          "precision"_a = "double", "tape_bytes"_a = 1e9,
          "`steps`: calls of step() at most. `every`: steps of the simulation in each.\n"
          "`readings`: names, such as pad, pad.sum, bodies.box, variables or an end effector;\n"
          "None: all end effectors and fields. `parameters`: names of numbers of the scene that\n"
          "environments may have of their own. `points`: whether there are derivatives by points\n"
          "of sensors. InputError: a number is out of range, or a name is unknown or has no\n"
          "derivative.")
      .def(
          "reset", &SceneTape::reset, "seed"_a = 0, "q"_a = nb::none(), "v"_a = nb::none(),
          "parameters"_a = nb::none(), "points"_a = nb::none(), "randomized"_a = nb::none(),
          "record"_a = true,
          "Starts anew and clears the tape. `q` (E, nq), `v` (E, nv) and `parameters`\n"
          "(E, names) take the place of what the scene draws; one row stands for all. `points`\n"
          "(points of all sensors, 7) moves points of sensors: x, y, z [m] in their body's frame,\n"
          "and kn, kt, mu, damping are added to their own. The scene is compiled again where it\n"
          "differs from that of the last reset. Without `record` nothing can be reversed.")
      .def("step", &SceneTape::step, "controls"_a, "Takes the controls (E, nu) of `every` steps.")
      .def("check_step", &SceneTape::check_step, "controls"_a,
           "Raises InputError if step() would do so for these controls; takes no step.")
      .def("observations", &SceneTape::observations,
           "(E, n) float64: q, v and the readings, one after the other.")
      .def("status", &SceneTape::status, "(E) int8: StepStatus of the last steps.")
      .def("parameters", &SceneTape::parameters,
           "(E, names) parameters of the environments, in SI units.")
      .def(
          "reverse", &SceneTape::reverse, "observation_bar"_a,
          "Reverses the last step() that is not reversed yet: takes derivatives of a loss by what\n"
          "it read (E, n), returns those by its controls (E, nu).")
      .def("reverse_start", &SceneTape::reverse_start, "observation_bar"_a,
           nb::sig("def reverse_start(self, observation_bar: numpy.typing.ArrayLike) -> "
                   "tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64]]"),
           "Ends the reverse pass: takes derivatives by the first readings (E, n), returns those\n"
           "by q (E, nq), v (E, nv), parameters (E, names) of the start, and by points (n, 7).")
      .def("begin_reverse", &SceneTape::begin_reverse, "Begins another reverse pass.")
      .def_prop_ro("taken", &SceneTape::taken, "Calls of step() on the tape.")
      // Copies: a reset with other points makes others.
      .def_prop_ro("spec", [](const SceneTape& s) { return TaskSpec(s.spec()); })
      .def_prop_ro("model", [](const SceneTape& s) { return Model(s.model()); })
      .def_prop_ro("points", &SceneTape::point_count,
                   "Of all sensors; 0 without their derivatives.")
      .def_prop_ro("num_envs", &SceneTape::count);
}

}  // namespace tangere::python
