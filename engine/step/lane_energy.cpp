// SPDX-License-Identifier: Apache-2.0
// One lane at a time in doubles: few steps need it.
#include "engine/step/lane_energy.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/layer/layer_contact.hpp"
#include "engine/step/dry_friction_state.hpp"
#include "engine/step/rotation_log.hpp"
#include "engine/step/shear_lane.hpp"
#include "engine/step/state_difference.hpp"
#include "kernels/contact/pair_contact.hpp"
#include "kernels/step/faces.hpp"
#include "kernels/step/loops.hpp"
#include "kernels/step/low_points.hpp"

namespace tangere {

using kernels::Frame;
using kernels::JointKind;
using kernels::kBlock;
using kernels::LinkPose;
using kernels::Quat;
using kernels::Row;
using kernels::Vec3;

namespace {

/// One lane of a workspace at the poses of a state.
template <int L>
struct LaneAt {
  const CompiledModel& model;
  const BasicWorkspace<L>& w;
  const AlignedVector<LinkPose<Row<L>>>& poses;
  int lane;
  LaneEnergy sum{};
  EnergyTerms* terms = nullptr;  ///< if not null, motors do work and hold nothing
  std::uint64_t* low = nullptr;  ///< scratch of for_each_low_point()

  [[nodiscard]] const double* block() const {
    if (w.stage.block == nullptr) return nullptr;
    return w.stage.block + w.stage.group * kernels::kGroup + lane;
  }
  [[nodiscard]] double number(const kernels::Parameter& p) const {
    return p.row < 0 ? p.value : block()[p.row * kBlock];
  }
  [[nodiscard]] Vec3<double> size(const Vec3<double>& value, int row) const {
    return kernels::load_vector<double>(value, row, block(), 0);
  }
  [[nodiscard]] Frame<double> world(int link) const {
    if (link < 0) return {kernels::diagonal(1.0), {0, 0, 0}};
    return frame_in_lane<L>(poses[std::size_t(link)], lane);
  }

  void add_motion() {
    for (std::size_t i = 0; i < model.links.size(); ++i) {
      const kernels::Link& link = model.links[i];
      if (!link.has_mass) continue;
      const auto& [mass, c, J] = kernels::load_inertia<double>(link, block(), 0);
      const auto& V = poses[i].V;
      const Vec3<double> turn = {V.a.x[lane], V.a.y[lane], V.a.z[lane]},
                         slide = {V.l.x[lane], V.l.y[lane], V.l.z[lane]};
      sum.moving +=
          0.5 * (mass * dot(slide, slide) + 2 * dot(turn, cross(c, slide)) + dot(turn, J * turn));
      const Frame<double> at = world(static_cast<int>(i));
      const Vec3<double> gravity = link.gravity_share * model.view.gravity;
      sum.total -= dot(gravity, mass * at.p + at.R * c);
      if (terms != nullptr) sum.total -= mass * dot(gravity, model.origin);
    }
  }

  /// Adds what springs, limits and a motor hold at a coordinate. `error`: distance from the target.
  void add_held(const kernels::Link& link, int k, double place, double stretch, double error,
                double rate) {
    const kernels::DofEffects& e = model.dof_effects[std::size_t(link.v + k)];
    if ((link.effects & kernels::kSpring) != 0)
      sum.moving += 0.5 * number(e.stiffness) * stretch * stretch;
    if ((link.effects & kernels::kLimit) != 0) {
      const double beyond = std::max({e.low - place, place - e.high, 0.0});
      sum.moving += 0.5 * number(e.limit_stiffness) * beyond * beyond;
    }
    if ((link.effects & kernels::kPositionServo) == 0) return;
    const double P = number(e.P);
    if (e.q_apart > 0) {  // `error` has no q to be taken from; it stores nothing
      if (terms != nullptr)
        terms->motors +=
            rate * std::clamp(P * (error + place) - number(e.D) * rate, e.force_low, e.force_high);
      return;
    }
    if (terms != nullptr) {
      terms->motors += rate * std::clamp(P * error - number(e.D) * rate, e.force_low, e.force_high);
      return;
    }
    const double force = std::clamp(P * error, e.force_low, e.force_high);
    if (P > 0) sum.moving += force * (error - force / (2 * P));
  }

  /// Adds what known forces of motors and damping do.
  void add_powers(const Row<L>* v) {
    for (const kernels::Link& link : model.links)
      for (int k = link.v; k < link.v + kernels::dofs(link.kind); ++k) {
        const double rate = v[k][lane];
        terms->motors += w.stage.tau[k][lane] * rate;
        if ((link.effects & kernels::kDamping) != 0)
          terms->taken += number(model.dof_effects[std::size_t(k)].damping) * rate * rate;
      }
  }

  /// Adds what the spring of dry friction holds, and what friction takes from the motion.
  void add_dry(const kernels::Link& link, int k, double place, double rate) {
    const kernels::DofEffects& e = model.dof_effects[std::size_t(link.v + k)];
    const double bound = number(e.friction), anchor = w.stage.dry_anchor[link.v + k][lane];
    const auto at = kernels::dry_friction(e, place, rate, anchor);
    const double stretch = place - anchor;
    sum.moving += 0.5 * bound * e.friction_rate * stretch * stretch;
    terms->taken += bound * rate * (at.share - at.rigid * e.friction_rate * stretch);
  }

  void add_joints(const Row<L>* q, const Row<L>* v) {
    for (const kernels::Link& link : model.links) {
      if ((link.effects & kernels::kBeyondDamping) == 0) continue;
      for (int k = 0; k < kernels::dofs(link.kind); ++k) {
        const double rate = v[link.v + k][lane];
        if ((link.effects & kernels::kArmature) == 0) continue;
        const double energy =
            0.5 * number(model.dof_effects[std::size_t(link.v + k)].armature) * rate * rate;
        sum.moving += energy;
        if (terms != nullptr) terms->motion += energy;
      }
      const auto rate = [&](int k) { return v[link.v + k][lane]; };
      const kernels::DofEffects* e = &model.dof_effects[std::size_t(link.v)];
      const Row<L>* target = w.stage.target + link.v;
      if (link.kind != JointKind::spherical) {
        for (int k = 0; k < kernels::dofs(link.kind); ++k) {
          const double place = q[link.q + k][lane];
          add_held(link, k, place, place - e[k].rest, target[k][lane] - place, rate(k));
          if (terms != nullptr && (link.effects & kernels::kDryFriction) != 0)
            add_dry(link, k, place, rate(k));
        }
        continue;
      }
      const Quat<double> at = quat_at(q + link.q, lane);
      const auto from = [&](const Vec3<double>& x) {
        return rotation_log(conjugate(kernels::quaternion_exp(x)) * at);
      };
      const Vec3<double> place = rotation_log(at),
                         stretch = from({e[0].rest, e[1].rest, e[2].rest}),
                         error = from({target[0][lane], target[1][lane], target[2][lane]});
      add_held(link, 0, place.x, stretch.x, -error.x, rate(0));
      add_held(link, 1, place.y, stretch.y, -error.y, rate(1));
      add_held(link, 2, place.z, stretch.z, -error.z, rate(2));
    }
  }

  [[nodiscard]] kernels::Vec6<double> twist(int link) const {
    if (link < 0) return kernels::zero6<double>();
    const auto& V = poses[std::size_t(link)].V;
    return {{V.a.x[lane], V.a.y[lane], V.a.z[lane]}, {V.l.x[lane], V.l.y[lane], V.l.z[lane]}};
  }

  /// Adds what the springs of loops hold, and what their damping takes.
  void add_loops() {
    for (const kernels::Loop& loop : model.loops) {
      const Frame<double> second = relative(world(loop.link1), world(loop.link2));
      const kernels::Vec6<double> W =
          motion_to_parent(second, twist(loop.link2)) - twist(loop.link1);
      const kernels::LoopState<double> s = kernels::loop_state(loop, second, W);
      sum.moving += 0.5 * number(loop.stiffness) * dot(s.gap, s.gap);
      if (loop.weld)
        sum.moving += 0.5 * number(loop.turning_stiffness) * dot(s.turned.phi, s.turned.phi);
      if (terms == nullptr) continue;
      terms->taken += number(loop.damping) * dot(s.u, s.u);
      if (loop.weld) terms->taken += number(loop.turning_damping) * dot(W.a, W.a);
    }
  }

  /// Returns the power that a touching point dissipates: the negative power of its force less the
  /// rate of energy stored in its spring.
  static double taken_at(const kernels::LawParameters<double>& law,
                         const kernels::PointContact<double>& p) {
    return p.d < 0 ? -dot(p.force, p.u) - law.kn * p.d * p.rate : 0;
  }

  /// Adds what damping and friction take at points of a pair, one array a component.
  void add_taken(const kernels::PairContact& pair, const Vec3<double>& half,
                 const Vec3<double>& faces, const Frame<double>& link2_in_1,
                 const std::array<const double*, 3>& points, const double* areas, int count) {
    const Frame<double> at = compose(link2_in_1, pair.frame2);
    const auto W = motion_to_parent(link2_in_1, twist(pair.link2)) - twist(pair.link1);
    const auto law = kernels::load_law<double>(pair.parameters, pair.law, pair.ramp, block(), 0);
    kernels::with_touched<double>(pair, half, faces, [&]<class Shape>(const Shape& shape) {
      auto own = law;
      for (int i = 0; i < count; ++i) {
        if (areas != nullptr) kernels::set_weighted(law, areas[i], own);
        terms->taken += taken_at(own, point_contact(shape, own, at.R, at.p, W.a, W.l,
                                                    {points[0][i], points[1][i], points[2][i]}));
      }
    });
  }

  /// The same on the ground.
  void add_taken(const kernels::GroundContact& ground, const Frame<double>& at, double radius) {
    const auto law =
        kernels::load_law<double>(ground.parameters, ground.law, ground.ramp, block(), 0);
    const Vec3<double> m = transposed_times(at.R, model.view.ground_normal);
    const double height = dot(model.view.ground_normal, at.p - model.view.ground_point);
    for_each_low_point(ground, m, height, low, [&](int k) {
      const double* x = ground.points + 3 * k;
      kernels::PointContact<double> p;
      if (ground_contact(law, m, height, twist(ground.link), Vec3<double>{x[0], x[1], x[2]}, radius,
                         p))
        terms->taken += taken_at(law, p);
    });
  }

  void add_pair(const kernels::KernelTable& table, std::size_t k, const Frame<double>& link2_in_1,
                double* found) {
    const kernels::PairContact& pair = model.pairs[k];
    const Frame<double> at = compose(link2_in_1, pair.frame2);
    const Vec3<double> half = size(pair.size, pair.size_row);
    Vec3<double> faces = {0, 0, 0};
    if (pair.faced) {
      const Row<L>* side = w.stage.faces + 3 * k;
      faces = {side[0][lane], side[1][lane], side[2][lane]};
    }
    const bool far =
        kernels::with_touched<double>(pair, half, faces, [&]<class Shape>(const Shape& shape) {
          return !nearer_than(shape, transposed_times(at.R, pair.middle - at.p), pair.extent);
        });
    if (far) return;
    double pose[12];
    for (int i = 0; i < 9; ++i) pose[i] = at.R.m[i / 3][i % 3];
    pose[9] = at.p.x, pose[10] = at.p.y, pose[11] = at.p.z;
    const int stride = search_stride(pair);
    double *x = found, *y = x + stride, *z = y + stride;
    double* const areas = pair.weights == nullptr ? nullptr : z + stride;
    const int count = table.find_candidates(
        {&pair, half, pose, w.candidates->lists[k].margin, x, stride, faces, nullptr, areas});
    double square = 0;
    if (terms != nullptr) add_taken(pair, half, faces, link2_in_1, {x, y, z}, areas, count);
    kernels::with_touched<double>(pair, half, faces, [&]<class Shape>(const Shape& shape) {
      for (int i = 0; i < count; ++i) {
        const Vec3<double> arm = Vec3<double>{x[i], y[i], z[i]} - at.p;
        const double d = std::min(kernels::distance_at(shape, transposed_times(at.R, arm)).d, 0.0);
        square += areas == nullptr ? d * d : areas[i] * d * d;
      }
    });
    sum.moving += 0.5 * number(pair.parameters.kn) * square;
  }

  /// Solves a pad's layer against the bodies of another link that move with W, with or without
  /// friction. Returns the pairs of these bodies.
  std::vector<int> solve_layer(const kernels::LinkPair& links, int pad,
                               const Frame<double>& link2_in_1, const kernels::Vec6<double>& W,
                               bool friction, LayerContact& contact) const {
    AlignedVector<double> places;
    const LayerPad& of = model.layer_pads[std::size_t(pad)];
    std::vector<int> members;
    contact.begin(kernels::active_kernels(), of);
    for (int i = links.first; i < links.first + links.count; ++i) {
      const auto& pair = model.pairs[std::size_t(model.pair_order[std::size_t(i)])];
      if (pair.layer_pad != pad) continue;
      members.push_back(model.pair_order[std::size_t(i)]);
      Coefficients<double> law =
          transformed(pair.parameters, [this](const kernels::Parameter& p) { return number(p); });
      if (!friction) law.mu = 0;
      const int stride = (pair.n_points + kernels::kGroup - 1) / kernels::kGroup * kernels::kGroup;
      places.assign(3 * std::size_t(stride), 0.0);
      for (int k = 0; k < pair.n_points; ++k)
        for (int axis = 0; axis < 3; ++axis)
          places[std::size_t(axis * stride + k)] = pair.points[3 * k + axis];
      contact.add_body(
          {pair.shape, pair.grid, pair.law, pair.ramp, false, false},
          layer_body<double>(of, pair.frame2, link2_in_1, W, law, size(pair.size, pair.size_row)),
          {places.data(), nullptr, nullptr, stride, pair.n_points});
    }
    contact.solve();
    return members;
  }

  /// Adds what the shear springs of points on layers hold, in proportion to the layers' loads.
  void add_sheared_layers(const ShearState& memory) {
    LayerContact contact;
    for (const kernels::LinkPair& links : model.link_pairs) {
      if (links.layer < 0) continue;
      const Frame<double> link2_in_1 = relative(world(links.link1), world(links.link2));
      for (int pad = 0; pad < static_cast<int>(model.layer_pads.size()); ++pad) {
        const std::vector<int> members =
            solve_layer(links, pad, link2_in_1, kernels::zero6<double>(), true, contact);
        contact.for_each_point([&](const LayerContact::Point& p) {
          if (!(p.normal > 0)) return;
          const kernels::PairContact& pair = model.pairs[std::size_t(members[std::size_t(p.body)])];
          if (pair.memory < 0) return;
          const int row = model.shear_springs[std::size_t(pair.memory)].first + p.candidate;
          const auto entry = std::ranges::lower_bound(memory, row, {}, &ShearEntry::point);
          if (entry == memory.end() || entry->point != row) return;
          double square = 0;
          for (const double x : entry->s) square += x * x;
          sum.moving += 0.5 * number(pair.parameters.ks) * square * p.friction_load / p.normal;
        });
      }
    }
  }

  void add_layers(const kernels::LinkPair& links, const Frame<double>& link2_in_1) {
    LayerContact contact;
    for (int pad = 0; pad < static_cast<int>(model.layer_pads.size()); ++pad) {
      solve_layer(links, pad, link2_in_1, kernels::zero6<double>(), false, contact);
      sum.moving += contact.energy();
      if (terms == nullptr || contact.empty()) continue;
      const auto W = motion_to_parent(link2_in_1, twist(links.link2)) - twist(links.link1);
      const double stored = dot(contact.wrench(), W);
      solve_layer(links, pad, link2_in_1, W, true, contact);
      terms->taken += dot(contact.wrench(), W) - stored;
    }
  }

  void add_contacts(const kernels::KernelTable& table, double* found) {
    for (const kernels::LinkPair& links : model.link_pairs) {
      const Frame<double> link2_in_1 = relative(world(links.link1), world(links.link2));
      const Vec3<double> arm =
          link2_in_1.R * links.shapes_middle + link2_in_1.p - links.points_middle;
      if (dot(arm, arm) >= links.apart * links.apart) continue;
      for (int i = 0; i < links.count; ++i) {
        const auto k = std::size_t(model.pair_order[std::size_t(links.first + i)]);
        if (model.pairs[k].layer_pad < 0) add_pair(table, k, link2_in_1, found);
      }
      if (links.layer >= 0) add_layers(links, link2_in_1);
    }
    for (const kernels::GroundContact& ground : model.grounds) {
      const Frame<double> at = world(ground.link);
      const double radius = kernels::ground_radius<double>(ground, block(), 0);
      if (terms != nullptr) add_taken(ground, at, radius);
      double square = 0;
      const Vec3<double> m = transposed_times(at.R, model.view.ground_normal);
      const double height = dot(model.view.ground_normal, at.p - model.view.ground_point);
      for_each_low_point(ground, m, height, low, [&](int k) {
        const double* p = ground.points + 3 * k;
        const Vec3<double> place = at.R * Vec3<double>{p[0], p[1], p[2]} + at.p;
        const double d =
            std::min(dot(model.view.ground_normal, place - model.view.ground_point) - radius, 0.0);
        square += d * d;
      });
      sum.moving += 0.5 * number(ground.parameters.kn) * square;
    }
  }
};

}  // namespace

template <int L>
LaneEnergy energy_of_bodies(const CompiledModel& model, const BasicWorkspace<L>& w,
                            const AlignedVector<LinkPose<Row<L>>>& poses, const Row<L>* q,
                            const Row<L>* v, int lane) {
  LaneAt<L> at{model, w, poses, lane};
  at.add_motion();
  at.add_joints(q, v);
  at.add_loops();
  at.sum.total += at.sum.moving;
  return at.sum;
}

template <int L>
double energy_of_contacts(const CompiledModel& model, const kernels::KernelTable& table,
                          BasicWorkspace<L>& w, const AlignedVector<LinkPose<Row<L>>>& poses,
                          int lane) {
  LaneAt<L> at{model, w, poses, lane, {}, nullptr, w.low_points.data()};
  at.add_contacts(table, w.search.data());
  return at.sum.moving;
}

template <int L>
double energy_of_friction(const CompiledModel& model, const BasicWorkspace<L>& w,
                          const AlignedVector<LinkPose<Row<L>>>& poses, const ShearState& memory,
                          int lane) {
  LaneAt<L> at{model, w, poses, lane};
  if (!model.layer_pads.empty() && !memory.empty()) at.add_sheared_layers(memory);
  double sum = at.sum.moving;
  std::size_t e = 0;
  for (const kernels::ShearSpringContact& contact : model.shear_springs) {  // by rising point
    double square = 0;
    const int end = contact.first + model.shear_rows(contact);
    const double* const areas = contact.contact.weights;
    for (; e < memory.size() && memory[e].point < end; ++e)
      for (const double s : memory[e].s)
        square += areas == nullptr ? s * s : areas[memory[e].point - contact.first] * s * s;
    const bool layered = contact.pair >= 0 && model.pairs[std::size_t(contact.pair)].layer_pad >= 0;
    if (contact.sensor < 0 && square > 0 && !layered)
      sum += 0.5 * number_of<L>(contact.contact.parameters.ks, w.stage, lane) * square;
  }
  for (const ShearEntry& entry : dry_entries(model, memory)) {
    const kernels::DofEffects& dof = model.dof_effects[std::size_t(dry_dof_of(model, entry).v)];
    sum += 0.5 * number_of<L>(dof.friction, w.stage, lane) * dof.friction_rate * entry.s[0] *
           entry.s[0];
  }
  return sum;
}

EnergyTerms energy_terms(const CompiledModel& model, const kernels::KernelTable& table,
                         SingleWorkspace& w) {
  EnergyTerms terms;
  LaneAt<1> at{model, w, w.poses_before, 0, {}, &terms, w.low_points.data()};
  at.add_motion();
  terms.motion = at.sum.moving;
  terms.height = at.sum.total;
  at.add_powers(w.v0);
  at.add_joints(w.q0, w.v0);
  at.add_loops();
  at.add_contacts(table, w.search.data());
  terms.held = at.sum.moving - terms.motion;
  return terms;
}

#define TANGERE_FOR_LANES(L)                                                                     \
  template LaneEnergy energy_of_bodies(const CompiledModel&, const BasicWorkspace<L>&,           \
                                       const AlignedVector<LinkPose<Row<L>>>&, const Row<L>*,    \
                                       const Row<L>*, int);                                      \
  template double energy_of_contacts(const CompiledModel&, const kernels::KernelTable&,          \
                                     BasicWorkspace<L>&, const AlignedVector<LinkPose<Row<L>>>&, \
                                     int);                                                       \
  template double energy_of_friction(const CompiledModel&, const BasicWorkspace<L>&,             \
                                     const AlignedVector<LinkPose<Row<L>>>&, const ShearState&,  \
                                     int);
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES

}  // namespace tangere
