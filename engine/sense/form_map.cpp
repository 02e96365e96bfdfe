// SPDX-License-Identifier: Apache-2.0
// Sums go over all tiles in the order of the readout. A skewed pad stores f·axis0, f·axis1 and
// -f·(axis0 × axis1), from which its sums compute the force in perpendicular axes.
#include "engine/sense/form_map.hpp"

#include <algorithm>
#include <mutex>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "engine/sense/channel_reading.hpp"
#include "engine/sense/dense_tiles.hpp"
#include "engine/sense/field_sum.hpp"
#include "engine/sense/flow_map.hpp"
#include "engine/sense/marker_map.hpp"
#include "engine/sense/picture_reading.hpp"

namespace tangere {

using kernels::kTactileTile;
using kernels::Mat3;
using kernels::PadTiles;
using kernels::Vec3;

namespace {

/// Turns the stored numbers of a skewed pad into (f·x, f·y, -f·z) in its perpendicular axes.
Mat3<double> perpendicular_from_stored(const PadTiles& pad) {
  const auto row = [&](int r) {
    return Vec3<double>{pad.axes[3 * r], pad.axes[3 * r + 1], pad.axes[3 * r + 2]};
  };
  const double volume = dot(row(0), cross(row(1), row(2)));
  Mat3<double> turn;
  for (int c = 0; c < 3; ++c) {
    const Vec3<double> column = (1 / volume) * cross(row((c + 1) % 3), row((c + 2) % 3));
    turn.m[0][c] = column.x, turn.m[1][c] = column.y, turn.m[2][c] = -column.z;
  }
  return turn;
}

/// Calls f(first number of a point in the field, its place, its axes) for all points of a pad.
/// `frame`: rows of the point's axes in pad axes, 64 numbers apart; nullptr on a flat pad.
template <class F>
void for_places(const PadTiles& pad, const F& f) {
  for (int tile = 0; tile < pad.tiles(); ++tile) {
    const Vec3<double> centre{pad.x[tile], pad.y[tile], pad.z[tile]};
    const double* const offsets =
        pad.offsets + (pad.curved() ? 3 * kTactileTile * tile : 2 * kTactileTile * pad.kind[tile]);
    for_points_of_tile(pad, tile, [&](int slot, int point) {
      const double height = pad.curved() ? offsets[2 * kTactileTile + slot] : 0;
      const Vec3<double> place =
          centre + Vec3<double>{offsets[slot], offsets[kTactileTile + slot], height};
      f(3 * std::size_t(point), place,
        pad.curved() ? pad.frames + 9 * kTactileTile * tile + slot : nullptr);
    });
  }
}

}  // namespace

struct FormMap::Impl {
  Model model;  // owns the pad
  FieldOutput output;
  PadTiles pad;
  kernels::Frame<double> in_body;
  int pressure_sign;
  std::optional<Mat3<double>> turn;  // of a skewed pad
  std::optional<MarkerMap> markers;
  std::optional<ChannelReading> channels;
  std::size_t size;  // of the form
  mutable std::mutex guard;
  mutable std::vector<std::unique_ptr<PictureReading<double>>> idle;  // scratch of pictures

  Impl(const Model& m, FieldOutput of) : model(m), output(of) {
    check_outputs(m.scene(), {&of, 1});
    if (is_view(of.form)) throw InputError("pictures of a camera do not follow from a field");
    const std::string reason = reason_against(m.scene(), of);
    if (!reason.empty()) throw InputError(reason);
    const CompiledSensor& s = compiled(m).sensors[std::size_t(of.sensor)];
    if (of.form == FieldForm::pressure)
      throw InputError("a pressure leaves friction out, so it does not follow from the field");
    pad = s.tiles();
    in_body = relative(compiled(m).bodies[std::size_t(s.body)].frame, s.pad);
    pressure_sign = m.sensors()[std::size_t(of.sensor)].pressure_sign;
    if (pad.skewed) turn = perpendicular_from_stored(pad);
    if (is_displacement(of.form)) markers.emplace(m, of.sensor);
    if (of.form == FieldForm::channels) channels.emplace(m, of.sensor);
    size = numbers_of(m.sensors()[std::size_t(of.sensor)], of.form);
    if (is_picture(of.form) && !m.scene().sensors[std::size_t(of.sensor)].layer)
      throw InputError("pictures of sensor '" + m.sensors()[std::size_t(of.sensor)].name +
                       "', which has no <layer>, do not follow from its field");
  }

  [[nodiscard]] std::size_t points() const { return std::size_t(pad.rows) * std::size_t(pad.cols); }

  /// Calls f with a reading of pictures that no other thread uses meanwhile.
  template <class F>
  void with_picture(const F& f) const {
    std::unique_ptr<PictureReading<double>> reading;
    {
      const std::lock_guard lock(guard);
      if (!idle.empty()) {
        reading = std::move(idle.back());
        idle.pop_back();
      }
    }
    if (!reading) reading = std::make_unique<PictureReading<double>>(model, output.sensor);
    f(*reading);
    const std::lock_guard lock(guard);
    idle.push_back(std::move(reading));
  }

  void sum(std::span<const double> field, std::span<double> to) const {
    thread_local std::vector<double> values, turned;
    thread_local std::vector<int> tiles;
    if (turn) {
      turned.resize(field.size());
      for (std::size_t i = 0; i < field.size(); i += 3) {
        const Vec3<double> f = *turn * Vec3<double>{field[i], field[i + 1], field[i + 2]};
        turned[i] = f.x, turned[i + 1] = f.y, turned[i + 2] = f.z;
      }
      field = turned;
    }
    tiles.resize(std::size_t(pad.tiles()));
    std::iota(tiles.begin(), tiles.end(), 0);
    values.resize(3 * kTactileTile * tiles.size());
    for (const int tile : tiles)
      gather_tile(pad, tile, field.data(), values.data() + 3 * kTactileTile * tile);
    const FieldSum total = field_sum(pad, in_body, pressure_sign, tiles, values.data());
    std::copy(total.begin(), total.end(), to.begin());
  }

  void pull_back_sum(std::span<const double> field, std::span<const double> bar,
                     std::span<double> to, std::span<double> point_bar) const {
    const auto stored = [&](std::size_t i) {
      const Vec3<double> f{field[i], field[i + 1], field[i + 2]};
      return turn ? *turn * f : f;
    };
    const Vec3<double> force = transposed_times(in_body.R, Vec3<double>{bar[0], bar[1], bar[2]});
    const Vec3<double> centre = transposed_times(in_body.R, Vec3<double>{bar[3], bar[4], bar[5]});
    double pressure = 0;
    Vec3<double> moment{0, 0, 0};
    for_places(pad, [&](std::size_t i, const Vec3<double>& place, const double*) {
      const double w = std::max(0.0, pressure_sign * stored(i).z);
      pressure += w, moment += w * place;
    });
    const Vec3<double> at = pressure > 0 ? (1 / pressure) * moment : moment;
    for_places(pad, [&](std::size_t i, const Vec3<double>& place, const double* frame) {
      Vec3<double> g{force.x, force.y, -force.z};
      if (frame != nullptr) {
        const auto row = [&](int r) {
          return Vec3<double>{frame[3 * r * kTactileTile], frame[(3 * r + 1) * kTactileTile],
                              frame[(3 * r + 2) * kTactileTile]};
        };
        g = {dot(row(0), g), dot(row(1), g), dot(row(2), g)};
      }
      const double w = pressure_sign * stored(i).z;
      if (w > 0) g.z += pressure_sign * dot(centre, place - at) / pressure;
      for (std::size_t k = 0; k < 3 && w > 0 && !point_bar.empty(); ++k)
        point_bar[i / 3 * kernels::kPointNumbers + k] += w / pressure * bar[3 + k];
      if (turn) g = transposed_times(*turn, g);
      to[i] += g.x, to[i + 1] += g.y, to[i + 2] += g.z;
    });
  }
};

FormMap::FormMap(const Model& model, FieldOutput output)
    : impl_(std::make_unique<Impl>(model, output)) {}
FormMap::~FormMap() = default;
FormMap::FormMap(FormMap&&) noexcept = default;
FormMap& FormMap::operator=(FormMap&&) noexcept = default;

std::size_t FormMap::field_size() const { return 3 * impl_->points(); }
std::size_t FormMap::size() const { return impl_->size; }

void FormMap::evaluate(std::span<const double> field, std::span<double> form) const {
  const Impl& m = *impl_;
  switch (m.output.form) {
    case FieldForm::field:
    case FieldForm::ideal: std::copy(field.begin(), field.end(), form.begin()); return;
    case FieldForm::pressure: return;  // refused by the constructor
    case FieldForm::shear:
      for (std::size_t k = 0; k < form.size(); ++k) form[k] = field[k / 2 * 3 + k % 2];
      return;
    case FieldForm::sum: m.sum(field, form); return;
    case FieldForm::markers:
    case FieldForm::surface: m.markers->displace(field, form); return;
    case FieldForm::channels: m.channels->evaluate(field, form); return;
    case FieldForm::height:
    case FieldForm::rgb:
    case FieldForm::rgb_marker:
    case FieldForm::view_rgb:  // those of cameras are refused by the constructor
    case FieldForm::view_depth:
    case FieldForm::view_ids:
      return m.with_picture([&](PictureReading<double>& picture) {
        picture.set_field(m.output.form, field);
        picture.read(m.output.form, form);
      });
    case FieldForm::flow: {
      const ShearField<double> shear{field};
      normalised_flow({&shear, 1}, form);
      return;
    }
  }
}

void FormMap::pull_back(std::span<const double> field, std::span<const double> form_bar,
                        std::span<double> field_bar, std::span<double> point_bar) const {
  const Impl& m = *impl_;
  switch (m.output.form) {
    case FieldForm::field:
    case FieldForm::ideal:
      for (std::size_t i = 0; i < form_bar.size(); ++i) field_bar[i] += form_bar[i];
      return;
    case FieldForm::pressure: return;  // refused by the constructor
    case FieldForm::shear:
      for (std::size_t k = 0; k < form_bar.size(); ++k) field_bar[k / 2 * 3 + k % 2] += form_bar[k];
      return;
    case FieldForm::sum: m.pull_back_sum(field, form_bar, field_bar, point_bar); return;
    case FieldForm::markers:
    case FieldForm::surface: m.markers->pull_back(field, form_bar, field_bar); return;
    case FieldForm::channels: m.channels->pull_back(field, form_bar, field_bar); return;
    case FieldForm::height:
    case FieldForm::rgb:
    case FieldForm::rgb_marker:
    case FieldForm::view_rgb:
    case FieldForm::view_depth:
    case FieldForm::view_ids:
      return m.with_picture([&](PictureReading<double>& picture) {
        picture.set_field(m.output.form, field);
        picture.pull_back(m.output.form, field, form_bar, field_bar);
      });
    case FieldForm::flow: {
      const ShearField<double> shear{field};
      const ShearCotangent to{field_bar, {}};
      normalised_flow_vjp({&shear, 1}, form_bar, {&to, 1});
      return;
    }
  }
}

}  // namespace tangere
