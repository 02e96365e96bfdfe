// SPDX-License-Identifier: Apache-2.0
// How readings are computed: kinematics in lanes, then the tactile kernel, per environment for
// large pads, per block for small ones. A part of readout.cpp.
#pragma once

#include <algorithm>
#include <array>
#include <numeric>
#include <optional>
#include <tuple>
#include <type_traits>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/frames.hpp"
#include "engine/sense/camera_reading.hpp"
#include "engine/sense/channel_reading.hpp"
#include "engine/sense/dense_tiles.hpp"
#include "engine/sense/elastic_field.hpp"
#include "engine/sense/field_sum.hpp"
#include "engine/sense/imperfect_field.hpp"
#include "engine/sense/layer_reading.hpp"
#include "engine/sense/marker_map.hpp"
#include "engine/sense/motion_reading.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/sense/past_states.hpp"
#include "engine/sense/picture_reading.hpp"
#include "engine/sense/readout.hpp"
#include "engine/sense/readout_checks.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;
using kernels::kTactileTile;

inline constexpr int kFewest = 6;  // fewer environments of a block are read one by one: less work

struct Readout::Impl {
  Model model;
  Precision precision;
  PadReader reader;
  // Fields in the readout's precision when T is the other type: one field, or those of a block.
  AlignedVector<double> wide;
  AlignedVector<float> single;
  std::vector<kernels::Frame<double>> in_body;  // (sensors) pad axes in the body
  ImperfectField imperfections;
  ElasticField elastic;
  LayerReading layered;
  std::vector<std::optional<MarkerMap>> markers;        // (sensors) of those that have them
  std::vector<std::optional<ChannelReading>> channels;  // (sensors) of those that have them
  // (sensors) of those of which a picture was read.
  std::vector<std::optional<PictureReading<float>>> pictures;
  std::vector<std::optional<PictureReading<double>>> pictures_f64;
  std::vector<std::optional<CameraReading>> cameras;  // those of which a picture was read
  std::vector<float> picture;                         // of one environment, before conversion
  std::vector<double> displacement, elastic_field;    // (points, 3)
  std::vector<double> channel_values;
  std::vector<double> one_reading, block_readings, tile_values;
  std::vector<double> earlier;     // fields of small pads in the states of `past`
  std::optional<PastStates> past;  // for sensors with lag

  Impl(const Model& m, Precision p)
      : model(m), precision(p), reader(m), imperfections(m), elastic(m) {
    std::size_t room = 0;
    for (const CompiledSensor& s : compiled(m).sensors) {
      const kernels::Frame<double>& body = compiled(m).bodies[std::size_t(s.body)].frame;
      in_body.push_back(relative(body, s.pad));
      const auto points = std::size_t(s.points());
      room = std::max(
          {room, std::size_t(s.n_tiles()) * 3 * kTactileTile, small(s) ? 3 * kBlock * points : 0});
      const auto grow = [](auto& x, std::size_t n) { x.resize(std::max(x.size(), n)); };
      if (s.elastic || s.layer) grow(elastic_field, 3 * points);
      const bool marked = m.scene().sensors[std::size_t(s.number)].markers.has_value();
      markers.emplace_back();
      if (marked) {
        markers.back().emplace(m, s.number);
        grow(displacement, 3 * points);
      }
      const bool channelled = m.sensors()[std::size_t(s.number)].channels > 0;
      channels.emplace_back();
      if (channelled) {
        channels.back().emplace(m, s.number);
        grow(channel_values, channels.back()->size());
      }
      if (!s.imperfect && !s.elastic && !s.layer && !marked && !channelled) continue;
      grow(one_reading, 3 * points);
      grow(tile_values, std::size_t(s.n_tiles()) * 3 * kTactileTile);
      if (small(s)) grow(block_readings, 3 * kBlock * points);
    }
    pictures.resize(compiled(m).sensors.size());
    pictures_f64.resize(pictures.size());
    cameras.resize(compiled(m).cameras.size());
    if (compiled(m).layout.past_states > 0) {
      earlier.resize(block_readings.size());
      past.emplace(m);
    }
    (p == Precision::f64 ? wide.resize(room) : single.resize(room));
  }

  static bool small(const CompiledSensor& s) { return s.points() <= kSmallPad && s.index.empty(); }
  [[nodiscard]] const CompiledSensor& sensor_of(int k) const {
    return compiled(model).sensors[std::size_t(k)];
  }
  template <class Real>
  Real* scratch() {
    return std::get<AlignedVector<Real>&>(std::tie(wide, single)).data();
  }

  /// Calls `body` with a zero of the type in which the readout computes.
  template <class Body>
  auto in_precision(const Body& body) {
    return precision == Precision::f64 ? body(double{}) : body(float{});
  }

  void place(const Batch& batch, int environment, int sensor) {
    const int block = environment / kBlock, group = environment % kBlock / kGroup;
    reader.move(batch, block, group);
    reader.find_touches(batch, block, group, sensor);
  }

  /// Components that the kernel computes for a form: a shear is two of three.
  static int computed(FieldForm form) { return form == FieldForm::pressure ? 1 : 3; }

  template <class Real>
  kernels::TactileArgs<Real> arguments(int environment, FieldOutput of) {
    auto a = reader.arguments<Real>(of.sensor, environment % kBlock / kGroup, environment % kGroup);
    a.pressure = of.form == FieldForm::pressure;
    return a;
  }

  /// Calls put(to, number) for the numbers of touched tiles and their places in `dense`. Returns
  /// how many tiles there are and lists them in reader.active.
  template <class Real, class T, class Put>
  int put_touched(int environment, FieldOutput of, T* dense, const Put& put) {
    auto a = arguments<Real>(environment, of);
    a.values = scratch<Real>();
    const int count = run_tactile(a), numbers = computed(of.form) * kTactileTile;
    const auto expand = [&]<int Components>() {
      for (int k = 0; k < count; ++k)
        put_tile<Components>(*a.pad, a.active[k], a.values + numbers * k, dense, put);
    };
    switch (components_of(of.form)) {
      case 1: expand.template operator()<1>(); break;
      case 2: expand.template operator()<2>(); break;
      default: expand.template operator()<3>(); break;
    }
    return count;
  }

  /// Writes the touched tiles of an environment, after find_touches(). Returns their number and
  /// lists them in reader.active.
  template <class T>
  int write_touched(int environment, FieldOutput of, T* dense) {
    return in_precision([&](auto zero) {
      using Real = decltype(zero);
      if constexpr (std::is_same_v<Real, T>) {
        if (of.form != FieldForm::shear) {
          auto a = arguments<Real>(environment, of);
          a.dense = dense;
          return run_tactile(a);
        }
      }
      return put_touched<Real>(environment, of, dense,
                               [](T& to, Real x) { to = static_cast<T>(x); });
    });
  }

  /// Returns the tiles that may hold other numbers than zero.
  template <class T>
  std::span<const int> fill(int environment, FieldOutput of, T* dense) {
    const auto count = std::size_t(write_touched(environment, of, dense));
    clear_tiles_between<T>(sensor_of(of.sensor).tiles(), {reader.active.data(), count},
                           components_of(of.form), dense);
    return {reader.active.data(), count};
  }

  /// Whether a reading depends on the shear state or on a layer. Pressure does not depend on shear.
  [[nodiscard]] bool is_elastic(FieldOutput of) const {
    const CompiledSensor& s = sensor_of(of.sensor);
    return s.layer != nullptr || (s.elastic && of.form != FieldForm::pressure);
  }
  /// Whether a reading is computed from the whole ideal field, or from no field.
  static bool is_derived(FieldForm form) {
    return is_displacement(form) || form == FieldForm::channels || is_picture(form);
  }
  /// Whether a reading needs more than the kernels' field.
  [[nodiscard]] bool imperfect(FieldOutput of) const {
    return is_derived(of.form) || is_elastic(of) ||
           (of.form != FieldForm::ideal && sensor_of(of.sensor).imperfect);
  }
  /// Turns an ideal field into the reading of an imperfect sensor, in the readout's precision.
  void make_imperfect(const Batch& batch, int environment, FieldOutput of,
                      std::span<double> field) {
    if (of.form != FieldForm::ideal)
      imperfections.apply(sensor_of(of.sensor), key_of(batch, environment), part_of(of.form),
                          field);
    if (precision != Precision::f64)
      for (double& x : field) x = static_cast<double>(static_cast<float>(x));
  }

  /// Computes the field of a sensor with lag: the weighted mean of earlier ideal fields. It depends
  /// on stored states alone, not on the times of earlier readings.
  void read_past(const Batch& batch, int environment, FieldOutput of, std::span<double> field) {
    const CompiledSensor& s = sensor_of(of.sensor);
    std::fill(field.begin(), field.end(), 0.0);
    for (std::size_t first = 0; first < s.weights.size(); first += kBlock) {
      const auto weights = std::span(s.weights).subspan(
          first, std::min(std::size_t(kBlock), s.weights.size() - first));
      past->recall(batch, environment, s.delay + static_cast<int>(first),
                   static_cast<int>(weights.size()));
      place_block(past->lanes(), 0, of.sensor, static_cast<int>(weights.size()));
      if (in_lanes(of.sensor, static_cast<int>(weights.size())))
        add_lanes(of, weights, field);
      else
        for (std::size_t k = 0; k < weights.size(); ++k)
          add_touched(static_cast<int>(k), of, weights[k], field);
    }
  }

  /// Adds the field of a lane of `past`, times its weight.
  void add_touched(int lane, FieldOutput of, double weight, std::span<double> field) {
    in_precision([&](auto zero) {
      using Real = decltype(zero);
      return put_touched<Real>(lane, of, field.data(), [weight](double& to, Real x) {
        to += weight * static_cast<double>(x);
      });
    });
  }

  /// Adds the fields of the first lanes of `past`, each times its weight. They are of a small pad.
  void add_lanes(FieldOutput of, std::span<const double> weights, std::span<double> field) {
    std::array<double*, kBlock> each{};
    for (std::size_t k = 0; k < weights.size(); ++k) each[k] = earlier.data() + field.size() * k;
    fill_block(of, static_cast<int>(weights.size()), each);
    for (std::size_t k = 0; k < weights.size(); ++k)
      for (std::size_t i = 0; i < field.size(); ++i) field[i] += weights[k] * each[k][i];
  }

  /// Fills in the reading of an imperfect sensor in an environment whose touches were found.
  void read_imperfect(const Batch& batch, int environment, FieldOutput of,
                      std::span<double> field) {
    if (sensor_of(of.sensor).past_states() > 0) {
      read_past(batch, environment, of, field);
    } else if (is_elastic(of)) {
      read_elastic(batch, environment, of, field);
    } else {
      fill(environment, of, field.data());
    }
    make_imperfect(batch, environment, of, field);
  }

  /// Computes the ideal field of a sensor with shear springs or a layer, or some of its components.
  /// The pressure leaves friction out.
  void read_elastic(const Batch& batch, int environment, FieldOutput of, std::span<double> field) {
    const FieldPart part = part_of(of.form);
    const auto width = std::size_t(part.count);
    const auto whole = std::span(elastic_field).first(field.size() / width * 3);
    if (const CompiledSensor& s = sensor_of(of.sensor); s.layer)
      layered.read(reader, elastic, batch, environment, s, of.form != FieldForm::pressure, whole);
    else
      elastic.read(reader, batch, environment, of.sensor, whole);
    for (std::size_t k = 0; k < field.size(); ++k)
      field[k] = whole[k / width * 3 + std::size_t(part.first) + k % width];
  }

  /// The same into scratch of the readout. For a sum: the field.
  std::span<const double> read_imperfect(const Batch& batch, int environment, FieldOutput of) {
    const FieldForm form = of.form == FieldForm::sum ? FieldForm::field : of.form;
    const std::span<double> field =
        std::span(one_reading).first(numbers_of(sensor_of(of.sensor).points(), form));
    read_imperfect(batch, environment, {of.sensor, form}, field);
    return field;
  }

  void check_has(FieldOutput of) const {
    if (const std::string reason = reason_against(model.scene(), of); !reason.empty())
      throw InputError(reason);
  }

  /// Computes the ideal field of a sensor, after find_touches(), into scratch of the readout.
  std::span<const double> read_ideal_field(const Batch& batch, int environment, int sensor) {
    const FieldOutput ideal{sensor, FieldForm::ideal};
    const auto field =
        std::span(one_reading).first(numbers_of(sensor_of(sensor).points(), ideal.form));
    if (is_elastic(ideal))
      read_elastic(batch, environment, ideal, field);
    else
      fill(environment, ideal, field.data());
    return field;
  }

  /// Writes how markers or the surface move under the ideal field, after find_touches().
  template <class T>
  void write_displacements(const Batch& batch, int environment, FieldOutput of, T* to) {
    check_has(of);
    const auto moved =
        std::span(displacement).first(numbers_of(sensor_of(of.sensor).points(), of.form));
    const std::span<const double> field = read_ideal_field(batch, environment, of.sensor);
    markers[std::size_t(of.sensor)]->displace(field, moved);
    std::transform(moved.begin(), moved.end(), to, [](double x) { return static_cast<T>(x); });
  }

  /// Writes what the hardware returns, after find_touches().
  template <class T>
  void write_channels(const Batch& batch, int environment, FieldOutput of, T* to) {
    check_has(of);
    const ChannelReading& reading = *channels[std::size_t(of.sensor)];
    const auto values = std::span(channel_values).first(reading.size());
    reading.evaluate(read_ideal_field(batch, environment, of.sensor), values);
    const auto time = static_cast<double>(batch.steps(environment)) * model.scene().timestep;
    reading.apply_flaws(key_of(batch, environment), time, values);
    std::transform(values.begin(), values.end(), to, [](double x) { return static_cast<T>(x); });
  }

  /// Writes a picture, after find_touches(). T: double, float or a byte. Doubles are computed in
  /// double, which gradients take, unless the readout is mixed.
  template <class T>
  void write_picture(const Batch& batch, int environment, FieldOutput of, T* to) {
    const std::size_t numbers = numbers_of(model.sensors()[std::size_t(of.sensor)], of.form);
    if constexpr (std::is_same_v<T, double>) {
      if (precision == Precision::f64)
        return read_picture(pictures_f64, batch, environment, of, std::span(to, numbers));
      picture.resize(numbers);
      read_picture(pictures, batch, environment, of, std::span(picture));
      std::copy(picture.begin(), picture.end(), to);
    } else {
      read_picture(pictures, batch, environment, of, std::span(to, numbers));
    }
  }
  template <class Real, class T>
  void read_picture(std::vector<std::optional<PictureReading<Real>>>& readings, const Batch& batch,
                    int environment, FieldOutput of, std::span<T> to) {
    check_has(of);
    std::optional<PictureReading<Real>>& reading = readings[std::size_t(of.sensor)];
    if (!reading) reading.emplace(model, of.sensor);
    if (reading->needs_depth())
      reading->set_touches(
          reader.arguments<double>(of.sensor, environment % kBlock / kGroup, environment % kGroup));
    if (reading->needs_field(of.form))
      reading->set_field(of.form, read_ideal_field(batch, environment, of.sensor));
    reading->set_draws(key_of(batch, environment));
    reading->read(of.form, to);
  }

  /// Writes a reading of an imperfect sensor whose touches were found.
  template <class T>
  void write_imperfect(const Batch& batch, int environment, FieldOutput of, T* to) {
    if (is_displacement(of.form)) return write_displacements(batch, environment, of, to);
    if (is_picture(of.form)) return write_picture(batch, environment, of, to);
    if (of.form == FieldForm::channels) return write_channels(batch, environment, of, to);
    if constexpr (std::is_same_v<T, double>)
      if (of.form != FieldForm::sum) {
        const std::size_t numbers = numbers_of(sensor_of(of.sensor).points(), of.form);
        return read_imperfect(batch, environment, of, {to, numbers});
      }
    const std::span<const double> field = read_imperfect(batch, environment, of);
    if (of.form == FieldForm::sum) return add_up_imperfect(of.sensor, field, to);
    std::transform(field.begin(), field.end(), to, [](double x) { return static_cast<T>(x); });
  }

  /// Lists all tiles of a sensor in reader.active.
  std::span<const int> all_tiles(int sensor) {
    const auto tiles = std::span(reader.active).first(std::size_t(sensor_of(sensor).n_tiles()));
    std::iota(tiles.begin(), tiles.end(), 0);
    return tiles;
  }

  template <class T>
  void add_up_imperfect(int sensor, std::span<const double> field, T* sum) {
    const kernels::PadTiles pad = sensor_of(sensor).tiles();
    const std::span<const int> tiles = all_tiles(sensor);
    for (const int tile : tiles)
      gather_tile(pad, tile, field.data(), tile_values.data() + 3 * kTactileTile * tile);
    const int sign = compiled(model).sensor_info[std::size_t(sensor)].pressure_sign;
    const FieldSum total =
        field_sum(pad, in_body[std::size_t(sensor)], sign, tiles, tile_values.data());
    std::transform(total.begin(), total.end(), sum, [](double x) { return static_cast<T>(x); });
  }

  /// Writes the sum of a field whose touches were found.
  template <class T>
  void add_up(int environment, int sensor, T* sum) {
    in_precision([&](auto zero) {
      using Real = decltype(zero);
      auto a = reader.arguments<Real>(sensor, environment % kBlock / kGroup, environment % kGroup);
      kernels::PadTiles pad = *a.pad;
      pad.skewed = false;  // forces in the pad's own axes, which are perpendicular
      a.pad = &pad;
      a.values = scratch<Real>();
      const int count = run_tactile(a);
      const int sign = compiled(model).sensor_info[std::size_t(sensor)].pressure_sign;
      const FieldSum total = field_sum(pad, in_body[std::size_t(sensor)], sign,
                                       {reader.active.data(), std::size_t(count)}, a.values);
      std::transform(total.begin(), total.end(), sum, [](double x) { return static_cast<T>(x); });
    });
  }

  /// Writes the tiles touched now and zeroes those that no longer are.
  template <class T>
  void refresh(const Batch& batch, int environment, DenseFrame<T>& frame) {
    const FieldOutput of{frame.sensor_, frame.form_}, computed = undivided(of);
    if (imperfect(computed)) {
      write(batch, environment, of, frame.values_.data());
      frame.mark_all();
      return;
    }
    const kernels::PadTiles pad = sensor_of(frame.sensor_).tiles();
    const int count = write_touched(environment, computed, frame.values_.data());
    if (of.form == FieldForm::flow)
      normalise_shear(pad, {reader.active.data(), std::size_t(count)}, frame.values_.data());
    for (int old = 0, now = 0; old < frame.count_; ++old) {
      const int tile = frame.written_[std::size_t(old)];
      while (now < count && reader.active[std::size_t(now)] < tile) ++now;
      if (now == count || reader.active[std::size_t(now)] != tile)
        clear_tile(pad, tile, components_of(frame.form_), frame.values_.data());
    }
    std::copy(reader.active.begin(), reader.active.begin() + count, frame.written_.begin());
    frame.count_ = count;
  }

  /// Writes the touched tiles of a small pad to the arrays of `environments` environments, and
  /// zeros elsewhere.
  template <class T>
  void fill_block(FieldOutput of, int environments, const std::array<T*, kBlock>& dense) {
    const auto points = std::size_t(sensor_of(of.sensor).points()),
               width = std::size_t(computed(of.form)), numbers = width * points;
    in_precision([&](auto zero) {
      using Real = decltype(zero);
      std::array<Real*, kBlock> out{};
      bool direct = false;
      if constexpr (std::is_same_v<Real, T>) {
        direct = of.form != FieldForm::shear;
        if (direct) out = dense;
      }
      for (std::size_t e = 0; e < std::size_t(environments); ++e) {
        if (!direct) out[e] = scratch<Real>() + numbers * e;
        std::fill(out[e], out[e] + numbers, Real(0));
      }
      constexpr int kLanes = std::is_same_v<Real, float> ? kBlock : kGroup;
      for (int first = 0; first < environments; first += kLanes) {
        auto a = reader.block_arguments<Real>(of.sensor, first / kGroup);
        a.pressure = of.form == FieldForm::pressure;
        a.dense = out.data() + first;
        run_tactile(a);
      }
      const auto kept = std::size_t(components_of(of.form));
      for (std::size_t e = 0; !direct && e < std::size_t(environments); ++e)
        for (std::size_t p = 0; p < points; ++p)
          for (std::size_t c = 0; c < kept; ++c)
            dense[e][kept * p + c] = static_cast<T>(out[e][width * p + c]);
    });
  }

  template <class T>
  void compact(const Batch& batch, int environment, CompactFrame<T>& frame) {
    if (const FieldOutput of{frame.sensor_}; imperfect(of)) {
      const std::span<const double> field = read_imperfect(batch, environment, of);
      const kernels::PadTiles pad = sensor_of(frame.sensor_).tiles();
      frame.count_ = 0;
      for (const int tile : all_tiles(frame.sensor_)) {
        T* const to = frame.values_.get() + 3 * kTactileTile * frame.count_;
        if (gather_tile(pad, tile, field.data(), to) || sensor_of(frame.sensor_).imperfect)
          frame.tiles_[std::size_t(frame.count_++)] = tile;
      }
      return;
    }
    frame.count_ = in_precision([&](auto zero) {
      using Real = decltype(zero);
      auto a = reader.arguments<Real>(frame.sensor_, environment % kBlock / kGroup,
                                      environment % kGroup);
      a.active = frame.tiles_.data();
      if constexpr (std::is_same_v<Real, T>) {
        a.values = frame.values_.get();
        return run_tactile(a);
      } else {
        a.values = scratch<Real>();
        const int count = run_tactile(a);
        std::transform(a.values, a.values + std::ptrdiff_t{3} * kTactileTile * count,
                       frame.values_.get(), [](Real x) { return static_cast<T>(x); });
        return count;
      }
    });
  }

  /// Finds the touches of the groups of a block that hold its first `environments`, at least. A
  /// vector of floats reads both groups, so those of an empty second one are found too.
  void place_block(const Batch& batch, int number, int sensor, int environments = kBlock) {
    const bool both = precision != Precision::f64 || environments > kGroup;
    for (int g = 0; g < (both ? kBlock / kGroup : 1); ++g) {
      reader.move(batch, number, g);
      reader.find_touches(batch, number, g, sensor);
    }
  }

  /// Small pads are read in all environments of a block at once, unless most lanes would be idle or
  /// shapes differ in size between lanes.
  [[nodiscard]] bool together(const Batch& batch, int number, int sensor) const {
    return sensor_of(sensor).past_states() == 0 && !sensor_of(sensor).elastic &&
           !sensor_of(sensor).layer && in_lanes(sensor, environments_of(batch, number));
  }
  [[nodiscard]] bool in_lanes(int sensor, int environments) const {
    return small(sensor_of(sensor)) && !sensor_of(sensor).sizes_vary && environments >= kFewest;
  }
  static int environments_of(const Batch& batch, int number) {
    return std::min(kBlock, batch.environments() - number * kBlock);
  }

  /// Reads all environments at once, or calls `one` for each with its group placed.
  template <class T, class One>
  void block(const Batch& batch, int number, FieldOutput of, const std::array<T*, kBlock>& dense,
             const One& one) {
    const int environments = environments_of(batch, number);
    place_block(batch, number, of.sensor);
    if (of.form != FieldForm::sum && !is_derived(of.form) && together(batch, number, of.sensor)) {
      const FieldOutput computed = undivided(of);
      imperfect(computed) ? fill_imperfect_block(batch, number, computed, dense)
                          : fill_block(computed, environments, dense);
      for (int e = 0; e < environments && of.form == FieldForm::flow; ++e)
        normalise_shear(sensor_of(of.sensor).tiles(), all_tiles(of.sensor), dense[std::size_t(e)]);
    } else {
      for (int e = 0; e < environments; ++e) one(e);
    }
  }

  /// Reads an imperfect small pad in all environments at once.
  template <class T>
  void fill_imperfect_block(const Batch& batch, int number, FieldOutput of,
                            const std::array<T*, kBlock>& dense) {
    const int environments = environments_of(batch, number);
    const std::size_t numbers = numbers_of(sensor_of(of.sensor).points(), of.form);
    std::array<double*, kBlock> each{};
    for (std::size_t e = 0; e < std::size_t(environments); ++e)
      each[e] = block_readings.data() + numbers * e;
    fill_block(of, environments, each);
    for (int e = 0; e < environments; ++e) {
      const std::span<double> field(each[std::size_t(e)], numbers);
      make_imperfect(batch, kBlock * number + e, of, field);
      std::transform(field.begin(), field.end(), dense[std::size_t(e)],
                     [](double x) { return static_cast<T>(x); });
    }
  }

  template <class T>
  void tactile(const Batch& batch, int environment, int sensor, std::span<T> force) {
    check_environment(model, batch, environment);
    checked_index("sensor", sensor, std::ssize(model.sensors()));
    check_size("field", force.size(), numbers_of(sensor_of(sensor).points(), FieldForm::field));
    place(batch, environment, sensor);
    write(batch, environment, {sensor}, force.data());
  }

  /// Reads what a camera sees in the environments of a block.
  template <class T>
  void view_block(const Batch& batch, int number, FieldOutput of,
                  std::span<const std::span<T>> views) {
    checked_index("camera", of.sensor, std::ssize(cameras));
    check_block(model, batch, number, "picture", views, numbers_of(model, of));
    std::optional<CameraReading>& camera = cameras[std::size_t(of.sensor)];
    if (!camera) camera.emplace(model, of.sensor);
    for (int e = 0; e < environments_of(batch, number); ++e) {
      if (e % kGroup == 0) reader.move(batch, number, e / kGroup);
      camera->set(reader, batch, kBlock * number + e);
      camera->read(of.form, views[std::size_t(e)]);
    }
  }

  template <class T>
  void block_spans(const Batch& batch, int number, FieldOutput of,
                   std::span<const std::span<T>> readings) {
    if (is_view(of.form)) return view_block(batch, number, of, readings);
    checked_index("sensor", of.sensor, std::ssize(model.sensors()));
    check_block(model, batch, number, "reading", readings,
                numbers_of(model.sensors()[std::size_t(of.sensor)], of.form));
    std::array<T*, kBlock> out{};
    for (std::size_t e = 0; e < std::min(readings.size(), std::size_t(kBlock)); ++e)
      out[e] = readings[e].data();
    block<T>(batch, number, of, out,
             [&](int e) { write(batch, kBlock * number + e, of, out[std::size_t(e)]); });
  }

  /// Writes a reading of an environment whose touches were found.
  template <class T>
  void write(const Batch& batch, int environment, FieldOutput of, T* to) {
    if (imperfect(undivided(of))) {
      write_imperfect(batch, environment, undivided(of), to);
      if (of.form == FieldForm::flow)
        normalise_shear(sensor_of(of.sensor).tiles(), all_tiles(of.sensor), to);
    } else if (of.form == FieldForm::sum) {
      add_up(environment, of.sensor, to);
    } else {
      const std::span<const int> tiles = fill(environment, undivided(of), to);
      if (of.form == FieldForm::flow) normalise_shear(sensor_of(of.sensor).tiles(), tiles, to);
    }
  }
};

}  // namespace tangere
