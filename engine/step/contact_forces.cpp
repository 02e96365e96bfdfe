// SPDX-License-Identifier: Apache-2.0
// Groups contacts, and sums over them. Sensor contacts form their own group, because their forces
// can be small beside load-bearing ones. The others count because they move sensed bodies.
#include "engine/step/contact_forces.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {

using kernels::Row;
using kernels::Vec3;

namespace {

// Floors of the scale, as shares of the bodies' weight: of all contacts, and of contacts without
// sensors in components with sensors. Otherwise a light ball that settles on stiff ground under a
// heavy pad would determine the substeps.
constexpr double kGraze = 0.01, kUnsensed = 0.05;

/// A ball around some points.
struct Ball {
  Vec3<double> middle{};
  double radius = 0;
};

/// Returns a ball that holds all balls of a list, around the mean of their middles.
Ball around(const std::vector<Ball>& balls) {
  Ball all;
  for (const Ball& b : balls) all.middle += (1.0 / static_cast<double>(balls.size())) * b.middle;
  for (const Ball& b : balls) {
    const Vec3<double> way = b.middle - all.middle;
    all.radius = std::max(all.radius, std::sqrt(dot(way, way)) + b.radius);
  }
  return all;
}

}  // namespace

ContactForces::ContactForces(const CompiledModel& m) : floor_(2 * std::size_t(m.components())) {
  std::vector<int> component(std::size_t(m.nv));
  for (int c = 0; c < m.components(); ++c)
    for (const int i : dofs_of_component(m, c)) component[std::size_t(i)] = c;
  const auto component_of = [&](int link) {
    return component[std::size_t(m.links[std::size_t(link)].v)];
  };
  const double gravity = std::sqrt(dot(m.view.gravity, m.view.gravity));
  std::vector<char> senses(std::size_t(m.components()));
  for (const CompiledSensor& s : m.sensors)
    if (s.link >= 0) senses[std::size_t(component_of(s.link))] = 1;
  for (int i = 0; i < static_cast<int>(m.links.size()); ++i) {
    const std::size_t c = std::size_t(component_of(i));
    const double weight = gravity * m.links[std::size_t(i)].mass;
    floor_[2 * c] += kGraze * weight;
    floor_[2 * c + 1] += kUnsensed * weight;
  }
  const auto is_sensed = [&](int link) {
    return std::ranges::any_of(m.sensors, [&](const CompiledSensor& s) { return s.link == link; });
  };
  const auto add = [&](int link1, int link2, const std::vector<Ball>& points) {
    const int c = component_of(link1 < 0 ? link2 : link1);
    const bool unsensed = senses[std::size_t(c)] != 0 && !is_sensed(link1) && !is_sensed(link2);
    const Ball ball = around(points);
    contacts_.push_back({2 * c + (unsensed ? 1 : 0), 6 * contacts_.size(), ball.middle,
                         ball.radius > 0 ? 1 / ball.radius : 0});
  };
  for (const kernels::LinkPair& links : m.link_pairs) {
    std::vector<Ball> points;
    for (int i = links.first; i < links.first + links.count; ++i) {
      const kernels::PairContact& pair = m.pairs[std::size_t(m.pair_order[std::size_t(i)])];
      points.push_back({pair.middle, pair.extent});
    }
    add(links.link1, links.link2, points);
  }
  for (const kernels::GroundedLink& grounded : m.grounded) {
    std::vector<Ball> points;
    for (int i = grounded.first; i < grounded.first + grounded.count; ++i) {
      const kernels::GroundContact& ground = m.grounds[std::size_t(m.ground_order[std::size_t(i)])];
      points.push_back({ground.middle, ground.extent});
    }
    add(grounded.link, -1, points);
  }
  std::ranges::stable_sort(contacts_, {}, &Contact::group);
  for (int group = 0; group <= static_cast<int>(floor_.size()); ++group)
    begin_.push_back(std::size_t(std::ranges::lower_bound(contacts_, group, {}, &Contact::group) -
                                 contacts_.begin()));
}

/// `b` null: zero.
template <int L>
double ContactForces::squared_distance(const Row<L>* a, const Row<L>* b, int group,
                                       int lane) const {
  double sum = 0;
  for (std::size_t k = begin_[std::size_t(group)]; k < begin_[std::size_t(group) + 1]; ++k) {
    const Contact& contact = contacts_[k];
    const auto number = [&](std::size_t i) {
      return a[contact.row + i][lane] - (b == nullptr ? 0 : b[contact.row + i][lane]);
    };
    const Vec3<double> force = {number(3), number(4), number(5)};
    const Vec3<double> torque =
        Vec3<double>{number(0), number(1), number(2)} - cross(contact.middle, force);
    sum += dot(force, force) + contact.per_length * contact.per_length * dot(torque, torque);
  }
  return sum;
}

template <int L>
double ContactForces::change(const Row<L>* start, const Row<L>* end, const Row<L>* a,
                             const Row<L>* b, int lane) const {
  double worst = 0;
  for (int group = 0; group < static_cast<int>(floor_.size()); ++group) {
    const double moved =
        squared_distance(a, end, group, lane) + squared_distance(b, end, group, lane);
    if (moved == 0) continue;
    const double scale = std::sqrt(std::max(squared_distance<L>(start, nullptr, group, lane),
                                            squared_distance<L>(end, nullptr, group, lane))) +
                         floor_[std::size_t(group)];
    const double share = std::sqrt(moved) / scale;
    if (std::isnan(share)) return share;
    worst = std::max(worst, share);
  }
  return worst;
}

template <int L>
LaneBits ContactForces::touching(const Row<L>* wrenches) const {
  LaneBits lanes = 0;
  for (std::size_t i = 0; i < rows(); ++i)
    for (int l = 0; l < L; ++l)
      if (wrenches[i][l] != 0) lanes |= 1U << l;
  return lanes;
}

template <int L>
LaneBits ContactForces::parted(const Row<L>* a, const Row<L>* b, int component) const {
  LaneBits lanes = 0;
  for (std::size_t k = begin_[2 * std::size_t(component)];
       k < begin_[2 * std::size_t(component) + 2]; ++k) {
    LaneBits in_a = 0, in_b = 0;
    for (std::size_t i = contacts_[k].row; i < contacts_[k].row + 6; ++i)
      for (int l = 0; l < L; ++l) {
        if (a[i][l] != 0) in_a |= 1U << l;
        if (b[i][l] != 0) in_b |= 1U << l;
      }
    lanes |= in_a & ~in_b;
  }
  return lanes;
}

#define TANGERE_FOR_LANES(L)                                                         \
  template double ContactForces::change(const Row<L>*, const Row<L>*, const Row<L>*, \
                                        const Row<L>*, int) const;                   \
  template LaneBits ContactForces::touching(const Row<L>*) const;                    \
  template LaneBits ContactForces::parted(const Row<L>*, const Row<L>*, int) const;
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES

}  // namespace tangere
