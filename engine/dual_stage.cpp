// SPDX-License-Identifier: Apache-2.0
// The kernels' templates over Dual<double>. Every number that a scene gives gets a row of its own: value in lane 0, tangent
// in lane 1 (kernels/stage.hpp).
#include "engine/dual_stage.hpp"

#include <algorithm>

#include "kernels/jacobian-inl.hpp"
#include "kernels/parameter_adjoint-inl.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::Parameter;
using D = DualNumber;

struct DualStage::Impl {
  const CompiledModel& m;
  // The model with parameters in rows of `block`.
  kernels::ModelView view;
  std::vector<kernels::PairContact> pairs;
  std::vector<kernels::GroundContact> grounds;
  std::vector<kernels::DofEffects> effects;
  std::vector<Parameter> origin;       ///< of every row
  std::vector<int> number;             ///< of every row: which number it is
  std::vector<double> block;           ///< (rows, 16)
  std::vector<double> inertia;         ///< tangents of masses, moments, inertias, (n_links, 10)
  bool heavier = false;                ///< some of them are not zero

  std::vector<D> force_scale, mass_diagonal, A, excess, scratch_rows;
  std::vector<kernels::LinkScratch<D>> links;
  std::vector<kernels::ContactScratch<D>> contacts;
  std::vector<kernels::JointColumns<D>> columns;
  std::vector<kernels::LinkAdjoint<D>> adjoint;
  std::vector<std::vector<D>> points, references;
  std::vector<kernels::CandidateList<D>> lists;

  explicit Impl(const CompiledModel& model) : m(model), view(model.view), pairs(model.pairs), grounds(model.grounds),
                                              effects(model.dof_effects) {
    const auto row = [this](Parameter& p, int which) {
      origin.push_back(p);
      number.push_back(which);
      p.row = static_cast<int>(origin.size()) - 1;
    };
    int next = 0;
    const auto contact = [&](kernels::ContactParameters& c) {
      for (Parameter* p : {&c.kn, &c.kt, &c.mu, &c.damping}) row(*p, next++);
    };
    for (auto& p : pairs) contact(p.parameters);
    for (auto& g : grounds) contact(g.parameters);
    next += kernels::kInertiaNumbers * view.n_links;
    for (auto& e : effects) {
      for (Parameter* p : {&e.damping, &e.stiffness, &e.P, &e.D}) row(*p, next++);
      row(e.armature, -1);
      row(e.limit_stiffness, -1);
    }
    view.pairs = pairs.data();
    view.grounds = grounds.data();
    view.effects = effects.data();
    block.assign(origin.size() * kBlock, 0.0);
    inertia.assign(std::size_t(kernels::kInertiaNumbers * view.n_links), 0.0);
    const std::size_t nv = std::size_t(m.nv);
    force_scale.resize(nv), mass_diagonal.resize(nv), excess.resize(1);
    A.resize(std::size_t(m.pattern.entries));
    scratch_rows.resize(12 * nv);
    links.resize(m.links.size()), adjoint.resize(m.links.size()), columns.resize(2 * m.links.size());
    contacts.resize(std::size_t(view.n_link_pairs + view.n_grounded));
    for (const kernels::PairContact& p : pairs) {
      points.emplace_back();
      for (int k = 0; k < 3 * p.n_points; ++k) points.back().emplace_back(p.points[k]);
      references.emplace_back(12, D(0.0));
      lists.push_back({points.back().data(), p.n_points, references.back().data(), 1e9, nullptr, 0, 0});
    }
  }

  kernels::StageArgs<D> arguments(DualStage& s) {
    kernels::StageArgs<D> a{};
    a.centre = s.centre.data();
    a.x = s.x.data();
    a.r = s.r.data();
    a.s = s.s.data();
    a.tau = s.tau.data();
    a.target = s.target.data();
    a.c0_over_h = D(s.c0_over_h);
    a.inverse_h = D(s.inverse_h);
    a.block = block.data();
    a.group = 0;
    a.candidates = lists.data();
    a.lone = -1;
    a.links = links.data();
    a.contacts = contacts.data();
    a.columns = columns.data();
    a.v = s.v.data();
    a.g = s.g.data();
    a.force_scale = force_scale.data();
    a.mass_diagonal = mass_diagonal.data();
    a.A = A.data();
    a.excess = excess.data();
    return a;
  }
};

DualStage::DualStage(const CompiledModel& model) : impl_(std::make_unique<Impl>(model)) {
  centre.resize(std::size_t(model.nq));
  for (auto* p : {&x, &r, &s, &tau, &target, &v, &g}) p->assign(std::size_t(model.nv), D(0.0));
}
DualStage::~DualStage() = default;

void DualStage::set_numbers(const double* column, std::span<const double> tangents) {
  Impl& i = *impl_;
  for (std::size_t k = 0; k < i.origin.size(); ++k) {
    const Parameter& p = i.origin[k];
    i.block[k * kBlock] = p.row < 0 ? p.value : column[p.row * kBlock];
    i.block[k * kBlock + 1] = tangents.empty() || i.number[k] < 0 ? 0 : tangents[std::size_t(i.number[k])];
  }
  const auto first = std::size_t(kernels::kContactNumbers * (i.view.n_pairs + i.view.n_grounds));
  for (std::size_t k = 0; k < i.inertia.size(); ++k) i.inertia[k] = tangents.empty() ? 0 : tangents[first + k];
  i.heavier = std::any_of(i.inertia.begin(), i.inertia.end(), [](double t) { return t != 0; });
}

void DualStage::rates() { kernels::kinematics(impl_->view, impl_->arguments(*this)); }

void DualStage::residual() {
  Impl& i = *impl_;
  const auto a = i.arguments(*this);
  kernels::kinematics(i.view, a);
  kernels::residual<false>(i.view, a);
  if (!i.heavier) return;
  // g is linear in masses: what their tangents weigh, without contacts, motors and effects.
  std::vector<kernels::Link> links = i.m.links;
  for (std::size_t k = 0; k < links.size(); ++k) {
    const double* n = &i.inertia[k * kernels::kInertiaNumbers];
    links[k].massive = true;
    links[k].effects = 0;
    links[k].mass = n[0];
    links[k].moment = {n[1], n[2], n[3]};
    links[k].inertia = {{{n[4], n[5], n[6]}, {n[5], n[7], n[8]}, {n[6], n[8], n[9]}}};
  }
  kernels::ModelView weight = i.view;
  weight.links = links.data();
  weight.n_link_pairs = weight.n_grounded = weight.n_pairs = weight.n_grounds = 0;
  std::vector<D> of_mass(g.size()), no_tau(g.size(), D(0.0));
  kernels::StageArgs<D> b = a;
  b.g = of_mass.data();
  b.tau = no_tau.data();
  kernels::kinematics(weight, b);
  kernels::residual<false>(weight, b);
  for (std::size_t k = 0; k < g.size(); ++k) g[k].epsilon += of_mass[k].value;
}

void DualStage::jacobian(std::vector<DualNumber>& A) {
  Impl& i = *impl_;
  const auto a = i.arguments(*this);
  kernels::kinematics(i.view, a);
  kernels::residual<true>(i.view, a);
  kernels::jacobian(i.view, a);
  const int n = i.m.nv;
  A.assign(std::size_t(n * n), D(0.0));
  for (int k = 0; k < n * n; ++k)
    if (const int slot = i.m.view.pattern.slot[k]; slot >= 0) A[std::size_t(k)] = i.A[std::size_t(slot)];
}

void DualStage::products(std::span<const double> lambda, std::vector<DualNumber>& c_lambda,
                         std::vector<DualNumber>& m_lambda, std::vector<DualNumber>& targets,
                         std::vector<DualNumber>* numbers) {
  Impl& i = *impl_;
  const std::size_t n = g.size();
  std::vector<D> along(n), zero(n, D(0.0)), nu(n), unused(4 * n, D(0.0));
  for (std::size_t k = 0; k < n; ++k) along[k] = D(lambda[k]);
  m_lambda.assign(n, D(0.0));
  targets.assign(n, D(0.0));
  const kernels::AdjointArgs<D> d = {zero.data(), zero.data(), nullptr,        along.data(),        nu.data(),
                                     m_lambda.data(), targets.data(), zero.data(), unused.data(), unused.data() + n,
                                     unused.data() + 2 * n, unused.data() + 3 * n, {0, 0, 0}, i.adjoint.data()};
  const auto a = i.arguments(*this);
  kernels::adjoint_products(i.view, a, d);
  c_lambda.resize(n);
  for (std::size_t k = 0; k < n; ++k) c_lambda[k] = -nu[k];  // v̄ = 0
  if (numbers != nullptr) kernels::parameter_products(i.view, a, d, numbers->data());
}

}  // namespace tangere
