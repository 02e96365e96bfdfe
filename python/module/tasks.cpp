// SPDX-License-Identifier: Apache-2.0
// What tasks declare, in Python.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "python/module/arrays.hpp"
#include "python/module/module.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

void add_tasks(nb::module_& m) {
  nb::class_<TensorSpec>(m, "TensorSpec", "An array of numbers that a task receives or returns.")
      .def(
          "__init__",
          [](TensorSpec* self, const std::string& name, const std::vector<std::size_t>& shape,
             const std::string& unit, const std::string& meaning, double low, double high,
             bool privileged, bool touch, std::size_t own_bytes) {
            new (self)
                TensorSpec{name, shape, unit, meaning, {}, low, high, privileged, touch, own_bytes};
          },
          "name"_a, "shape"_a, "unit"_a = "", "meaning"_a = "", "low"_a = -TensorSpec::kUnbounded,
          "high"_a = TensorSpec::kUnbounded, "privileged"_a = false, "touch"_a = false,
          "own_bytes"_a = 0)
      .def_ro("name", &TensorSpec::name)
      .def_prop_ro(
          "shape", [](const TensorSpec& t) { return nb::tuple(nb::cast(t.shape)); },
          nb::for_getter(nb::sig("def shape(self) -> tuple[int, ...]")))
      .def_ro("unit", &TensorSpec::unit)
      .def_ro("meaning", &TensorSpec::meaning)
      .def_ro("low", &TensorSpec::low, "Lower bound of every number, or -inf.")
      .def_ro("high", &TensorSpec::high)
      .def_ro("scale", &TensorSpec::scale,
              "Typical sizes in `unit`: one, or one per place on the last axis. Empty: 1.")
      .def_ro("privileged", &TensorSpec::privileged, "A robot could not measure it.")
      .def_ro("touch", &TensorSpec::touch,
              "What pads feel: all numbers are 0 where nothing is felt.")
      .def_ro("own_bytes", &TensorSpec::own_bytes,
              "1: uint8, a picture in colours; 2: int16, numbers of bodies; 0: float32.")
      .def("__repr__", [](const TensorSpec& t) {
        return fmt::format("TensorSpec('{}', ({}), '{}')", t.name, fmt::join(t.shape, ", "),
                           t.unit);
      });
  nb::class_<TaskSpec>(m, "TaskSpec", "What a task declares.")
      .def(
          "__init__",
          [](TaskSpec* self, const std::string& name, const std::string& scene,
             const std::string& success, const TensorSpec& action,
             const std::vector<TensorSpec>& observations, int steps_per_action, int horizon) {
            auto* const spec = new (self) TaskSpec;
            spec->name = name;
            spec->scene = scene;
            spec->success = success;
            spec->action = action;
            spec->observations = observations;
            spec->steps_per_action = steps_per_action;
            spec->snapshots = {steps_per_action};
            spec->horizon = horizon;
          },
          "name"_a, "scene"_a, "success"_a, "action"_a, "observations"_a, "steps_per_action"_a,
          "horizon"_a)
      .def_ro("name", &TaskSpec::name)
      .def_ro("summary", &TaskSpec::summary)
      .def_ro("scene", &TaskSpec::scene, "Its file among tangere.scenes().")
      .def_ro("success", &TaskSpec::success, "When an episode counts as solved.")
      .def_ro("action", &TaskSpec::action)
      .def_ro("observations", &TaskSpec::observations)
      .def_ro("steps_per_action", &TaskSpec::steps_per_action, "Simulation steps.")
      .def_ro("horizon", &TaskSpec::horizon, "Actions after which an episode is truncated.")
      .def_ro("task_state", &TaskSpec::task_state, "Numbers that an episode keeps for the task.")
      .def("__repr__", [](const TaskSpec& s) { return fmt::format("TaskSpec('{}')", s.name); });
  m.def("task_names", &task_names, "Names of all tasks.");
  m.def("task_spec", &task_spec, "name"_a,
        "What the task of that name declares. InputError: there is none.");
}

}  // namespace tangere::python
