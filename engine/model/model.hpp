// SPDX-License-Identifier: Apache-2.0
// A compiled scene: indices and constants, without strings on hot paths. It is immutable, and all
// batches and threads share it.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/model/effects.hpp"
#include "engine/model/scene.hpp"

namespace tangere {

struct CompiledModel;  // private to the engine

/// A tactile sensor after compilation.
struct SensorInfo {
  std::string name;
  std::string body;
  int rows = 0, cols = 0;  ///< of a rectangular array; points = rows * cols, row-major
  int points = 0;
  int every = 0;           ///< as in the scene; 0: the caller chooses
  int pressure_sign = 1;   ///< +1: the third component is positive under pressure; -1: negative
  bool imperfect = false;  ///< its readings differ from the ideal field (docs/sensors.md)
  int past_states = 0;     ///< earlier states on which a reading depends
};

/// An end effector after compilation.
struct EndEffectorInfo {
  std::string name;
  std::string joint;
};

/// One contact declared in the scene, after compilation.
struct ContactInfo {
  std::string first, second;  ///< bodies; second is "ground" for a ground contact
  int points = 0;             ///< candidate points (1 for a sphere on the ground)
  std::string law;
};

/// A mesh that can be touched, after compilation.
struct MeshInfo {
  std::string body;
  std::array<int, 3> cells{};  ///< of its grid, x y z
  double cell = 0;             ///< edge of a cell [m]
  std::size_t bytes = 0;       ///< memory of the grid; bodies with the same mesh share one
  /// Of the distance on the surface [m], and the share of the area where the grid is too coarse
  /// for it (engine/model/mesh_fit.hpp says by what).
  double error = 0, unresolved = 0;
  /// The share from which on programs warn. Edges alone stay below it.
  static constexpr double kMostUnresolved = 0.1;
};

/// A stage of the step that the scene calls for, what it works on and the variant of its kernel.
struct StageInfo {
  std::string name, of, variant;
};

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
  [[nodiscard]] double mass(int body) const;  ///< [kg]
  [[nodiscard]] double timestep() const;      ///< [s]
  /// The scene's scheme, or SDIRK3 where its accuracy asks for one (keeping_accuracy()).
  [[nodiscard]] Integrator integrator() const;
  [[nodiscard]] const SolverOptions& solver() const;
  /// The tolerance that leaves errors well below those of a step [s] of this scheme
  /// (docs/solver.md). In force where neither scene nor caller names one.
  [[nodiscard]] double following_tolerance(Integrator integrator, double timestep) const;
  [[nodiscard]] std::span<const double> initial_q() const;  ///< (nq) where the scene starts
  /// Whether friction of some contact or sensor remembers (docs/shear.md).
  [[nodiscard]] bool remembers() const;
  [[nodiscard]] std::span<const SensorInfo> sensors() const;
  [[nodiscard]] std::span<const EndEffectorInfo> end_effectors()
      const;  ///< end effectors, in file order
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
  [[nodiscard]] std::span<const std::string> u_units()
      const;  ///< "1": controls are dimensionless for force motors
  [[nodiscard]] std::span<const std::string> body_names() const;
  [[nodiscard]] std::size_t state_bytes_per_environment() const;  ///< memory in a Batch

  /// Whether both are the same compiled scene, not only equal ones.
  friend bool operator==(const Model& a, const Model& b) { return a.compiled_ == b.compiled_; }

 private:
  friend const CompiledModel& compiled(const Model& model);
  std::shared_ptr<const CompiledModel> compiled_;
};

}  // namespace tangere
