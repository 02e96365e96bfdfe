// SPDX-License-Identifier: Apache-2.0
// Converts batched rows to the plain arrays of the tactile kernels.
#include "engine/sense/pad_reader.hpp"

#include <algorithm>

namespace tangere {

using kernels::kGroup;
using kernels::LaneRow;
using kernels::LinkPose;
using kernels::Touch;

namespace {

kernels::Vec3<double> lane_of(const kernels::Vec3<LaneRow>& a, int l) {
  return {a.x[l], a.y[l], a.z[l]};
}
kernels::Mat3<double> lane_of(const kernels::Mat3<LaneRow>& a, int l) {
  kernels::Mat3<double> c;
  for (int i = 0; i < 9; ++i) c.m[i / 3][i % 3] = a.m[i / 3][i % 3][l];
  return c;
}

}  // namespace

PadReader::PadReader(const Model& model)
    : model_(model),
      q_(std::size_t(model.nq())),
      v_(std::size_t(model.nv())),
      zero_(std::size_t(model.nv())),
      rates_(std::size_t(model.nv())),
      links_(kGroups * compiled(model).links.size()) {
  std::size_t tiles = 0, targets = 0;
  for (const CompiledSensor& s : compiled(model).sensors) {
    Pad pad{s.tiles(), {}};
    for (const int body : s.targets) {
      const CompiledBody& b = compiled(model).bodies[std::size_t(body)];
      pad.shapes.push_back({b.shape, {b.size.x, b.size.y, b.size.z}, b.grid});
    }
    tiles = std::max(tiles, std::size_t(s.n_tiles()));
    targets = std::max(targets, s.targets.size());
    pads_.push_back(std::move(pad));
  }
  active.resize(tiles);
  touches_.resize(kGroups * targets);
  group_touches_.resize(targets);
  one_.resize(targets);
  one_shapes_.resize(targets);
  sizes_.resize(std::size_t{3} * kGroups * targets);
}

void PadReader::move(const Batch& batch, int block, int group) {
  const CompiledModel& m = compiled(model_);
  const double* rows = batch.block(block);
  const auto load = [&](LaneRow* to, int first, int count) {
    for (int i = 0; i < count; ++i) {
      const double* from = kernels::row_of(rows, first + i, group);
      std::copy(from, from + kGroup, to[i].lane);
    }
  };
  load(q_.data(), m.layout.q, m.nq);
  load(v_.data(), m.layout.v, m.nv);
  kernels::active_kernels().link_poses(
      m.view, {q_.data(), v_.data(), zero_.data(), rates_.data(), rows, group},
      links_.data() + std::size_t(group) * m.links.size());
}

LinkPose<double> PadReader::link(int link, int group, int lane) const {
  if (link < 0) return {{kernels::diagonal(1.0), {0, 0, 0}}, kernels::zero6<double>()};
  const LinkPose<LaneRow>& p =
      links_[std::size_t(group) * compiled(model_).links.size() + std::size_t(link)];
  return {{lane_of(p.world.R, lane), lane_of(p.world.p, lane)},
          {lane_of(p.V.a, lane), lane_of(p.V.l, lane)}};
}

void PadReader::find_touches(const Batch& batch, int block, int group, int sensor) {
  const CompiledModel& m = compiled(model_);
  const CompiledSensor& s = m.sensors[std::size_t(sensor)];
  const LinkPose<LaneRow>* links = links_.data() + std::size_t(group) * m.links.size();
  const auto pose = [&](int link) { return link < 0 ? nullptr : links + link; };
  const auto parameter = [&](const kernels::Parameter& p, LaneRow& out) {
    if (p.row < 0) {
      std::fill(out.lane, out.lane + kGroup, p.value);
    } else {
      const double* from = kernels::row_of(batch.block(block), p.row, group);
      std::copy(from, from + kGroup, out.lane);
    }
  };
  for (std::size_t k = 0; k < s.targets.size(); ++k) {
    const CompiledBody& body = m.bodies[std::size_t(s.targets[k])];
    Touch<LaneRow>& touch = touches_[kGroups * k + std::size_t(group)];
    kernels::active_kernels().pad_touch(pose(s.link), s.pad, pose(body.link), body.frame, &touch);
    for (std::size_t i = 0; i < kCoefficients; ++i) parameter(s.parameters[i], touch.law[i]);
    for (int i = 0; i < 3 && body.size_row >= 0; ++i)
      parameter({0, body.size_row + i},
                sizes_[3 * (kGroups * k + std::size_t(group)) + std::size_t(i)]);
  }
}

const kernels::TouchShape* PadReader::shapes(int sensor, int group, int lane) {
  const CompiledModel& m = compiled(model_);
  const CompiledSensor& s = m.sensors[std::size_t(sensor)];
  const std::vector<kernels::TouchShape>& constant = pads_[std::size_t(sensor)].shapes;
  if (!s.sizes_vary) return constant.data();
  for (std::size_t k = 0; k < s.targets.size(); ++k) {
    one_shapes_[k] = constant[k];
    if (m.bodies[std::size_t(s.targets[k])].size_row < 0) continue;
    const LaneRow* const size = &sizes_[3 * (kGroups * k + std::size_t(group))];
    for (int i = 0; i < 3; ++i) one_shapes_[k].size[i] = size[i][lane];
  }
  return one_shapes_.data();
}

template <class Real>
kernels::TactileArgs<Real> PadReader::arguments(int sensor, int group, int lane) {
  const CompiledSensor& s = compiled(model_).sensors[std::size_t(sensor)];
  const Pad& pad = pads_[std::size_t(sensor)];
  for (std::size_t k = 0; k < s.targets.size(); ++k) {
    const Touch<LaneRow>& t = touches_[kGroups * k + std::size_t(group)];
    one_[k] = {lane_of(t.Q, lane), lane_of(t.c, lane), lane_of(t.omega, lane), lane_of(t.v, lane),
               transformed(t.law, [lane](const LaneRow& a) { return a[lane]; })};
  }
  return {&pad.tiles,
          s.law,
          static_cast<int>(s.targets.size()),
          shapes(sensor, group, lane),
          one_.data(),
          active.data(),
          nullptr,
          nullptr};
}

template <class Real>
kernels::TactileBlockArgs<Real> PadReader::block_arguments(int sensor, int group) {
  const CompiledSensor& s = compiled(model_).sensors[std::size_t(sensor)];
  const Pad& pad = pads_[std::size_t(sensor)];
  for (std::size_t k = 0; k < s.targets.size(); ++k)
    group_touches_[k] = &touches_[kGroups * k + std::size_t(group)];
  return {&pad.tiles,
          s.law,
          static_cast<int>(s.targets.size()),
          pad.shapes.data(),
          group_touches_.data(),
          nullptr};
}

template kernels::TactileArgs<float> PadReader::arguments(int, int, int);
template kernels::TactileArgs<double> PadReader::arguments(int, int, int);
template kernels::TactileBlockArgs<float> PadReader::block_arguments(int, int);
template kernels::TactileBlockArgs<double> PadReader::block_arguments(int, int);

}  // namespace tangere
