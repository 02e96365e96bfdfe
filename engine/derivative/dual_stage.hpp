// SPDX-License-Identifier: Apache-2.0
// One environment's stage in dual numbers: the plain templates of the kernels with a tangent beside
// every input. It is slow. It serves the tangents that the adjoint is checked against.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere {

using DualNumber = kernels::Dual<double>;

/// The caller sets the inputs. Contacts are summed over the points that touch.
class DualStage {
 public:
  explicit DualStage(const CompiledModel& model);
  ~DualStage();

  std::vector<DualNumber> centre, x, r, s, tau, target;  ///< (nq), then (nv) each
  double c0_over_h = 0, inverse_h = 0;
  std::vector<DualNumber> v, g;  ///< (nv) out

  /// Sets the numbers of one environment from its column of a block, and their tangents:
  /// (parameter_numbers), in the order of kernels/step/arguments.hpp; empty: zeros.
  void set_numbers(const double* column, std::span<const double> tangents = {});

  /// Sets the tangents of every point's own numbers of a sensor with shear springs, (points,
  /// kPointNumbers); empty: zeros.
  void set_points(int sensor, std::span<const double> tangents);

  /// While frozen, the numbers' tangents count as zero.
  void freeze_numbers(bool frozen);

  /// Chooses the faces that count in solves from this centre (kernels/step/faces.hpp). Overwrites
  /// v.
  void choose_faces();

  /// Shear state at the start of a solve, three numbers for each point with a shear spring.
  std::vector<DualNumber> s_start;
  /// Sets the anchors of solves from this centre. Call after choose_faces() and set_numbers().
  void recall();
  /// Replaces `s_start` by the shear state at the end of such a solve, at q and v.
  void advance(const std::vector<DualNumber>& q, const std::vector<DualNumber>& v);

  /// The same for sensors that keep anchors, where they are due after `steps` steps of an episode.
  void update_sensor_shear_state(const std::vector<DualNumber>& q, const std::vector<DualNumber>& v,
                                 std::int64_t steps);

  /// Computes v and g, with the tangents of masses included.
  void residual();
  /// Computes v alone, and the poses of links.
  void rates();
  /// Returns where a point of a link (-1: the world) is, at the poses computed last.
  [[nodiscard]] kernels::Vec3<DualNumber> in_world(int link,
                                                   const kernels::Vec3<double>& point) const;

  /// Computes how the field of a sensor, (points, 3), changes at the state centre ⊕ 0 with twist r
  /// (c0_over_h = 0, inverse_h = 1). `numbers`: tangents as rows of BlockCotangent::parameters; or
  /// empty. `points`: (points, kPointNumbers), tangents of every point's own numbers; or empty.
  /// `field`: the field itself, (points, 3); or empty.
  void field(int sensor, const double* column, std::span<const double> numbers,
             std::span<const double> points, std::span<double> field, std::span<double> field_dot);

 private:
  [[nodiscard]] std::array<DualNumber, 3> contact_loads(int sensor) const;
  void elastic_field(int sensor, const Coefficients<DualNumber>& law, std::span<double> field,
                     std::span<double> field_dot);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
