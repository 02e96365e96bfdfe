// SPDX-License-Identifier: Apache-2.0
// Measures factor and solve of a tree with 30 dofs: eight environments in lanes on the scene's
// pattern, against Eigen's dense LU with pivoting, one environment at a time. Both run together,
// because their ratio is the result.
#include <benchmark/benchmark.h>
#include <Eigen/LU>

#include <string>

#include "engine/model/compile.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/random.hpp"
#include "engine/step/workspace.hpp"
#include "kernels/table/isa.hpp"

namespace tangere {
namespace {

using kernels::kGroup;

constexpr int kFingers = 4, kJoints = 6, kDofs = 6 + kFingers * kJoints;

LinkDescription link(const std::string& name, int parent, JointType type) {
  LinkDescription l;
  l.name = l.body.name = name;
  l.joint.name = name + "_joint";
  l.joint.type = type;
  l.parent = parent;
  l.joint.pose.position = {0.02, 0, 0.03};
  l.body.shape = CuboidShape{{0.02, 0.03, 0.04}, {2, 2, 2}};
  l.body.density = 1000;
  return l;
}

/// A free palm with four fingers of six joints each.
Scene hand() {
  Scene s;
  s.name = "hand";
  s.links.push_back(link("palm", -1, JointType::free));
  for (int f = 0; f < kFingers; ++f)
    for (int j = 0; j < kJoints; ++j) {
      const int parent = j == 0 ? 0 : static_cast<int>(s.links.size()) - 1;
      s.links.push_back(
          link("link_" + std::to_string(f) + std::to_string(j), parent, JointType::revolute));
    }
  return s;
}

/// Matrices on the hand's pattern, each in lanes and dense. The diagonals dominate, as masses over
/// h² do.
struct Systems {
  std::shared_ptr<const CompiledModel> model = compile(hand());
  Workspace work{*model};
  Eigen::Matrix<double, kDofs, kDofs> dense[kGroup];
  Eigen::Matrix<double, kDofs, 1> rhs[kGroup];

  Systems() {
    std::uint32_t drawn = 0;
    const auto number = [&drawn] {
      return uniform(RandomKey{1, 0, 0, Purpose::contact, drawn++}, -1, 1);
    };
    const kernels::Pattern& p = model->view.pattern;
    for (int l = 0; l < kGroup; ++l) {
      dense[l].setZero();
      for (int i = 0; i < kDofs; ++i) {
        work.stage.g[i][l] = rhs[l][i] = number();
        for (int j = 0; j < kDofs; ++j) {
          const int at = p.slot[i * kDofs + j];
          if (at < 0) continue;
          work.stage.A[at][l] = dense[l](i, j) = number() + (i == j ? 2.0 * kDofs : 0.0);
        }
      }
    }
  }
};

void count(benchmark::State& state, double environments) {
  state.counters["ns/env"] =
      benchmark::Counter(double(state.iterations()) * environments * 1e-9,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void BM_LanesOnThePattern(benchmark::State& state) {
  Systems s;
  const auto& kernel = kernels::active_kernels().group;
  for (auto _ : state) {
    kernel.factor(s.model->view, s.work.stage, nullptr);
    kernel.solve(s.model->view, s.work.stage, s.work.stage.g, s.work.test);
    benchmark::ClobberMemory();
  }
  count(state, kGroup);
  state.counters["factor entries"] = s.model->pattern.factor_entries;
  state.SetLabel(kernels::active_isa_name());
}

template <class Matrix>
void eigen(benchmark::State& state) {
  Systems s;
  const Matrix a[2] = {s.dense[0], s.dense[1]};
  Eigen::PartialPivLU<Matrix> lu(kDofs);
  Eigen::Matrix<double, kDofs, 1> x;
  int i = 0;
  for (auto _ : state) {
    lu.compute(a[i]);
    x = lu.solve(s.rhs[i]);
    benchmark::DoNotOptimize(x.data());
    benchmark::ClobberMemory();
    i = 1 - i;
  }
  count(state, 1);
}
void BM_EigenFixed(benchmark::State& state) { eigen<Eigen::Matrix<double, kDofs, kDofs>>(state); }
void BM_EigenDynamic(benchmark::State& state) { eigen<Eigen::MatrixXd>(state); }

BENCHMARK(BM_LanesOnThePattern);
BENCHMARK(BM_EigenFixed);
BENCHMARK(BM_EigenDynamic);

}  // namespace
}  // namespace tangere
