// SPDX-License-Identifier: Apache-2.0
// Every contact that remembers gets a range of point numbers. The memory of an environment is
// sorted by them.
#include "engine/model/compile_memories.hpp"

#include <cmath>

#include "engine/model/compiled_model.hpp"

namespace tangere {

using kernels::Vec3;

namespace {

bool remembers(const kernels::ContactParameters& p) { return p.ks.value != 0 || p.ks.row >= 0; }

/// Keeps points (n, 3) as rows of coordinates that vectors can read.
void keep_places(CompiledModel& m, kernels::RememberingContact& of) {
  constexpr int kLanes = kernels::kGroup;
  const int n = of.contact.n_points;
  of.stride = (n + kLanes - 1) / kLanes * kLanes;
  AlignedVector<double> rows(std::size_t(3 * of.stride), kernels::kFarAway);
  for (int k = 0; k < n; ++k)
    for (int c = 0; c < 3; ++c) rows[std::size_t(c * of.stride + k)] = of.contact.points[3 * k + c];
  m.tile_storage.push_back(std::move(rows));
  of.places = m.tile_storage.back().data();
}

int add(CompiledModel& m, kernels::RememberingContact of) {
  of.first = m.remembering_points;
  m.remembering_points += of.contact.n_points;
  m.memories.push_back(of);
  return static_cast<int>(m.memories.size()) - 1;
}

void add_grounds(CompiledModel& m) {
  int number = kCoefficients * (static_cast<int>(m.pairs.size()) - 1);
  for (kernels::GroundContact& g : m.grounds) {
    number += kCoefficients;
    if (!remembers(g.parameters)) continue;
    kernels::RememberingContact of;
    of.number = number;
    of.ground = true;
    of.radius = g.radius;
    of.radius_row = g.radius_row;
    of.contact = {};
    of.contact.link1 = g.link;
    of.contact.link2 = -1;
    of.contact.frame2 = ground_frame(m.view.ground_point, m.view.ground_normal);
    of.contact.shape = PrimitiveShape::plane;
    of.contact.law = g.law;
    of.contact.ramp = g.ramp;
    of.contact.parameters = g.parameters;
    of.contact.points = g.points;
    of.contact.n_points = g.n_points;
    of.contact.body1 = g.body;
    of.contact.body2 = -1;
    keep_places(m, of);
    g.memory = add(m, of);
    g.first_anchor = m.ground_anchors;
    m.ground_anchors += g.n_points;
  }
}

}  // namespace

kernels::Frame<double> ground_frame(const Vec3<double>& point, const Vec3<double>& normal) {
  const Vec3<double> aside =
      std::abs(normal.x) < 0.6 ? Vec3<double>{1, 0, 0} : Vec3<double>{0, 1, 0};
  Vec3<double> x = aside - dot(aside, normal) * normal;
  x = (1 / std::sqrt(dot(x, x))) * x;
  const Vec3<double> y = cross(normal, x);
  return {{{{x.x, y.x, normal.x}, {x.y, y.y, normal.y}, {x.z, y.z, normal.z}}}, point};
}

void compile_memories(CompiledModel& m) {
  for (std::size_t k = 0; k < m.pairs.size(); ++k) {
    kernels::PairContact& pair = m.pairs[k];
    if (!remembers(pair.parameters)) continue;
    kernels::RememberingContact of;
    of.contact = pair;
    of.pair = static_cast<int>(k);
    of.number = kCoefficients * of.pair;
    pair.memory = add(m, of);
  }
  add_grounds(m);
}

}  // namespace tangere
