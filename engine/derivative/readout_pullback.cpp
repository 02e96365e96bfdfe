// SPDX-License-Identifier: Apache-2.0
// Fields across points, then wrenches up the tree in lanes (docs/gradients.md).
//
// For a shape in pad axes, with Z = Ad V₂, W = Z - V₁, ε = Ad δ₂ - δ₁, δW = Ad δV₂ - δV₁ - Z × ε:
//   ε̄ += Z ×* W̄;  δ̄₂ = Adᵀ ε̄, δ̄₁ = -ε̄, V̄₂ = Adᵀ W̄, V̄₁ = -W̄
#include "engine/derivative/readout_pullback.hpp"

#include <algorithm>
#include <array>
#include <memory>

#include "engine/derivative/link_cotangents.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/scene/frames.hpp"
#include "engine/sense/dense_tiles.hpp"
#include "engine/sense/elastic_field.hpp"
#include "engine/sense/imperfect_field.hpp"
#include "engine/sense/layer_reading.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/sense/past_states.hpp"
#include "engine/sense/picture_reading.hpp"

namespace tangere {

using kernels::Frame;
using kernels::kBlock;
using kernels::kGroup;
using kernels::LaneRow;
using kernels::LinkPose;
using kernels::Vec3;
using kernels::Vec6;

namespace {

constexpr int kGroups = kBlock / kGroup;
constexpr int kStiffness = 0, kDamping = 3;  // coefficients of the normal force

}  // namespace

struct ReadoutPullback::Impl {
  Model model;
  PadReader reader;
  const Batch* batch = nullptr;
  int block = 0;
  std::vector<int> met;  ///< (kGroups) sensor whose shapes the reader holds; -1: none
  std::array<AlignedVector<kernels::MotionCotangent<LaneRow>>, kGroups> links;
  std::array<bool, kGroups> used{};
  AlignedVector<LaneRow> rows;  ///< q, v, zeros, rates, q̄, v̄, places of one group
  AlignedVector<CacheLine> scratch;
  std::vector<kernels::TouchCotangent<double>> touches;
  std::vector<kernels::Touch<double>> frictionless;
  std::vector<int> tiles;  ///< tiles of a whole field that are not zero
  std::vector<double> tile_values;
  AlignedVector<double> own;  ///< (tiles, kPointNumbers, 64)
  ImperfectField imperfections;
  ElasticField elastic;
  LayerReading layered;
  std::vector<double> layer_bar;
  /// (sensors) of those of which a picture was pulled back.
  std::vector<std::unique_ptr<PictureReading<double>>> pictures;
  std::array<std::vector<double>, kBlock> memory;  ///< cotangents of the shear state
  std::vector<double> whole, ideal, expanded;      ///< (points, 3) of one sensor
  /// For each lane, (1 + past states, 2, nv) cotangents of the present and of earlier states, by
  /// sensors with lag; empty: zeros.
  std::array<std::vector<double>, kBlock> lagging;
  struct Past;
  std::unique_ptr<Past> past;  ///< made when a sensor with lag is pulled back

  explicit Impl(const Model& m)
      : model(m), reader(m), met(kGroups, -1), imperfections(m), elastic(m) {
    const CompiledModel& c = compiled(m);
    for (auto& l : links) l.resize(c.links.size());
    rows.resize(std::size_t(c.nq + 5 * c.nv) + kernels::kPlaceNumbers * c.links.size());
    std::size_t bytes = 0, targets = 0;
    for (const kernels::KernelTable* t : kernels::available_kernels())
      bytes = std::max(bytes, t->pullback_bytes(c.view));
    for (const CompiledSensor& s : c.sensors) {
      targets = std::max(targets, s.targets.size());
      whole.resize(std::max(whole.size(), 3 * std::size_t(s.points())));
    }
    ideal.resize(whole.size());
    expanded.resize(whole.size());
    scratch.resize(cache_lines(bytes));
    touches.resize(targets);
  }

  /// Returns null for the world, link -1.
  kernels::MotionCotangent<LaneRow>* link(int group, int link) {
    return link < 0 ? nullptr : &links[std::size_t(group)][std::size_t(link)];
  }

  /// Adds the derivatives by the points' own numbers, turned from pad axes to the body's.
  void hand_on_points(const CompiledSensor& s, std::span<const int> touched,
                      std::span<double> points, bool pressure) const {
    const kernels::PadTiles pad = s.tiles();
    const kernels::Mat3<double> turn =
        transpose(compiled(model).bodies[std::size_t(s.body)].frame.R) * s.pad.R;
    for (std::size_t i = 0; i < touched.size(); ++i)
      for_points_of_tile(pad, touched[i], [&](int slot, int point) {
        const double* from = &own[i * kPointNumbers * kernels::kTactileTile + std::size_t(slot)];
        const auto number = [&](int k) { return from[k * kernels::kTactileTile]; };
        const Vec3<double> place = turn * Vec3<double>{number(0), number(1), number(2)};
        double* to = &points[std::size_t(point * kPointNumbers)];
        to[0] += place.x, to[1] += place.y, to[2] += place.z;
        for (int k = 0; k < kPointCoefficients; ++k)
          if (!pressure || k == kStiffness || k == kDamping) to[3 + k] += number(3 + k);
      });
  }

  void find_touches(int group, int sensor) {
    if (met[std::size_t(group)] == sensor) return;
    reader.find_touches(*batch, block, group, sensor);
    met[std::size_t(group)] = sensor;
  }

  /// Fills `tiles` and `tile_values` with those of a whole field that are not zero.
  void gather(const CompiledSensor& s, std::span<const double> field) {
    const kernels::PadTiles pad = s.tiles();
    tiles.clear();
    tile_values.resize(std::size_t(pad.tiles()) * 3 * kernels::kTactileTile);
    for (int tile = 0; tile < pad.tiles(); ++tile)
      if (gather_tile(pad, tile, field.data(),
                      tile_values.data() + 3 * kernels::kTactileTile * tiles.size()))
        tiles.push_back(tile);
  }

  /// The kernels' arguments for a lane whose touches were found. A pressure leaves friction out.
  kernels::TactileArgs<double> arguments(const CompiledSensor& s, int lane, bool pressure) {
    auto a = reader.arguments<double>(s.number, lane / kGroup, lane % kGroup);
    if (pressure) without_friction(a, frictionless);
    return a;
  }

  /// Computes the ideal field, (points, 3), or the ideal pressure, (points), in one lane.
  void read(const CompiledSensor& s, int lane, bool pressure, std::span<double> to) {
    find_touches(lane / kGroup, s.number);
    if (!pressure) return s.layer ? read_layered(s, lane, false, to) : read_springs(s, lane, to);
    const auto all = std::span(expanded).first(3 * to.size());
    s.layer ? read_layered(s, lane, true, all)
            : read_ideal(reader, s, arguments(s, lane, true), all);
    for (std::size_t k = 0; k < to.size(); ++k) to[k] = all[3 * k + 2];
  }

  /// Computes the field of the springs, (points, 3).
  void read_springs(const CompiledSensor& s, int lane, std::span<double> to) {
    if (s.elastic)
      elastic.read(reader, *batch, kBlock * block + lane, s.number, to);
    else
      read_ideal(reader, s, arguments(s, lane, false), to);
  }

  /// Computes the field of a sensor with a layer, (points, 3). A pressure leaves friction out.
  void read_layered(const CompiledSensor& s, int lane, bool pressure, std::span<double> to) {
    find_touches(lane / kGroup, s.number);
    layered.read(reader, elastic, *batch, kBlock * block + lane, s, !pressure, to);
  }

  /// Adds to a row of `parameters`, if there are any.
  static void add(int lane, int row, double x, std::span<double> parameters) {
    if (!parameters.empty()) parameters[std::size_t(row * kBlock + lane)] += x;
  }

  /// Pulls the cotangent of such a field back.
  void pull_back_layered(int lane, const CompiledSensor& s, bool pressure,
                         std::span<const double> cotangent, std::span<double> parameters,
                         std::span<double> points) {
    if (!points.empty())
      throw InputError("derivatives by the points of tactile sensor '" +
                       model.scene().sensors[std::size_t(s.number)].name +
                       "', which has a layer or a table; expected a sensor of springs");
    const std::size_t numbers = 3 * std::size_t(s.points());
    layer_bar.assign(cotangent.begin(), cotangent.end());
    read_layered(s, lane, pressure, std::span(expanded).first(numbers));
    LayeredField::Cotangents& bar = layered.pull_back(layer_bar, !parameters.empty(),
                                                      std::span(touches).first(s.targets.size()));
    add(lane, compiled(model).view.rows.sensor(s.number), bar.stiffness, parameters);
    if (!s.layer->table) {
      const int row = compiled(model).layer_row(s.number);
      add(lane, row, bar.material.thickness, parameters);
      add(lane, row + 1, bar.material.poisson, parameters);
    }
    add_touches(lane, s, parameters);
    if (s.layer->load_control) pull_back_loads(lane, parameters);
    const bool rubs = !pressure || s.layer->load_control;  // loads count friction
    if (rubs) pull_back_springs(lane, s, bar.whole, parameters);
    for (std::size_t k = 0; !rubs && k < numbers; ++k) bar.normal[k] += bar.whole[k];
    gather(s, bar.normal);
    pull_back(lane, s.number, tiles, tile_values, parameters, {}, true);
  }

  /// Pulls the cotangent of the loads of the last layer back to its contacts.
  void pull_back_loads(int lane, std::span<double> parameters) {
    const kernels::ParameterRows& of = compiled(model).view.rows;
    std::vector<double>& shear = memory[std::size_t(lane)];
    shear.resize(3 * batch->shear_state(kBlock * block + lane).size());
    for (const ContactLoads::Share& share : layered.pull_back_loads(!parameters.empty(), shear)) {
      const kernels::PairContact& pair = compiled(model).pairs[std::size_t(share.pair)];
      hand_on(share.motion, pair.link1, {kernels::diagonal(1.0), {0, 0, 0}}, pair.link2,
              lane / kGroup, lane % kGroup);
      for (int k = 0; k < kCoefficients; ++k)
        add(lane, of.pair(share.pair) + k, share.motion.law[std::size_t(k)], parameters);
      for (int k = 0; k < kernels::kSizeNumbers; ++k) {
        add(lane, of.solid(pair.body1) + k, (&share.stretch.x)[k], parameters);
        add(lane, of.solid(pair.body2) + k, (&share.motion.size.x)[k], parameters);
      }
    }
  }

  /// Pulls the cotangent of a picture of the bodies' depth back.
  void pull_back_picture(int lane, FieldOutput of, std::span<const double> cotangent,
                         std::span<double> parameters) {
    const CompiledSensor& s = compiled(model).sensors[std::size_t(of.sensor)];
    if (s.layer && !s.layer->table)
      throw InputError(
          "a picture of a layer follows from the field; expected the field's cotangent");
    pictures.resize(compiled(model).sensors.size());
    std::unique_ptr<PictureReading<double>>& reading = pictures[std::size_t(of.sensor)];
    if (!reading) reading = std::make_unique<PictureReading<double>>(model, of.sensor);
    find_touches(lane / kGroup, s.number);
    const auto field = std::span(expanded).first(3 * std::size_t(s.points()));
    if (reading->needs_field(of.form)) {
      read(s, lane, false, field);
      reading->set_field(of.form, field);
    }
    const auto touch = arguments(s, lane, false);
    reading->set_touches(touch);
    reading->set_draws(key_of(*batch, kBlock * block + lane));
    const auto bars = std::span(touches).first(s.targets.size());
    layer_bar.assign(reading->needs_field(of.form) ? field.size() : 0, 0.0);
    reading->pull_back_touches(of.form, touch, cotangent, !parameters.empty(), bars, layer_bar);
    add_touches(lane, s, parameters);
    if (layer_bar.empty()) return;
    const std::vector<double> field_bar = layer_bar;  // of a table, which has scratch of that name
    pull_back_ideal(lane, s, false, field_bar, parameters, {});
  }

  /// Adds the cotangents of motions and sizes in `touches`.
  void add_touches(int lane, const CompiledSensor& s, std::span<double> parameters) {
    const CompiledModel& m = compiled(model);
    used[std::size_t(lane / kGroup)] = true;
    for (std::size_t k = 0; k < s.targets.size(); ++k) {
      hand_on(touches[k], s.link, s.pad, m.bodies[std::size_t(s.targets[k])].link, lane / kGroup,
              lane % kGroup);
      const int size = m.view.rows.solid(s.targets[k]);
      for (int c = 0; c < 3; ++c) add(lane, size + c, (&touches[k].size.x)[c], parameters);
    }
  }

  void pull_back_springs(int lane, const CompiledSensor& s, std::span<const double> cotangent,
                         std::span<double> parameters) {
    if (s.elastic) {
      std::copy(cotangent.begin(), cotangent.end(), whole.begin());
      return pull_back_elastic(lane, s, parameters, {});
    }
    gather(s, cotangent);
    pull_back(lane, s.number, tiles, tile_values, parameters, {});
  }

  /// Pulls the cotangent in `whole` of a sensor's reading back: of its field or of its pressure.
  void pull_back_reading(int lane, const CompiledSensor& s, bool pressure,
                         std::span<double> parameters, std::span<double> points) {
    const FieldPart part = part_of(pressure ? FieldForm::pressure : FieldForm::field);
    const std::size_t numbers = std::size_t(part.count) * std::size_t(s.points());
    const std::span<double> cotangent = std::span(whole).first(numbers),
                            field = std::span(ideal).first(numbers);
    const bool lags = s.past_states() > 0;
    if (!(s.imperfections.saturation == NormalAndShear{}))
      lags ? read_past(s, lane, pressure, field) : read(s, lane, pressure, field);
    imperfections.pull_back(s, key_of(*batch, kBlock * block + lane), part, field, cotangent);
    lags ? pull_back_past(lane, s, pressure, cotangent, parameters, points)
         : pull_back_ideal(lane, s, pressure, cotangent, parameters, points);
  }

  /// Pulls the cotangent of the ideal field, (points, 3), or of the ideal pressure, (points), back.
  void pull_back_ideal(int lane, const CompiledSensor& s, bool pressure,
                       std::span<const double> cotangent, std::span<double> parameters,
                       std::span<double> points) {
    if (!pressure && s.layer)
      return pull_back_layered(lane, s, false, cotangent, parameters, points);
    if (!pressure && s.elastic) {
      std::copy(cotangent.begin(), cotangent.end(), whole.begin());
      return pull_back_elastic(lane, s, parameters, points);
    }
    if (pressure) {
      const std::span<double> field = std::span(expanded).first(3 * cotangent.size());
      std::fill(field.begin(), field.end(), 0.0);
      for (std::size_t k = 0; k < cotangent.size(); ++k) field[3 * k + 2] = cotangent[k];
      cotangent = field;
      if (s.layer) return pull_back_layered(lane, s, true, cotangent, parameters, points);
    }
    gather(s, cotangent);
    pull_back(lane, s.number, tiles, tile_values, parameters, points, pressure);
  }

  template <class F>
  void for_past(int lane, const CompiledSensor& s, const F& f);
  void read_past(const CompiledSensor& s, int lane, bool pressure, std::span<double> to);
  void pull_back_past(int lane, const CompiledSensor& s, bool pressure,
                      std::span<const double> cotangent, std::span<double> parameters,
                      std::span<double> points);
  void add_past(BlockCotangent& out) const;

  void pull_back(int lane, int sensor, std::span<const int> touched,
                 std::span<const double> cotangents, std::span<double> parameters,
                 std::span<double> points, bool pressure = false);

  /// Pulls the cotangent in `whole` of an elastic sensor's field back.
  void pull_back_elastic(int lane, const CompiledSensor& s, std::span<double> parameters,
                         std::span<double> points) {
    const CompiledModel& m = compiled(model);
    const int environment = kBlock * block + lane, group = lane / kGroup;
    std::vector<double>& s_start = memory[std::size_t(lane)];
    s_start.resize(3 * batch->shear_state(environment).size());
    used[std::size_t(group)] = true;
    for (const ElasticField::Share& share : elastic.pull_back(
             reader, *batch, environment, s.number,
             std::span<const double>(whole).first(3 * std::size_t(s.points())), s_start, points)) {
      const CompiledBody& body = m.bodies[std::size_t(share.of->contact.body2)];
      hand_on(share.motion, s.link, {kernels::diagonal(1.0), {0, 0, 0}}, body.link, group,
              lane % kGroup);
      for (std::size_t k = 0; k < kCoefficients && !parameters.empty(); ++k)
        parameters[(std::size_t(share.of->number) + k) * kBlock + std::size_t(lane)] +=
            share.motion.law[k];
    }
  }

  /// Adds one shape's sums, in the axes of a pad, to the cotangents of its link and the sensor's.
  void hand_on(const kernels::TouchCotangent<double>& c, int sensor_link, const Frame<double>& pad,
               int body_link, int group, int lane) {
    const LinkPose<double> one = reader.link(sensor_link, group, lane),
                           two = reader.link(body_link, group, lane);
    const Frame<double> second_in_first = relative(one.world, two.world);
    const Vec6<double> Z = motion_to_child(pad, motion_to_parent(second_in_first, two.V));
    const Vec6<double> pose = wrench_to_parent(pad, c.displacement + cross_wrench(Z, c.twist));
    const Vec6<double> twist = wrench_to_parent(pad, c.twist);
    hand_on_to_links<kGroup>(second_in_first, pose, twist, lane, link(group, sensor_link),
                             link(group, body_link));
  }
};

void check_has_no_lag(const Model& model, std::span<const FieldOutput> outputs) {
  for (const FieldOutput& output : outputs) check_has_no_lag(model, output.sensor);
}

/// Earlier states of one environment in the lanes of a block, and how they are pulled back.
struct ReadoutPullback::Impl::Past {
  PastStates states;
  ReadoutPullback pullback;
  BlockCotangent cotangent;
  std::vector<double> scaled;

  explicit Past(const Model& m) : states(m), pullback(m), scaled(pullback.impl_->whole.size()) {
    for (auto* x : {&cotangent.q, &cotangent.v}) x->resize(std::size_t(m.nv() * kBlock));
  }
  [[nodiscard]] Impl& then() { return *pullback.impl_; }
};

/// Calls f(k, n) after the states delay + k … delay + k + n - 1 steps ago were placed in the first
/// lanes of `past`, for all states that a reading depends on.
template <class F>
void ReadoutPullback::Impl::for_past(int lane, const CompiledSensor& s, const F& f) {
  if (!past) past = std::make_unique<Past>(model);
  const int all = static_cast<int>(s.weights.size());
  for (int first = 0; first < all; first += kBlock) {
    const int count = std::min(kBlock, all - first);
    past->states.recall(*batch, kBlock * block + lane, s.delay + first, count);
    past->pullback.place(past->states.lanes(), 0);
    f(first, count);
  }
}

/// Computes the field after delay and low-pass, or the pressure.
void ReadoutPullback::Impl::read_past(const CompiledSensor& s, int lane, bool pressure,
                                      std::span<double> to) {
  std::fill(to.begin(), to.end(), 0.0);
  for_past(lane, s, [&](int first, int count) {
    const auto one = std::span(past->scaled).first(to.size());
    for (int k = 0; k < count; ++k) {
      past->then().read(s, k, pressure, one);
      const double weight = s.weights[std::size_t(first + k)];
      for (std::size_t i = 0; i < to.size(); ++i) to[i] += weight * one[i];
    }
  });
}

/// Pulls the cotangent of what read_past() computes back to every state that it depends on. States
/// before an episode are its first one.
void ReadoutPullback::Impl::pull_back_past(int lane, const CompiledSensor& s, bool pressure,
                                           std::span<const double> cotangent,
                                           std::span<double> parameters, std::span<double> points) {
  const std::size_t nv = std::size_t(model.nv()), at = std::size_t(lane),
                    states = 1 + std::size_t(compiled(model).layout.past_states);
  std::vector<double>& to = lagging[at];
  to.resize(states * 2 * nv);
  const std::int64_t steps = batch->steps(kBlock * block + lane);
  for_past(lane, s, [&](int first, int count) {
    BlockCotangent& c = past->cotangent;
    for (auto* x : {&c.q, &c.v}) std::fill(x->begin(), x->end(), 0.0);
    c.parameters.assign(parameters.size(), 0.0);
    past->pullback.clear();
    const auto scaled = std::span(past->scaled).first(cotangent.size());
    for (int k = 0; k < count; ++k) {
      const double weight = s.weights[std::size_t(first + k)];
      for (std::size_t i = 0; i < scaled.size(); ++i) scaled[i] = weight * cotangent[i];
      past->then().pull_back_ideal(k, s, pressure, scaled, c.parameters, points);
    }
    past->pullback.finish(c);
    for (std::size_t k = 0; k < std::size_t(count); ++k) {
      const auto ago = std::min<std::int64_t>(s.delay + first + int(k), steps);
      double* const state = &to[std::size_t(ago) * 2 * nv];
      for (std::size_t i = 0; i < nv; ++i)
        state[i] += c.q[i * kBlock + k], state[nv + i] += c.v[i * kBlock + k];
      for (std::size_t row = 0; row < parameters.size(); row += kBlock)
        parameters[row + at] += c.parameters[row + k];
    }
  });
}

/// Adds `lagging`.
void ReadoutPullback::Impl::add_past(BlockCotangent& out) const {
  const std::size_t nv = std::size_t(model.nv());
  for (std::size_t l = 0; l < kBlock; ++l) {
    const std::vector<double>& from = lagging[l];
    if (from.empty()) continue;
    if (out.past.empty()) out.past.resize((from.size() - 2 * nv) * kBlock);
    for (std::size_t i = 0; i < nv; ++i) {
      out.q[i * kBlock + l] += from[i];
      out.v[i * kBlock + l] += from[nv + i];
    }
    for (std::size_t i = 2 * nv; i < from.size(); ++i)
      out.past[(i - 2 * nv) * kBlock + l] += from[i];
  }
}

ReadoutPullback::ReadoutPullback(const Model& model) : impl_(std::make_unique<Impl>(model)) {}
ReadoutPullback::~ReadoutPullback() = default;
ReadoutPullback::ReadoutPullback(ReadoutPullback&&) noexcept = default;
ReadoutPullback& ReadoutPullback::operator=(ReadoutPullback&&) noexcept = default;

void ReadoutPullback::place(const Batch& batch, int block) {
  impl_->batch = &batch;
  impl_->block = block;
  for (int g = 0; g < kGroups; ++g) impl_->reader.move(batch, block, g);
  std::fill(impl_->met.begin(), impl_->met.end(), -1);
}

void ReadoutPullback::clear() {
  for (auto& group : impl_->links)
    std::fill(group.begin(), group.end(), kernels::MotionCotangent<LaneRow>{});
  impl_->used.fill(false);
  for (std::vector<double>& lane : impl_->memory) lane.clear();
  for (std::vector<double>& lane : impl_->lagging) lane.clear();
}

void ReadoutPullback::Impl::pull_back(int lane, int sensor, std::span<const int> touched,
                                      std::span<const double> cotangents,
                                      std::span<double> parameters, std::span<double> points,
                                      bool pressure) {
  if (touched.empty()) return;
  const int group = lane / kGroup, in_group = lane % kGroup;
  find_touches(group, sensor);
  const CompiledModel& m = compiled(model);
  const CompiledSensor& s = m.sensors[std::size_t(sensor)];
  const auto a = arguments(s, lane, pressure);
  if (!points.empty()) own.assign(touched.size() * kPointNumbers * kernels::kTactileTile, 0.0);
  kernels::active_kernels().pull_back_field(
      {a.pad, a.law, a.n_touches, a.shapes, a.touches, static_cast<int>(touched.size()),
       touched.data(), cotangents.data(), !parameters.empty(),
       points.empty() ? nullptr : own.data(), touches.data()});
  if (!points.empty()) hand_on_points(s, touched, points, pressure);
  used[std::size_t(group)] = true;
  const int row = m.view.rows.sensor(sensor);
  for (std::size_t k = 0; k < s.targets.size(); ++k) {
    const kernels::TouchCotangent<double>& c = touches[k];
    hand_on(c, s.link, s.pad, m.bodies[std::size_t(s.targets[k])].link, group, in_group);
    for (int n = 0; n < kCoefficients; ++n)
      if (!pressure || n == kStiffness || n == kDamping)
        add(lane, row + n, c.law[std::size_t(n)], parameters);
    const int size = m.view.rows.solid(s.targets[k]);
    for (int n = 0; n < 3; ++n) add(lane, size + n, (&c.size.x)[n], parameters);
  }
}

void ReadoutPullback::field(int lane, int sensor, std::span<const int> tiles,
                            std::span<const double> cotangents, std::span<double> parameters,
                            std::span<double> points) {
  const CompiledSensor& s = compiled(impl_->model).sensors[std::size_t(sensor)];
  if (!s.imperfect && !s.elastic && !s.layer)
    return impl_->pull_back(lane, sensor, tiles, cotangents, parameters, points);
  const kernels::PadTiles pad = s.tiles();
  std::fill(impl_->whole.begin(), impl_->whole.end(), 0.0);
  for (std::size_t k = 0; k < tiles.size(); ++k)
    expand_tile<3>(pad, tiles[k], cotangents.data() + 3 * kernels::kTactileTile * k,
                   impl_->whole.data());
  impl_->pull_back_reading(lane, s, false, parameters, points);
}

void ReadoutPullback::dense_field(int lane, int sensor, std::span<const double> cotangents,
                                  std::span<double> parameters, std::span<double> points) {
  std::copy(cotangents.begin(), cotangents.end(), impl_->whole.begin());
  impl_->pull_back_reading(lane, compiled(impl_->model).sensors[std::size_t(sensor)], false,
                           parameters, points);
}

void ReadoutPullback::pressure(int lane, int sensor, std::span<const double> cotangents,
                               std::span<double> parameters, std::span<double> points) {
  std::copy(cotangents.begin(), cotangents.end(), impl_->whole.begin());
  impl_->pull_back_reading(lane, compiled(impl_->model).sensors[std::size_t(sensor)], true,
                           parameters, points);
}

void ReadoutPullback::ideal_field(int lane, int sensor, std::span<const double> cotangents,
                                  std::span<double> parameters, std::span<double> points) {
  impl_->pull_back_ideal(lane, compiled(impl_->model).sensors[std::size_t(sensor)], false,
                         cotangents, parameters, points);
}

void ReadoutPullback::picture(int lane, FieldOutput output, std::span<const double> cotangents,
                              std::span<double> parameters) {
  impl_->pull_back_picture(lane, output, cotangents, parameters);
}

void ReadoutPullback::end_effector(int lane, int end_effector, std::span<const double> cotangent) {
  Impl& i = *impl_;
  const CompiledEndEffector& v = compiled(i.model).end_effectors[std::size_t(end_effector)];
  if (v.link < 0) return;
  const int group = lane / kGroup;
  const LinkPose<double> at = i.reader.link(v.link, group, lane % kGroup);
  const Vec3<double> f =
      transposed_times(at.world.R, Vec3<double>{cotangent[0], cotangent[1], cotangent[2]});
  add_to_lane<kGroup>(i.link(group, v.link)->pose, {cross(v.point, f), f}, lane % kGroup, 1);
  i.used[std::size_t(group)] = true;
}

// With the link's world pose (R, p) and twist (w, u) in its own axes, and the body's origin c in
// the link: x = p + R c, q = that of R R_b, ω = R w, ẋ = R (u + w × c). A displacement (θ, ρ) of
// the link in its own axes turns q by ½ (0, Rθ) ⊗ q.
void ReadoutPullback::body(int lane, int body, std::span<const double> pose,
                           std::span<const double> twist) {
  Impl& i = *impl_;
  const CompiledBody& b = compiled(i.model).bodies[std::size_t(body)];
  if (b.link < 0) return;
  const int group = lane / kGroup;
  const LinkPose<double> at = i.reader.link(b.link, group, lane % kGroup);
  const auto in_link = [&](const double* x) {
    return transposed_times(at.world.R, Vec3<double>{x[0], x[1], x[2]});
  };
  const Vec3<double> c = b.frame.p, rate = at.V.l + cross(at.V.a, c);
  const Vec3<double> x = in_link(&pose[0]), omega = in_link(&twist[0]), v = in_link(&twist[3]);
  const kernels::Quat<double> q = quaternion_of(compose(at.world, b.frame).R);
  const Vec3<double> imaginary{q.x, q.y, q.z}, bar{pose[4], pose[5], pose[6]};
  const Vec3<double> turn = 0.5 * (q.w * bar - pose[3] * imaginary + cross(imaginary, bar));
  const Vec3<double> angle =
      transposed_times(at.world.R, turn) + cross(c, x) + cross(at.V.a, omega) + cross(rate, v);
  kernels::MotionCotangent<LaneRow>* const to = i.link(group, b.link);
  add_to_lane<kGroup>(to->pose, {angle, x}, lane % kGroup, 1);
  add_to_lane<kGroup>(to->twist, {omega + cross(c, v), v}, lane % kGroup, 1);
  i.used[std::size_t(group)] = true;
}

void ReadoutPullback::finish(BlockCotangent& out) {
  Impl& i = *impl_;
  const CompiledModel& m = compiled(i.model);
  for (std::size_t l = 0; l < kBlock; ++l) {
    if (i.memory[l].empty()) continue;
    std::vector<double>& to = out.shear[l];
    to.resize(i.memory[l].size());
    for (std::size_t k = 0; k < to.size(); ++k) to[k] += i.memory[l][k];
  }
  i.add_past(out);
  LaneRow *q = i.rows.data(), *v = q + m.nq, *zero = v + m.nv, *rates = zero + m.nv,
          *q_bar = rates + m.nv, *v_bar = q_bar + m.nv, *places = v_bar + m.nv;
  const int place_count = out.parameters.empty() ? 0 : kernels::kPlaceNumbers * m.view.n_links;
  for (int g = 0; g < kGroups; ++g) {
    if (!i.used[std::size_t(g)]) continue;
    const auto load = [&](LaneRow* to, int first, int count) {
      for (int k = 0; k < count; ++k) {
        const double* from = kernels::row_of(i.batch->block(i.block), first + k, g);
        std::copy(from, from + kGroup, to[k].lane);
      }
    };
    load(q, m.layout.q, m.nq);
    load(v, m.layout.v, m.nv);
    std::fill(q_bar, places + place_count, LaneRow{});
    kernels::active_kernels().pull_back_links(
        m.view, {q, v, zero, rates, i.batch->block(i.block), g}, i.scratch.data()->bytes,
        i.links[std::size_t(g)].data(), q_bar, v_bar, place_count > 0 ? places : nullptr);
    const auto add = [g](double* to, const LaneRow* from, int count) {
      for (int k = 0; k < count; ++k)
        for (int l = 0; l < kGroup; ++l) to[k * kBlock + g * kGroup + l] += from[k][l];
    };
    add(out.q.data(), q_bar, m.nv);
    add(out.v.data(), v_bar, m.nv);
    if (place_count > 0)
      add(&out.parameters[std::size_t(m.view.rows.places * kBlock)], places, place_count);
  }
}

}  // namespace tangere
