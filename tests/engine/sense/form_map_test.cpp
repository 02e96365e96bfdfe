// SPDX-License-Identifier: Apache-2.0
// Forms of fields against the readout bit for bit, and their pullbacks against differences.
#include "engine/sense/form_map.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/sense/readout.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

/// A ball under a flat array, a skewed one and a list of points, each in contact.
constexpr const char* kScene = R"(<tangere model="forms"><option unit="m-kg"/>
<robot><link name="hand"><joint name="hand" type="translational" pos="0 0 0.03"/>
<body name="hand" type="cuboid" size="0.04 0.04 0.02" pos="0 0 0.001" density="500"/></link></robot>
<robot><link name="ball"><joint name="ball" type="free3d" pos="0.001 -0.002 0.0"/>
<body name="ball" type="sphere" radius="0.0215" density="500"/></link></robot>
<sensor>
<tactile name="flat" body="hand" type="rect_array" rect_pos0="-0.01 -0.01 -0.01"
 rect_pos1="0.01 0.01 -0.01" axis0="1 0 0" axis1="0 1 0" resolution="9 11" kn="100" kt="2" mu="0.5"
 damping="50"><markers stiffness="20" thickness="0.003" spread="0.003"/></tactile>
<tactile name="skewed" body="hand" type="rect_array" rect_pos0="-0.01 -0.01 -0.01"
 rect_pos1="0.01 0.01 -0.01" axis0="1 0 0" axis1="9e-7 1 0" resolution="9 11" kn="100" kt="2"
 mu="0.5" damping="50"/>
<tactile name="dome" body="hand" type="hemisphere" radius="0.012" count="90" pos="0 0 -0.001"
 quat="0 1 0 0" kn="100" kt="2" mu="0.5" damping="50"/>
</sensor></tangere>)";

struct Touching {
  Model model{parse_scene(kScene, "forms").scene};
  Batch batch{model, 1};
  Readout readout{model};

  Touching() {
    std::vector<double> q(std::size_t(model.nq()));
    batch.get_q(0, q);
    const std::vector<double> v(std::size_t(model.nv()), 0.02);
    batch.set_state(0, q, v);
  }
  std::vector<double> read(FieldOutput output) {
    std::vector<double> out(
        numbers_of(model.sensors()[std::size_t(output.sensor)].points, output.form));
    const std::span<double> to(out);
    readout.read_block(batch, 0, output, {&to, 1});
    return out;
  }
};

constexpr FieldForm kForms[] = {FieldForm::field, FieldForm::shear, FieldForm::sum, FieldForm::flow,
                                FieldForm::markers};

TEST(FormMap, EqualsTheReadout) {
  Touching t;
  for (int sensor = 0; sensor < 3; ++sensor)
    for (const FieldForm form : kForms) {
      if (form == FieldForm::markers && sensor > 0) continue;
      const FormMap map(t.model, {sensor, form});
      std::vector<double> found(map.size());
      map.evaluate(t.read({sensor, FieldForm::field}), found);
      const std::vector<double> expected = t.read({sensor, form});
      ASSERT_EQ(found.size(), expected.size());
      double largest = 0;
      for (std::size_t i = 0; i < found.size(); ++i) {
        if (sensor == 1 && form == FieldForm::sum)
          EXPECT_NEAR(found[i], expected[i], 1e-15) << sensor << ' ' << to_string(form) << ' ' << i;
        else
          EXPECT_EQ(found[i], expected[i]) << sensor << ' ' << to_string(form) << ' ' << i;
        largest = std::max(largest, std::abs(found[i]));
      }
      EXPECT_GT(largest, 0) << sensor << ' ' << to_string(form);
    }
}

TEST(FormMap, PullsBackItsDifferences) {
  Touching t;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int sensor = 0; sensor < 3; ++sensor)
    for (const FieldForm form : kForms) {
      if (form == FieldForm::markers && sensor > 0) continue;
      const FormMap map(t.model, {sensor, form});
      const std::vector<double> field = t.read({sensor, FieldForm::field});
      std::vector<double> weight(map.size()), along(field.size()), bar(field.size());
      for (double& x : weight) x = normal(random);
      for (std::size_t i = 0; i < along.size(); ++i)
        along[i] = field[i] != 0 ? normal(random) * std::abs(field[i]) : 0;
      map.pull_back(field, weight, bar);
      const double h = 1e-5;
      double analytic = 0, difference = 0;
      for (std::size_t i = 0; i < along.size(); ++i) analytic += bar[i] * along[i];
      for (const int sign : {1, -1}) {
        std::vector<double> moved = field, out(map.size());
        for (std::size_t i = 0; i < moved.size(); ++i) moved[i] += sign * h * along[i];
        map.evaluate(moved, out);
        for (std::size_t i = 0; i < out.size(); ++i) difference += sign * weight[i] * out[i];
      }
      difference /= 2 * h;
      EXPECT_NEAR(analytic, difference, 1e-8 * std::max(1.0, std::abs(analytic)))
          << sensor << ' ' << to_string(form);
    }
}

/// At a given field the centre of pressure moves with the points.
TEST(FormMap, CentreOfPressureMovesWithPoints) {
  Touching t;
  const FormMap map(t.model, {0, FieldForm::sum});
  const std::vector<double> field = t.read({0, FieldForm::field}), weight{0, 0, 0, 1, 2, 3};
  std::vector<double> bar(field.size()), points(field.size() / 3 * kPointNumbers);
  map.pull_back(field, weight, bar, points);
  std::array<double, 3> sum{};
  for (std::size_t i = 0; i < points.size(); ++i)
    if (i % kPointNumbers < 3) sum[i % kPointNumbers] += points[i];
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(sum[k], weight[3 + k], 1e-12);
}

TEST(FormMap, RefusesWhatAFieldDoesNotDetermine) {
  const Touching t;
  EXPECT_THROW(FormMap(t.model, {3, FieldForm::field}), InputError);
  EXPECT_THROW(FormMap(t.model, {1, FieldForm::markers}), InputError);
  EXPECT_THROW(FormMap(t.model, {0, FieldForm::pressure}), InputError);
}

/// Markers of an imperfect sensor are those of its ideal field.
TEST(FormMap, MarkersAreOfTheIdealField) {
  const Touching t;
  std::string imperfect = kScene;
  imperfect.replace(imperfect.find("<markers"), 0, "<imperfections noise=\"0.1\"/>");
  const Model noisy(parse_scene(imperfect, "forms").scene);
  const FormMap plain(t.model, {0, FieldForm::markers}), map(noisy, {0, FieldForm::markers});
  std::vector<double> field(plain.field_size()), expected(plain.size()), moved(map.size());
  for (std::size_t i = 0; i < field.size(); ++i) field[i] = 1e-3 * double(i % 7);
  plain.evaluate(field, expected);
  map.evaluate(field, moved);
  EXPECT_EQ(moved, expected);
}

}  // namespace
}  // namespace tangere
