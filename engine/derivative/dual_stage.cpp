// SPDX-License-Identifier: Apache-2.0
// The kernels' templates over Dual<double>. Every number of the scene gets a row of its own, with
// its value in lane 0 and its tangent in lane 1 (kernels/step/stage.hpp).
#include "engine/derivative/dual_stage.hpp"

#include <algorithm>

#include "engine/derivative/dual_field.hpp"
#include "engine/derivative/dual_layer.hpp"
#include "engine/derivative/dual_stage_impl.hpp"
#include "engine/sense/contact_loads.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::Parameter;
using D = DualNumber;

namespace {

/// The values of a pair's numbers, and the faces that count there.
PairAt<double> pair_values(const kernels::PairContact& pair, const PairAt<D>& at) {
  const auto value = [](const kernels::Vec3<D>& x) {
    return kernels::Vec3<double>{x.x.value, x.y.value, x.z.value};
  };
  PairAt<double> out{};
  for (int k = 0; k < 9; ++k)
    out.link2_in_1.R.m[k / 3][k % 3] = at.link2_in_1.R.m[k / 3][k % 3].value;
  out.link2_in_1.p = value(at.link2_in_1.p);
  out.size = value(at.size);
  choose_faces(pair, out);
  return out;
}

}  // namespace

DualStage::DualStage(const CompiledModel& model) : impl_(std::make_unique<Impl>(model)) {
  centre.resize(std::size_t(model.nq));
  for (auto* p : {&x, &r, &s, &tau, &target, &v, &g}) p->assign(std::size_t(model.nv), D(0.0));
  s_start.assign(3 * std::size_t(model.shear_state_points()), D(0.0));
}
DualStage::~DualStage() = default;

void DualStage::set_numbers(const double* column, std::span<const double> tangents) {
  Impl& i = *impl_;
  for (std::size_t k = 0; k < i.origin.size(); ++k) {
    const Parameter& p = i.origin[k];
    i.block[k * kBlock] = p.row < 0 ? p.value : column[p.row * kBlock];
    i.block[k * kBlock + 1] =
        tangents.empty() || i.number[k] < 0 ? 0 : tangents[std::size_t(i.number[k])];
  }
  for (std::size_t k = 0; k < i.bodies.size(); ++k) {
    const int first = i.m.links[k].inertia_row;
    if (first < 0) continue;
    const auto row = [&](int n) { return column[(first + n) * kBlock]; };
    kernels::Link& link = i.bodies[k];
    link.mass = row(0);
    link.mass_times_com = {row(1), row(2), row(3)};
    link.inertia = {{{row(4), row(5), row(6)}, {row(5), row(7), row(8)}, {row(6), row(8), row(9)}}};
  }
  const auto first = std::size_t(i.view.rows.links), sizes = std::size_t(i.view.rows.solids);
  for (std::size_t k = 0; k < i.inertia.size(); ++k)
    i.inertia[k] = tangents.empty() ? 0 : tangents[first + k];
  for (std::size_t k = 0; k < i.stretch.size(); ++k)
    i.stretch[k] = tangents.empty() ? 0 : tangents[sizes + k];
  for (std::size_t b = 0; b < i.touched_sizes.size(); ++b)
    i.touched_sizes[b] =
        kernels::load_vector<double>(i.m.bodies[b].size, i.m.bodies[b].size_row, column, 0);
  for (std::size_t k = 0; k < i.sensor_laws.size(); ++k) {
    auto row = std::size_t(i.view.rows.sensor(static_cast<int>(k)));
    i.sensor_laws[k] = transformed(i.m.sensors[k].parameters, [&](const Parameter& p) {
      const double tangent = tangents.size() > row ? tangents[row] : 0;
      ++row;
      return D(p.row < 0 ? p.value : column[p.row * kBlock], tangent);
    });
  }
  for (std::size_t k = 0; k < i.m.layer_pads.size(); ++k)
    i.layers.set_material(k, i.material_tangent(i.m.layer_pads[k].sensor, tangents));
  i.heavier = std::any_of(i.inertia.begin(), i.inertia.end(), [](double t) { return t != 0; });
}

void DualStage::set_points(int sensor, std::span<const double> tangents) {
  impl_->point_tangents[std::size_t(sensor)].assign(tangents.begin(), tangents.end());
}

void DualStage::choose_faces() {
  Impl& i = *impl_;
  const std::vector<D> zero(v.size(), D(0.0));
  kernels::StageArgs<D> a = i.arguments(*this);
  a.x = a.r = a.s = zero.data();
  a.c0_over_h = D(0.0);
  a.inverse_h = D(1.0);
  kernels::choose_faces_at(i.view, a, i.faces.data());
}

void DualStage::recall() {
  Impl& i = *impl_;
  for (const DryDof& dof : i.m.dry_dofs)
    i.dry_anchors[std::size_t(dof.v)] =
        centre[std::size_t(dof.q)] - i.dry_displacement(s_start, dof);
  if (i.m.shear_springs.empty()) return;
  const std::vector<D> still(v.size(), D(0.0));
  const std::vector<kernels::LinkPose<D>> poses = i.poses_at(centre, still);
  for (const kernels::ShearSpringContact& of : i.m.shear_springs) {
    if (i.m.shear_interval(of) > 0) continue;
    const kernels::LoadedTouch<D> t = i.touch(of, poses);
    i.with_touched_shape(of, [&](const auto& shape) {
      for (int k = 0; k < of.contact.n_points; ++k) {
        const D* kept = &s_start[3 * std::size_t(of.first + k)];
        i.anchors[std::size_t(of.first + k)] = kernels::recalled(
            shape, t, i.place(of, k), kernels::Vec3<D>{kept[0], kept[1], kept[2]});
      }
    });
  }
}

void DualStage::advance(const std::vector<D>& q, const std::vector<D>& twist) {
  Impl& i = *impl_;
  for (const DryDof& dof : i.m.dry_dofs) {
    const D &at = q[std::size_t(dof.q)], &rate = twist[std::size_t(dof.v)];
    i.dry_displacement(s_start, dof) =
        i.dry_friction_at(dof, at, rate).hold * (at - i.dry_anchors[std::size_t(dof.v)]);
  }
  if (i.m.shear_springs.empty()) return;
  const std::vector<kernels::LinkPose<D>> poses = i.poses_at(q, twist);
  for (const kernels::ShearSpringContact& of : i.m.shear_springs) {
    if (i.m.shear_interval(of) > 0) continue;
    const kernels::LoadedTouch<D> t = i.touch(of, poses);
    i.with_touched_shape(of, [&](const auto& shape) {
      for (int k = 0; k < of.contact.n_points; ++k) {
        const auto p = kernels::meet_elastic(shape, t, i.law_of(of, k, t), i.place(of, k),
                                             i.anchors[std::size_t(of.first + k)]);
        D* kept = &s_start[3 * std::size_t(of.first + k)];
        const kernels::Vec3<D> next = p.d < D(0.0) ? p.hold * p.s : kernels::zero3<D>();
        kept[0] = next.x, kept[1] = next.y, kept[2] = next.z;
      }
    });
  }
}

void DualStage::update_sensor_shear_state(const std::vector<D>& q, const std::vector<D>& twist,
                                          std::int64_t steps) {
  Impl& i = *impl_;
  const std::vector<kernels::LinkPose<D>> poses = i.poses_at(q, twist);
  for (const kernels::ShearSpringContact& of : i.m.shear_springs) {
    if (!is_due(i.m, of, steps)) continue;
    i.meet_skin(of, poses, s_start, [&](const auto& shape, const auto& t, int k, const auto& p) {
      kernels::Anchor<D> after = {kernels::zero3<D>(), kernels::zero3<D>(), D(0.0)};
      if (p.d < D(0.0)) after = kernels::recalled(shape, t, i.place(of, k), p.hold * p.s);
      D* const b = &s_start[3 * std::size_t(of.first + k)];
      D* const a = b + 3 * of.contact.n_points;
      b[0] = after.b.x, b[1] = after.b.y, b[2] = after.b.z;
      a[0] = after.a.x, a[1] = after.a.y, a[2] = after.a.z;
    });
  }
}

void DualStage::rates() { kernels::kinematics(impl_->view, impl_->arguments(*this)); }

kernels::Vec3<D> DualStage::in_world(int link, const kernels::Vec3<double>& point) const {
  const kernels::Vec3<D> at = kernels::broadcast<D>(point);
  if (link < 0) return at;
  const kernels::Frame<D>& pose = impl_->links[std::size_t(link)].world;
  return pose.R * at + pose.p;
}

void DualStage::freeze_numbers(bool frozen) {
  Impl& i = *impl_;
  if (frozen == i.frozen) return;
  i.frozen = frozen;
  i.tangents.resize(i.origin.size());
  for (std::size_t k = 0; k < i.origin.size(); ++k) {
    double& tangent = i.block[k * kBlock + 1];
    if (frozen) i.tangents[k] = tangent;
    tangent = frozen ? 0 : i.tangents[k];
  }
}

void DualStage::residual() {
  Impl& i = *impl_;
  const auto a = i.arguments(*this);
  kernels::kinematics(i.view, a);
  i.find_touching();
  i.layers.compute(i.view, i.contacts, {i.points, i.listed_points, i.listed_anchors},
                   i.block.data(), i.frozen);
  i.put_ground_anchors();
  i.put_dry_anchors();
  kernels::residual<false>(i.view, a);
  if (!i.heavier || i.frozen) return;
  std::vector<D> mass_product(g.size());
  i.weigh(a, mass_product);
  for (std::size_t k = 0; k < g.size(); ++k) g[k].epsilon += mass_product[k].value;
}

void DualStage::field(int sensor, const double* column, std::span<const double> numbers,
                      std::span<const double> points, std::span<double> field,
                      std::span<double> field_dot) {
  Impl& i = *impl_;
  const CompiledSensor& skin = i.m.sensors[std::size_t(sensor)];
  kernels::kinematics(i.view, i.arguments(*this));
  auto number = std::size_t(i.m.view.rows.sensor(sensor));
  const Coefficients<D> coefficients = transformed(skin.parameters, [&](const Parameter& p) {
    const double tangent = numbers.empty() ? 0.0 : numbers[number];
    ++number;
    return D(p.row < 0 ? p.value : column[p.row * kBlock], tangent);
  });
  if (skin.elastic) set_points(sensor, points);
  const auto springs = [&](const Coefficients<D>& law, bool elastic, std::span<double> value,
                           std::span<double> change) {
    if (elastic) return elastic_field(sensor, law, value, change);
    read_dual_field(i.m, sensor, i.links, law, column, numbers, points, value, change);
  };
  if (!skin.layer) return springs(coefficients, skin.elastic, field, field_dot);
  if (!points.empty())
    throw InputError("derivatives by points of a sensor with a layer or a table; expected springs");
  read_dual_layer(i.m, sensor, i.links, coefficients, i.material_tangent(sensor, numbers), column,
                  numbers, springs, contact_loads(sensor), field, field_dot);
}

/// Loads of the contacts of a sensor whose layer carries them, at the poses of kinematics().
std::array<D, 3> DualStage::contact_loads(int sensor) const {
  const Impl& i = *impl_;
  const CompiledSensor& skin = i.m.sensors[std::size_t(sensor)];
  std::array<D, 3> sum{D(0.0), D(0.0), D(0.0)};
  for (const int k : skin.contacts) {
    kernels::PairContact pair = i.pairs[std::size_t(k)];
    const double* const stretch = &i.stretch[std::size_t(kernels::kSizeNumbers * pair.body1)];
    pair.ball_tangent = pair.ball_radius > 0 ? stretch[0] : 0;
    const kernels::LinkPose<D> one = dual_pose(i.links, pair.link1),
                               two = dual_pose(i.links, pair.link2);
    PairAt<D> at;
    at.link2_in_1 = relative(one.world, two.world);
    at.twist = motion_to_parent(at.link2_in_1, two.V) - one.V;
    at.law = kernels::load_law<D>(pair.parameters, pair.law, pair.ramp, i.block.data(), 0);
    at.size = kernels::load_vector<D>(pair.size, pair.size_row, i.block.data(), 0);
    const PairAt<double> values = pair_values(pair, at);
    at.faces = values.faces;
    std::vector<PairPoint<D>> points;
    for (const int n : touching_points(pair, values)) {
      const double* const p = pair.points + 3 * n;
      const kernels::Vec3<double> moves = i.stretched(pair.body1, {p[0], p[1], p[2]});
      points.push_back({{{p[0], moves.x}, {p[1], moves.y}, {p[2], moves.z}},
                        kernels::zero3<D>(),
                        pair.weights == nullptr ? 1 : pair.weights[n]});
      if (pair.memory < 0) continue;
      const int first = i.m.shear_springs[std::size_t(pair.memory)].first;
      const D* const kept = &s_start[3 * std::size_t(first + n)];
      points.back().stretched = {kept[0], kept[1], kept[2]};
    }
    const std::array<D, 3> own = loads_of_pair<D>(skin, pair, at, points);
    for (std::size_t c = 0; c < 3; ++c) sum[c] += own[c];
  }
  return sum;
}

/// Field of a sensor with shear springs: the contact law at the state `centre` with twist r and its
/// shear state.
void DualStage::elastic_field(int sensor, const Coefficients<D>& law, std::span<double> field,
                              std::span<double> field_dot) {
  Impl& i = *impl_;
  const CompiledSensor& skin = i.m.sensors[std::size_t(sensor)];
  i.sensor_laws[std::size_t(sensor)] = law;
  std::fill(field.begin(), field.end(), 0.0);
  std::fill(field_dot.begin(), field_dot.end(), 0.0);
  const std::vector<kernels::LinkPose<D>> poses = i.poses_at(centre, r);
  for (const kernels::ShearSpringContact& of : i.m.shear_springs) {
    if (of.sensor != sensor) continue;
    i.meet_skin(of, poses, s_start, [&](const auto&, const auto&, int k, const auto& p) {
      const D f[3] = {p.force.x, p.force.y, p.force.z};
      const double* axes = &skin.point_axes[9 * std::size_t(k)];
      const auto to = 3 * std::size_t(skin.in_field[std::size_t(k)]);
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t e = 0; e < 3; ++e) {
          if (!field.empty()) field[to + c] += axes[3 * c + e] * f[e].value;
          field_dot[to + c] += axes[3 * c + e] * f[e].epsilon;
        }
    });
  }
}

}  // namespace tangere
