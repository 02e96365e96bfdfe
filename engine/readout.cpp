// SPDX-License-Identifier: Apache-2.0
// Forward kinematics of one environment in plain doubles, then the tactile kernel per touching body.
#include "engine/readout.hpp"

#include <algorithm>
#include <vector>

#include "engine/aligned.hpp"
#include "engine/compiled_model.hpp"
#include "kernels/kernel_table.hpp"
#include "kernels/residual-inl.hpp"

namespace tangere {

using kernels::Frame;
using kernels::Vec3;
using kernels::Vec6;

struct Readout::Impl {
  Model model;
  std::vector<kernels::LinkScratch<double>> links;
  std::vector<double> q, v, zero, joint_v;
  std::vector<AlignedVector<double>> force;       // per sensor, in tiles, zero between calls
  std::vector<std::vector<unsigned char>> touched;

  explicit Impl(const Model& m)
      : model(m),
        links(m.compiled().links.size()),
        q(std::size_t(m.nq())),
        v(std::size_t(m.nv())),
        zero(std::size_t(m.nv())),
        joint_v(std::size_t(m.nv())) {
    for (const CompiledSensor& s : m.compiled().sensors) {
      force.emplace_back(std::size_t(s.n_tiles) * 3 * kernels::kTactileTile, 0.0);
      touched.emplace_back(std::size_t(s.n_tiles), static_cast<unsigned char>(0));
    }
  }

  /// World poses and body twists of all links. With x = 0 and r = v, the stage's rates are v itself.
  void kinematics(const Batch& batch, int environment) {
    batch.get_q(environment, q);
    batch.get_v(environment, v);
    kernels::StageArgs<double> a{};
    a.centre = q.data();
    a.x = zero.data();
    a.r = v.data();
    a.s = zero.data();
    a.c0_over_h = 0;
    a.inverse_h = 1;
    a.links = links.data();
    a.v = joint_v.data();
    kernels::outward_sweep(model.compiled().view, a);
  }

  [[nodiscard]] Frame<double> world(int link) const {
    return link < 0 ? Frame<double>{kernels::diagonal(1.0), {0, 0, 0}} : links[std::size_t(link)].world;
  }
  [[nodiscard]] Vec6<double> twist(int link) const {
    return link < 0 ? kernels::zero6<double>() : links[std::size_t(link)].V;
  }

  /// Adds what `body` does to `sensor`, in tiles.
  void feel(const Batch& batch, int environment, int sensor, int body) {
    const CompiledModel& m = model.compiled();
    const CompiledSensor& s = m.sensors[std::size_t(sensor)];
    const CompiledBody& b = m.bodies[std::size_t(body)];
    const Frame<double> link2 = relative(world(s.link), world(b.link));
    const Frame<double> shape = compose(link2, b.frame);
    const Vec6<double> W = motion_to_parent(link2, twist(b.link)) - twist(s.link);
    const double* block = batch.block(environment / kernels::kBlock) + environment % kernels::kBlock;
    const auto value = [&](const kernels::Parameter& p) {
      return p.row < 0 ? p.value : block[std::size_t(p.row) * kernels::kBlock];
    };
    kernels::TactileArgs a{};
    a.points = s.points.data();
    a.bounds = s.bounds.data();
    a.n_tiles = s.n_tiles;
    a.shape = b.shape;
    a.size[0] = b.size.x, a.size[1] = b.size.y, a.size[2] = b.size.z;
    for (int i = 0; i < 9; ++i) a.Q[i] = shape.R.m[i / 3][i % 3];
    a.c[0] = shape.p.x, a.c[1] = shape.p.y, a.c[2] = shape.p.z;
    a.omega[0] = W.a.x, a.omega[1] = W.a.y, a.omega[2] = W.a.z;
    a.v[0] = W.l.x, a.v[1] = W.l.y, a.v[2] = W.l.z;
    a.kn = value(s.parameters.kn);
    a.kt = value(s.parameters.kt);
    a.mu = value(s.parameters.mu);
    a.damping = value(s.parameters.damping);
    a.law = s.law;
    std::copy(s.axes, s.axes + 9, a.axes);
    a.force = force[std::size_t(sensor)].data();
    a.touched = touched[std::size_t(sensor)].data();
    kernels::active_kernels().tactile(a);
  }
};

Readout::Readout(const Model& model) : impl_(std::make_unique<Impl>(model)) {}
Readout::~Readout() = default;
Readout::Readout(Readout&&) noexcept = default;
Readout& Readout::operator=(Readout&&) noexcept = default;

void Readout::bodies(const Batch& batch, int environment, std::span<double> pose, std::span<double> twist) {
  impl_->kinematics(batch, environment);
  const CompiledModel& m = impl_->model.compiled();
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const CompiledBody& body = m.bodies[b];
    const Frame<double> at = compose(impl_->world(body.link), body.frame);
    const kernels::Quat<double> o = quaternion_of(at.R);
    const double values[7] = {at.p.x, at.p.y, at.p.z, o.w, o.x, o.y, o.z};
    std::copy(values, values + 7, &pose[7 * b]);
    const Vec6<double> V = impl_->twist(body.link);
    const kernels::Mat3<double> R = impl_->world(body.link).R;
    const Vec3<double> omega = R * V.a, v = R * (V.l + cross(V.a, body.frame.p));
    const double rates[6] = {omega.x, omega.y, omega.z, v.x, v.y, v.z};
    std::copy(rates, rates + 6, &twist[6 * b]);
  }
}

void Readout::tactile(const Batch& batch, int environment, int sensor, std::span<double> force) {
  impl_->kinematics(batch, environment);
  const CompiledSensor& s = impl_->model.compiled().sensors[std::size_t(sensor)];
  for (int body : s.targets) impl_->feel(batch, environment, sensor, body);
  std::fill(force.begin(), force.end(), 0.0);
  constexpr int kTile = kernels::kTactileTile;
  for (int t = 0; t < s.n_tiles; ++t) {
    unsigned char& touched = impl_->touched[std::size_t(sensor)][std::size_t(t)];
    if (touched == 0) continue;
    double* tile = impl_->force[std::size_t(sensor)].data() + std::size_t(t) * 3 * kTile;
    for (int k = 0; k < kTile; ++k) {
      const int index = s.index[std::size_t(t * kTile + k)];
      if (index < 0) continue;
      for (int c = 0; c < 3; ++c) force[std::size_t(3 * index + c)] = tile[c * kTile + k];
    }
    std::fill(tile, tile + 3 * kTile, 0.0);
    touched = 0;
  }
}

}  // namespace tangere
