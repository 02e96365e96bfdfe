// SPDX-License-Identifier: Apache-2.0
// Forms of a field as functions of the field of their sensor (engine/scene/field_form.hpp), and
// their pullbacks. `ideal`, `markers`, `surface`, `channels` and pictures are functions of the
// ideal field. Shear, markers and surface are linear; channels are quadratic; a flow is a quotient.
// Of a sum, with a point's place x_i and its pressing force p_i = max(0, sign f_3,i):
//
//   F = Σ_i R_iᵀ f_i,  c = Σ_i p_i x_i / P,  P = Σ_i p_i,  ∂c/∂p_i = (x_i - c)/P,  ∂c/∂x_i = p_i/P
#pragma once

#include <memory>
#include <span>

#include "engine/model/model.hpp"
#include "engine/scene/field_form.hpp"

namespace tangere {

/// One form of one sensor's field. Several threads may use it at once. Each thread allocates
/// scratch at its first call.
class FormMap {
 public:
  /// Throws InputError for a sensor that does not exist, for markers of a sensor without them, for
  /// `pressure`, which leaves friction out, and for pictures of a sensor without a layer: the field
  /// does not determine them.
  FormMap(const Model& model, FieldOutput output);
  ~FormMap();
  FormMap(FormMap&&) noexcept;
  FormMap& operator=(FormMap&&) noexcept;

  [[nodiscard]] std::size_t field_size() const;  ///< 3 points
  [[nodiscard]] std::size_t size() const;        ///< numbers_of(sensor, form)

  /// Computes the form, (size), from the field, (field_size) [N]. The bits are those of
  /// Readout::read_block(), but the sum of a pad whose axes are not perpendicular differs by
  /// rounding; pictures are in double precision, without noise and gains; channels are without
  /// their flaws.
  void evaluate(std::span<const double> field, std::span<double> form) const;
  /// Adds to `field_bar`, (field_size), the pullback of `form_bar`, (size), at `field`. A flow
  /// changes with the first point of the largest shear. Points that do not press have no derivative
  /// of the centre of pressure. `point_bar`: (points, kPointNumbers), to which the derivatives of
  /// the centre by the places of points, at a given field, are added, or empty.
  void pull_back(std::span<const double> field, std::span<const double> form_bar,
                 std::span<double> field_bar, std::span<double> point_bar = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
