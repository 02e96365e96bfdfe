// SPDX-License-Identifier: Apache-2.0
// The numbers of a scene by which gradients are taken, and how each enters the rows of derivatives
// that the kernels compute.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "engine/model/model.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

struct BlockCotangent;

struct NumberInfo {
  SceneNumber number;
  std::string name, unit;  ///< name_of(), unit_of()
  double value;            ///< in the scene; <randomize> may vary it by environment
};

/// Coefficients of contacts and sensors, densities (or masses) and sizes of bodies, effects and
/// places of joints, gains of motors, numbers of loops and of the material of layers. Each appears
/// once: a number that a scene gives for a whole joint has one derivative. Every gradient by them
/// has their order.
class NumberGradients {
 public:
  explicit NumberGradients(const Model& model);

  [[nodiscard]] std::span<const NumberInfo> infos() const { return infos_; }
  [[nodiscard]] int count() const { return static_cast<int>(infos_.size()); }
  /// Computes the derivatives of a loss by all numbers, (count), for one environment of the batch.
  /// An Adjoint made with parameters must have reversed it.
  void gradient(const BlockCotangent& cotangent, const Batch& batch, int environment,
                std::span<double> out) const;
  /// The transpose: computes how the rows of BlockCotangent::parameters change when these numbers
  /// of an environment, (count), change.
  void spread(std::span<const double> change, const Batch& batch, int environment,
              std::span<double> rows) const;

 private:
  struct Term {
    int row;  ///< of BlockCotangent::parameters
    double coefficient;
  };
  using Terms = std::vector<Term>;
  using Masses = std::array<double, 10>;  ///< a link's mass, mass times centre, inertia
  struct Entry {
    Terms terms;
    int body = -1;  ///< if ≥ 0, the masses of this body vary by environment and are not in `terms`
  };
  void add(const SceneNumber& number, Terms terms, int body = -1);
  /// `rows`: of the first coefficient, for each contact that has it.
  void add_coefficients(SceneNumber of, std::initializer_list<int> rows);
  void add_contacts();
  void add_bodies();
  void add_joints();
  void add_place(std::size_t joint);
  void add_motors();
  void add_loops();
  /// Terms of number `which` of the dofs `first` … `end` - 1 of a joint.
  [[nodiscard]] Terms dof_terms(std::size_t joint, int which, int first, int end) const;
  /// How the masses of a body's link change with a number of a body of this shape and density.
  [[nodiscard]] Masses masses_by(const SceneNumber& number, int body, const Shape& shape,
                                 double density) const;
  /// The same for entry k, with the density and size that an environment has.
  [[nodiscard]] Masses masses_by(std::size_t k, const Batch& batch, int environment) const;
  [[nodiscard]] int mass_row(int body) const;

  Model model_;
  std::vector<NumberInfo> infos_;
  std::vector<Entry> entries_;  // parallel to infos_
};

/// Number of rows of BlockCotangent::parameters: those of the kernels, then the coefficients of
/// every sensor.
int parameter_rows(const Model& model);

}  // namespace tangere
