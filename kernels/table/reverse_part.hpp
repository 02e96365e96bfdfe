// SPDX-License-Identifier: Apache-2.0
// The reverse functions of an instruction set's table: those of stages and of readings.
#pragma once

#include "kernels/reverse/motion_pullback.hpp"
#include "kernels/reverse/parameter_adjoint.hpp"
#include "kernels/reverse/tactile_pullback.hpp"
#include "kernels/reverse/tactile_tangent.hpp"
#include "kernels/table/kernel_table.hpp"
#include "kernels/table/stage_view.hpp"

namespace tangere::kernels {

template <class N, int L>
AdjointArgs<N> adjoint_arguments(const StageAdjoint<L>& d, LinkAdjoint<N>* links) {
  const auto view = [](auto* p) { return StageView<N, L>::view(p); };
  AdjointArgs<N> a{view(d.q_bar),
                   view(d.v_bar),
                   view(d.rhs),
                   view(d.lambda),
                   view(d.nu),
                   view(d.mass_lambda),
                   view(d.target),
                   view(d.dry_anchor),
                   view(d.q_centre),
                   view(d.v_centre),
                   {d.history.s_centre, d.history.count, {}},
                   links};
  for (int k = 0; k < d.history.count; ++k) {
    const auto& o = d.history.older[k];
    a.history.older[k] = {o.rho, o.s, view(o.difference), view(o.q), view(o.v)};
  }
  return a;
}

template <class N, int L>
void add_adjoint_kernels(StageKernels<L>& k) {
  using View = StageView<N, L>;
  k.scratch_bytes = [](const ModelView& m) -> std::size_t {
    return sizeof(LinkScratch<N>) * m.n_links +
           sizeof(ContactScratch<N>) * (m.n_link_pairs + m.n_grounded + m.n_loops) +
           sizeof(CandidateList<N>) * m.n_pairs + sizeof(JointColumns<N>) * 2 * m.n_links +
           sizeof(LinkAdjoint<N>) * m.n_links +
           sizeof(TransmissionColumn<N>) * m.n_transmission_dofs +
           sizeof(N) * (m.n_transmissions + m.most_transmission_dofs * m.most_transmission_dofs) +
           sizeof(PolynomialScratch<N>) * m.n_polynomials +
           sizeof(std::uint64_t) * low_words(m.most_ground_points) + 10 * alignof(N);
  };
  k.adjoint_rhs = [](const ModelView& m, const Stage<L>& s, const StageAdjoint<L>& d) {
    kernels::adjoint_rhs(m, StageView<N, L>::arguments(m, s, -1), adjoint_arguments<N>(d, nullptr));
  };
  k.adjoint_products = [](const ModelView& m, const Stage<L>& s, const StageAdjoint<L>& d) {
    typename View::Scratch scratch{s.scratch};
    const StageArgs<N> a = View::arguments(m, s, -1, scratch);
    kernels::adjoint_products(
        m, a, adjoint_arguments<N>(d, scratch.template take<LinkAdjoint<N>>(m.n_links)));
  };
  k.parameter_products = [](const ModelView& m, const Stage<L>& s, const StageAdjoint<L>& d,
                            int lone, Row<L>* out) {
    typename View::Scratch scratch{s.scratch};
    const StageArgs<N> a = View::arguments(m, s, lone, scratch);
    kernels::parameter_products(
        m, a, adjoint_arguments<N>(d, scratch.template take<LinkAdjoint<N>>(m.n_links)),
        View::view(out));
  };
  k.pull_back_poses = [](const ModelView& m, const Stage<L>& s, const Row<L>* q, const Row<L>* v,
                         const Row<L>* zero, std::byte* scratch, MotionCotangent<Row<L>>* links,
                         Row<L>* q_bar, Row<L>* v_bar, Row<L>* places) {
    kernels::pull_back_links(m, View::state_of(s, q, v, zero),
                             reinterpret_cast<LinkMotion<N>*>(scratch),
                             reinterpret_cast<MotionCotangent<N>*>(links), View::view(q_bar),
                             View::view(v_bar), View::view(places));
  };
}

template <class Arch>
void add_reading_pullback_kernels(KernelTable& k) {
  k.pull_back_links = [](const ModelView& m, const GroupState& s, std::byte* scratch,
                         MotionCotangent<LaneRow>* links, LaneRow* q_bar, LaneRow* v_bar,
                         LaneRow* places) {
    using N = Lanes<Arch>;
    using View = StageView<N, kGroup>;
    kernels::pull_back_links(m, at_state<N>(s), reinterpret_cast<LinkMotion<N>*>(scratch),
                             reinterpret_cast<MotionCotangent<N>*>(links), View::view(q_bar),
                             View::view(v_bar), View::view(places));
  };
  k.pullback_bytes = [](const ModelView& m) -> std::size_t {
    return sizeof(LinkMotion<Lanes<Arch>>) * std::size_t(m.n_links);
  };
  k.pull_back_field = [](const TactilePullback& a) { kernels::pull_back_field<Arch>(a); };
  k.field_tangent = [](const TactileTangent& a) { kernels::field_tangent<Arch>(a); };
}

}  // namespace tangere::kernels
