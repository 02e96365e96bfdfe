// SPDX-License-Identifier: Apache-2.0
// Derivatives of readings of <layer load="contact">: in dual numbers, in reverse and by
// differences.
#include <gtest/gtest.h>

#include "tests/engine/field_loss.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/load_control_scene.hpp"

namespace tangere {
namespace {

using testing::FieldLoss;
using testing::gel_on_a_hinge;
using testing::LoadScene;
using testing::RunInput;
using Numbers = std::vector<double>;

constexpr int kLoadSteps = 2;

struct LoadGradientCase {
  const char* name;
  LoadScene scene;
  bool carried = true;  ///< else a tilt is at its end
};
void PrintTo(const LoadGradientCase& c, std::ostream* out) { *out << c.name; }

LoadScene small_pad(LoadScene s) {
  s.n = 12;
  return s;
}

const LoadGradientCase kLoadGradientCases[] = {
    {"a ball that slides", small_pad({})},
    {"a ball that sticks",
     small_pad({.contact = R"(<surface_contact body1="ball" body2="table" kn="4e7" kt="2e4" mu="0.9"
 damping="1e8" ks="2e7"/>)",
                .skin = R"(mu="0.7")"})},
    {"a ball by its centre, on a gel that relaxes",
     small_pad({.contact = R"(<general_primitive_contact general_body="ball" primitive_body="table"
 kn="1500" kt="20" mu="0.5" damping="20"/>)",
                .skin = R"(mu="0.7" ks="0" kt="4e5" relaxation="2e-3")"})},
    {"a capsule",
     small_pad({.body = R"(type="capsule" length="0.01" radius="0.0149")",
                .contact = R"(<surface_contact body1="table" body2="ball" kn="4e7" kt="2e4" mu="0.5"
 damping="1e8" ks="1e7"/>)"})},
    {"a tilt at its end",
     small_pad(
         {.body = R"(type="sphere" radius="0.019")",
          .contact = R"(<surface_contact body1="table" body2="ball" kn="4e7" kt="2e4" mu="0.5"/>)",
          .start = "0.0045 0.001 0.0186"}),
     false}};

class LoadControlGradient : public ::testing::TestWithParam<LoadGradientCase> {};

RunInput load_input(const Model& model) {
  RunInput in;
  in.q = testing::q_of(Batch(model, 1));
  in.v = {0.1, 0.05, -0.02, -0.03, 1, 2, -1};
  in.u.resize(std::size_t(kLoadSteps));
  return in;
}

/// By the start, and by all numbers of the scene.
TEST_P(LoadControlGradient, AdjointTangentAndDifferencesAgree) {
  const Scene scene = testing::parsed(gel_on_a_hinge(GetParam().scene));
  const Model model = testing::without_second_looks(scene);
  const StepperOptions options = testing::options(Integrator::bdf1, scene.timestep, 1e-13);
  const RunInput in = load_input(model);
  const FieldLoss loss(model, kLoadSteps, 7);
  EXPECT_GT(std::abs(field_loss_of_run(model, options, in, loss)), 1e-3) << "the body touches";
  Readout readout(model);
  Batch start(model, 1);
  start.set_state(0, in.q, in.v);
  static_cast<void>(loss.value(readout, start, 0));
  EXPECT_EQ(readout.loads_not_carried(), GetParam().carried ? 0 : 1);
  const testing::RunGradient adjoint = adjoint_of_fields(model, options, in, loss);
  testing::Random random(11);
  testing::expect_tangent(model, options, in, adjoint, random, testing::change_of_fields(loss));

  const auto along = [&](const std::function<void(RunInput&, double)>& change) {
    return testing::best_difference(
        [&](double e) {
          RunInput other = in;
          change(other, e);
          return field_loss_of_run(model, options, other, loss);
        },
        1e-6);
  };
  testing::RunGradient difference;
  for (int i = 0; i < model.nv(); ++i) {
    difference.q.push_back(
        along([&](RunInput& x, double e) { x.q = testing::moved(model, x.q, i, e); }));
    difference.v.push_back(along([&](RunInput& x, double e) { x.v[std::size_t(i)] += 100 * e; }) /
                           100);
  }
  int compared = testing::compare(adjoint.q, difference.q, testing::norm(difference.q), 1e-5, "q");
  compared += testing::compare(adjoint.v, difference.v, testing::norm(difference.v), 1e-5, "v");
  const NumberGradients parameters(model);
  for (int k = 0; k < parameters.count(); ++k) {
    const NumberInfo& of = parameters.infos()[std::size_t(k)];
    const double size = testing::size_of(of);
    if (size == 0) continue;
    const double numeric = testing::best_difference(
        [&](double e) {
          Scene other = model.scene();
          number_in(other, of.number) += e * size;
          return field_loss_of_run(Model(other), options, in, loss);
        },
        1e-4);
    if (!std::isfinite(numeric)) continue;
    ++compared;
    EXPECT_NEAR(adjoint.parameters[std::size_t(k)] * size, numeric, 1e-5 * (1 + std::abs(numeric)))
        << of.name;
  }
  EXPECT_GT(compared, 20);
}

INSTANTIATE_TEST_SUITE_P(Contacts, LoadControlGradient, ::testing::ValuesIn(kLoadGradientCases));

/// Of a pressure, which leaves friction out but whose shift and tilts do not.
TEST(LoadControlGradient, PressuresMatchDifferences) {
  const Model model(testing::parsed(gel_on_a_hinge(small_pad({}))));
  Batch batch(model, 1);
  const RunInput in = load_input(model);
  const std::size_t points = std::size_t(model.sensors()[0].points), nv = in.v.size();
  testing::Random random(5);
  Numbers weights(points);
  for (double& w : weights) w = random.normal();
  const auto value = [&](const Numbers& q, const Numbers& v) {
    batch.set_state(0, q, v);
    Numbers pressure(points);
    std::vector<std::span<double>> one = {pressure};
    Readout(model).read_block(batch, 0, {0, FieldForm::pressure}, one);
    double sum = 0;
    for (std::size_t k = 0; k < points; ++k) sum += weights[k] * pressure[k];
    return sum;
  };
  static_cast<void>(value(in.q, in.v));
  ReadoutPullback pullback(model);
  BlockCotangent c;
  for (auto* x : {&c.q, &c.v}) x->assign(nv * 16, 0.0);
  pullback.place(batch, 0);
  pullback.clear();
  pullback.pressure(0, 0, weights);
  pullback.finish(c);
  Numbers found, wanted;
  for (std::size_t i = 0; i < nv; ++i) {
    found.push_back(c.q[16 * i]);
    wanted.push_back(testing::best_difference(
        [&](double e) { return value(testing::moved(model, in.q, int(i), e), in.v); }, 1e-6));
    found.push_back(c.v[16 * i]);
    wanted.push_back(testing::best_difference(
        [&](double e) {
          Numbers v = in.v;
          v[i] += e;
          return value(in.q, v);
        },
        1e-5));
  }
  EXPECT_EQ(testing::compare(found, wanted, testing::norm(wanted), 1e-5, "pressure"),
            static_cast<int>(2 * nv));
}

}  // namespace
}  // namespace tangere
