// SPDX-License-Identifier: Apache-2.0
// Tunnelling check: finds bodies that passed through each other between two states.
#pragma once

#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "engine/step/workspace.hpp"

namespace tangere {

/// The pairs of a model, and how thin their bodies are.
class TunnellingCheck {
 public:
  explicit TunnellingCheck(const CompiledModel& model);

  /// Returns the lanes in which some link moved far enough relative to another to pass through a
  /// body of a pair. `x`: displacements of the step, (nv). `way`: scratch, (nv).
  template <int L>
  [[nodiscard]] LaneBits far_movers(const kernels::Row<L>* x, kernels::Row<L>* way) const;

  /// Returns those of `lanes` in which no tunnelling is possible: at the end of the solve the links
  /// of every pair are farther apart than their displacement. Reads the results of kinematics().
  template <int L>
  [[nodiscard]] LaneBits out_of_reach(const BasicWorkspace<L>& w, LaneBits lanes) const;

  /// Whether in one lane, between these poses of the links, the centre of a body crossed the mid
  /// plane of one of its contact partners.
  template <int L>
  [[nodiscard]] bool tunnelled(const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& before,
                               const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& after,
                               int lane) const;

  /// Whether between two states of an environment, any number of steps apart, the centre of a
  /// convex body crossed the mid plane of another. `column`: the environment's column of the block,
  /// for sizes that vary.
  [[nodiscard]] bool changed_sides(const AlignedVector<kernels::LinkPose<kernels::Row<1>>>& before,
                                   const AlignedVector<kernels::LinkPose<kernels::Row<1>>>& after,
                                   const double* column) const;
  /// Returns a lower bound on the relative displacement before some body can change sides [m]: the
  /// least distance of a centre from the part of a mid plane that it would have to cross.
  [[nodiscard]] double clearance(const AlignedVector<kernels::LinkPose<kernels::Row<1>>>& poses,
                                 const double* column) const;

 private:
  /// Returns half the widths of a shape of this size along its axes [m]; zeros of a plane or a
  /// mesh.
  static kernels::Vec3<double> half_of(PrimitiveShape shape, const kernels::Vec3<double>& size);
  /// A convex body of a pair, and the middle of the other one.
  struct Slab {
    int link, other;             ///< -1: the world
    kernels::Frame<double> at;   ///< the body in its link
    kernels::Vec3<double> half;  ///< of the size in the scene
    PrimitiveShape shape;
    int size_row;                  ///< as in kernels::PairContact
    kernels::Vec3<double> middle;  ///< of the other body, in its link
    /// Half the largest width of the other body [m]; infinite if it is not convex, so that its
    /// middle may lie beside it.
    double other_wide;
    [[nodiscard]] bool other_convex() const { return other_wide < HUGE_VAL; }
    std::size_t link_pair_bound;
  };
  void add(int link, const kernels::Frame<double>& at, PrimitiveShape shape,
           const kernels::Vec3<double>& size, int size_row, int other,
           const kernels::Vec3<double>& middle, double other_wide);
  [[nodiscard]] static double within_of(const Slab& wall, double half);
  [[nodiscard]] static kernels::Vec3<double> half_in(const Slab& wall, const double* column);
  template <int L>
  [[nodiscard]] static kernels::Vec3<double> middle_in(
      const Slab& wall, const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& poses, int lane);
  [[nodiscard]] static bool came_through(const Slab& wall, const kernels::Vec3<double>& half,
                                         const kernels::Vec3<double>& from,
                                         const kernels::Vec3<double>& to);

  /// A ball around all slabs and centres of one link, in its axes.
  struct Ball {
    kernels::Vec3<double> centre{};
    double radius = 0;
  };
  /// Two links, half the smallest thickness of their bodies [m], and the balls of both.
  struct LinkPairBound {
    int link, other;
    double half;
    Ball link_ball{}, other_ball{};
  };
  void bound_slab_pairs();
  void bound_link_pairs();
  template <int L>
  [[nodiscard]] static bool stay_apart(
      const LinkPairBound& gate, const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& before,
      const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& after, int lane);

  /// A pair of links, and the largest sum of a slab's half diagonal and of the distances of slab
  /// and centre from the balls' centres (LinkPair) [m].
  struct RadiusBound {
    std::size_t link_pair;
    double radius_sum;
  };

  const CompiledModel& model_;
  std::vector<Slab> slabs_;
  std::vector<RadiusBound> bounds_;  ///< of every pair of links with a slab
  bool bounded_ = true;              ///< whether the arms of all links are known
  std::vector<int> sliders_;         ///< in q: the sliding dofs of links that others turn
  std::vector<LinkPairBound> link_pair_bounds_;
  std::map<std::pair<int, int>, std::size_t> bound_of_links_;  ///< (lower link, higher link)
  std::vector<double> arm_;  ///< (links) from a link's origin to any middle that it moves [m]
};

}  // namespace tangere
