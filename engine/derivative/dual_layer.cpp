// SPDX-License-Identifier: Apache-2.0
// Dual numbers go through the depths of points; the layer itself is linear in their changes.
#include "engine/derivative/dual_layer.hpp"

#include "kernels/step/arguments.hpp"

namespace tangere {

using kernels::kBlock;
using D = kernels::Dual<double>;

namespace {

kernels::Vec3<double> values(const kernels::Vec3<D>& x) {
  return {x.x.value, x.y.value, x.z.value};
}
kernels::Touch<double> values(const kernels::Touch<D>& t, const Coefficients<D>& law) {
  kernels::Touch<double> out{};
  for (int i = 0; i < 9; ++i) out.Q.m[i / 3][i % 3] = t.Q.m[i / 3][i % 3].value;
  out.c = values(t.c), out.omega = values(t.omega), out.v = values(t.v);
  out.law = transformed(law, [](const D& x) { return x.value; });
  return out;
}

}  // namespace

void read_dual_layer(const CompiledModel& m, int sensor,
                     std::span<const kernels::LinkScratch<D>> links,
                     const Coefficients<D>& coefficients, const LayerMaterial& material_dot,
                     const double* column, std::span<const double> numbers,
                     const DualSprings& springs, const std::array<D, 3>& loads,
                     std::span<double> field, std::span<double> field_dot) {
  const CompiledSensor& s = m.sensors[std::size_t(sensor)];
  std::vector<double> whole(field_dot.size()), whole_dot(whole), normal(whole), normal_dot(whole);
  Coefficients<D> smooth = coefficients;
  smooth.kt = smooth.mu = D(0.0);
  springs(coefficients, s.elastic, whole, whole_dot);
  springs(smooth, false, normal, normal_dot);
  std::vector<kernels::Touch<D>> touches;
  std::vector<kernels::Touch<double>> touch_values;
  std::vector<kernels::TouchShape> shapes;
  std::vector<kernels::Vec3<D>> sizes;
  const kernels::LinkPose<D> hand = dual_pose(links, s.link);
  for (const int number : s.targets) {
    const CompiledBody& body = m.bodies[std::size_t(number)];
    const kernels::LinkPose<D> other = dual_pose(links, body.link);
    kernels::pad_touch(&hand, s.pad, &other, body.frame, touches.emplace_back());
    touch_values.push_back(values(touches.back(), coefficients));
    sizes.push_back(dual_size(m, number, column, numbers));
    const kernels::Vec3<double> size = values(sizes.back());
    shapes.push_back({body.shape, {size.x, size.y, size.z}, body.grid});
  }
  kernels::TactileArgs<double> a{};
  a.law = s.law;
  a.n_touches = static_cast<int>(touches.size());
  a.shapes = shapes.data();
  a.touches = touch_values.data();
  LayeredField layered;
  std::vector<double> own(whole.size());
  layered.read(s, a, {whole, normal}, own, {loads[0].value, loads[1].value, loads[2].value});
  if (!field.empty()) std::copy(own.begin(), own.end(), field.begin());
  layered.push_forward({whole_dot, normal_dot}, touches, sizes, coefficients.kn.epsilon,
                       material_dot, field_dot,
                       {loads[0].epsilon, loads[1].epsilon, loads[2].epsilon});
}

}  // namespace tangere
