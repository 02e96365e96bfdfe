// SPDX-License-Identifier: Apache-2.0
// Tests tactile fields and end effectors in reverse against differences of readings, for every
// shape, law and kind of pad.
#include <gtest/gtest.h>

#include "engine/derivative/readout_pullback.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/sense/readout.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using testing::kBlock;
using testing::Random;

using testing::Pad;
using State = testing::PadState;

/// Σ weights · readings.
class Reading {
 public:
  Reading(const Model& model, unsigned seed) : model_(model) {
    Random random(seed);
    weights_.resize(std::size_t(3 * model.sensors()[0].points));
    for (double& w : weights_) w = random.normal();
    for (double& w : of_end_effectors_) w = 10 * random.normal();
  }
  [[nodiscard]] double value(const State& s, const Model* other = nullptr) const {
    const Model& model = other == nullptr ? model_ : *other;
    Batch batch(model, 1);
    batch.set_state(0, s.q, s.v);
    Readout readout(model);
    std::vector<double> field(weights_.size());
    readout.tactile(batch, 0, 0, field);
    double sum = 0;
    for (std::size_t i = 0; i < field.size(); ++i) sum += weights_[i] * field[i];
    double position[6];
    readout.end_effectors(batch, 0, position);
    for (std::size_t i = 0; i < 6; ++i) sum += of_end_effectors_[i] * position[i];
    return sum;
  }
  /// Uses lane `lane` of a block; the other lanes have other states. Returns how many tiles were
  /// touched.
  std::size_t pull_back(const State& s, int lane, BlockCotangent& out) const {
    Batch batch(model_, kBlock);
    batch.set_state(lane, s.q, s.v);
    CompactFrame<double> frame(model_, 0);
    Readout readout(model_);
    readout.read(batch, lane, frame);
    std::vector<double> cotangents(frame.values().size(), 0.0);
    tile_weights(frame, cotangents);
    ReadoutPullback pullback(model_);
    pullback.place(batch, 0);
    pullback.clear();
    for (auto* x : {&out.q, &out.v}) x->assign(std::size_t(model_.nv() * kBlock), 0.0);
    out.parameters.assign(std::size_t(parameter_rows(model_) * kBlock), 0.0);
    pullback.field(lane, 0, frame.tiles(), cotangents, out.parameters);
    for (int k = 0; k < 2; ++k)
      pullback.end_effector(lane, k, std::span(of_end_effectors_).subspan(3 * std::size_t(k), 3));
    pullback.finish(out);
    return frame.tiles().size();
  }

 private:
  /// Fills in the weights in the layout of the tiles.
  void tile_weights(const CompactFrame<double>& frame, std::vector<double>& out) const {
    const kernels::PadTiles pad = compiled(model_).sensors[0].tiles();
    for (std::size_t k = 0; k < frame.tiles().size(); ++k) {
      const int tile = frame.tiles()[k];
      for (int p = 0; p < 64; ++p) {
        int point = -1;
        if (pad.curved()) {
          if (p < pad.points_of(tile)) point = pad.index[64 * tile + p];
        } else if (p / 8 < pad.rows_of(tile) && p % 8 < pad.cols_of(tile)) {
          point = pad.first_of(tile) + p / 8 * pad.cols + p % 8;
        }
        for (int c = 0; c < 3 && point >= 0; ++c)
          out[k * 192 + std::size_t(64 * c + p)] = weights_[std::size_t(3 * point + c)];
      }
    }
  }

  Model model_;
  std::vector<double> weights_;
  double of_end_effectors_[6] = {};
};

using Case = std::tuple<PrimitiveShape, ContactLaw, Pad>;
class FieldPullback : public ::testing::TestWithParam<Case> {};

TEST_P(FieldPullback, MatchesDifferences) {
  const auto [shape, law, pad] = GetParam();
  const Model model(testing::pad_scene(shape, law, pad));
  Random random(7);
  int compared = 0, sizes = 0, places = 0;
  std::size_t touched = 0;
  for (unsigned trial = 0; trial < 6; ++trial) {
    const State s = testing::random_pad_state(model, random);
    const Reading reading(model, trial);
    const int lane = static_cast<int>(5 * trial % 16);
    BlockCotangent c;
    touched += reading.pull_back(s, lane, c);
    double scale_q = 0, scale_v = 0;
    for (double x : c.q) scale_q = std::max(scale_q, std::abs(x));
    for (double x : c.v) scale_v = std::max(scale_v, std::abs(x));
    const auto compare = [&](const std::function<double(double)>& f, double got, double scale,
                             double start, const char* what) {
      const double right = (f(start) - f(0)) / start, left = (f(0) - f(-start)) / start;
      if (std::abs(right - left) > 1e-4 * scale)
        return;  // a kink, or strong bending: points that touch come and go
      EXPECT_NEAR(0.5 * (right + left), got, 2e-6 * scale) << what;
      ++compared;
    };
    for (int i = 0; i < model.nv(); ++i) {
      compare(
          [&](double e) {
            return reading.value({testing::moved(model, s.q, i, e), s.v});
          },
          c.q[std::size_t(i * kBlock + lane)], scale_q, 1e-8, "q");
      compare(
          [&](double e) {
            State other = s;
            other.v[std::size_t(i)] += e;
            return reading.value(other);
          },
          c.v[std::size_t(i * kBlock + lane)], scale_v, 1e-6, "v");
    }
    const NumberGradients parameters(model);
    std::vector<double> gradient(std::size_t(parameters.count()));
    parameters.gradient(c, Batch(model, kBlock), lane, gradient);
    for (int k = 0; k < parameters.count(); ++k) {
      const NumberInfo& info = parameters.infos()[std::size_t(k)];
      const bool of_size =
          info.name.rfind("body thing", 0) == 0 && info.number.field != NumberField::density;
      const bool of_place = info.number.field == NumberField::pos;
      if (info.name.rfind("tactile", 0) != 0 && !of_size && !of_place) continue;
      sizes += of_size && gradient[std::size_t(k)] != 0;
      places += of_place && gradient[std::size_t(k)] != 0;
      const double size = testing::size_of(info), g = gradient[std::size_t(k)] * size;
      compare(
          [&](double e) {
            Scene scene = model.scene();
            number_in(scene, info.number) += e * size;
            const Model other(scene);
            return reading.value(s, &other);
          },
          g, std::max(1.0, std::abs(g)), 1e-6, info.name.c_str());
    }
    // Lanes without input stay unchanged.
    for (int i = 0; i < model.nv(); ++i)
      for (int l = 0; l < kBlock; ++l)
        EXPECT_TRUE(l == lane || c.q[std::size_t(i * kBlock + l)] == 0.0);
  }
  EXPECT_GT(touched, 6U);
  EXPECT_GT(compared, model.nv() * 6);
  EXPECT_TRUE(shape == PrimitiveShape::plane || sizes > 3) << sizes;
  EXPECT_GT(places, 6);
}

INSTANTIATE_TEST_SUITE_P(
    All, FieldPullback,
    ::testing::Combine(::testing::Values(PrimitiveShape::sphere, PrimitiveShape::cuboid,
                                         PrimitiveShape::plane, PrimitiveShape::cylinder,
                                         PrimitiveShape::capsule, PrimitiveShape::ellipsoid,
                                         PrimitiveShape::mesh),
                       ::testing::Values(ContactLaw::clamped, ContactLaw::paper),
                       ::testing::Values(Pad::flat, Pad::skewed, Pad::curved)));

}  // namespace
}  // namespace tangere
