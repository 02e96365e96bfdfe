// SPDX-License-Identifier: Apache-2.0
// The numbers of a scene that gradients are taken by: coefficients of contacts and sensors,
// densities and sizes of bodies, damping, stiffness, gains of position motors.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "engine/derivative/adjoint.hpp"

namespace tangere {

struct ParameterInfo {
  std::string
      name;  ///< "contact pad ball kn", "ground ball mu", "tactile pad kt", "body ball density",
             ///< "body tip mass", "body pad size[0]", "joint arm damping", "motor arm P"
  std::string unit;  ///< SI
  double value;      ///< in the scene; environments may differ where <randomize> says so
};

/// Every such number of a model, once: a number that a scene gives for a whole joint has one
/// derivative.
class Parameters {
 public:
  explicit Parameters(const Model& model);

  [[nodiscard]] std::span<const ParameterInfo> infos() const { return infos_; }
  [[nodiscard]] int count() const { return static_cast<int>(infos_.size()); }
  /// Where number k stands in a scene that the model could have been compiled from.
  [[nodiscard]] double& in(Scene& scene, int k) const;
  /// Which of a scene's randomisations (Scene::randomizations) number k follows; -1: none, it is
  /// the scene's.
  [[nodiscard]] int randomization(const Scene& scene, int k) const;
  /// Derivatives of a loss by all of them, (count), for an environment of the batch that an Adjoint
  /// made with parameters has reversed.
  void gradient(const BlockCotangent& cotangent, const Batch& batch, int environment,
                std::span<double> out) const;
  /// The other way: how the rows of BlockCotangent::parameters change when these numbers of an
  /// environment, (count), do.
  void spread(std::span<const double> change, const Batch& batch, int environment,
              std::span<double> rows) const;

 private:
  enum class Place { pair, ground, sensor, density, mass, size, joint, turning, motor };
  struct Term {
    int row;  ///< of BlockCotangent::parameters
    double coefficient;
  };
  struct Entry {
    Place place;
    int index, field;
    std::vector<Term> terms;
    bool varies = false;  ///< how masses follow is each environment's own, and not among the terms
  };
  using Masses = std::array<double, 10>;  ///< rows of a link's mass, moment and inertia
  void add(std::string name, std::string unit, Entry entry);
  void add_coefficients(const std::string& of, bool linear, Place place, int index, int row);
  void add_contacts();
  void add_bodies();
  void add_joints();
  void add_motors();
  /// Of a joint's dofs from `first` on.
  [[nodiscard]] Entry of_dofs(Place place, int joint, int field, int first, int end) const;
  /// How the masses of its link change with an entry of a body that is so.
  [[nodiscard]] Masses masses_by(const Entry& entry, const Shape& shape, double density) const;
  /// The same in an environment of its own density and size.
  [[nodiscard]] Masses masses_by(const Entry& entry, const Batch& batch, int environment) const;
  [[nodiscard]] int mass_row(const Entry& entry) const;

  Model model_;
  std::vector<ParameterInfo> infos_;
  std::vector<Entry> entries_;
};

/// Rows of BlockCotangent::parameters: those of the kernels, then kn, kt, mu, damping of every
/// sensor.
int parameter_rows(const Model& model);

}  // namespace tangere
