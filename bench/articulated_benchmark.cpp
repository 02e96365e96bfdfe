// SPDX-License-Identifier: Apache-2.0
// Measures what a step without contacts costs beyond its articulated-body kernels: whole steps
// against the same calls of kinematics, residual, Jacobian, factor and solve alone.
//
// A table of kernels that notes each call takes the place of the table in use for one step. Then
// steps and the noted calls take turns. The noted calls work on the stepper's own rows, where the
// step left them, so both find the same memory in the same cache. Each repetition is a whole
// comparison: the median of the ratios of neighbours in time counts.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/isa.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tasks/effects/ablation.hpp"

namespace tangere {
namespace {

using kernels::GroupStage;
using kernels::LaneRow;
using kernels::ModelView;

constexpr int kEnvironments = 16, kInstants = 8, kRounds = 201, kStepsOfRound = 20;

/// Not the thread's CPU time: asking for that takes as long as some of the steps.
double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double median(std::vector<double> of) {
  std::nth_element(of.begin(), of.begin() + std::ssize(of) / 2, of.end());
  return of[of.size() / 2];
}

/// One call of an articulated-body kernel. Only what its kind takes is set.
struct Call {
  enum class Kind { kinematics, residual, evaluate, factor, solve, solve_watched } kind;
  const ModelView* model;
  const GroupStage* stage;
  int lone = -1;
  std::optional<LaneRow> accept{};  ///< of a factor that is not of all lanes
  const LaneRow* b = nullptr;
  LaneRow *out = nullptr, *sound = nullptr;
};

const kernels::KernelTable* used = nullptr;  ///< the table that the noted calls go to
std::vector<Call>* noted = nullptr;

void repeat(const Call& c) {
  const auto& kernel = used->group;
  switch (c.kind) {
    case Call::Kind::kinematics: return kernel.kinematics(*c.model, *c.stage);
    case Call::Kind::residual: return kernel.residual(*c.model, *c.stage, c.lone);
    case Call::Kind::evaluate: return kernel.evaluate(*c.model, *c.stage, c.lone);
    case Call::Kind::factor:
      return kernel.factor(*c.model, *c.stage, c.accept ? &*c.accept : nullptr);
    case Call::Kind::solve: return kernel.solve(*c.model, *c.stage, c.b, c.out);
    case Call::Kind::solve_watched:
      return kernel.solve_watched(*c.model, *c.stage, c.b, c.out, c.sound);
  }
}

void note(const Call& call) {
  noted->push_back(call);
  repeat(call);
}

/// Returns the table in use with functions that note their calls.
kernels::KernelTable noting_table() {
  using Kind = Call::Kind;
  kernels::KernelTable table = *used;
  table.group.kinematics = [](const ModelView& m, const GroupStage& s) {
    note({Kind::kinematics, &m, &s});
  };
  table.group.residual = [](const ModelView& m, const GroupStage& s, int lone) {
    note({Kind::residual, &m, &s, lone});
  };
  table.group.evaluate = [](const ModelView& m, const GroupStage& s, int lone) {
    note({Kind::evaluate, &m, &s, lone});
  };
  table.group.factor = [](const ModelView& m, const GroupStage& s, const LaneRow* accept) {
    note({Kind::factor, &m, &s, -1,
          accept == nullptr ? std::nullopt : std::optional<LaneRow>(*accept)});
  };
  table.group.solve = [](const ModelView& m, const GroupStage& s, const LaneRow* b, LaneRow* out) {
    note({Kind::solve, &m, &s, -1, {}, b, out});
  };
  table.group.solve_watched = [](const ModelView& m, const GroupStage& s, const LaneRow* b,
                                 LaneRow* out, LaneRow* sound) {
    note({Kind::solve_watched, &m, &s, -1, {}, b, out, sound});
  };
  return table;
}

/// `joints` hinges in a row, each half across the one before, driven by force motors.
Scene chain(int joints) {
  Scene s;
  s.name = "chain";
  s.timestep = 5e-3;
  ConstantControl control;
  for (int k = 0; k < joints; ++k) {
    LinkDescription link;
    link.parent = k - 1;
    link.name = link.joint.name = link.body.name = "link" + std::to_string(k);
    link.joint.type = JointType::revolute;
    link.joint.axis0 = {k % 2 == 0 ? 0.0 : 1.0, k % 2 == 0 ? 1.0 : 0.0, 0.0};
    link.joint.pose.position = {0, 0, k == 0 ? 0.0 : 0.1};
    link.joint.damping = 0.1;
    link.body.pose.position = {0, 0, 0.05};
    link.body.shape = CuboidShape{{0.03, 0.03, 0.1}};
    link.body.density = 1000;
    s.links.push_back(link);
    s.motors.push_back({link.joint.name, -0.5, 0.5, {}});
    control.values.push_back(0.3 * std::sin(1.0 + k));
  }
  s.control = control;
  return s;
}

/// A shipped scene without contacts and sensors.
Scene without_contacts(const std::string& name) {
  Scene bare = read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene;
  for (const EffectKind kind :
       {EffectKind::pair_contact, EffectKind::ground_contact, EffectKind::tactile})
    bare = without(bare, {kind});
  return bare;
}

/// Blocks of a run that is under way, and the controls of the step that follows.
class Run {
 public:
  explicit Run(const Scene& scene)
      : model_(scene), batch_(model_, kEnvironments, 1), stepper_(model_) {
    const ControlProgram program(model_, model_.timestep(), 1);
    const auto nu = static_cast<std::size_t>(model_.nu());
    std::vector<double> u(nu * kEnvironments);
    const std::int64_t planned =
        program.steps() < 0 ? 200 : std::min<std::int64_t>(program.steps(), 200);
    for (std::int64_t step = 0; step < planned; ++step) {
      for (std::size_t e = 0; e < kEnvironments; ++e)
        program.evaluate(step, static_cast<std::int64_t>(e), std::span(u).subspan(e * nu, nu));
      if (step * kInstants / planned != (step + 1) * kInstants / planned) {
        starts_.push_back(batch_.save_block(0));
        controls_.push_back(u);
      }
      stepper_.step(batch_, u);
    }
  }

  [[nodiscard]] std::size_t instants() const { return starts_.size(); }
  /// Steps from an instant. Returns the seconds of the step alone.
  double step(std::size_t instant) {
    batch_.restore_block(0, starts_[instant]);
    const double start = seconds();
    stepper_.step(batch_, controls_[instant]);
    return seconds() - start;
  }
  /// Returns the articulated-body calls of that step.
  std::vector<Call> calls(std::size_t instant) {
    std::vector<Call> all;
    used = &kernels::active_kernels();
    noted = &all;
    const kernels::KernelTable table = noting_table();
    kernels::use_kernels(table);
    step(instant);
    kernels::use_kernels(*used);
    return all;
  }
  [[nodiscard]] double passes() const {
    double sum = 0;
    for (int e = 0; e < kEnvironments; ++e) sum += batch_.iterations(e);
    return sum / kEnvironments;
  }

 private:
  Model model_;
  Batch batch_;
  Stepper stepper_;
  std::vector<decltype(std::declval<Batch>().save_block(0))> starts_;
  std::vector<std::vector<double>> controls_;
};

void step_over_kernels(benchmark::State& state, const Scene& scene) {
  Run run(scene);
  for (auto _ : state) {
    std::vector<double> ratios, steps, alone;
    double passes = 0;
    for (std::size_t k = 0; k < run.instants(); ++k) {
      const std::vector<Call> calls = run.calls(k);
      passes += run.passes() / static_cast<double>(run.instants());
      for (int round = 0; round < kRounds / kInstants; ++round) {
        double whole = 0, kernels = 0;
        for (int n = 0; n < kStepsOfRound; ++n) {
          whole += run.step(k);
          const double start = seconds();
          for (const Call& call : calls) repeat(call);
          kernels += seconds() - start;
        }
        ratios.push_back(whole / kernels);
        steps.push_back(whole / (kStepsOfRound * kEnvironments));
        alone.push_back(kernels / (kStepsOfRound * kEnvironments));
      }
    }
    state.SetIterationTime(median(steps));
    state.counters["step_us"] = 1e6 * median(steps);
    state.counters["kernels_us"] = 1e6 * median(alone);
    state.counters["passes"] = passes;
    state.counters["ratio"] = median(ratios);
  }
  state.SetLabel(kernels::active_isa_name());
}

void add(const std::string& name, const Scene& scene) {
  benchmark::RegisterBenchmark(
      name.c_str(), [scene](benchmark::State& state) { step_over_kernels(state, scene); })
      ->Iterations(1)
      ->UseManualTime();
}

}  // namespace
}  // namespace tangere

int main(int argc, char** argv) {
  using namespace tangere;
  for (const int joints : {7, 14, 28}) add("chain/" + std::to_string(joints), chain(joints));
  for (const char* name :
       {"rolling_ball", "box_pushing", "cap_opening", "insertion", "stable_grasp"})
    add(std::string("without_contacts/") + name, without_contacts(name));
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
