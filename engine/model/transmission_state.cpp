// SPDX-License-Identifier: Apache-2.0
// The kernels' formulas (kernels/step/transmissions.hpp) in doubles: a state is a stage at x = 0
// whose rates are v.
#include "engine/model/transmission_state.hpp"

#include <cmath>
#include <numeric>

#include "kernels/reverse/transmission_adjoint.hpp"

namespace tangere {

using kernels::TransmissionPart;

TransmissionState::TransmissionState(const CompiledModel& m)
    : m_(m),
      links_(m.links),
      q_(std::size_t(m.nq)),
      v_(std::size_t(m.nv)),
      x_(std::size_t(m.nv)),
      zero_(std::size_t(m.nv)),
      rates_(std::size_t(m.nv)),
      force_(m.transmissions.size()),
      scratch_(m.links.size()),
      columns_(m.transmission_dofs.size()) {
  for (kernels::Link& link : links_) link.place_row = -1;
  point_transmissions(m, view_);
  view_.n_links = static_cast<int>(m.links.size());
  second_.resize(std::size_t(view_.most_transmission_dofs) *
                 std::size_t(view_.most_transmission_dofs));
  a_.centre = q_.data();
  a_.own_x = x_.data();
  a_.x = a_.s = zero_.data();
  a_.r = v_.data();
  a_.c0_over_h = 0;
  a_.inverse_h = 1;
  a_.v = rates_.data();
  a_.links = scratch_.data();
  a_.transmission_columns = columns_.data();
  a_.transmission_force = force_.data();
  a_.transmission_second = second_.data();
}

void TransmissionState::move_to(const double* q, const double* v, int stride,
                                const double* column) {
  for (std::size_t i = 0; i < q_.size(); ++i) q_[i] = q[i * std::size_t(stride)];
  for (std::size_t i = 0; i < v_.size(); ++i) v_[i] = v == nullptr ? 0 : v[i * std::size_t(stride)];
  view_.links = column == nullptr ? links_.data() : m_.links.data();
  a_.block = column;
  a_.group = 0;
  kernels::outward_sweep(view_, a_);
  kernels::transmission_motions(view_, a_);
}

void TransmissionState::place(double* q, double* v, int stride, const double* column) {
  move_to(q, v, stride, column);
  for (const kernels::Transmission& t : m_.transmissions) {
    const auto iq = std::size_t(t.q), iv = std::size_t(t.v);
    // Already there to rounding: kept as is, so that a stored state continues bit for bit.
    const auto set = [](double& to, double x) {
      if (!(std::abs(to - x) <= 1e-14 * (1 + std::abs(x)))) to = x;
    };
    set(q[iq * std::size_t(stride)], q_[iq] + x_[iv]);
    set(v[iv * std::size_t(stride)], rates_[iv]);
  }
}

void TransmissionState::add_places(const TransmissionPart<double>& part, double q_bar, double v_bar,
                                   double* places, int stride) {
  std::vector<double> alone(3 * links_.size());
  for (int i = 0; i < part.transmission.pieces; ++i)
    kernels::add_piece_places<double>(a_, part, part.pieces[i],
                                      {q_bar, v_bar, 0.0, a_.v, zero_.data()}, alone.data());
  for (std::size_t i = links_.size(); i-- > 0;) {  // a place moves all that hangs on its link
    const kernels::Vec3<double> in_parent =
        scratch_[i].local.R *
        kernels::Vec3<double>{alone[3 * i], alone[3 * i + 1], alone[3 * i + 2]};
    const double x[3] = {in_parent.x, in_parent.y, in_parent.z};
    for (std::size_t k = 0; k < 3; ++k) {
      places[std::ptrdiff_t(3 * i + k) * stride] += x[k];
      if (links_[i].parent >= 0) alone[std::size_t(3 * links_[i].parent) + k] += x[k];
    }
  }
}

void TransmissionState::complete(const double* q, const double* v, int stride, const double* column,
                                 std::span<const double> numbers_dot, std::span<double> q_dot,
                                 std::span<double> v_dot) {
  move_to(q, v, stride, column);
  kernels::for_each_transmission(view_, a_, [&](const TransmissionPart<double>& part) {
    kernels::transmission_second(a_, part);
    double along = 0, rate = 0;
    for (int k = 0; k < part.transmission.dofs; ++k) {
      const auto dof = std::size_t(part.dofs[k].v);
      if (part.transmission.has_length) along += part.columns[k].slope * q_dot[dof];
      rate += part.columns[k].slope * v_dot[dof] + part.columns[k].rate * q_dot[dof];
    }
    const auto place_change = [&](double q_bar, double v_bar) {
      std::vector<double> places(3 * links_.size());
      add_places(part, q_bar, v_bar, places.data(), 1);
      return std::inner_product(places.begin(), places.end(),
                                numbers_dot.begin() + m_.view.rows.places, 0.0);
    };
    if (!numbers_dot.empty()) along += place_change(1, 0), rate += place_change(0, 1);
    q_dot[std::size_t(part.transmission.v)] = along;
    v_dot[std::size_t(part.transmission.v)] = rate;
  });
}

void TransmissionState::pull_back(const double* q, const double* v, int stride,
                                  const double* column, double* q_bar, double* v_bar,
                                  double* places, int out_stride) {
  move_to(q, v, stride, column);
  const auto at = [&](double* x, int i) -> double& { return x[std::ptrdiff_t(i) * out_stride]; };
  kernels::for_each_transmission(view_, a_, [&](const TransmissionPart<double>& part) {
    kernels::transmission_second(a_, part);
    double &own_q = at(q_bar, part.transmission.v), &own_v = at(v_bar, part.transmission.v);
    for (int k = 0; k < part.transmission.dofs; ++k) {
      const int dof = part.dofs[k].v;
      at(q_bar, dof) += part.columns[k].rate * own_v;
      if (part.transmission.has_length) at(q_bar, dof) += part.columns[k].slope * own_q;
      at(v_bar, dof) += part.columns[k].slope * own_v;
    }
    if (places != nullptr) add_places(part, own_q, own_v, places, out_stride);
    own_q = own_v = 0;
  });
}

}  // namespace tangere
