// SPDX-License-Identifier: Apache-2.0
// The numbers of a scene that gradients are taken by: coefficients of contacts and sensors, densities, damping, stiffness,
// gains of position motors.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/adjoint.hpp"

namespace tangere {

struct ParameterInfo {
  std::string name;  ///< "contact pad ball kn", "ground ball mu", "tactile pad kt", "body ball density", "joint arm damping"
  std::string unit;  ///< SI
  double value;      ///< in the scene; environments may differ where <randomize> says so
};

/// Every such number of a model, once: a number that a scene gives for a whole joint has one derivative.
class Parameters {
 public:
  explicit Parameters(const Model& model);

  [[nodiscard]] std::span<const ParameterInfo> infos() const { return infos_; }
  [[nodiscard]] int count() const { return static_cast<int>(infos_.size()); }
  /// Where number k stands in a scene that the model could have been compiled from.
  [[nodiscard]] double& in(Scene& scene, int k) const;
  /// Which of a scene's randomisations (Scene::randomizations) number k follows; -1: none, it is the scene's.
  [[nodiscard]] int randomization(const Scene& scene, int k) const;
  /// Derivatives of a loss by all of them, (count), for one lane of a block whose Adjoint was made with parameters.
  void gradient(const BlockCotangent& cotangent, int lane, std::span<double> out) const;
  /// The other way: how the rows of BlockCotangent::parameters change when these numbers, (count), change so.
  void spread(std::span<const double> change, std::span<double> rows) const;

 private:
  enum class Place { pair, ground, sensor, body, joint, turning, motor };
  struct Term {
    int row;             ///< of BlockCotangent::parameters
    double coefficient;
  };
  struct Entry {
    Place place;
    int index, field;
    std::vector<Term> terms;
  };
  void add(std::string name, std::string unit, Entry entry);
  void add_coefficients(const std::string& of, bool linear, Place place, int index, int row);
  void add_densities(const CompiledModel& m, int row);
  void add_joints(const CompiledModel& m, int row);

  std::vector<ParameterInfo> infos_;
  std::vector<Entry> entries_;
};

/// Rows of BlockCotangent::parameters: those of the kernels, then kn, kt, mu, damping of every sensor.
int parameter_rows(const CompiledModel& model);

}  // namespace tangere
