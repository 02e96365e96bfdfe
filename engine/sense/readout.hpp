// SPDX-License-Identifier: Apache-2.0
// The readings of a batch: poses and twists of bodies, end effectors, tactile fields, pictures of
// cameras. Reads the state and changes nothing.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "engine/base/precision.hpp"
#include "engine/sense/tactile_frame.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

/// Reads any batch of its model, and owns the scratch of one thread. Only the constructor and the
/// first picture of a sensor allocate; displacements of markers and surfaces have scratch of each
/// thread besides.
///
/// Tactile fields are in [N]: f·axis0, f·axis1, -f·(axis0 × axis1), where f is the force on the
/// sensor's body. They are exactly zero where nothing touches, unless the sensor is imperfect:
/// then every reading of it but FieldForm::ideal has its imperfections, and the same reading taken
/// twice in a step has the same noise. Every body that can move relative to the sensor is sensed.
/// Every way of reading gives the same numbers: those of the readout's precision, converted where T
/// is the other type. T is float or double. A flow is that of the shear in T. Pictures are computed
/// in single precision. FieldForm::markers, surface and pictures throw InputError for a sensor
/// without them. Every function throws InputError for a
/// batch or frame of another Model, for an environment, block, sensor or body that does not exist,
/// and for an array of another length than its shape says.
class Readout {
 public:
  explicit Readout(const Model& model, Precision precision = Precision::f64);
  ~Readout();
  Readout(Readout&&) noexcept;
  Readout& operator=(Readout&&) noexcept;

  [[nodiscard]] Precision precision() const;
  /// How many readings so far were of a layer under load control that does not carry the loads of
  /// its contacts: the body is beside the pad, or the tilt is at its end (docs/layer.md).
  [[nodiscard]] std::int64_t loads_not_carried() const;

  /// Reads world poses (nb, 7: x y z qw qx qy qz of the body frame) and twists (nb, 6: angular,
  /// then linear velocity of the body frame's origin, world axes) of one environment, for every
  /// body of the scene in file order, or for those of `chosen` alone in their order.
  void bodies(const Batch& batch, int environment, std::span<double> pose, std::span<double> twist,
              std::span<const int> chosen = {});

  /// Reads world positions of the scene's end effectors, (end effectors, 3) [m], of one environment
  /// in file order; with `velocity`, also their velocities, (end effectors, 3) [m/s], world axes.
  void end_effectors(const Batch& batch, int environment, std::span<double> position,
                     std::span<double> velocity = {});
  /// Reads the positions in the environments from 16 block on, (end effectors, 3) each. The bits
  /// are the same; kinematics is computed once for eight environments. Arrays beyond the batch's
  /// last environment may be missing.
  void read_end_effectors(const Batch& batch, int block,
                          std::span<const std::span<double>> positions);
  /// Computes (end effectors, 3, nv): the derivative of each position by displacements of q along
  /// the dofs of v, rotations on the right (docs/dynamics.md), so that velocity = jacobian v.
  void end_effector_jacobian(const Batch& batch, int environment, std::span<double> jacobian);

  /// Reads the field of one sensor and environment into (points, 3), zeros included.
  void tactile(const Batch& batch, int environment, int sensor, std::span<double> force);
  void tactile(const Batch& batch, int environment, int sensor, std::span<float> force);

  /// Reads the sensor and the form that the frame was made for.
  template <class T>
  void read(const Batch& batch, int environment, DenseFrame<T>& frame);
  template <class T>
  void read(const Batch& batch, int environment, CompactFrame<T>& frame);

  /// Reads the environments from 16 block on, numbers_of(model, output) each, one array per
  /// environment. Arrays beyond the batch's last environment are left alone and may be missing.
  /// Flat pads of up to 512 points are read in all environments at once.
  void read_block(const Batch& batch, int block, FieldOutput output,
                  std::span<const std::span<double>> readings);
  void read_block(const Batch& batch, int block, FieldOutput output,
                  std::span<const std::span<float>> readings);
  /// The same of a picture in colours, rounded to whole grey levels; other forms are refused.
  void read_block(const Batch& batch, int block, FieldOutput output,
                  std::span<const std::span<std::uint8_t>> pictures);
  /// The same of the numbers of bodies that a camera sees; other forms are refused.
  void read_block(const Batch& batch, int block, FieldOutput output,
                  std::span<const std::span<std::int16_t>> numbers);
  /// The same into one frame per environment, all of the same sensor and form.
  template <class T>
  void read_block(const Batch& batch, int block, std::span<DenseFrame<T>> frames);
  template <class T>
  void read_block(const Batch& batch, int block, std::span<CompactFrame<T>> frames);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
