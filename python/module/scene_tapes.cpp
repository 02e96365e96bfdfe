// SPDX-License-Identifier: Apache-2.0
// SceneTape in Python.
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "python/module/module.hpp"
#include "python/module/options.hpp"
#include "python/module/scene_tape.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

namespace {

void make_tape(SceneTape* self, const Scene& scene, const Whole<int>& envs, const Whole<int>& steps,
               const Whole<int>& every, const std::optional<std::vector<std::string>>& readings,
               bool points, const std::optional<Whole<int>>& threads, const std::string& precision,
               double tape_bytes) {
  TapeOptions options;
  options.precision = precision_named(precision);
  options.length = steps.value("steps");
  options.threads = threads_of(threads);
  options.tape_bytes = tape_bytes;
  options.points = points;
  new (self) SceneTape({scene, readings, every.value("every"), envs.value("num_envs"), options});
}

void reset_tape(SceneTape& tape, const Whole<std::uint64_t>& seed,
                const std::optional<Argument<double>>& q, const std::optional<Argument<double>>& v,
                const std::optional<Argument<double>>& shear_state,
                const std::optional<Argument<double>>& points,
                const std::optional<NamedValues>& numbers, bool record) {
  tape.reset(seed, {q, v, shear_state, numbers}, points, record);
}

constexpr const char* kArrays =
    "tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]";

std::string signature(const char* name, const char* arguments, int more = 0) {
  std::string arrays = kArrays;
  for (int k = 0; k < more; ++k) arrays += ", numpy.typing.NDArray[numpy.float64]";
  return fmt::format("def {}(self, {}) -> {}]", name, arguments, arrays);
}

constexpr const char* kBar = "observation_bar: numpy.typing.ArrayLike";

void add_calls(nb::class_<SceneTape>& c) {
  c.def("reset", &reset_tape, "seed"_a = 0, "q"_a = nb::none(), "v"_a = nb::none(),
        "shear_state"_a = nb::none(), "points"_a = nb::none(), "numbers"_a = nb::none(),
        "record"_a = true,
        "Starts anew and clears the tape. `q` (E, nq), `v` (E, nv), `shear_state` (E, points, 3)\n"
        "and `numbers` (name → one value or (E)) take the place of what the scene draws; one\n"
        "row of q and v stands for all. `points` (points of all sensors, 7) moves points of\n"
        "sensors: x, y, z [m] in their body's frame, and kn, kt, mu, damping are added to their\n"
        "own. The scene is compiled again where it differs from that of the last reset. Without\n"
        "`record` nothing can be reversed.");
  c.def("step", &SceneTape::step, "controls"_a, "numbers"_a = nb::none(),
        "Takes `every` steps with the controls (E, every, nu). `numbers`: name → one value or\n"
        "(E), from now on.");
  c.def("check_step", &SceneTape::check_step, "controls"_a,
        "Raises InputError if step() would do so for these controls; takes no step.");
  c.def("reverse", &SceneTape::reverse, "observation_bar"_a,
        nb::sig(signature("reverse", kBar).c_str()),
        "Reverses the last step() that is not reversed yet: takes derivatives of a loss by what\n"
        "it read (E, n), returns those by its controls (E, every, nu) and by the parameters that\n"
        "it was given (E, names), while they held.");
  c.def("reverse_start", &SceneTape::reverse_start, "observation_bar"_a,
        nb::sig(signature("reverse_start", kBar, 3).c_str()),
        "Ends the reverse pass: takes derivatives by the first readings (E, n), returns those by\n"
        "q (E, nq), v (E, nv), shear state (E, points, 3) if it was given, points (n, 7) and\n"
        "parameters (E, names) of the start.");
  c.def("begin_reverse", &SceneTape::begin_reverse, "Begins another reverse pass.");
  c.def("add_parameters", &SceneTape::add_parameters, "names"_a,
        "Numbers of the scene that environments may have of their own, with derivatives. Names\n"
        "that are new compile the scene again and clear the tape. InputError: a name that is\n"
        "unknown or has no derivative.");
}

}  // namespace

void add_scene_tapes(nb::module_& m) {
  nb::class_<SceneTape> c(
      m, "SceneTape",
      "A scene on tape, for back-propagation through time: tangere.torch.Simulation joins it to\n"
      "PyTorch. Environment e has the draws of episode e of the seed.");
  c.def("__init__", &make_tape, "scene"_a, "num_envs"_a, "steps"_a, "every"_a = 1,
        "readings"_a = nb::none(), "points"_a = false, "threads"_a = nb::none(),
        "precision"_a = "double", "tape_bytes"_a = 1e9,
        "`steps`: calls of step() at most. `every`: steps of the simulation in each.\n"
        "`readings`: names, such as pad, pad.sum, bodies.box, variables, shear_state or an end\n"
        "effector; None: all end effectors and fields. `points`: whether there are derivatives by\n"
        "points of sensors. InputError: a number is out of range, or a name is unknown or has no\n"
        "derivative.");
  add_calls(c);
  c.def("observations", &SceneTape::observations,
        "(E, n) float64: q, v and the readings, one after the other.");
  c.def("status", &SceneTape::status, "(E) int8: StepStatus of the last steps.");
  c.def("varying", &SceneTape::varying,
        "(E, numbers) values of what varies in the last step, in SI units and the order of\n"
        "model.scene.varying.");
  c.def("bodies", &SceneTape::bodies, "q"_a, "v"_a, "varying"_a,
        "(E, nb, 13) poses and twists of bodies in the states q (E, nq) and v (E, nv), with the\n"
        "numbers of varying().");
  const char* const given =
      "q: numpy.typing.ArrayLike, v: numpy.typing.ArrayLike, "
      "varying: numpy.typing.ArrayLike, body_bar: numpy.typing.ArrayLike";
  c.def("reverse_bodies", &SceneTape::reverse_bodies, "q"_a, "v"_a, "varying"_a, "body_bar"_a,
        nb::sig(signature("reverse_bodies", given).c_str()),
        "Derivatives by q (E, nq) and v (E, nv) from those by these bodies.");
  const auto current = [&](const char* name, auto get, const char* doc) {
    c.def_prop_ro(
        name, [get](SceneTape& s) { return s.current(get); }, doc);
  };
  using Self = const SceneTape&;
  current(
      "taken", [](Self s) { return s.taken(); }, "Calls of step() on the tape.");
  current(
      "spec", [](Self s) { return TaskSpec(s.spec()); }, "The scene as a task; a copy.");
  current(
      "model", [](Self s) { return Model(s.model()); }, "The compiled scene.");
  current(
      "parameters", [](Self s) { return std::vector(s.parameters()); },
      "Names that have derivatives.");
  current(
      "units", [](Self s) { return s.units(); }, "Units of `parameters`.");
  current(
      "shared", [](Self s) { return s.shared(); },
      "Name → value of those parameters that are the same in all environments.");
  current(
      "points", [](Self s) { return s.point_count(); },
      "Of all sensors; 0 without their derivatives.");
  current(
      "shear_points", [](Self s) { return s.shear_points(); }, "Of contacts with ks.");
  c.def_prop_ro("num_envs", &SceneTape::count);
}

}  // namespace tangere::python
