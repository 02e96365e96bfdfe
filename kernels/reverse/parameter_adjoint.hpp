// SPDX-License-Identifier: Apache-2.0
// -(∂g/∂p)ᵀ λ for the numbers of a scene, after adjoint_products(). φ = λᵀ g is linear in masses,
// dampings, stiffnesses and gains. The effect of a contact's coefficients on its points' forces is
// weighted by Y, the slip along λ:
//   ∂φ/∂p = Σ (Y_l + Y_a × x₂)·∂f/∂p
//       ∂φ/∂(m, c, J) of Λᵀ I X = Λ_a·(J α + c × a) + Λ_l·(m a - c × α), X = (α; a)
// with X = A, and with X = V and -V × Λ in place of Λ. Sizes act through d and n of the touched
// body, and through the places ξ of a body's own points, which move with its surface. ξ̄ and ρ̄
// follow from f̄ = Y_l + Y_a × x₂ and x̄ = f × Y_a (kernels/reverse/point_pullback.hpp). A size's
// share is that of ρ̄ (kernels/contact/distance.hpp) plus Σ ξ̄·∂ξ/∂size.
#pragma once

#include "kernels/reverse/adjoint.hpp"
#include "kernels/reverse/point_pullback.hpp"

namespace tangere::kernels {

template <class N>
void subtract_law(const Coefficients<N>& c, N* out) {
  for (std::size_t k = 0; k < kCoefficients; ++k) out[k] -= c[k];
}

/// Sums over the points of one pair or ground contact.
template <class N>
struct ContactCotangent {
  Coefficients<N> law;
  Vec3<N> size, stretch;  ///< size of the touched shape, and of the body whose points touch
};
template <class N>
ContactCotangent<N> zero_contact() {
  return {{N(0.0), N(0.0), N(0.0), N(0.0)}, zero3<N>(), zero3<N>()};
}

/// Returns Σ ξ̄·∂ξ/∂size for a point of a body at ξ, link axes.
template <class N>
Vec3<N> stretch_share(const Solid& body, const Vec3<N>& xi, const Vec3<N>& xi_bar) {
  if (!body.stretches) return zero3<N>();
  const Mat3<N> R = broadcast<N>(body.frame.R);
  const Vec3<N> y = transposed_times(R, xi - broadcast<N>(body.frame.p)),
                bar = transposed_times(R, xi_bar);
  return with_distance<N>(body.shape, body.size, [&]<class Shape>(const Shape&) {
    if constexpr (requires { Shape::stretch_share(body.size, y, bar); }) {
      return Shape::stretch_share(body.size, y, bar);
    } else {
      return zero3<N>();
    }
  });
}

/// Adds one point of a pair, if it touches. `slip`: Y. `law`: that of the point, whose coefficients
/// but mu are `area` times those of the pair; null: they are those of the pair.
template <class Shape, class N>
void add_point(const Shape& shape, const Frame<N>& at, const Vec6<N>& W,
               const LawParameters<N>& law, const N* area, const Solid& body, const Vec6<N>& slip,
               const Vec3<N>& xi, ContactCotangent<N>& sum) {
  const PointContact<N> p = point_contact(shape, law, at.R, at.p, W.a, W.l, xi);
  const auto touching = p.d < N(0.0);
  if (!any(touching)) return;
  const N gate = select(touching, N(1.0), N(0.0));
  const Vec3<N> f_bar = gate * (slip.l + cross(slip.a, p.x2));
  if (area == nullptr) {
    pull_back_law(law, p, f_bar, sum.law);
  } else {
    Coefficients<N> own = {N(0.0), N(0.0), N(0.0), N(0.0)};
    pull_back_law(law, p, f_bar, own);
    for (std::size_t k = 0; k < kCoefficients; ++k)
      sum.law[k] = scales_with_area(k) ? mul_add(*area, own[k], sum.law[k]) : sum.law[k] + own[k];
  }
  TouchCotangent<N> unused;
  unused.twist = unused.displacement = zero6<N>();
  const PlaceCotangent<N> from_force = pull_back_motion<Shape>(law, p, W.a, f_bar, unused);
  const PlaceCotangent<N> from_arm = pull_back_place<Shape>(p, cross(p.force, slip.a));
  const Vec3<N> rho = from_force.rho + from_arm.rho;
  sum.size += pull_back_size(shape, p, at.R, at.p, xi, rho, from_force.d + from_arm.d);
  if constexpr (requires { shape.grown; }) {
    sum.stretch.x -= pull_back_force(law, p, f_bar).d;  // at fixed ξ, d falls as the ball grows
  } else {
    sum.stretch += gate * stretch_share(body, xi, from_force.x + from_arm.x - rho);
  }
}

template <class Shape, class N>
[[gnu::noinline]] void pair_adjoint(const Shape& shape, const Frame<N>& at, const Vec6<N>& W,
                                    const LawParameters<N>& law, const Solid& body,
                                    const CandidateList<N>& list, int lone, const Vec6<N>& slip,
                                    ContactCotangent<N>& sum) {
  LawParameters<N> own = law;
  for_each_place(list, lone, [&](int k, const Vec3<N>& xi) {
    set_point_law(law, list, lone, k, own);
    const bool weighted = has_areas(list, lone);
    const N area = weighted ? area_at(list, lone, k) : N(1.0);
    add_point(shape, at, W, own, weighted ? &area : nullptr, body, slip, xi, sum);
  });
}

template <class N>
void subtract(const Vec3<N>& sum, N* out) {
  out[0] -= sum.x, out[1] -= sum.y, out[2] -= sum.z;
}

/// Adds the derivatives by coefficients and sizes of every shape of two links.
template <class N>
void link_pair_parameters(const ModelView& model, const StageArgs<N>& a, const LinkPair& links,
                          const ContactScratch<N>& o, const LinkAdjoint<N>* adjoint, N* out) {
  const Vec6<N> slip = adjoint_slip(links, o, adjoint);
  for (int m = links.first; m < links.first + links.count; ++m) {
    const int k = model.pair_order[m];
    const PairContact& pair = model.pairs[k];
    // kernels/shear/shear_pullback.hpp, or a coupled layer
    if (pair.memory >= 0 || pair.layer_pad >= 0) continue;
    const LawParameters<N> law =
        load_law<N>(pair.parameters, pair.law, pair.ramp, a.block, a.group);
    const Frame<N> at = compose(o.link2_in_1, broadcast<N>(pair.frame2));
    ContactCotangent<N> sum = zero_contact<N>();
    const Vec3<N> size = load_vector<N>(pair.size, pair.size_row, a.block, a.group);
    with_touched<N>(pair, size, faces_of(a, pair, k), [&]<class Shape>(const Shape& shape) {
      pair_adjoint(shape, at, o.W, law, model.solids[pair.body1], a.candidates[k], a.lone, slip,
                   sum);
    });
    subtract_law(sum.law, out + model.rows.pair(k));
    if (pair.body2 >= 0) subtract(sum.size, out + model.rows.solid(pair.body2));
    subtract(sum.stretch, out + model.rows.solid(pair.body1));
  }
}

/// Sums over one body against the ground, with Y = -Λ. Forces act at ξ = ξ_c - r m itself, where
/// ξ_c is a point of the body or a ball's centre.
template <class N>
ContactCotangent<N> ground_adjoint(const ModelView& model, const StageArgs<N>& a,
                                   const GroundContact& ground, const Vec6<N>& twist) {
  const LinkScratch<N>& link = a.links[ground.link];
  const Vec3<N> normal = broadcast<N>(model.ground_normal);
  const Vec3<N> m = transposed_times(link.world.R, normal);
  const N height = dot(normal, link.world.p - broadcast<N>(model.ground_point));
  const LawParameters<N> law =
      load_law<N>(ground.parameters, ground.law, ground.ramp, a.block, a.group);
  const N radius = ground_radius<N>(ground, a.block, a.group);
  const bool ball = ground.radius > 0;
  ContactCotangent<N> sum = zero_contact<N>();
  for_each_low_point(ground, m, height, a.low_points, [&](int i) {
    const Vec3<N> centre = ground_point<N>(ground, i);
    PointContact<N> p;
    if (!ground_contact(law, m, height, link.V, centre, radius, p)) return;
    const N gate = select(p.d < N(0.0), N(1.0), N(0.0));
    const Vec3<N> f_bar = (-gate) * (twist.l + cross(twist.a, p.x2));
    pull_back_law(law, p, f_bar, sum.law);
    const ForceCotangent<N> bar = pull_back_force(law, p, f_bar);
    const Vec3<N> xi_bar = cross(bar.u, link.V.a) - cross(p.force, twist.a);
    if (ball) {
      sum.size.x -= dot(m, xi_bar) + bar.d;
    } else {
      sum.stretch += stretch_share(model.solids[ground.body], centre, xi_bar + bar.d * m);
    }
  });
  return sum;
}

/// Adds the derivatives of every pair and ground contact.
template <class N>
void contact_parameters(const ModelView& model, const StageArgs<N>& a, const LinkAdjoint<N>* links,
                        N* out) {
  for_each_link_pair(model, a, [&](int k) {
    if (a.contacts[k].near)
      link_pair_parameters(model, a, model.link_pairs[k], a.contacts[k], links, out);
  });
  for (int k = 0; k < model.n_grounded; ++k) {
    const GroundedLink& grounded = model.grounded[k];
    if (!a.contacts[model.n_link_pairs + k].near) continue;
    for (int m = grounded.first; m < grounded.first + grounded.count; ++m) {
      const int g = model.ground_order[m];
      if (model.grounds[g].memory >= 0) continue;
      const ContactCotangent<N> sum =
          ground_adjoint(model, a, model.grounds[g], links[grounded.link].twist);
      subtract_law(sum.law, out + model.rows.ground(g));
      subtract(sum.size + sum.stretch, out + model.rows.solid(model.grounds[g].body));
    }
  }
}

/// Adds -∂(Λᵀ I X) by (m, c, J), with J as xx xy xz yy yz zz.
template <class N>
void subtract_inertia(const Vec6<N>& twist, const Vec6<N>& x, N* out) {
  out[0] -= dot(twist.l, x.l);
  const Vec3<N> c = cross(x.l, twist.a) - cross(x.a, twist.l);
  out[1] -= c.x, out[2] -= c.y, out[3] -= c.z;
  const Vec3<N>&t = twist.a, &w = x.a;
  out[4] -= t.x * w.x;
  out[5] -= mul_add(t.x, w.y, t.y * w.x);
  out[6] -= mul_add(t.x, w.z, t.z * w.x);
  out[7] -= t.y * w.y;
  out[8] -= mul_add(t.y, w.z, t.z * w.y);
  out[9] -= t.z * w.z;
}

/// Adds the derivatives by mass, mass · centre and inertia of every link, ten numbers each.
template <class N>
void inertia_parameters(const ModelView& model, const StageArgs<N>& a, const LinkAdjoint<N>* links,
                        N* out) {
  for (int i = 0; i < model.n_links; ++i, out += kInertiaNumbers) {
    const LinkScratch<N>& s = a.links[i];
    if (model.links[i].never_rotates) {
      out[0] -= dot(links[i].twist.l, felt_acceleration(model, model.links[i], s).l);
      continue;
    }
    subtract_inertia(links[i].twist, felt_acceleration(model, model.links[i], s), out);
    subtract_inertia(-cross_motion(s.V, links[i].twist), s.V, out);
  }
}

/// How far q is outside of the limits, with the sign of the force.
template <class N>
N beyond_limits(const DofEffects& e, const N& q) {
  N unused;
  return limit_force(e, N(1.0), q, unused);
}

/// Adds the derivatives by the parameters of a joint's dofs. A ball joint has one stiffness, that
/// of its first dof.
template <JointKind K, class N>
void joint_parameters(const ModelView& model, const StageArgs<N>& a, const Link& link,
                      const N* lambda, N* out) {
  const DofEffects* e = model.effects + link.v;
  const N *c = a.centre + link.q, *x = a.x + link.v, *u = a.target + link.v;
  const auto motor = [&](int k, const N& error) {
    N inside;
    const N& v = a.v[link.v + k];
    motor_force(e[k], load_parameter(a, e[k].P), load_parameter(a, e[k].D), error, v, inside);
    out[kDofNumbers * k + kDofP] += inside * lambda[link.v + k] * error;
    out[kDofNumbers * k + kDofD] -= inside * lambda[link.v + k] * v;
  };
  for (int k = 0; k < dofs(K); ++k) {
    const N &of = lambda[link.v + k], &v = a.v[link.v + k];
    out[kDofNumbers * k + kDofDamping] -= of * v;
    out[kDofNumbers * k + kDofArmature] -=
        of * mul_add(a.c0_over_h, v, a.inverse_h * a.s[link.v + k]);
  }
  if constexpr (K != JointKind::spherical) {
    for (int k = 0; k < dofs(K); ++k) {
      const N q = c[k] + x[k];
      const N& of = lambda[link.v + k];
      out[kDofNumbers * k + kDofStiffness] += of * (N(e[k].rest) - q);
      out[kDofNumbers * k + kDofLimitStiffness] += of * beyond_limits(e[k], q);
      if (link.effects & kDryFriction)
        out[kDofNumbers * k + kDofFriction] -=
            of * dry_friction(e[k], q, a.v[link.v + k], a.dry_anchor[link.v + k]).share;
      if (link.effects & kPositionServo) motor(k, motor_error(e[k], u[k], q));
    }
  } else {
    const Quat<N> q = Quat<N>{c[0], c[1], c[2], c[3]} * quaternion_exp(Vec3<N>{x[0], x[1], x[2]});
    const Vec3<N> of = {lambda[link.v], lambda[link.v + 1], lambda[link.v + 2]};
    const Quat<N> rest = quaternion_exp(Vec3<N>{N(e[0].rest), N(e[1].rest), N(e[2].rest)});
    out[kDofStiffness] -= dot(rotation_vector<false>(conjugate(rest) * q).phi, of);
    const RotationVector<N> at = rotation_vector<true>(q);
    const Vec3<N> force_bar = transposed_times(inverse_left_jacobian(at), of);
    out[kDofLimitStiffness] += force_bar.x * beyond_limits(e[0], at.phi.x);
    out[kDofNumbers + kDofLimitStiffness] += force_bar.y * beyond_limits(e[1], at.phi.y);
    out[2 * kDofNumbers + kDofLimitStiffness] += force_bar.z * beyond_limits(e[2], at.phi.z);
    if (link.effects & kPositionServo) {
      const Vec3<N> psi =
          rotation_vector<false>(conjugate(q) * quaternion_exp(Vec3<N>{u[0], u[1], u[2]})).phi;
      motor(0, psi.x), motor(1, psi.y), motor(2, psi.z);
    }
  }
}

/// Sets in `out`, (n_links, 3), what moving each link alone along its axes does through contacts.
/// ε, the motion of body 2 in body 1's axes, changes w₁ by K ε + D (ε × Z), and Ad Λ₂ by ε × Ad Λ₂.
template <class N>
void contact_places(const ModelView& model, const StageArgs<N>& a, const LinkAdjoint<N>* links,
                    N* out) {
  const auto place_bar = [](const PairSums<N>& sums, const Vec6<N>& y) {
    return transposed_times(sums.k[0][1], y.a) + transposed_times(sums.k[1][1], y.l);
  };
  const auto subtract = [out](int link, const Vec3<N>& x) {
    N* const to = out + kPlaceNumbers * link;
    to[0] -= x.x, to[1] -= x.y, to[2] -= x.z;
  };
  const auto add = [&](const auto& pair, const ContactScratch<N>& o) {
    const Vec6<N> y = adjoint_slip(pair, o, links);
    const Vec3<N> second = pair.link1 < 0 ? y.a : y.a + links[pair.link1].twist.a;  // of Ad Λ₂
    const Vec3<N> e = place_bar(o.sums, y) + cross(o.Z.a, transposed_damping(o.sums, y).l) +
                      cross(second, o.sums.wrench.l);
    if (pair.link1 >= 0) subtract(pair.link1, -e);
    if (pair.link2 >= 0) subtract(pair.link2, transposed_times(o.link2_in_1.R, e));
  };
  for (int k = 0; k < model.n_link_pairs; ++k)
    if (a.contacts[k].near) add(model.link_pairs[k], a.contacts[k]);
  for (int k = 0; k < model.n_loops; ++k) add(model.loops[k], loop_scratch(model, a, k));
  for (int k = 0; k < model.n_grounded; ++k) {
    const ContactScratch<N>& o = a.contacts[model.n_link_pairs + k];
    if (!o.near) continue;
    const int link = model.grounded[k].link;
    subtract(link, place_bar(o.sums, links[link].twist));
  }
}

/// Computes the derivatives by Link::frame.p of every link. A move ε of a subtree in the axes of
/// its first link, without turning it, changes Λ, V and A there by Λ_p × ε, V_p × ε and A_p × ε.
template <class N>
void place_parameters(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d,
                      N* out) {
  const LinkAdjoint<N>* const links = d.links;
  contact_places(model, a, links, out);
  transmission_places(model, a, d, out);
  for (int i = model.n_links - 1; i >= 0; --i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& s = a.links[i];
    N* const own = out + kPlaceNumbers * i;
    Vec3<N> sum = {own[0], own[1], own[2]};
    if (link.parent >= 0) {
      const Vec3<N> up = s.local.R * sum;
      add3(out + kPlaceNumbers * link.parent, up);
      const LinkAdjoint<N>& o = links[i];
      const Vec6<N> lambda = motion_to_child(link, s.local, links[link.parent].twist);
      sum -= cross(s.F.l, lambda.a) + cross(o.A_bar.l, s.Ap.a) + cross(o.V_bar.l, s.Vp.a);
    }
    sum = s.local.R * sum;
    own[0] = sum.x, own[1] = sum.y, own[2] = sum.z;
  }
}

/// Adds the derivatives by the numbers of every loop.
template <class N>
void loop_parameters(const ModelView& model, const StageArgs<N>& a, const LinkAdjoint<N>* links,
                     N* out) {
  for (int k = 0; k < model.n_loops; ++k, out += kLoopNumbers) {
    const ContactScratch<N>& o = loop_scratch(model, a, k);
    const Vec6<N> slip = adjoint_slip(model.loops[k], o, links);
    const LoopState<N> s = loop_state(model.loops[k], o.link2_in_1, o.W);
    const Vec3<N> f_bar = slip.l + cross(slip.a, s.x2);
    out[0] += dot(f_bar, s.gap);
    out[1] += dot(f_bar, s.u);
    if (!model.loops[k].weld) continue;
    out[2] -= dot(slip.a, s.turned.phi);
    out[3] -= dot(slip.a, o.W.a);
  }
}

/// Adds all derivatives to `out`, zeros at first, in the order of ParameterRows.
template <class N>
void parameter_products(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d,
                        N* out) {
  contact_parameters<N>(model, a, d.links, out);
  inertia_parameters(model, a, d.links, out + model.rows.links);
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    with_kind(link.kind, [&]<JointKind K>() {
      joint_parameters<K>(model, a, link, d.lambda, out + model.rows.dof(link.v, 0));
    });
  }
  place_parameters(model, a, d, out + model.rows.places);
  loop_parameters(model, a, d.links, out + model.rows.loops);
}

}  // namespace tangere::kernels
