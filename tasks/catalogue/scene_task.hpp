// SPDX-License-Identifier: Apache-2.0
// A scene as a task that rewards nothing: an action is the controls of some steps, and chosen
// readings are observed. So a tape of a task (tasks/gradients/task_tape.hpp) is also one of any
// scene.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "engine/sense/form_map.hpp"
#include "tasks/catalogue/task.hpp"

namespace tangere {

class SceneTask : public Task {
 public:
  /// `steps`: of the simulation for each action, (steps, nu) controls. `horizon`: actions of an
  /// episode. Observations are
  /// "state.q" (nq), "state.v" (nv) and `readings` by name, in their order:
  /// - "pad", "pad.pressure", "pad.sum" … of sensors (engine/scene/field_form.hpp);
  /// - "variables" (n, 3), the end effectors, or one by its name (3);
  /// - "bodies" (nb, 13), or "bodies.box" (13): x y z, qw qx qy qz, angular, linear velocity;
  /// - "shear_state" (points, 3), of contacts with ks (engine/step/shear_state_arrays.hpp).
  /// Without `readings`: all end effectors, then the field of every sensor. Throws InputError for a
  /// scene that cannot be compiled, and for a reading that it does not have or that does not follow
  /// from the field of its sensor.
  SceneTask(const Scene& scene, int steps, int horizon,
            const std::optional<std::vector<std::string>>& readings = {});

  /// Sets the numbers of <randomize> instead of drawing them, in order, for episodes 0 to
  /// rows.size()/k - 1, where k is their count. Empty: they are drawn. No episode may be played at
  /// the same time.
  void set_varying(std::vector<double> rows) { varying_ = std::move(rows); }

  void start(const TaskStart& start) const override;
  void controls(const TaskView& view, int step, std::span<double> u) const override;
  void observe(const TaskView& view, std::span<double> observation) const override;
  StepOutcome evaluate(const TaskView&) const override { return {}; }
  void reward_vjp(const TaskView&, double, const ViewCotangent&) const override {}
  void observe_vjp(const TaskView& view, std::span<const double> weight,
                   const ViewCotangent& out) const override;
  void controls_vjp(const TaskView& view, int step, std::span<const double> weight,
                    const ViewCotangent& out) const override;

 private:
  struct Field {
    std::optional<FormMap> map;  ///< none: of a pressure
    std::size_t first, size;     ///< numbers of Snapshot::tactile
    std::size_t point;           ///< its sensor's first among the points of all sensors
  };
  struct Motion {
    std::size_t body;
  };
  struct Positions {
    std::size_t first, count;  ///< numbers of Snapshot::end_effectors
  };
  struct Shear {};
  using Reading = std::variant<Field, Motion, Positions, Shear>;

  std::vector<Reading> readings_;
  std::vector<double> varying_;
};

}  // namespace tangere
