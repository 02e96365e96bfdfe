// SPDX-License-Identifier: Apache-2.0
// The losses are half squares, so their derivatives are the numbers themselves.
#include "tasks/gradients/losses.hpp"

#include <algorithm>
#include <numeric>
#include <optional>

#include "engine/scene/imperfection_checks.hpp"
#include "engine/sense/form_map.hpp"
#include "engine/step/displacement.hpp"

namespace tangere {
namespace {

class FinalState : public RolloutLoss {
 public:
  explicit FinalState(const Model& model) : model_(model) {}
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    if (at.step != at.steps) return 0;
    double sum = 0;
    for (std::size_t i = 0; i < at.v.size(); ++i) {
      sum += 0.5 * at.v[i] * at.v[i];
      out.v[i] += at.v[i];
    }
    std::vector<double> off(at.q.begin(), at.q.end());
    for (std::size_t i = 0; i < off.size(); ++i) {
      off[i] -= model_.initial_q()[i];
      sum += 0.5 * off[i] * off[i];
    }
    add_along_dofs(model_, at.q, off, out.q);
    return sum;
  }

 private:
  Model model_;
};

class Path : public RolloutLoss {
 public:
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    double sum = 0;
    for (std::size_t i = 0; i < at.v.size(); ++i) {
      sum += 0.5 * at.v[i] * at.v[i];
      out.v[i] += at.v[i];
    }
    return sum;
  }
};

class Fields : public RolloutLoss {
 public:
  Fields(int every, std::size_t components) : every_(every), components_(components) {}
  [[nodiscard]] bool reads_fields(std::int64_t step) const override {
    return step > 0 && step % every_ == 0;
  }
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    constexpr std::size_t kLanes = 8, kTile = 64;
    double squares[kLanes] = {};  // independent sums: a single one would wait for every addition
    for (std::size_t s = 0; s < at.fields.size(); ++s) {
      const std::span<const double> values = at.fields[s]->values();  // (tiles, 3, 64)
      for (std::size_t row = 0; row < values.size() / kTile; ++row) {
        if (row % 3 >= components_) continue;
        const double* from = &values[row * kTile];
        double* to = &out.fields[s][row * kTile];
        for (std::size_t i = 0; i < kTile; i += kLanes)
          for (std::size_t k = 0; k < kLanes; ++k) {
            squares[k] += from[i + k] * from[i + k];
            to[i + k] += from[i + k];
          }
      }
    }
    return 0.5 * std::accumulate(squares, squares + kLanes, 0.0);
  }

 private:
  int every_;
  std::size_t components_;
};

/// Readings that are functions of the ideal field: displacements of markers, channels or pictures,
/// less those of no field. The cotangent of the field is the pullback of theirs.
class Readings : public RolloutLoss {
 public:
  Readings(const Model& model, LossKind kind, int every) : model_(model), every_(every) {
    const bool pictures = kind == LossKind::pictures, channels = kind == LossKind::channels;
    const FieldForm form = pictures   ? FieldForm::rgb
                           : channels ? FieldForm::channels
                                      : FieldForm::markers;
    if (pictures) scale_ = 1.0 / 255;
    bool any = false;
    for (const TactileDescription& d : model.scene().sensors) {
      const int sensor = static_cast<int>(maps_.size());
      maps_.emplace_back();
      if (!reason_against(model.scene(), {sensor, form}).empty()) continue;
      any = true;
      if (is_imperfect(d.imperfections) || !d.points.empty() || (pictures && !d.layer))
        throw InputError(
            d.source.prefix() + "loss '" + to_string(kind) + "': sensor '" + d.name +
            (pictures ? "' is imperfect or has no <layer>; expected an ideal one with a layer"
                      : "' is imperfect or a list of points; expected an ideal rect_array"));
      const FormMap& map = maps_.back().emplace(model, FieldOutput{sensor, form});
      rest_.resize(maps_.size());
      rest_.back().resize(map.size());
      map.evaluate(std::vector<double>(map.field_size()), rest_.back());
    }
    if (!any)
      throw InputError(std::string("loss '") + to_string(kind) + "': no sensor of the scene has " +
                       (pictures   ? "<picture>"
                        : channels ? "<channels>"
                                   : "<markers>"));
  }
  [[nodiscard]] bool reads_fields(std::int64_t step) const override {
    return step > 0 && step % every_ == 0;
  }
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    double squares = 0;
    for (std::size_t s = 0; s < at.fields.size(); ++s) {
      if (!maps_[s]) continue;
      std::vector<double> field(maps_[s]->field_size()), form(maps_[s]->size()),
          cotangent(field.size());
      at.fields[s]->expand(field);
      maps_[s]->evaluate(field, form);
      for (std::size_t k = 0; k < form.size(); ++k) {
        const double x = scale_ * (form[k] - rest_[s][k]);
        squares += x * x;
        form[k] = scale_ * x;
      }
      maps_[s]->pull_back(field, form, cotangent);
      add_to_tiles(*at.fields[s], model_.sensors()[s], cotangent, out.fields[s]);
    }
    return 0.5 * squares;
  }

 private:
  static void add_to_tiles(const CompactFrame<double>& frame, const SensorInfo& info,
                           std::span<const double> from, std::span<double> to) {
    constexpr int kSide = 8;
    for (std::size_t k = 0; k < frame.tiles().size(); ++k) {
      const int tile = frame.tiles()[k], row0 = kSide * (tile / frame.tile_cols()),
                col0 = kSide * (tile % frame.tile_cols());
      for (int i = 0; i < std::min(kSide, info.rows - row0); ++i)
        for (int j = 0; j < std::min(kSide, info.cols - col0); ++j)
          for (std::size_t c = 0; c < 3; ++c)
            to[(3 * k + c) * kSide * kSide + static_cast<std::size_t>(kSide * i + j)] +=
                from[3 * static_cast<std::size_t>((row0 + i) * info.cols + col0 + j) + c];
    }
  }

  Model model_;
  int every_;
  double scale_ = 1;
  std::vector<std::optional<FormMap>> maps_;  // (sensors) of those that have the reading
  std::vector<std::vector<double>> rest_;     // (sensors) the reading of no field
};

class EndEffectors : public RolloutLoss {
 public:
  [[nodiscard]] bool reads_end_effectors(std::int64_t /*step*/) const override { return true; }
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    if (at.step != at.steps) return 0;
    double sum = 0;
    for (std::size_t i = 0; i < at.end_effectors.size(); ++i) {
      sum += 0.5 * at.end_effectors[i] * at.end_effectors[i];
      out.end_effectors[i] += at.end_effectors[i];
    }
    return sum;
  }
};

}  // namespace

const char* to_string(LossKind value) {
  switch (value) {
    case LossKind::final_state: return "final";
    case LossKind::path: return "path";
    case LossKind::tactile: return "tactile";
    case LossKind::shear: return "shear";
    case LossKind::end_effectors: return "variables";
    case LossKind::markers: return "markers";
    case LossKind::pictures: return "pictures";
    case LossKind::channels: return "channels";
  }
  return "unknown";
}

const char* loss_meaning(LossKind value) {
  switch (value) {
    case LossKind::final_state:
      return "half the squares of the last state, positions from where the scene starts, number by "
             "number";
    case LossKind::path: return "half the squares of all velocities, summed over steps";
    case LossKind::tactile: return "half the squares of all tactile forces, summed over fields";
    case LossKind::shear: return "half the squares of all shear forces, summed over fields";
    case LossKind::end_effectors: return "half the squares of the end effectors' last positions";
    case LossKind::markers:
      return "half the squares of all markers' displacements, summed over fields";
    case LossKind::pictures:
      return "half the squares of all pictures less their background, over 255, summed over fields";
    case LossKind::channels:
      return "half the squares of all channels less those of no field, summed over fields";
  }
  return "";
}

const std::vector<LossKind>& loss_kinds() {
  static const std::vector<LossKind> kinds = {
      LossKind::final_state,   LossKind::path,    LossKind::tactile,  LossKind::shear,
      LossKind::end_effectors, LossKind::markers, LossKind::pictures, LossKind::channels};
  return kinds;
}

std::unique_ptr<RolloutLoss> make_loss(LossKind kind, const Model& model, int every) {
  const bool reads_fields = kind == LossKind::tactile || kind == LossKind::shear;
  if (reads_fields && model.sensors().empty())
    throw InputError(std::string("loss '") + to_string(kind) +
                     "': the scene has no tactile sensor");
  if (kind == LossKind::end_effectors && model.end_effectors().empty())
    throw InputError("loss 'variables': the scene has no end effector");
  switch (kind) {
    case LossKind::final_state: return std::make_unique<FinalState>(model);
    case LossKind::path: return std::make_unique<Path>();
    case LossKind::tactile: return std::make_unique<Fields>(every, 3);
    case LossKind::shear: return std::make_unique<Fields>(every, 2);
    case LossKind::markers:
    case LossKind::pictures:
    case LossKind::channels: return std::make_unique<Readings>(model, kind, every);
    case LossKind::end_effectors: break;
  }
  return std::make_unique<EndEffectors>();
}

}  // namespace tangere
