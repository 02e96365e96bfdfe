// SPDX-License-Identifier: Apache-2.0
// Tests that a machine written in metres and kilograms and the same in centimetres and grams move
// alike: every output is SI.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

constexpr int kEnvironments = 4;

struct Series {
  std::vector<std::vector<double>> q, v, force;  // per step, of all environments
};

Series run(const std::string& name) {
  const Model model(read_scene(std::string(TANGERE_TEST_DATA) + "/scenes/" + name).scene);
  Batch batch(model, kEnvironments, 3);
  Stepper stepper(model);
  Readout readout(model);
  const ControlProgram control(model, model.timestep(), 3);
  const std::size_t nu = std::size_t(model.nu()), nq = std::size_t(model.nq()),
                    nv = std::size_t(model.nv());
  const std::size_t numbers = 3 * std::size_t(model.sensors()[0].points);
  std::vector<double> u(kEnvironments * nu);
  Series s;
  for (int k = 0; k < int(control.steps()); ++k) {
    for (std::size_t e = 0; e < kEnvironments; ++e)
      control.evaluate(k, std::int64_t(e), std::span(u).subspan(e * nu, nu));
    stepper.step(batch, u);
    s.q.emplace_back(kEnvironments * nq);
    s.v.emplace_back(kEnvironments * nv);
    s.force.emplace_back(kEnvironments * numbers);
    for (std::size_t e = 0; e < kEnvironments; ++e) {
      batch.get_q(int(e), std::span(s.q.back()).subspan(e * nq, nq));
      batch.get_v(int(e), std::span(s.v.back()).subspan(e * nv, nv));
      readout.tactile(batch, int(e), 0, std::span(s.force.back()).subspan(e * numbers, numbers));
    }
  }
  EXPECT_EQ(batch.failed_count(), 0) << name;
  return s;
}

/// Largest difference of each number, relative to its largest size in the run.
double apart(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a[0].size(); ++i) {
    double difference = 0, size = 0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      difference = std::max(difference, std::abs(a[k][i] - b[k][i]));
      size = std::max(size, std::abs(a[k][i]));
    }
    if (size > 1e-12) worst = std::max(worst, difference / size);
  }
  return worst;
}

TEST(Units, CentimetresAndGramsMoveAsMetresAndKilogrammes) {
  const Series a = run("units_m_kg.xml"), b = run("units_cm_g.xml");
  ASSERT_EQ(a.q.size(), 300U);
  ASSERT_EQ(b.q.size(), 300U);
  double peak = 0;
  std::size_t touching = 0;
  for (const auto& field : a.force) {
    for (const double f : field) peak = std::max(peak, std::abs(f));
    touching += std::any_of(field.begin(), field.end(), [](double f) { return f != 0; });
  }
  EXPECT_GT(peak, 1e-4) << "the pad feels the ball [N]";
  EXPECT_GT(touching, 100U);
  EXPECT_LT(touching, 300U) << "and lets go of it";
  EXPECT_LT(apart(a.q, b.q), 1e-10);
  EXPECT_LT(apart(a.v, b.v), 1e-10);
  EXPECT_LT(apart(a.force, b.force), 1e-10);
}

}  // namespace
}  // namespace tangere
