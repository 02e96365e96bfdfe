// SPDX-License-Identifier: Apache-2.0
// Tangents of links from the root outward, in double, then of fields across points. Let δ = (θ; ρ)
// be a link's displacement and δV the change of its twist, both in its axes, and V_p its parent's
// twist there:
//   δ = X δ_p + S q̇;  δV = X δV_p + V_p × (S q̇) + S v̇;      ε = Ad δ₂ - δ₁,
//       δW = Ad δV₂ - δV₁ - Z × ε  in a pad's axes
#include "engine/derivative/field_tangent.hpp"

#include <algorithm>
#include <numeric>

#include "engine/sense/dense_tiles.hpp"
#include "engine/sense/imperfect_field.hpp"
#include "engine/sense/pad_reader.hpp"

namespace tangere {

using kernels::Frame;
using kernels::JointKind;
using kernels::kBlock;
using kernels::kGroup;
using kernels::Link;
using kernels::LinkPose;
using kernels::Vec3;
using kernels::Vec6;

namespace {

struct LinkTangent {
  Vec6<double> pose, twist;
};

/// Returns S x of a joint.
Vec6<double> along_joint(const Link& link, std::span<const double> x) {
  const auto v = std::size_t(link.v);
  const Vec3<double> sum =
      kernels::dofs(link.kind) == 1 ? x[v] * link.axis : Vec3<double>{x[v], x[v + 1], x[v + 2]};
  const Vec3<double> none = {0, 0, 0};
  return kernels::slides(link.kind) ? Vec6<double>{none, sum} : Vec6<double>{sum, none};
}

}  // namespace

struct FieldTangent::Impl {
  Model model;
  PadReader reader;
  const Batch* batch = nullptr;
  int block = 0, lane = 0;
  int met_group = -1, met_sensor = -1;  ///< group and sensor of the shapes that the reader holds
  std::vector<LinkTangent> links;
  std::vector<kernels::TouchTangent> touches;
  ImperfectField imperfections;
  std::vector<double> whole, ideal;  ///< (points, 3) of an imperfect sensor
  std::vector<int> all;              ///< its tiles
  std::vector<double> tile_values;   ///< (tiles, 3, 64)

  explicit Impl(const Model& m)
      : model(m), reader(m), links(compiled(m).links.size()), imperfections(m) {
    std::size_t targets = 0;
    for (const CompiledSensor& s : compiled(m).sensors) {
      targets = std::max(targets, s.targets.size());
      if (!s.imperfect) continue;
      whole.resize(std::max(whole.size(), 3 * std::size_t(s.points())));
      all.resize(std::max(all.size(), std::size_t(s.n_tiles())));
    }
    touches.resize(targets);
    ideal.resize(whole.size());
    tile_values.resize(all.size() * 3 * kernels::kTactileTile);
    std::iota(all.begin(), all.end(), 0);
  }

  /// Computes how the ideal field of a sensor changes in the tiles. Its touches were found.
  void ideal_field(const CompiledSensor& s, std::span<const int> tiles, std::span<double> change) {
    const auto a = reader.arguments<double>(s.number, lane / kGroup, lane % kGroup);
    for (std::size_t k = 0; k < s.targets.size(); ++k)
      touches[k] = against(s, compiled(model).bodies[std::size_t(s.targets[k])]);
    kernels::active_kernels().field_tangent({a.pad, a.law, a.n_touches, a.shapes, a.touches,
                                             touches.data(), static_cast<int>(tiles.size()),
                                             tiles.data(), change.data()});
  }

  /// The same for the reading of an imperfect sensor.
  void imperfect_field(const CompiledSensor& s, std::span<const int> tiles,
                       std::span<double> change) {
    const kernels::PadTiles pad = s.tiles();
    const auto every = std::span(all).first(std::size_t(pad.tiles()));
    const auto field = std::span(whole).first(3 * std::size_t(s.points()));
    ideal_field(s, every, tile_values);
    for (const int tile : every)
      expand_tile<3>(pad, tile, tile_values.data() + 3 * kernels::kTactileTile * tile,
                     field.data());
    read_ideal(reader, s, reader.arguments<double>(s.number, lane / kGroup, lane % kGroup), ideal);
    imperfections.push_forward(s, key_of(*batch, kBlock * block + lane),
                               std::span(ideal).first(field.size()), field);
    for (std::size_t k = 0; k < tiles.size(); ++k)
      gather_tile(pad, tiles[k], field.data(), change.data() + 3 * kernels::kTactileTile * k);
  }

  [[nodiscard]] LinkPose<double> pose(int link) const {
    return reader.link(link, lane / kGroup, lane % kGroup);
  }
  [[nodiscard]] LinkTangent tangent(int link) const {
    return link < 0 ? LinkTangent{kernels::zero6<double>(), kernels::zero6<double>()}
                    : links[std::size_t(link)];
  }

  /// Tangent of one shape against a pad.
  [[nodiscard]] kernels::TouchTangent against(const CompiledSensor& s,
                                              const CompiledBody& body) const {
    const LinkPose<double> one = pose(s.link), two = pose(body.link);
    const LinkTangent first = tangent(s.link), second = tangent(body.link);
    const Frame<double> second_in_first = relative(one.world, two.world);
    const auto in_pad = [&](const Vec6<double>& motion2, const Vec6<double>& motion1) {
      return motion_to_child(s.pad, motion_to_parent(second_in_first, motion2) - motion1);
    };
    const Vec6<double> Z = motion_to_child(s.pad, motion_to_parent(second_in_first, two.V));
    const Vec6<double> displacement = in_pad(second.pose, first.pose);
    return {displacement, in_pad(second.twist, first.twist) - cross_motion(Z, displacement)};
  }
};

FieldTangent::FieldTangent(const Model& model) : impl_(std::make_unique<Impl>(model)) {}
FieldTangent::~FieldTangent() = default;
FieldTangent::FieldTangent(FieldTangent&&) noexcept = default;
FieldTangent& FieldTangent::operator=(FieldTangent&&) noexcept = default;

void FieldTangent::place(const Batch& batch, int block) {
  impl_->batch = &batch;
  impl_->block = block;
  impl_->met_group = impl_->met_sensor = -1;
  for (int g = 0; g < kBlock / kGroup; ++g) impl_->reader.move(batch, block, g);
}

void FieldTangent::move(int lane, std::span<const double> q, std::span<const double> v) {
  Impl& i = *impl_;
  i.lane = lane;
  const CompiledModel& m = compiled(i.model);
  for (std::size_t k = 0; k < m.links.size(); ++k) {
    const Link& link = m.links[k];
    const LinkPose<double> own = i.pose(static_cast<int>(k)), parent = i.pose(link.parent);
    const LinkTangent before = i.tangent(link.parent);
    const Frame<double> local = relative(parent.world, own.world);
    const Vec6<double> moved = along_joint(link, q);
    i.links[k] = {motion_to_child(local, before.pose) + moved,
                  motion_to_child(local, before.twist) +
                      cross_motion(motion_to_child(local, parent.V), moved) + along_joint(link, v)};
  }
}

void FieldTangent::field(int sensor, std::span<const int> tiles, std::span<double> change) {
  Impl& i = *impl_;
  check_has_no_lag(i.model, sensor);
  const CompiledModel& m = compiled(i.model);
  const CompiledSensor& s = m.sensors[std::size_t(sensor)];
  if (s.elastic)
    throw InputError("tactile sensor '" + m.scene.sensors[std::size_t(sensor)].name +
                     "' has ks: its field has no tangent by one state alone; expected ks=\"0\"");
  if (s.layer)
    throw InputError("tactile sensor '" + m.scene.sensors[std::size_t(sensor)].name +
                     "' has a layer or a table: its field has no tangent here; expected springs");
  const int group = i.lane / kGroup;
  if (i.met_group != group || i.met_sensor != sensor)
    i.reader.find_touches(*i.batch, i.block, group, sensor);
  i.met_group = group, i.met_sensor = sensor;
  if (s.imperfect) {
    i.imperfect_field(s, tiles, change);
  } else {
    i.ideal_field(s, tiles, change);
  }
}

}  // namespace tangere
