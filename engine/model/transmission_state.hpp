// SPDX-License-Identifier: Apache-2.0
// Coordinates and rates of transmissions in a state, and what goes back from them.
#pragma once

#include <span>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "kernels/step/transmissions.hpp"

namespace tangere {

/// Scratch for one thread.
class TransmissionState {
 public:
  explicit TransmissionState(const CompiledModel& m);

  /// Sets the coordinates and rates of transmissions in a state, whose numbers are `stride` apart.
  /// `column`: the environment's numbers, row r at column[16 r]; null: the scene's.
  void place(double* q, double* v, int stride, const double* column);

  /// Sets the changes of transmissions in a state from those of other dofs, (nv) each, and of the
  /// scene's numbers (CompiledModel::view.rows), or empty.
  void complete(const double* q, const double* v, int stride, const double* column,
                std::span<const double> numbers_dot, std::span<double> q_dot,
                std::span<double> v_dot);

  /// Adds cotangents of transmissions in a state to those of other dofs and to `places`,
  /// (n_links, 3) by Link::frame.p, or null, and clears them. All are `out_stride` apart.
  void pull_back(const double* q, const double* v, int stride, const double* column, double* q_bar,
                 double* v_bar, double* places, int out_stride);

 private:
  void move_to(const double* q, const double* v, int stride, const double* column);
  /// Adds the derivatives of q_bar ℓ + v_bar ℓ̇ by places, (n_links, 3), `stride` apart.
  void add_places(const kernels::TransmissionPart<double>& part, double q_bar, double v_bar,
                  double* places, int stride);

  const CompiledModel& m_;
  std::vector<kernels::Link> links_;  ///< with the scene's places
  kernels::ModelView view_{};
  std::vector<double> q_, v_, x_, zero_, rates_, force_, second_;
  std::vector<kernels::LinkScratch<double>> scratch_;
  std::vector<kernels::TransmissionColumn<double>> columns_;
  kernels::StageArgs<double> a_{};
};

}  // namespace tangere
