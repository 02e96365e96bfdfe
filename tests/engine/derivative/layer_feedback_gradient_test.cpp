// SPDX-License-Identifier: Apache-2.0
// Gradients of motions with <layer feedback="true">: by the adjoint, in dual numbers and by
// differences.
#include <gtest/gtest.h>

#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/gradient_tangent.hpp"
#include "tests/engine/layer_feedback_scene.hpp"

namespace tangere {
namespace {

using testing::gel_model;
using testing::gel_table;
using testing::options;
using testing::RunInput;

struct LayerCase {
  const char* body;
  const char* skin;
  Integrator scheme;
};
void PrintTo(const LayerCase& c, std::ostream* out) { *out << c.body << ", " << c.skin; }

class LayerFeedbackGradient : public ::testing::TestWithParam<LayerCase> {};

/// A body that presses the gel, slides and turns.
RunInput gel_input(const Model& model, int steps) {
  RunInput in;
  in.q = testing::q_of(Batch(model, 1));
  for (int i = 0; i < 2; ++i) in.q = testing::moved(model, in.q, 3 + i, 0.05 * (i + 1));
  in.v = {0.05, -0.02, -0.03, 1, 2, -1};
  in.u.resize(std::size_t(steps));
  return in;
}

TEST_P(LayerFeedbackGradient, AdjointTangentAndDifferencesAgree) {
  const Scene scene = parse_scene(gel_table(GetParam().body, GetParam().skin, 7), "gel.xml").scene;
  const Model model = testing::without_second_looks(scene);
  const StepperOptions o = options(GetParam().scheme, scene.timestep, 1e-13);
  const RunInput in = gel_input(model, 5);
  EXPECT_EQ(testing::check_tangent(model, o, in, 3), 1);
  EXPECT_GT(testing::check_gradient(model, o, in, 4, 1e-5), 12);
}

constexpr const char* kSphere = R"(type="sphere" radius="0.02")";

INSTANTIATE_TEST_SUITE_P(
    Bodies, LayerFeedbackGradient,
    ::testing::Values(LayerCase{kSphere, R"(mu="0")", Integrator::bdf2},
                      LayerCase{kSphere, R"(mu="0.7" ks="0" kt="4e5")", Integrator::sdirk2},
                      LayerCase{kSphere, R"(mu="0.7")", Integrator::bdf2},
                      LayerCase{kSphere, R"(mu="0.7")", Integrator::sdirk2},
                      LayerCase{R"(type="cuboid" size="0.012 0.016 0.039")", R"(mu="0.7")",
                                Integrator::bdf1},
                      LayerCase{R"(type="capsule" length="0.02" radius="0.0097")",
                                R"(mu="0.7" ks="0" kt="4e5")", Integrator::bdf1}));

}  // namespace
}  // namespace tangere
