// SPDX-License-Identifier: Apache-2.0
// A compiled scene: indices and constants, without strings on hot paths. It is immutable, and all
// batches and threads share it.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/model/model_info.hpp"
#include "engine/scene/effects.hpp"
#include "engine/scene/scene.hpp"

namespace tangere {

struct CompiledModel;  // private to the engine

/// A handle: copies share one compiled scene.
class Model {
 public:
  /// Compiles a scene. Throws InputError (file:line) for references to names that do not exist,
  /// massless leaves, degenerate sensors, …, and if kernels cannot run here (kernels::isa_error()).
  explicit Model(const Scene& scene);

  [[nodiscard]] const Scene& scene() const;
  [[nodiscard]] int nq() const;             ///< configuration coordinates (quaternions count 4)
  [[nodiscard]] int nv() const;             ///< velocity dofs
  [[nodiscard]] int nu() const;             ///< controls: motors in file order, one control per dof
  [[nodiscard]] int nb() const;             ///< bodies of the scene, folded or not, in file order
  [[nodiscard]] int moving_bodies() const;  ///< bodies that are not fixed in the world
  [[nodiscard]] double mass(int body) const;  ///< [kg], of body 0 … nb() - 1 in file order
  [[nodiscard]] double timestep() const;      ///< [s]
  /// The scene's scheme; SDIRK3 if the scene has an accuracy that its scheme cannot keep
  /// (keeping_accuracy()).
  [[nodiscard]] Integrator integrator() const;
  [[nodiscard]] const SolverOptions& solver() const;
  /// The tolerance that leaves errors well below those of a step [s] of this scheme
  /// (docs/solver.md). In force where neither scene nor caller names one.
  [[nodiscard]] double following_tolerance(Integrator integrator, double timestep) const;
  [[nodiscard]] std::span<const double> initial_q() const;  ///< (nq) where the scene starts
  /// Whether some contact or sensor has shear springs (k_s, docs/shear.md), or some joint dry
  /// friction.
  [[nodiscard]] bool has_shear_state() const;
  /// Whether some joint follows others, also by a transmission.
  [[nodiscard]] bool has_followers() const;
  /// Whether some joint is a transmission.
  [[nodiscard]] bool has_transmissions() const;
  /// Whether some links are closed to loops.
  [[nodiscard]] bool has_loops() const;
  [[nodiscard]] std::span<const SensorInfo> sensors() const;
  [[nodiscard]] std::span<const EndEffectorInfo> end_effectors() const;  ///< in file order
  [[nodiscard]] std::span<const ContactInfo> contacts() const;
  [[nodiscard]] std::span<const MeshInfo> meshes() const;  ///< those with a distance, by body
  /// What effects_of() lists for the scene, with the variants of the kernels.
  [[nodiscard]] std::span<const EffectInfo> effects() const;
  [[nodiscard]] std::span<const StageInfo> stages() const;     ///< in the order in which they run
  [[nodiscard]] std::span<const std::string> q_names() const;  ///< "object_joint.qw" …
  [[nodiscard]] std::span<const std::string> v_names() const;
  [[nodiscard]] std::span<const std::string> u_names() const;
  [[nodiscard]] std::span<const std::string> q_units() const;  ///< "m", "rad", "1"
  [[nodiscard]] std::span<const std::string> v_units() const;
  [[nodiscard]] std::span<const std::string> u_units() const;  ///< "1" of force motors, "m", "rad"
  [[nodiscard]] std::span<const std::string> body_names() const;
  [[nodiscard]] std::size_t state_bytes_per_environment() const;  ///< in a Batch

  /// Whether both share one compiled scene; two compilations of equal scenes differ.
  friend bool operator==(const Model& a, const Model& b) { return a.compiled_ == b.compiled_; }

 private:
  /// Returns the arrays behind it.
  friend const CompiledModel& compiled(const Model& model);
  std::shared_ptr<const CompiledModel> compiled_;
};

}  // namespace tangere
