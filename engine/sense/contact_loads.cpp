// SPDX-License-Identifier: Apache-2.0
// The contact law at every point that touches. Derivatives go through dual numbers, one direction
// after the other.
#include "engine/sense/contact_loads.hpp"

#include <algorithm>

#include "engine/model/stretched_point.hpp"
#include "engine/step/shear_lane.hpp"
#include "kernels/shear/update_shear_state.hpp"
#include "kernels/step/faces.hpp"

namespace tangere {

using kernels::Frame;
using kernels::kBlock;
using kernels::kGroup;
using kernels::PairContact;
using kernels::Vec3;
using kernels::Vec6;
using D = kernels::Dual<double>;

namespace {

/// Number k of a vector of three or six.
template <class V>
D& number(V& of, std::size_t k) {
  return reinterpret_cast<D*>(&of)[k];
}
Vec3<D> still(const Vec3<double>& x) { return {x.x, x.y, x.z}; }

PairAt<D> still(const PairAt<double>& at) {
  PairAt<D> out{};
  out.link2_in_1 = kernels::broadcast<D>(at.link2_in_1);
  out.twist = {still(at.twist.a), still(at.twist.l)};
  out.law = {transformed(at.law, [](double x) { return D(x); }), at.law.law, at.law.ramp};
  out.size = still(at.size);
  out.faces = at.faces;
  return out;
}

/// Displaces link 2 by number k of (θ; ρ) in link 1's axes, about its origin.
void displace(const Frame<double>& at, std::size_t k, Frame<D>& out) {
  Vec6<double> by{};
  (&by.a.x)[k] = 1;
  const kernels::Mat3<double> turned = kernels::skew(by.a) * at.R;
  const Vec3<double> moved = by.l + cross(by.a, at.p);
  for (int i = 0; i < 9; ++i) out.R.m[i / 3][i % 3].epsilon = turned.m[i / 3][i % 3];
  out.p.x.epsilon = moved.x, out.p.y.epsilon = moved.y, out.p.z.epsilon = moved.z;
}

double along(const std::array<D, 3>& loads, const PadLoads& bar) {
  return bar[0] * loads[0].epsilon + bar[1] * loads[1].epsilon + bar[2] * loads[2].epsilon;
}

}  // namespace

void choose_faces(const PairContact& pair, PairAt<double>& at) {
  at.faces = {0, 0, 0};
  if (!pair.faced) return;
  at.faces = kernels::chosen_faces(pair, compose(at.link2_in_1, pair.frame2), at.size);
}

std::vector<int> touching_points(const PairContact& pair, const PairAt<double>& at) {
  const Frame<double> shape = compose(at.link2_in_1, pair.frame2);
  double pose[12];
  for (int i = 0; i < 9; ++i) pose[i] = shape.R.m[i / 3][i % 3];
  pose[9] = shape.p.x, pose[10] = shape.p.y, pose[11] = shape.p.z;
  AlignedVector<double> places, weights;
  std::vector<int> index;
  for (int room = 8 * kGroup;; room *= 2) {
    places.resize(3 * std::size_t(room));
    weights.resize(pair.weights == nullptr ? 0 : std::size_t(room));
    index.resize(std::size_t(room));
    const int count = kernels::active_kernels().find_candidates(
        {&pair, at.size, pose, kernels::kTouchMargin, places.data(), room, at.faces, index.data(),
         pair.weights == nullptr ? nullptr : weights.data()});
    if (count > room - kGroup) continue;
    index.resize(std::size_t(count));
    return index;
  }
}

template <class N>
std::array<N, 3> loads_of_pair(const CompiledSensor& sensor, const PairContact& pair,
                               const PairAt<N>& at, std::span<const PairPoint<N>> points) {
  const Frame<N> shape = compose(at.link2_in_1, kernels::broadcast<N>(pair.frame2));
  const kernels::LoadedTouch<N> t = {shape.R, shape.p, at.twist.a, at.twist.l,
                                     at.law,  N(0.0),  false};
  Vec6<N> wrench = kernels::zero6<N>();
  kernels::with_touched<N>(
      pair, at.size, kernels::broadcast<N>(at.faces), [&](const auto& touched) {
        for (const PairPoint<N>& p : points) {
          kernels::LawParameters<N> law = t.law;
          if (pair.weights != nullptr) kernels::set_weighted(t.law, N(p.weight), law);
          const auto add = [&](const kernels::PointContact<N>& found) {
            wrench += {cross(found.x2, found.force), found.force};
          };
          if (pair.memory < 0)
            add(kernels::point_contact(touched, law, t.Q, t.c, t.omega, t.v, p.xi));
          else
            add(kernels::meet_elastic(touched, t, law, p.xi,
                                      kernels::recalled(touched, t, p.xi, p.stretched)));
        }
      });
  const Frame<N> pad = kernels::broadcast<N>(sensor.pad);
  const Vec6<N> in_pad = pair.body1 == sensor.body
                             ? wrench_to_child(pad, wrench)
                             : wrench_to_child(compose(at.link2_in_1, pad), -wrench);
  const N o(sensor.layer->outward);
  return {-(o * in_pad.l.z), o * in_pad.a.y, -(o * in_pad.a.x)};
}
template std::array<double, 3> loads_of_pair(const CompiledSensor&, const PairContact&,
                                             const PairAt<double>&,
                                             std::span<const PairPoint<double>>);
template std::array<D, 3> loads_of_pair(const CompiledSensor&, const PairContact&, const PairAt<D>&,
                                        std::span<const PairPoint<D>>);

PadLoads ContactLoads::read(const PadReader& reader, const Batch& batch, int environment,
                            const CompiledSensor& sensor) {
  model_ = &compiled(batch.model());
  sensor_ = &sensor;
  state_ = &batch.shear_state(environment);
  touching_.clear();
  const int block = environment / kBlock, group = environment % kBlock / kGroup,
            lane = environment % kGroup;
  const auto value = [&](const kernels::Parameter& p) {
    return p.row < 0 ? p.value : kernels::row_of(batch.block(block), p.row, group)[lane];
  };
  PadLoads sum{};
  for (const int k : sensor.contacts) {
    const PairContact& pair = model_->pairs[std::size_t(k)];
    const kernels::LinkPose<double> one = reader.link(pair.link1, group, lane),
                                    two = reader.link(pair.link2, group, lane);
    Touching of{k, {}, {}, {}};
    of.at.link2_in_1 = relative(one.world, two.world);
    of.at.twist = motion_to_parent(of.at.link2_in_1, two.V) - one.V;
    of.at.law = {transformed(pair.parameters, value), pair.law, pair.ramp};
    of.at.size = pair.size;
    for (int i = 0; i < 3 && pair.size_row >= 0; ++i)
      (&of.at.size.x)[i] = value({0, pair.size_row + i});
    choose_faces(pair, of.at);
    of.index = touching_points(pair, of.at);
    if (of.index.empty()) continue;
    for (const int i : of.index) {
      const double* const xi = pair.points + 3 * i;
      PairPoint<double> p{{xi[0], xi[1], xi[2]}, {0, 0, 0}, 1};
      if (pair.weights != nullptr) p.weight = pair.weights[i];
      of.points.push_back(p);
    }
    if (pair.memory >= 0) {
      const kernels::ShearSpringContact& springs = model_->shear_springs[std::size_t(pair.memory)];
      for (std::size_t i = 0; i < of.index.size(); ++i)
        for (const ShearEntry& e : entries_of(*state_, {springs.first + of.index[i], 1}))
          of.points[i].stretched = {e.s[0], e.s[1], e.s[2]};
    }
    const std::array<double, 3> own = loads_of_pair<double>(sensor, pair, of.at, of.points);
    for (std::size_t i = 0; i < 3; ++i) sum[i] += own[i];
    touching_.push_back(std::move(of));
  }
  return sum;
}

ContactLoads::Share ContactLoads::share_of(const Touching& of, const PadLoads& bar,
                                           bool numbers) const {
  PairContact pair = model_->pairs[std::size_t(of.pair)];
  PairAt<D> at = still(of.at);
  std::vector<PairPoint<D>> points;
  for (const PairPoint<double>& p : of.points)
    points.push_back({still(p.xi), still(p.stretched), p.weight});
  const auto change = [&] { return along(loads_of_pair<D>(*sensor_, pair, at, points), bar); };
  Share out{of.pair, {}, {0, 0, 0}};
  for (std::size_t k = 0; k < 6; ++k) {
    displace(of.at.link2_in_1, k, at.link2_in_1);
    (&out.motion.displacement.a.x)[k] = change();
  }
  at.link2_in_1 = kernels::broadcast<D>(of.at.link2_in_1);
  const auto by = [&](D& x) {
    x.epsilon = 1;
    const double found = change();
    x.epsilon = 0;
    return found;
  };
  for (std::size_t k = 0; k < 6; ++k) (&out.motion.twist.a.x)[k] = by(number(at.twist, k));
  if (!numbers) return out;
  for (std::size_t k = 0; k < kCoefficients; ++k) out.motion.law[k] = by(at.law[k]);
  for (std::size_t k = 0; k < kernels::kSizeNumbers; ++k) {
    (&out.motion.size.x)[k] = by(number(at.size, k));
    double size[kernels::kSizeNumbers] = {};
    size[k] = 1;
    pair.ball_tangent = pair.ball_radius > 0 ? size[0] : 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3<double> moves =
          stretched_point(model_->solids[std::size_t(pair.body1)], size, of.points[i].xi);
      points[i].xi.x.epsilon = moves.x, points[i].xi.y.epsilon = moves.y;
      points[i].xi.z.epsilon = moves.z;
    }
    (&out.stretch.x)[k] = change();
    for (std::size_t i = 0; i < points.size(); ++i) points[i].xi = still(of.points[i].xi);
    pair.ball_tangent = 0;
  }
  return out;
}

/// Adds the cotangents of elastic displacements that are stored.
void ContactLoads::pull_back_memory(const Touching& of, const PadLoads& bar,
                                    std::span<double> memory) const {
  const PairContact& pair = model_->pairs[std::size_t(of.pair)];
  if (pair.memory < 0) return;
  const int first = model_->shear_springs[std::size_t(pair.memory)].first;
  const PairAt<D> at = still(of.at);
  for (std::size_t i = 0; i < of.index.size(); ++i)
    for (const ShearEntry& e : entries_of(*state_, {first + of.index[i], 1})) {
      const auto entry = std::size_t(&e - state_->data());
      PairPoint<D> p{still(of.points[i].xi), still(of.points[i].stretched), of.points[i].weight};
      for (std::size_t k = 0; k < 3; ++k) {
        number(p.stretched, k).epsilon = 1;
        memory[3 * entry + k] += along(loads_of_pair<D>(*sensor_, pair, at, {&p, 1}), bar);
        number(p.stretched, k).epsilon = 0;
      }
    }
}

std::span<const ContactLoads::Share> ContactLoads::pull_back(const PadLoads& bar, bool numbers,
                                                             std::span<double> memory) {
  shares_.clear();
  if (bar == PadLoads{}) return shares_;
  for (const Touching& of : touching_) {
    shares_.push_back(share_of(of, bar, numbers));
    pull_back_memory(of, bar, memory);
  }
  return shares_;
}

}  // namespace tangere
