// SPDX-License-Identifier: Apache-2.0
// Relative difference of two sets of contact forces, per group of connected contacts.
#pragma once

#include <vector>

#include "engine/step/workspace.hpp"

namespace tangere {

class ContactForces {
 public:
  explicit ContactForces(const CompiledModel& model);

  [[nodiscard]] bool none() const { return contacts_.empty(); }
  /// Rows of all wrenches, six for each contact.
  [[nodiscard]] std::size_t rows() const { return 6 * contacts_.size(); }

  /// Returns the largest share, of all groups, in which the forces of one lane change:
  ///   √Σ (‖a - end‖² + ‖b - end‖²) / (max(‖start‖, ‖end‖) + a small share of the bodies' weight)
  /// The contacts of bodies that joints and contacts connect are one group, or two: those of links
  /// with sensors, and the others. A torque counts by the force that it is at the rim of the
  /// contact's points. Each argument: what contact_wrenches() writes.
  template <int L>
  [[nodiscard]] double change(const kernels::Row<L>* start, const kernels::Row<L>* end,
                              const kernels::Row<L>* a, const kernels::Row<L>* b, int lane) const;

  /// The lanes in which something touches.
  template <int L>
  [[nodiscard]] LaneBits touching(const kernels::Row<L>* wrenches) const;

  /// The lanes in which some contact of a component has a wrench in `a` and none in `b`.
  template <int L>
  [[nodiscard]] LaneBits parted(const kernels::Row<L>* a, const kernels::Row<L>* b,
                                int component) const;

 private:
  struct Contact {
    int group = 0;
    std::size_t row = 0;             ///< of its wrench
    kernels::Vec3<double> middle{};  ///< of its points, in the axes of its first link [m]
    double per_length = 0;           ///< 1/radius of a ball around `middle` that holds them [1/m]
  };
  template <int L>
  double squared_distance(const kernels::Row<L>* a, const kernels::Row<L>* b, int group,
                          int lane) const;

  std::vector<Contact> contacts_;   ///< by group; in it pairs of links, then grounded links
  std::vector<std::size_t> begin_;  ///< (groups + 1) first contact of each
  std::vector<double> floor_;       ///< (groups) [N]
};

}  // namespace tangere
