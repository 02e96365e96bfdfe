// SPDX-License-Identifier: Apache-2.0
// The residual g of a step: kinematics outward, contacts, inverse dynamics inward (RNEA in body
// axes).
//
//   V = V_p + S q̇,  A = A_p + S q̈ + V × (S q̇),  F = I A + V ×* I V - w_ext,  F_p += X* F
//   g = Sᵀ F - τ - joint effects (kernels/step/joint_effects.hpp)
// The base of a tree accelerates at -gravity times the share of its root, so gravity needs no term
// of its own. A link with another share has a lift: I (0; lift gravity) is added to F.
#pragma once

#include "kernels/contact/elastic_contact.hpp"
#include "kernels/step/faces.hpp"
#include "kernels/step/followers.hpp"
#include "kernels/step/joint_effects.hpp"
#include "kernels/step/loops.hpp"
#include "kernels/step/low_points.hpp"
#include "kernels/step/pair_motion.hpp"
#include "kernels/step/point_sums.hpp"
#include "kernels/step/stage.hpp"
#include "kernels/step/transmissions.hpp"

namespace tangere::kernels {

/// Computes the pose of a child link in its parent and its joint's rates. Writes q̇ and q̈ to
/// `rate` and `acceleration`.
template <class N>
void joint_motion(const Link& link, const StageArgs<N>& a, LinkScratch<N>& out, Vec6<N>& rate,
                  Vec6<N>& acceleration) {
  const int i = link.v;
  const auto slope = [&](int k) {
    return mul_add(a.c0_over_h, a.x[i + k], a.inverse_h * a.r[i + k]);
  };
  const auto acceleration_of = [&](int k, const N& v) {
    return mul_add(a.c0_over_h, v, a.inverse_h * a.s[i + k]);
  };
  rate = acceleration = zero6<N>();
  Frame<N> moved = {diagonal(N(1.0)), zero3<N>()};
  bool turns = false;
  switch (link.kind) {
    case JointKind::revolute:
    case JointKind::prismatic: {
      const Vec3<N> axis = broadcast<N>(link.axis);
      const N v = slope(0), q = a.centre[link.q] + a.x[i], acc = acceleration_of(0, v);
      a.v[i] = v;
      if (link.kind == JointKind::prismatic) {
        moved.p = q * axis;
        rate.l = v * axis;
        acceleration.l = acc * axis;
      } else {
        turns = true;
        const Vec3<N> x = reduce_angle(q) * axis;
        moved.R = rotation_exp(x, rotation_series(x));
        rate.a = v * axis;
        acceleration.a = acc * axis;
      }
      break;
    }
    case JointKind::translational: {
      const Vec3<N> v = {slope(0), slope(1), slope(2)};
      moved.p = {a.centre[link.q] + a.x[i], a.centre[link.q + 1] + a.x[i + 1],
                 a.centre[link.q + 2] + a.x[i + 2]};
      a.v[i] = v.x, a.v[i + 1] = v.y, a.v[i + 2] = v.z;
      rate.l = v;
      acceleration.l = {acceleration_of(0, v.x), acceleration_of(1, v.y), acceleration_of(2, v.z)};
      break;
    }
    case JointKind::spherical: {
      turns = true;
      const Vec3<N> x = {a.x[i], a.x[i + 1], a.x[i + 2]};
      const Vec3<N> x_rate = {slope(0), slope(1), slope(2)};
      const RotationSeries<N> k = rotation_series(x);
      const N* c = a.centre + link.q;
      moved.R = to_matrix(Quat<N>{c[0], c[1], c[2], c[3]}) * rotation_exp(x, k);
      out.chart = right_jacobian(x, k);
      out.chart_rate = a.c0_over_h * out.chart + right_jacobian_derivative(x, k, x_rate);
      const Vec3<N> v = out.chart * x_rate;
      a.v[i] = v.x, a.v[i + 1] = v.y, a.v[i + 2] = v.z;
      rate.a = v;
      acceleration.a = {acceleration_of(0, v.x), acceleration_of(1, v.y), acceleration_of(2, v.z)};
      break;
    }
  }
  const Frame<N> base = {broadcast<N>(link.frame.R),
                         load_vector<N>(link.frame.p, link.place_row, a.block, a.group)};
  out.local.R = link.has_rest_rotation ? (turns ? base.R * moved.R : base.R) : moved.R;
  out.local.p =
      slides(link.kind) ? (link.has_rest_rotation ? base.R * moved.p : moved.p) + base.p : base.p;
}

/// Returns I m for a rigid body: (J ω + c × v; m v - c × ω), c = mass times centre of mass.
template <class N>
Vec6<N> inertia_times(const N& mass, const Vec3<N>& moment, const Mat3<N>& inertia,
                      const Vec6<N>& m) {
  return {inertia * m.a + cross(moment, m.l), mass * m.l - cross(moment, m.a)};
}

/// Computes poses, twists and accelerations of every link.
template <class N>
void outward_sweep(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N>& o = a.links[i];
    Vec6<N> rate, acceleration;
    joint_motion(link, a, o, rate, acceleration);
    if (link.parent < 0) {
      o.world = o.local;
      o.Vp = zero6<N>();
      const Vec3<N> rising = -broadcast<N>(link.gravity_share * model.gravity);
      o.Ap = {zero3<N>(), link.may_rotate ? transposed_times(o.local.R, rising) : rising};
    } else {
      const LinkScratch<N>& p = a.links[link.parent];
      o.world = compose(link, p.world, o.local);
      o.Vp = motion_to_child(link, o.local, p.V);
      o.Ap = motion_to_child(link, o.local, p.A);
    }
    o.V = o.Vp + rate;
    o.A = o.Ap + acceleration;
    if (!link.never_rotates) o.A += cross_motion(o.V, rate);
  }
}

/// Returns gravity in a link's axes.
template <class N>
Vec3<N> gravity_in(const ModelView& model, const LinkScratch<N>& o) {
  return transposed_times(o.world.R, broadcast<N>(model.gravity));
}

/// Returns the acceleration that a link's masses feel. That of the base has the share of the root.
template <class N>
Vec6<N> felt_acceleration(const ModelView& model, const Link& link, const LinkScratch<N>& o) {
  if (!model.lifted || link.lift == 0) return o.A;
  return {o.A.a, o.A.l + N(link.lift) * gravity_in(model, o)};
}

/// Computes the inertial wrench of every link about its own origin.
template <class N>
void inertial_wrenches(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N>& o = a.links[i];
    o.F = zero6<N>();
    if (!link.has_mass) continue;
    const auto [mass, moment, inertia] = load_inertia<N>(link, a.block, a.group);
    if (link.never_rotates) {  // its torque does no work
      o.F.l = mass * felt_acceleration(model, link, o).l;
      continue;
    }
    o.F = inertia_times(mass, moment, inertia, felt_acceleration(model, link, o)) +
          cross_wrench(o.V, inertia_times(mass, moment, inertia, o.V));
  }
}

/// Returns a bound on the approach of any point of body 1 to a shape since the lists were built,
/// minus the margin. With G = (R, p) of the links, a point ξ is at Rᵀ(ξ - p) in body 2, and so in
/// every shape that is fixed there.
template <class N>
N list_excess(const LinkPair& pair, const CandidateList<N>& list, const Frame<N>& now) {
  const N* ref = list.reference;
  const Vec3<N> p0 = {ref[9], ref[10], ref[11]};
  Mat3<N> R0;
  for (int k = 0; k < 9; ++k) R0.m[k / 3][k % 3] = ref[k];
  const Mat3<N> turn = now.R - R0;
  N moved;
  if (pair.ball) {
    const Vec3<N> step = turn * broadcast<N>(pair.centre) + (now.p - p0);
    moved = sqrt(dot(step, step));
  } else {
    N square(0.0);
    for (int k = 0; k < 9; ++k)
      square = mul_add(turn.m[k / 3][k % 3], turn.m[k / 3][k % 3], square);
    const Vec3<N> step = transposed_times(now.R, now.p) - transposed_times(R0, p0);
    moved = sqrt(square) * N(pair.reach) + sqrt(dot(step, step));
  }
  return moved - list.margin;
}

template <class N>
bool is_apart(const StageArgs<N>& a, int link_pair) {
  return a.apart != nullptr && a.apart[link_pair] != 0;
}

/// Returns a positive number where the balls around the points and the shapes of two links are
/// nearer to each other than `margin`. Keeps how far apart they are.
template <class N>
N balls_overlap(const LinkPair& pair, int link_pair, const StageArgs<N>& a, double margin) {
  const auto in_world = [&](int link, const Vec3<double>& middle) {
    const Vec3<N> at = broadcast<N>(middle);
    return link < 0 ? at : a.links[link].world.R * at + a.links[link].world.p;
  };
  const Vec3<N> arm =
      in_world(pair.link2, pair.shapes_middle) - in_world(pair.link1, pair.points_middle);
  const double reach = pair.apart + margin;
  a.between[link_pair] = dot(arm, arm);
  return N(reach * reach) - a.between[link_pair];
}

/// Whether a ball holds what touches other links.
inline bool has_ball(const LinkBall& ball) {
  return ball.radius >= 0 && ball.radius <= std::numeric_limits<double>::max();
}
template <class N>
Vec3<N> ball_centre(const ModelView& model, const StageArgs<N>& a, int link) {
  const Frame<N>& world = a.links[link].world;
  return world.R * broadcast<N>(model.link_balls[link].centre) + world.p;
}

/// Computes how far the balls of links moved since the solve started. Pairs of links that are not
/// considered cannot touch while no ball moves by more than its slack.
template <class N>
void ball_motions(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    if (!has_ball(model.link_balls[i])) continue;
    const N* start = a.ball_starts + 3 * i;
    const Vec3<N> way = ball_centre(model, a, i) - Vec3<N>{start[0], start[1], start[2]};
    a.ball_moves[i] = sqrt(dot(way, way));
    a.excess[0] = max(a.excess[0], a.ball_moves[i] - a.ball_slack[i]);
  }
}

/// Calls f(k, ξ) for the candidate points, one after the other.
template <class N, class F>
void for_each_place(const CandidateList<N>& list, int lone, const F& f) {
  if (lone < 0) {
    for (int k = 0; k < list.count; ++k)
      f(k, Vec3<N>{list.points[3 * k], list.points[3 * k + 1], list.points[3 * k + 2]});
  } else {
    const double *x = list.own, *y = x + list.stride, *z = y + list.stride;
    for (int k = 0; k < list.own_count; ++k) f(k, Vec3<N>{N(x[k]), N(y[k]), N(z[k])});
  }
}
/// Whether the candidates have areas. Workspaces of one lane have no rows.
template <class N>
bool has_areas(const CandidateList<N>& list, int lone) {
  return lone < 0 ? list.weights != nullptr : list.own_weights != nullptr;
}
template <class N>
N area_at(const CandidateList<N>& list, int lone, int k) {
  return lone < 0 ? list.weights[k] : N(list.own_weights[k]);
}
/// Sets the law of candidate k. `out` must hold `law` at first.
template <class N>
void set_point_law(const LawParameters<N>& law, const CandidateList<N>& list, int lone, int k,
                   LawParameters<N>& out) {
  if (has_areas(list, lone)) set_weighted(law, area_at(list, lone, k), out);
}

/// Adds the candidate points one by one, for shapes whose Hessian has no special form: capsules,
/// ellipsoids, meshes and balls.
template <bool Derivatives, class Shape, class N>
void add_candidates(const Shape& shape, const LawParameters<N>& law, const CandidateList<N>& list,
                    const Frame<N>& frame, const Vec6<N>& W, PairSums<N>& sums) {
  LawParameters<N> own = law;
  for_each_place(list, -1, [&](int k, const Vec3<N>& xi) {
    set_point_law(law, list, -1, k, own);
    accumulate<Derivatives>(sums, shape, own, frame.R, frame.p, W.a, W.l, xi);
  });
}

/// The same with shear springs.
template <bool Derivatives, class Shape, class N>
[[gnu::noinline]] void add_elastic(const Shape& shape, const LawParameters<N>& law,
                                   const CandidateList<N>& list, int lone, const Frame<N>& frame,
                                   const Vec6<N>& W, PairSums<N>& sums) {
  LawParameters<N> own = law;
  for_each_place(list, lone, [&](int k, const Vec3<N>& xi) {
    const auto number = [&](int i) {
      return lone < 0 ? list.anchors[kAnchorNumbers * k + i]
                      : N(list.own_anchors[i * list.stride + k]);
    };
    set_point_law(law, list, lone, k, own);
    accumulate_elastic<Derivatives>(sums, shape, own, frame.R, frame.p, W.a, W.l, xi,
                                    load_anchor<N>(number));
  });
}

template <class N>
bool has_candidates(const CandidateList<N>& list, int lone) {
  return (lone < 0 ? list.count : list.own_count) > 0;
}

/// Scales law parameters by the stage's continuation factors.
template <class N>
void soften(const StageArgs<N>& a, LawParameters<N>& law) {
  law.kn = law.kn * a.normal_share;
  law.damping = law.damping * a.normal_share;
  law.kt = law.kt * a.friction_share;
  law.ks = law.ks * a.friction_share;
  law.friction_tangent = a.friction_tangent;
}

/// Adds the points around a sphere.
template <bool Derivatives, template <class> class Sums, class Motion, class N>
[[gnu::noinline]] void add_sphere(const Motion& motion, const LawParameters<N>& law,
                                  const CandidateList<N>& list, int lone, const Vec6<N>& W,
                                  PairSums<N>& sums) {
  PointSums<Derivatives, Sums, N> sphere;
  sphere.start(lone);
  sphere.add(motion, law, list, lone);
  add_finished<Derivatives>(motion, W, sphere.result(lone), sums);
}

/// Sets the sums to zero; without derivatives, only those of the wrench.
template <bool Derivatives, class N>
void start(PairSums<N>& sums) {
  if constexpr (Derivatives) {
    sums = PairSums<N>::zero();
  } else {
    sums.wrench = zero6<N>();
  }
}

/// Adds sums; without derivatives, only those of the wrench.
template <bool Derivatives, class N>
void add_sums(const PairSums<N>& from, PairSums<N>& to) {
  to.wrench += from.wrench;
  if constexpr (Derivatives)
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) to.k[i][j] += from.k[i][j], to.d[i][j] += from.d[i][j];
}

/// Computes the sums over all shapes of two links. Flat and bent faces share their sums, which are
/// about body 1's origin; those with shear springs share sums of their own.
template <bool Derivatives, class N>
void sum_link_pair(const ModelView& model, const LinkPair& links, const StageArgs<N>& a,
                   ContactScratch<N>& o) {
  start<Derivatives>(o.sums);
  if (links.layer >= 0) add_sums<Derivatives>(a.layer_sums[links.layer], o.sums);
  PointSums<Derivatives, FaceSums, N> faces;
  PointSums<Derivatives, ElasticFaceSums, N> elastic_faces;
  bool any_face = false, any_elastic = false;
  for (int i = 0; i < links.count; ++i) {
    const int k = model.pair_order[links.first + i];
    const PairContact& pair = model.pairs[k];
    const CandidateList<N>& list = a.candidates[k];
    if (pair.layer_pad >= 0 || !has_candidates(list, a.lone)) continue;
    LawParameters<N> law = load_law<N>(pair.parameters, pair.law, pair.ramp, a.block, a.group);
    soften(a, law);
    const auto frame = [&] { return compose(o.link2_in_1, broadcast<N>(pair.frame2)); };
    const Vec3<N> size = load_vector<N>(pair.size, pair.size_row, a.block, a.group);
    const Vec3<N> side = faces_of(a, pair, k);
    with_touched<N>(pair, size, side, [&]<template <class> class Shape>(const Shape<N>& shape) {
      const bool elastic = pair.memory >= 0;
      if constexpr (Shape<N>::kSums == PointSumForm::about_centre) {
        const Vec3<N> centre = o.link2_in_1.R * broadcast<N>(pair.frame2.p) + o.link2_in_1.p;
        const SphereMotion<N> motion = sphere_motion(centre, o.W, shape.radius);
        if (elastic) {
          add_sphere<Derivatives, ElasticSphereSums>(
              ElasticSphereMotion<N>{motion, frame().R, law.kt, law.ks}, law, list, a.lone, o.W,
              o.sums);
        } else {
          add_sphere<Derivatives, SphereSums>(motion, law, list, a.lone, o.W, o.sums);
        }
      } else if constexpr (Shape<N>::kSums == PointSumForm::points) {
        constexpr bool kBall = std::is_same_v<Shape<N>, GrownShape<N>>;  // no shear springs
        if constexpr (!kBall)
          if (elastic)
            return add_elastic<Derivatives>(shape, law, list, a.lone, frame(), o.W, o.sums);
        if (add_lone_candidates<Derivatives>(pair, size, side, frame(), o.W, law, list, a.lone,
                                             o.sums))
          return;
        add_candidates<Derivatives>(shape, law, list, frame(), o.W, o.sums);
      } else {
        const FaceMotion<Shape, N> motion = {frame(), o.W, shape};
        if (elastic) {
          if (!any_elastic) elastic_faces.start(a.lone);
          any_elastic = true;
          elastic_faces.add(ElasticFaceMotion<Shape, N>{motion, law.kt, law.ks}, law, list, a.lone);
        } else {
          if (!any_face) faces.start(a.lone);
          any_face = true;
          faces.add(motion, law, list, a.lone);
        }
      }
    });
  }
  if (any_face) add_finished<Derivatives>(o.W, faces.result(a.lone), o.sums);
  if (any_elastic) add_finished<Derivatives>(o.W, elastic_faces.result(a.lone), o.sums);
}

/// Adds the points of one link that are in the ground. Returns false where no lane has any.
template <bool Derivatives, class N>
bool sum_grounded(const ModelView& model, const GroundedLink& grounded, const StageArgs<N>& a,
                  PairSums<N>& sums) {
  const LinkScratch<N>& link = a.links[grounded.link];
  const Vec3<N> m = transposed_times(link.world.R, broadcast<N>(model.ground_normal));
  const N height =
      dot(broadcast<N>(model.ground_normal), link.world.p - broadcast<N>(model.ground_point));
  bool near = false, started = false;
  for (int i = 0; i < grounded.count; ++i) {
    const GroundContact& ground = model.grounds[model.ground_order[grounded.first + i]];
    const N radius = ground_radius<N>(ground, a.block, a.group);
    const N extent = ground.radius_row < 0 ? N(ground.extent) : N(ground.extent) + radius;
    if (!any(dot(m, broadcast<N>(ground.middle)) + height < extent)) continue;
    if (!started) start<Derivatives>(sums);
    started = true;
    LawParameters<N> law =
        load_law<N>(ground.parameters, ground.law, ground.ramp, a.block, a.group);
    soften(a, law);
    if (ground.memory >= 0) {
      const Frame<N> in_body = relative(link.world, broadcast<N>(model.ground));
      const N* anchors = a.ground_anchors + kAnchorNumbers * ground.first_anchor;
      for_each_low_point(ground, m, height, a.low_points, [&](int k) {
        near |= accumulate_elastic_ground<Derivatives>(
            sums, law, m, height, link.V, ground_point<N>(ground, k), radius, in_body,
            load_anchor<N>([&](int number) { return anchors[kAnchorNumbers * k + number]; }));
      });
      continue;
    }
    for_each_low_point(ground, m, height, a.low_points, [&](int k) {
      near |= accumulate_ground<Derivatives>(sums, law, m, height, link.V,
                                             ground_point<N>(ground, k), radius);
    });
  }
  return near;
}

/// Turns -0 into +0. A contact that is near in another lane only adds ±0, which must not show in
/// this lane's bits.
template <class N>
void without_negative_zeros(N* x, int count) {
  for (int i = 0; i < count; ++i) x[i] = x[i] + N(0.0);
}

/// Whether some lane has a candidate of the shapes of link pair k.
template <class N>
bool near(const ModelView& model, int k, const StageArgs<N>& a) {
  if (is_apart(a, k)) return false;
  const LinkPair& links = model.link_pairs[k];
  for (int i = 0; i < links.count; ++i)
    if (has_candidates(a.candidates[model.pair_order[links.first + i]], a.lone)) return true;
  return false;
}

/// Computes the contact sums of every pair of links and grounded link. Subtracts their wrenches
/// from the links' F.
template <bool Derivatives, class N>
void contact_sweep(const ModelView& model, const StageArgs<N>& a) {
  for_each_link_pair(model, a, [&](int k) {
    const LinkPair& pair = model.link_pairs[k];
    ContactScratch<N>& o = a.contacts[k];
    o.near = near(model, k, a);
    if (!o.near) return;
    sum_link_pair<Derivatives>(model, pair, a, o);
    if (pair.link1 >= 0) a.links[pair.link1].F -= o.sums.wrench;
    if (pair.link2 >= 0) a.links[pair.link2].F += wrench_to_child(o.link2_in_1, o.sums.wrench);
  });
  for (int k = 0; k < model.n_grounded; ++k) {
    ContactScratch<N>& o = a.contacts[model.n_link_pairs + k];
    o.near = sum_grounded<Derivatives>(model, model.grounded[k], a, o.sums);
    if (o.near) a.links[model.grounded[k].link].F -= o.sums.wrench;
  }
}

/// Computes joint forces from the wrenches, leaves first, and |forces| for the stopping test.
template <class N>
void inward_sweep(const ModelView& model, const StageArgs<N>& a) {
  for (int i = model.n_links - 1; i >= 0; --i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    with_kind(link.kind, [&]<JointKind K>() {
      for (int k = 0; k < dofs(K); ++k) {
        const int d = link.v + k;
        a.g[d] = project<K>(link, k, o.F) - a.tau[d];
        a.force_scale[d] = abs(a.tau[d]);
      }
      if (link.effects & kDamping) add_damping<K>(model, a, link);
      if (link.effects & kBeyondDamping) add_joint_load<K>(model, a, link);
    });
    if (link.parent >= 0) a.links[link.parent].F += wrench_to_parent(link, o.local, o.F);
  }
}

/// Computes poses and motions at x, and how far each lane has outrun its candidate lists.
template <class N>
void kinematics(const ModelView& model, const StageArgs<N>& a) {
  polynomial_motions(model, a);
  outward_sweep(model, a);
  transmission_motions(model, a);
  a.excess[0] = N(0.0);
  if (a.considered != nullptr) ball_motions(model, a);
  for_each_link_pair(model, a, [&](int k) {
    const LinkPair& pair = model.link_pairs[k];
    if (is_apart(a, k)) {
      a.excess[0] = max(a.excess[0], balls_overlap(pair, k, a, 0));
      return;
    }
    const CandidateList<N>& list = a.candidates[model.pair_order[pair.first]];
    pair_motion(pair, a, a.contacts[k]);
    a.excess[0] = max(a.excess[0], list_excess(pair, list, a.contacts[k].link2_in_1));
  });
}

/// Chooses the faces of every pair that is faced, at the relative poses of its links, to
/// (n_pairs, 3).
template <class N>
void choose_faces(const ModelView& model, const StageArgs<N>& a, N* out) {
  for_each_link_pair(model, a, [&](int g) {
    const LinkPair& links = model.link_pairs[g];
    if (!links.faced) return;
    for (int i = links.first; i < links.first + links.count; ++i) {
      const int k = model.pair_order[i];
      const PairContact& pair = model.pairs[k];
      if (!pair.faced) continue;
      const Frame<N> at = compose(a.contacts[g].link2_in_1, broadcast<N>(pair.frame2));
      const Vec3<N> half = load_vector<N>(pair.size, pair.size_row, a.block, a.group);
      const Vec3<N> side = chosen_faces(pair, at, half);
      out[3 * k] = side.x, out[3 * k + 1] = side.y, out[3 * k + 2] = side.z;
    }
  });
}

/// Computes the poses of links at the pose of `a`, whose rates do not matter. Overwrites v.
template <class N>
void place_links(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N>& o = a.links[i];
    Vec6<N> rate, acceleration;
    joint_motion(link, a, o, rate, acceleration);
    o.world = link.parent < 0 ? o.local : compose(link, a.links[link.parent].world, o.local);
  }
}

/// The same as choose_faces() at the pose of `a`, whose rates do not matter. Overwrites the scratch
/// and v.
template <class N>
void choose_faces_at(const ModelView& model, const StageArgs<N>& a, N* out) {
  place_links(model, a);
  for_each_link_pair(model, a, [&](int g) {
    if (model.link_pairs[g].faced)
      a.contacts[g].link2_in_1 = link_pair_pose(model.link_pairs[g], a);
  });
  choose_faces(model, a, out);
}

/// Computes the centres of the links' balls in the world at the pose of `a`, (n_links, 3). Those of
/// links without a ball are not set. Overwrites the scratch and v.
template <class N>
void place_balls(const ModelView& model, const StageArgs<N>& a, N* out) {
  place_links(model, a);
  for (int i = 0; i < model.n_links; ++i) {
    if (!has_ball(model.link_balls[i])) continue;
    const Vec3<N> at = ball_centre(model, a, i);
    out[3 * i] = at.x, out[3 * i + 1] = at.y, out[3 * i + 2] = at.z;
  }
}

/// Computes g at the x of kinematics() and leaves everything that the Jacobian needs in the
/// scratch.
template <bool Derivatives, class N>
void residual(const ModelView& model, const StageArgs<N>& a) {
  inertial_wrenches(model, a);
  contact_sweep<Derivatives>(model, a);
  loop_sweep<Derivatives>(model, a);
  inward_sweep(model, a);
  for_each_link_pair(model, a, [&](int k) {
    const ContactScratch<N>& o = a.contacts[k];
    if (!o.near) return;
    const LinkPair& pair = model.link_pairs[k];
    add_force_scale(model, a, pair.link1, o.sums.wrench);
    if (pair.link2 >= 0)
      add_force_scale(model, a, pair.link2, wrench_to_child(o.link2_in_1, o.sums.wrench));
  });
  for (int k = 0; k < model.n_grounded; ++k) {
    const ContactScratch<N>& o = a.contacts[model.n_link_pairs + k];
    if (o.near) add_force_scale(model, a, model.grounded[k].link, o.sums.wrench);
  }
  add_loop_scales(model, a);
  fold_transmissions(model, a);
  fold_residual(model, a);
  without_negative_zeros(a.g, model.nv);
}

/// Copies the wrenches of all contacts at the x of residual(): those of pairs of links, then of
/// grounded links, each on its first link, about that link's origin and in its axes.
template <class N>
void contact_wrenches(const ModelView& model, const StageArgs<N>& a, N* out) {
  const auto copy = [&](int k) {
    const ContactScratch<N>& o = a.contacts[k];
    const Vec6<N> wrench = o.near ? o.sums.wrench : zero6<N>();
    N* row = out + 6 * k;
    row[0] = wrench.a.x, row[1] = wrench.a.y, row[2] = wrench.a.z;
    row[3] = wrench.l.x, row[4] = wrench.l.y, row[5] = wrench.l.z;
  };
  if (a.considered != nullptr)
    for (int i = 0; i < 6 * model.n_link_pairs; ++i) out[i] = N(0.0);
  for_each_link_pair(model, a, copy);
  for (int k = 0; k < model.n_grounded; ++k) copy(model.n_link_pairs + k);
}

}  // namespace tangere::kernels
