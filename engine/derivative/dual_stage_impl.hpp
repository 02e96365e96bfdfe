// SPDX-License-Identifier: Apache-2.0
// The data of a stage in dual numbers: the model with a row of its own for every number, and the
// arguments of the kernels.
#pragma once

#include <algorithm>

#include "engine/derivative/dual_layer_contacts.hpp"
#include "engine/derivative/dual_stage.hpp"
#include "engine/model/group_contacts.hpp"
#include "engine/model/stretched_point.hpp"
#include "engine/step/kept_anchors.hpp"
#include "kernels/shear/update_shear_state.hpp"
#include "kernels/step/link_poses.hpp"
#include "kernels/step/residual.hpp"

namespace tangere {

struct DualStage::Impl {
  const CompiledModel& m;
  // The model with parameters in rows of `block`.
  kernels::ModelView view;
  std::vector<kernels::PairContact> pairs;
  std::vector<kernels::GroundContact> grounds;
  std::vector<kernels::DofEffects> effects;
  std::vector<kernels::Loop> loops;
  std::vector<kernels::Link> bodies;       ///< links with the environment's masses
  std::vector<kernels::Parameter> origin;  ///< for every row: where its number comes from
  std::vector<int> number;                 ///< for every row: the index of its number, -1: none
  std::vector<double> block;               ///< (rows, 16)
  std::vector<double> inertia;  ///< tangents of mass, mass · centre, inertia; (n_links, 10)
  bool heavier = false;         ///< some of `inertia` are not zero
  bool frozen = false;
  std::vector<double> tangents;  ///< tangents of the rows, kept while frozen
  std::vector<double> stretch;   ///< tangents of the solids' sizes, (n_solids, 3)

  std::vector<DualNumber> force_scale, mass_diagonal, excess;
  std::vector<kernels::LinkScratch<DualNumber>> links;
  std::vector<kernels::ContactScratch<DualNumber>> contacts;
  std::vector<kernels::JointColumns<DualNumber>> columns;
  std::vector<kernels::TransmissionColumn<DualNumber>> transmission_columns;
  std::vector<DualNumber> transmission_force;
  std::vector<kernels::PolynomialScratch<DualNumber>> polynomials;
  std::vector<std::vector<double>> ground_tangents;  ///< of the points in the ground
  std::vector<std::vector<DualNumber>> points, references, areas;
  std::vector<kernels::CandidateList<DualNumber>> lists;
  std::vector<DualNumber> faces;
  std::vector<std::vector<int>> listed_points;  ///< of each pair, by their places in `points`
  DualLayerContacts layers{m};
  // Shear state: anchors of all points, and those in the order of the kernels.
  std::vector<kernels::Anchor<DualNumber>> anchors;
  std::vector<std::vector<DualNumber>> listed_anchors;  ///< of each pair
  std::vector<DualNumber> ground_anchors;
  std::vector<DualNumber> dry_anchors,
      stage_dry_anchors;  ///< (nv) with tangents, and those of a stage
  std::vector<Coefficients<DualNumber>> sensor_laws;
  std::vector<std::vector<double>> point_tangents;   ///< of each sensor; empty: zeros
  std::vector<kernels::Vec3<double>> touched_sizes;  ///< of each body in this environment

  /// Returns the tangents of the material of a sensor's layer; `all`: of every number, or none.
  [[nodiscard]] LayerMaterial material_tangent(int sensor, std::span<const double> all) const {
    const auto row = std::size_t(m.layer_row(sensor));
    return all.size() > row + 1 ? LayerMaterial{all[row], all[row + 1]} : LayerMaterial{};
  }

  explicit Impl(const CompiledModel& model)
      : m(model),
        view(model.view),
        pairs(model.pairs),
        grounds(model.grounds),
        effects(model.dof_effects),
        loops(model.loops),
        bodies(model.links) {
    const auto row = [this](kernels::Parameter& p, int which) {
      origin.push_back(p);
      number.push_back(which);
      p.row = static_cast<int>(origin.size()) - 1;
    };
    const auto contact = [&](kernels::ContactParameters& c, int first) {
      for (int k = 0; k < kCoefficients; ++k) row(c[std::size_t(k)], first + k);
    };
    for (int k = 0; k < view.n_pairs; ++k)
      contact(pairs[std::size_t(k)].parameters, view.rows.pair(k));
    for (int k = 0; k < view.n_grounds; ++k)
      contact(grounds[std::size_t(k)].parameters, view.rows.ground(k));
    for (int dof = 0; dof < view.nv; ++dof) {
      kernels::DofEffects& e = effects[std::size_t(dof)];
      for (int k = 0; k < kernels::kDofNumbers; ++k)
        row(e.*kernels::kDofParameters[k], view.rows.dof(dof, k));
    }
    for (int k = 0; k < view.n_loops; ++k)
      for (int i = 0; i < kernels::kLoopNumbers; ++i)
        row(loops[std::size_t(k)].*kernels::kLoopParameters[i], view.rows.loop(k) + i);
    // `first`: row of the block that holds the first number, or -1: the numbers are `values`.
    const auto side_by_side = [this](int& first, int count, const double* values, int which) {
      const int from = first;
      first = static_cast<int>(origin.size());
      for (int i = 0; i < count; ++i) {
        origin.push_back(from < 0 ? kernels::Parameter{values[i], -1}
                                  : kernels::Parameter{0, from + i});
        number.push_back(which < 0 ? -1 : which + i);
      }
    };
    for (auto& p : pairs)
      side_by_side(p.size_row, 3, &p.size.x, p.body2 < 0 ? -1 : view.rows.solid(p.body2));
    for (auto& g : grounds)
      if (g.radius > 0) side_by_side(g.radius_row, 1, &g.radius, view.rows.solid(g.body));
    for (auto& g : grounds)
      g.point_tangents = ground_tangents.emplace_back(std::size_t(3 * g.n_points)).data();
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      kernels::Link& link = bodies[k];
      link.inertia_row = -1;
      link.has_offset = true;  // numbers that are zero may have tangents
      link.effects |= kernels::kArmature | kernels::kSpring | kernels::kLimit;
      side_by_side(link.place_row, kernels::kPlaceNumbers, &link.frame.p.x,
                   view.rows.place(static_cast<int>(k)));
    }
    view.links = bodies.data();
    view.pairs = pairs.data();
    view.grounds = grounds.data();
    view.effects = effects.data();
    view.loops = loops.data();
    block.assign(origin.size() * kernels::kBlock, 0.0);
    inertia.assign(std::size_t(kernels::kInertiaNumbers * view.n_links), 0.0);
    stretch.assign(std::size_t(kernels::kSizeNumbers * view.n_solids), 0.0);
    const std::size_t nv = std::size_t(m.nv);
    force_scale.resize(nv), mass_diagonal.resize(nv), excess.resize(1);
    dry_anchors.assign(nv, DualNumber(0.0)), stage_dry_anchors.assign(nv, DualNumber(0.0));
    links.resize(m.links.size()), columns.resize(2 * m.links.size());
    contacts.resize(std::size_t(view.n_link_pairs + view.n_grounded + view.n_loops));
    transmission_columns.resize(m.transmission_dofs.size());
    transmission_force.resize(m.transmissions.size());
    polynomials.resize(m.polynomials.size());
    faces.assign(3 * pairs.size(), DualNumber(0.0));
    for (const kernels::PairContact& p : pairs) {
      points.emplace_back(std::size_t(3 * p.n_points), DualNumber(0.0));
      references.emplace_back(12, DualNumber(0.0));
      lists.push_back({points.back().data(), 0, references.back().data(), 1e9, nullptr, 0, 0,
                       nullptr, nullptr});
      areas.emplace_back(p.weights == nullptr ? 0 : std::size_t(p.n_points));
      if (p.weights != nullptr) lists.back().weights = areas.back().data();
      listed_anchors.emplace_back();
      if (p.memory < 0) continue;
      listed_anchors.back().assign(std::size_t(kernels::kAnchorNumbers * p.n_points),
                                   DualNumber(0.0));
      lists.back().anchors = listed_anchors.back().data();
    }
    listed_points.resize(pairs.size());
    anchors.resize(std::size_t(m.shear_spring_points));
    ground_anchors.assign(std::size_t(kernels::kAnchorNumbers * m.ground_anchors), DualNumber(0.0));
    sensor_laws.resize(m.sensors.size());
    point_tangents.resize(m.sensors.size());
    touched_sizes.resize(m.bodies.size());
  }

  /// Returns the tangent of a body's contact point, link axes, with the body's size.
  [[nodiscard]] kernels::Vec3<double> stretched(int body, const kernels::Vec3<double>& at) const {
    return stretched_point(m.solids[std::size_t(body)],
                           &stretch[std::size_t(kernels::kSizeNumbers * body)], at);
  }

  /// Sets the tangents of the points that touch the ground.
  void stretch_grounds() {
    for (std::size_t g = 0; g < grounds.size(); ++g) {
      const double* p = grounds[g].points;
      std::vector<double>& t = ground_tangents[g];
      for (std::size_t k = 0; k < t.size(); k += 3) {
        const kernels::Vec3<double> moves =
            frozen ? kernels::zero3<double>()
                   : stretched(grounds[g].body, {p[k], p[k + 1], p[k + 2]});
        t[k] = moves.x, t[k + 1] = moves.y, t[k + 2] = moves.z;
      }
    }
  }

  /// Copies an anchor, without tangents while numbers are frozen.
  void put_anchor(int point, DualNumber* to) const {
    const kernels::Anchor<DualNumber>& a = anchors[std::size_t(point)];
    const DualNumber* const from = &a.b.x;
    static_assert(sizeof a == kernels::kAnchorNumbers * sizeof(DualNumber));
    for (int i = 0; i < kernels::kAnchorNumbers; ++i)
      to[i] = frozen ? DualNumber(from[i].value) : from[i];
  }
  void put_ground_anchors() {
    for (const kernels::ShearSpringContact& of : m.shear_springs) {
      if (!of.ground) continue;
      const int first = grounds[std::size_t(of.grounded)].first_anchor;
      for (int i = 0; i < of.contact.n_points; ++i)
        put_anchor(of.first + i,
                   &ground_anchors[std::size_t(kernels::kAnchorNumbers * (first + i))]);
    }
  }

  void put_dry_anchors() {
    for (const DryDof& dof : m.dry_dofs) {
      const DualNumber& z = dry_anchors[std::size_t(dof.v)];
      stage_dry_anchors[std::size_t(dof.v)] = frozen ? DualNumber(z.value) : z;
    }
  }
  /// Returns the law of a joint's dry friction at its coordinate and rate.
  [[nodiscard]] kernels::DryFriction<DualNumber> dry_friction_at(const DryDof& dof,
                                                                 const DualNumber& q,
                                                                 const DualNumber& v) const {
    return kernels::dry_friction(m.dof_effects[std::size_t(dof.v)], q, v,
                                 dry_anchors[std::size_t(dof.v)]);
  }
  /// Returns the elastic displacement of dry friction in a shear state.
  DualNumber& dry_displacement(std::vector<DualNumber>& state, const DryDof& dof) const {
    return state[3 * std::size_t(m.shear_spring_points + (&dof - m.dry_dofs.data()))];
  }

  /// Returns a contact with shear springs at the poses of all links.
  [[nodiscard]] kernels::LoadedTouch<DualNumber> touch(
      const kernels::ShearSpringContact& of,
      const std::vector<kernels::LinkPose<DualNumber>>& poses) const {
    const auto pose = [&](int link) {
      return link < 0 ? kernels::LinkPose<DualNumber>{{kernels::diagonal(DualNumber(1.0)),
                                                       kernels::zero3<DualNumber>()},
                                                      kernels::zero6<DualNumber>()}
                      : poses[std::size_t(link)];
    };
    const kernels::LinkPose<DualNumber> one = pose(of.contact.link1), two = pose(of.contact.link2);
    const kernels::Frame<DualNumber> second = relative(one.world, two.world),
                                     shape = compose(
                                         second, kernels::broadcast<DualNumber>(of.contact.frame2));
    const kernels::Vec6<DualNumber> twist = motion_to_parent(second, two.V) - one.V;
    const auto loaded = [&](const kernels::ContactParameters& p) {
      return kernels::load_law<DualNumber>(p, of.contact.law, of.contact.ramp, block.data(), 0);
    };
    const kernels::LawParameters<DualNumber> law =
        of.pair >= 0 ? loaded(pairs[std::size_t(of.pair)].parameters)
        : of.ground  ? loaded(grounds[std::size_t(of.grounded)].parameters)
                     : kernels::LawParameters<DualNumber>{sensor_laws[std::size_t(of.sensor)],
                                                          of.contact.law, of.contact.ramp};
    // No tangents of sizes: gradients by sizes are refused for contacts with shear springs.
    DualNumber radius(0.0);
    if (of.ground)
      radius = DualNumber(
          kernels::ground_radius<DualNumber>(grounds[std::size_t(of.grounded)], block.data(), 0)
              .value);
    return {shape.R, shape.p, twist.a, twist.l, law, radius, of.ground};
  }

  /// Calls f with the shape that a contact touches.
  template <class F>
  void with_touched_shape(const kernels::ShearSpringContact& of, const F& f) const {
    if (of.pair >= 0) {
      const kernels::PairContact& pair = pairs[std::size_t(of.pair)];
      const kernels::Vec3<double> size =
          kernels::load_vector<double>(pair.size, pair.size_row, block.data(), 0);
      const DualNumber* side = &faces[std::size_t(3 * of.pair)];
      kernels::with_touched<DualNumber>(pair, kernels::broadcast<DualNumber>(size),
                                        kernels::Vec3<DualNumber>{side[0], side[1], side[2]}, f);
    } else {
      kernels::with_distance<DualNumber>(
          of.contact.shape,
          of.ground ? kernels::zero3<DualNumber>()
                    : kernels::broadcast<DualNumber>(touched_sizes[std::size_t(of.contact.body2)]),
          f, of.contact.grid);
    }
  }

  /// Returns the law at point i of a contact: a sensor's points may have factors.
  [[nodiscard]] kernels::LawParameters<DualNumber> law_of(
      const kernels::ShearSpringContact& of, int i,
      const kernels::LoadedTouch<DualNumber>& t) const {
    kernels::LawParameters<DualNumber> law = t.law;
    if (of.contact.weights != nullptr)
      kernels::set_weighted(t.law, DualNumber(of.contact.weights[i]), law);
    if (of.sensor < 0) return law;
    const std::vector<double>& factors = m.sensors[std::size_t(of.sensor)].point_factors;
    if (!factors.empty()) {
      const double* own = &factors[std::size_t(kPointCoefficients * i)];
      for (std::size_t k = 0; k < kCoefficients; ++k)
        law[k] = DualNumber(own[factor_index(k)]) * law[k];
    }
    const double* own = own_tangents(of, i);
    if (own == nullptr) return law;
    for (std::size_t k = 0; k < kPointCoefficients; ++k) law[k] += DualNumber(0.0, own[3 + k]);
    if (t.law.kt.value != 0)  // a point's ks keeps its ratio to kt
      law.ks += DualNumber(
          0.0, own[3 + factor_index(kCoefficients - 1)] * t.law.ks.value / t.law.kt.value);
    return law;
  }

  /// Returns the anchor of point k of a sensor at this touch (engine/step/kept_anchors.hpp).
  template <class Shape>
  [[nodiscard]] kernels::Anchor<DualNumber> skin_anchor(
      const Shape& shape, const kernels::LoadedTouch<DualNumber>& t,
      const kernels::ShearSpringContact& of, int k, const std::vector<DualNumber>& s_start) const {
    const DualNumber* const b = &s_start[3 * std::size_t(of.first + k)];
    const kernels::Vec3<DualNumber> xi = place(of, k);
    if (m.shear_interval(of) == 0)
      return kernels::recalled(shape, t, xi, kernels::Vec3<DualNumber>{b[0], b[1], b[2]});
    const DualNumber* const a = b + 3 * of.contact.n_points;
    const auto is_zero = [](const DualNumber* x) {
      return x[0].value == 0 && x[1].value == 0 && x[2].value == 0;
    };
    if (is_zero(b) && is_zero(a))
      return kernels::recalled(shape, t, xi, kernels::zero3<DualNumber>());
    return {{b[0], b[1], b[2]}, {a[0], a[1], a[2]}, DualNumber(0.0)};
  }

  /// Calls f(shape, touch, k, point) for every point of a sensor against one body.
  template <class F>
  void meet_skin(const kernels::ShearSpringContact& of,
                 const std::vector<kernels::LinkPose<DualNumber>>& poses,
                 const std::vector<DualNumber>& s_start, const F& f) const {
    const kernels::LoadedTouch<DualNumber> t = touch(of, poses);
    with_touched_shape(of, [&](const auto& shape) {
      for (int k = 0; k < of.contact.n_points; ++k)
        f(shape, t, k,
          kernels::meet_elastic(shape, t, law_of(of, k, t), place(of, k),
                                skin_anchor(shape, t, of, k, s_start)));
    });
  }

  [[nodiscard]] std::vector<kernels::LinkPose<DualNumber>> poses_at(
      const std::vector<DualNumber>& q, const std::vector<DualNumber>& v) const {
    std::vector<DualNumber> zero(v.size(), DualNumber(0.0)), rates(v.size());
    kernels::StageArgs<DualNumber> a{};
    a.centre = q.data();
    a.x = a.s = zero.data();
    a.r = v.data();
    a.c0_over_h = DualNumber(0.0);
    a.inverse_h = DualNumber(1.0);
    a.v = rates.data();
    a.block = block.data();
    std::vector<kernels::LinkPose<DualNumber>> out(bodies.size());
    kernels::link_poses(view, a, out.data());
    return out;
  }

  /// Returns the tangents of a sensor's point i of its own numbers, or null.
  [[nodiscard]] const double* own_tangents(const kernels::ShearSpringContact& of, int i) const {
    if (of.sensor < 0 || point_tangents[std::size_t(of.sensor)].empty()) return nullptr;
    const CompiledSensor& s = m.sensors[std::size_t(of.sensor)];
    return &point_tangents[std::size_t(of.sensor)]
                          [std::size_t(kernels::kPointNumbers * s.in_field[std::size_t(i)])];
  }
  [[nodiscard]] kernels::Vec3<DualNumber> place(const kernels::ShearSpringContact& of,
                                                int i) const {
    const double* p = of.contact.points + 3 * i;
    const double* t = own_tangents(of, i);
    if (t == nullptr) return {DualNumber(p[0]), DualNumber(p[1]), DualNumber(p[2])};
    const int body = m.sensors[std::size_t(of.sensor)].body;
    const kernels::Vec3<double> moves =
        m.bodies[std::size_t(body)].frame.R * kernels::Vec3<double>{t[0], t[1], t[2]};
    return {{p[0], moves.x}, {p[1], moves.y}, {p[2], moves.z}};
  }

  /// Lists the points that touch at the poses of kinematics(). The others add nothing to values or
  /// tangents. Points move with the sizes of their bodies.
  void find_touching() {
    stretch_grounds();
    for (int k = 0; k < view.n_link_pairs; ++k) {
      const kernels::LinkPair& link_pair = view.link_pairs[k];
      for (int member = link_pair.first; member < link_pair.first + link_pair.count; ++member) {
        const int at = view.pair_order[member];
        kernels::PairContact& pair = pairs[std::size_t(at)];
        if (pair.ball_radius > 0)
          pair.ball_tangent = frozen ? 0 : stretch[std::size_t(kernels::kSizeNumbers * pair.body1)];
        kernels::Frame<double> in_1;
        const kernels::Frame<DualNumber>& dual = contacts[std::size_t(k)].link2_in_1;
        for (int e = 0; e < 9; ++e) in_1.R.m[e / 3][e % 3] = dual.R.m[e / 3][e % 3].value;
        in_1.p = {dual.p.x.value, dual.p.y.value, dual.p.z.value};
        const kernels::Frame<double> shape = compose(in_1, pair.frame2);
        const kernels::Vec3<double> size =
            kernels::load_vector<double>(pair.size, pair.size_row, block.data(), 0);
        const DualNumber* chosen = &faces[std::size_t(3 * at)];
        const kernels::Vec3<double> side = {chosen[0].value, chosen[1].value, chosen[2].value};
        std::vector<DualNumber>& list = points[std::size_t(at)];
        int count = 0;
        listed_points[std::size_t(at)].clear();
        for (int i = 0; i < pair.n_points; ++i) {
          const double* p = pair.points + 3 * i;
          const kernels::Vec3<double> y =
              transposed_times(shape.R, kernels::Vec3<double>{p[0], p[1], p[2]} - shape.p);
          const double d = kernels::with_touched<double>(
              pair, size, side, [&](const auto& s) { return distance_at(s, y).d; });
          if (!(d < 1e-9 + bulge_of(m, pair))) continue;  // [m], above rounding
          const kernels::Vec3<double> moves =
              frozen ? kernels::zero3<double>() : stretched(pair.body1, {p[0], p[1], p[2]});
          list[std::size_t(3 * count)] = {p[0], moves.x};
          list[std::size_t(3 * count + 1)] = {p[1], moves.y};
          list[std::size_t(3 * count + 2)] = {p[2], moves.z};
          listed_points[std::size_t(at)].push_back(i);
          if (pair.weights != nullptr) areas[std::size_t(at)][std::size_t(count)] = pair.weights[i];
          if (pair.memory >= 0)
            put_anchor(m.shear_springs[std::size_t(pair.memory)].first + i,
                       &listed_anchors[std::size_t(at)][std::size_t(7 * count)]);
          ++count;
        }
        lists[std::size_t(at)].count = count;
      }
    }
  }

  /// Computes the contribution of the tangents of masses to g, which is linear in masses. Contacts,
  /// motors and effects are left out.
  void weigh(const kernels::StageArgs<DualNumber>& a, std::vector<DualNumber>& g) {
    std::vector<kernels::Link> light = bodies;
    for (std::size_t k = 0; k < light.size(); ++k) {
      const double* n = &inertia[k * kernels::kInertiaNumbers];
      light[k].has_mass = true;
      light[k].effects = 0;
      light[k].mass = n[0];
      light[k].mass_times_com = {n[1], n[2], n[3]};
      light[k].inertia = {{{n[4], n[5], n[6]}, {n[5], n[7], n[8]}, {n[6], n[8], n[9]}}};
    }
    kernels::ModelView weight = view;
    weight.links = light.data();
    weight.n_link_pairs = weight.n_grounded = weight.n_pairs = weight.n_grounds = 0;
    weight.n_loops = 0;
    std::vector<DualNumber> no_tau(g.size(), DualNumber(0.0));
    kernels::StageArgs<DualNumber> b = a;
    b.g = g.data();
    b.tau = no_tau.data();
    kernels::kinematics(weight, b);
    kernels::residual<false>(weight, b);
  }

  kernels::StageArgs<DualNumber> arguments(DualStage& s) {
    kernels::StageArgs<DualNumber> a{};
    a.centre = s.centre.data();
    a.x = s.x.data();
    a.r = s.r.data();
    a.s = s.s.data();
    a.tau = s.tau.data();
    a.target = s.target.data();
    a.dry_anchor = stage_dry_anchors.data();
    a.c0_over_h = DualNumber(s.c0_over_h);
    a.inverse_h = DualNumber(s.inverse_h);
    a.block = block.data();
    a.group = 0;
    a.candidates = lists.data();
    a.ground_anchors = ground_anchors.data();
    a.layer_sums = layers.sums();
    a.faces = faces.data();
    a.lone = -1;
    a.links = links.data();
    a.contacts = contacts.data();
    a.columns = columns.data();
    a.transmission_columns = transmission_columns.data();
    a.transmission_force = transmission_force.data();
    a.polynomials = polynomials.data();
    a.own_x = s.x.data();
    a.own_r = s.r.data();
    a.v = s.v.data();
    a.g = s.g.data();
    a.force_scale = force_scale.data();
    a.mass_diagonal = mass_diagonal.data();
    a.excess = excess.data();
    return a;
  }
};

}  // namespace tangere
