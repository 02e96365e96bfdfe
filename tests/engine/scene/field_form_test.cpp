// SPDX-License-Identifier: Apache-2.0
// Tests the forms of a field: pressure is the field without friction, shear its first components,
// flow that over its largest length, a sum what plain loops add up to. What nobody asks for calls
// no kernel.
#include "engine/scene/field_form.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "engine/base/error.hpp"
#include "engine/sense/flow_map.hpp"
#include "engine/sense/readout.hpp"
#include "kernels/numbers/block.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using kernels::kBlock;
using kernels::Vec3;
using testing::Pad;
using testing::Random;

struct FormCase {
  Pad pad;
  int side;  // points along an axis; 0: as the scene has it
};

Scene form_scene(const FormCase& c, double kt = 2) {
  Scene s = testing::pad_scene(PrimitiveShape::sphere, ContactLaw::clamped, c.pad);
  s.sensors[0].coefficients.kt = kt;
  if (c.side > 0) s.sensors[0].array.rows = s.sensors[0].array.cols = c.side;
  return s;
}

/// Twenty environments; every fifth touches nothing.
Batch form_batch(const Model& model) {
  Random random(7);
  Batch batch(model, 20);
  for (int e = 0; e < batch.environments(); ++e) {
    testing::PadState s = testing::random_pad_state(model, random);
    if (e % 5 == 4) s.q[std::size_t(model.nq() - 7)] += 1;
    batch.set_state(e, s.q, s.v);
  }
  return batch;
}

/// Reads every environment by blocks, into memory that holds something else.
template <class T>
std::vector<std::vector<T>> read_form(const Model& model, const Batch& batch, FieldForm form,
                                      Precision precision) {
  Readout readout(model, precision);
  std::vector<std::vector<T>> all(
      std::size_t(batch.environments()),
      std::vector<T>(numbers_of(model.sensors()[0].points, form), T(-3)));
  for (int b = 0; b < batch.blocks(); ++b) {
    std::vector<std::span<T>> places;
    for (int e = b * kBlock; e < std::min(batch.environments(), (b + 1) * kBlock); ++e)
      places.emplace_back(all[std::size_t(e)]);
    readout.read_block(batch, b, {0, form}, std::span<const std::span<T>>(places));
  }
  return all;
}

template <class T>
double largest_of(const std::vector<std::vector<T>>& all, std::size_t first, std::size_t stride) {
  double peak = 0;
  for (const auto& one : all)
    for (std::size_t k = first; k < one.size(); k += stride)
      peak = std::max(peak, std::abs(double(one[k])));
  return peak;
}

class FieldForms : public ::testing::TestWithParam<std::tuple<FormCase, Precision>> {
 protected:
  FormCase case_ = std::get<0>(GetParam());
  Precision precision_ = std::get<1>(GetParam());
  Model model_{form_scene(case_)};
  Batch batch_ = form_batch(model_);
};

TEST_P(FieldForms, ShearIsTheFirstTwoComponents) {
  const auto field = read_form<double>(model_, batch_, FieldForm::field, precision_);
  EXPECT_GT(largest_of(field, 0, 3), 0);
  const auto shear = read_form<double>(model_, batch_, FieldForm::shear, precision_);
  for (std::size_t e = 0; e < field.size(); ++e)
    for (std::size_t k = 0; k < shear[e].size(); ++k)
      ASSERT_EQ(shear[e][k], field[e][k / 2 * 3 + k % 2]) << "environment " << e;
  const auto wide = read_form<float>(model_, batch_, FieldForm::field, precision_);
  const auto narrow = read_form<float>(model_, batch_, FieldForm::shear, precision_);
  for (std::size_t e = 0; e < wide.size(); ++e)
    for (std::size_t k = 0; k < narrow[e].size(); ++k)
      ASSERT_EQ(narrow[e][k], wide[e][k / 2 * 3 + k % 2]);
}

/// Read by blocks and by frames that held another reading.
template <class T>
void check_flow(const Model& model, const Batch& batch, Precision precision) {
  const auto field = read_form<T>(model, batch, FieldForm::field, precision);
  const auto flow = read_form<T>(model, batch, FieldForm::flow, precision);
  EXPECT_GT(largest_of(flow, 0, 1), 0.5) << "the longest has length 1";
  Readout readout(model, precision);
  DenseFrame<T> frame(model, 0, FieldForm::flow);
  std::vector<T> expected(flow[0].size());
  for (std::size_t e = 0; e < field.size(); ++e) {
    const ShearField<T> one{field[e]};
    normalised_flow(std::span(&one, 1), std::span(expected));
    ASSERT_EQ(flow[e], expected) << "environment " << e;
    readout.read(batch, static_cast<int>(e), frame);
    ASSERT_TRUE(std::ranges::equal(frame.values(), expected)) << "environment " << e;
  }
}

TEST_P(FieldForms, FlowIsShearOverItsLargestLength) {
  check_flow<double>(model_, batch_, precision_);
  check_flow<float>(model_, batch_, precision_);
}

TEST_P(FieldForms, PressureIsTheThirdComponentWithoutFriction) {
  const Model smooth(form_scene(case_, 0));
  const auto field = read_form<double>(smooth, form_batch(smooth), FieldForm::field, precision_);
  const auto pressure = read_form<double>(model_, batch_, FieldForm::pressure, precision_);
  const double peak = largest_of(field, 2, 3);
  EXPECT_GT(peak, 0);
  const double tolerance = precision_ == Precision::f64 ? 1e-12 : 1e-5;
  for (std::size_t e = 0; e < field.size(); ++e)
    for (std::size_t k = 0; k < pressure[e].size(); ++k)
      ASSERT_NEAR(pressure[e][k], field[e][3 * k + 2], tolerance * peak) << "environment " << e;
  const auto narrow = read_form<float>(model_, batch_, FieldForm::pressure, precision_);
  for (std::size_t e = 0; e < field.size(); ++e)
    for (std::size_t k = 0; k < narrow[e].size(); ++k)
      ASSERT_EQ(narrow[e][k], static_cast<float>(pressure[e][k]));
}

/// A point's place and the rows by which its components follow from a force, body axes.
struct PointPlace {
  Vec3<double> at, rows[3];
};
std::vector<PointPlace> point_places(const TactileDescription& t) {
  const auto vec = [](const Vector3& a) { return Vec3<double>{a[0], a[1], a[2]}; };
  std::vector<PointPlace> places;
  for (const TactilePoint& p : t.points)
    places.push_back({vec(p.position), {vec(p.axis0), vec(p.axis1), -1.0 * vec(p.normal)}});
  if (!places.empty()) return places;
  const RectArray& a = t.array;
  const Vec3<double> x = vec(a.axis0), y = vec(a.axis1), way = vec(a.corner1) - vec(a.corner0);
  for (int i = 0; i < a.rows; ++i)
    for (int j = 0; j < a.cols; ++j)
      places.push_back({vec(a.corner0) + (i * dot(way, x) / (a.rows - 1)) * x +
                            (j * dot(way, y) / (a.cols - 1)) * y,
                        {x, y, -1.0 * cross(x, y)}});
  return places;
}

/// The force whose products with three rows are known.
Vec3<double> force_of(const Vec3<double> (&r)[3], const double* x) {
  const double volume = dot(r[0], cross(r[1], r[2]));
  return (1 / volume) *
         (x[0] * cross(r[1], r[2]) + x[1] * cross(r[2], r[0]) + x[2] * cross(r[0], r[1]));
}

TEST_P(FieldForms, SumIsWhatPlainLoopsAddUpTo) {
  const auto field = read_form<double>(model_, batch_, FieldForm::field, precision_);
  const auto sums = read_form<double>(model_, batch_, FieldForm::sum, precision_);
  const std::vector<PointPlace> places = point_places(model_.scene().sensors[0]);
  const int sign = model_.sensors()[0].pressure_sign;
  // Squares of what skewed axes miss are left out of their pads' positions.
  const double tolerance = precision_ == Precision::f64 ? 1e-9 : 1e-5;
  int pressed = 0;
  for (std::size_t e = 0; e < field.size(); ++e) {
    Vec3<double> force{0, 0, 0}, moment{0, 0, 0};
    double weight = 0, peak = 0;
    for (std::size_t k = 0; k < places.size(); ++k) {
      const double* const x = &field[e][3 * k];
      force += force_of(places[k].rows, x);
      const double w = std::max(0.0, sign * x[2]);
      moment += w * places[k].at;
      weight += w;
      peak = std::max(peak, std::abs(x[2]));
    }
    const double expected[] = {force.x, force.y, force.z};
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(sums[e][c], expected[c], tolerance * peak * double(places.size()));
    if (weight == 0) {
      for (std::size_t c = 3; c < 6; ++c) EXPECT_EQ(sums[e][c], 0);
      continue;
    }
    ++pressed;
    const double centre[] = {moment.x / weight, moment.y / weight, moment.z / weight};
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(sums[e][3 + c], centre[c], 1e-6);
  }
  EXPECT_GT(pressed, 5);
  EXPECT_LT(pressed, 20);
}

TEST_P(FieldForms, FramesHoldThem) {
  for (const FieldForm form : {FieldForm::pressure, FieldForm::shear}) {
    const auto whole = read_form<double>(model_, batch_, form, precision_);
    Readout readout(model_, precision_);
    DenseFrame<double> alone(model_, 0, form);
    std::vector<DenseFrame<double>> block(kBlock, DenseFrame<double>(model_, 0, form));
    readout.read_block(batch_, 0, std::span(block));
    for (int e = 0; e < kBlock; ++e) {
      readout.read(batch_, e, alone);  // clears what the environment before left
      const std::vector<double> one(alone.values().begin(), alone.values().end());
      ASSERT_EQ(one, whole[std::size_t(e)]);
      const auto of_block = block[std::size_t(e)].values();
      ASSERT_TRUE(std::equal(one.begin(), one.end(), of_block.begin(), of_block.end()));
    }
  }
  EXPECT_THROW(DenseFrame<double>(model_, 0, FieldForm::sum), InputError);
}

INSTANTIATE_TEST_SUITE_P(
    All, FieldForms,
    ::testing::Combine(::testing::Values(FormCase{Pad::flat, 0}, FormCase{Pad::flat, 29},
                                         FormCase{Pad::skewed, 0}, FormCase{Pad::skewed, 29},
                                         FormCase{Pad::curved, 0}),
                       ::testing::Values(Precision::f64, Precision::mixed)));

/// A sum has the same bits wherever its environment is in the batch.
TEST(FieldForm, SumsDoNotDependOnTheBatch) {
  const Model model(form_scene({Pad::flat, 0}));
  const Batch many = form_batch(model);
  const auto sums = read_form<double>(model, many, FieldForm::sum, Precision::f64);
  for (int e = 0; e < many.environments(); ++e) {
    Batch one(model, 1);
    one.set_state(0, testing::q_of(many, e), testing::v_of(many, e));
    EXPECT_EQ(read_form<double>(model, one, FieldForm::sum, Precision::f64)[0],
              sums[std::size_t(e)]);
  }
}

TEST(FieldForm, NamesFindTheirReading) {
  const std::vector<std::string> sensors = {"pad", "pad.sum", "skin"};
  EXPECT_EQ(find_output(sensors, "pad"), (FieldOutput{0, FieldForm::field}));
  EXPECT_EQ(find_output(sensors, "skin.shear"), (FieldOutput{2, FieldForm::shear}));
  EXPECT_EQ(find_output(sensors, "pad.sum"), (FieldOutput{1, FieldForm::field}));
  EXPECT_EQ(find_output(sensors, "pad.sum.sum"), (FieldOutput{1, FieldForm::sum}));
  EXPECT_EQ(find_output(sensors, "pad.field"), std::nullopt);
  EXPECT_EQ(find_output(sensors, "q"), std::nullopt);
  for (const std::string& name : output_names(sensors))
    EXPECT_TRUE(is_plain_output(name) || find_output(sensors, name)) << name;
}

TEST(FieldForm, ASensorOfLawLinearIsRefused) {
  Scene scene = form_scene({Pad::flat, 0});
  scene.sensors[0].law = ContactLaw::linear;
  EXPECT_THROW(Model{scene}, InputError);
}

}  // namespace
}  // namespace tangere
