// SPDX-License-Identifier: Apache-2.0
// Compares the bits of states, fields, gradients and shards with those in hashes.txt, for every
// instruction set that was built. One set of each rounding also runs 1, 2 and 17 environments, half
// as long.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "engine/sense/readout.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tests/golden/hash.hpp"

namespace tangere {
namespace {

using testing::Hash;

constexpr std::uint64_t kSeed = 7;
constexpr int kEnvironments = 9;       // of hashes.txt: a group of lanes, and one
constexpr int kMostEnvironments = 17;  // two blocks of 16 lanes, one of them in the last one
const std::string kFile = TANGERE_SOURCE_DIR "/tests/golden/hashes.txt";

/// One row of hashes.txt: a scene, the rounding of products that are added (testing::rounding), the
/// numbers of steps, and hashes as hexadecimal numbers.
struct Row {
  std::string scene, rounding;
  int steps = 0, gradient_steps = 0;
  std::string states, fields, gradients;
};

struct Table {
  std::string mathematics;  // hash of the C library's functions at points
  std::vector<Row> rows;
};

/// Hashes functions of the C library that the engine calls. Another release of that library may
/// round differently in the last bit, and then no hash of hashes.txt means anything.
std::string mathematics() {
  Hash hash;
  double x = 1e-3;
  for (int i = 0; i < 4000; ++i) {
    const double values[] = {std::sin(x),      std::cos(x),        std::exp(-x),
                             std::log(x),      std::atan2(x, 2.0), std::acos(1 / (1 + x)),
                             std::pow(x, 0.3), std::tanh(x)};
    hash.add(std::span<const double>(values));
    x *= 1.0037;
  }
  return hash.text();
}

Table read_table() {
  Table table;
  std::ifstream file(kFile);
  std::string line;
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    Row row;
    words >> row.scene;
    if (row.scene == "mathematics") {
      words >> table.mathematics;
    } else {
      words >> row.rounding >> row.steps >> row.gradient_steps >> row.states >> row.fields >>
          row.gradients;
      table.rows.push_back(row);
    }
  }
  return table;
}

/// Hashes of one environment each.
struct EnvironmentHashes {
  std::vector<Hash> states, fields;
  std::vector<Hash> half_states, half_fields;  ///< after half of the steps
};

/// Runs a scene's own controls. Each environment's hash takes in its state, status, passes and
/// residual after every step, and all fields after every tenth.
EnvironmentHashes run(const Model& model, int environments, int steps, bool half = false) {
  Batch batch(model, environments, kSeed);
  Stepper stepper(model);
  Readout readout(model);
  const ControlProgram controls(model, stepper.timestep(), kSeed);
  const auto nu = std::size_t(model.nu());
  std::vector<double> u(std::size_t(environments) * nu), q(std::size_t(model.nq())),
      v(std::size_t(model.nv())), force;
  EnvironmentHashes hashes;
  hashes.states.resize(std::size_t(environments));
  hashes.fields.resize(std::size_t(environments));
  const int middle = (steps + 1) / 2;
  for (int step = 0; step < (half ? middle : steps); ++step) {
    for (int e = 0; e < environments; ++e)
      controls.evaluate(step, batch.episode(e), std::span(u).subspan(std::size_t(e) * nu, nu));
    stepper.step(batch, u);
    for (int e = 0; e < environments; ++e) {
      batch.get_q(e, q);
      batch.get_v(e, v);
      Hash& hash = hashes.states[std::size_t(e)];
      hash.add(q);
      hash.add(v);
      hash.add(std::vector<double>{double(static_cast<int>(batch.status(e))),
                                   double(batch.iterations(e)), batch.residual(e)});
      if (step % 10 != 9 || failed(batch.status(e))) continue;
      for (std::size_t s = 0; s < model.sensors().size(); ++s) {
        force.resize(std::size_t(model.sensors()[s].points) * 3);
        readout.tactile(batch, e, int(s), force);
        hashes.fields[std::size_t(e)].add(force);
      }
    }
    if (step + 1 == middle) hashes.half_states = hashes.states, hashes.half_fields = hashes.fields;
  }
  return hashes;
}

std::string combined(std::span<const Hash> hashes) {
  Hash all;
  for (const Hash& hash : hashes) all.add(hash.text());
  return all.text();
}

/// Hashes gradients of a loss on fields, or on the last state where nothing feels.
std::string gradients(const Model& model, int environments, int steps) {
  if (steps == 0) return "-";
  TapeOptions options;
  options.length = steps;
  options.parameters = true;
  const Batch start(model, environments, kSeed);
  const ControlProgram controls(model, model.timestep(), kSeed);
  const StepControls u = [&](std::int64_t step, int environment, std::span<double> out) {
    controls.evaluate(step, start.episode(environment), out);
  };
  const LossKind kind = model.sensors().empty() ? LossKind::final_state : LossKind::tactile;
  const auto loss = make_loss(kind, model, 10);
  const auto path = make_loss(LossKind::path, model, 10);
  const RolloutLoss* losses[] = {loss.get(), path.get()};
  const GradientSummary summary = rollout_gradients(start, u, options, losses);
  Hash hash;
  for (const LossGradient& g : summary.losses)
    for (const auto* array : {&g.value, &g.u, &g.q, &g.v, &g.parameters}) hash.add(*array);
  return hash.text();
}

/// The first environments of batches of other sizes have the same bits.
void expect_no_effect_of_size(const Model& model, const Row& row, const EnvironmentHashes& nine) {
  for (const int environments : {1, 2, kMostEnvironments}) {
    const EnvironmentHashes other = run(model, environments, row.steps, true);
    for (int e = 0; e < std::min(environments, kEnvironments); ++e) {
      const auto i = std::size_t(e);
      EXPECT_EQ(other.half_states[i].text(), nine.half_states[i].text())
          << row.scene << ": environment " << e << " of " << environments;
      EXPECT_EQ(other.half_fields[i].text(), nine.half_fields[i].text())
          << row.scene << ": environment " << e << " of " << environments;
    }
  }
}

Row computed(const Row& row, bool all_sizes) {
  Row result = row;
  const Model model(read_scene(TANGERE_SOURCE_DIR "/scenes/" + row.scene).scene);
  const EnvironmentHashes nine = run(model, kEnvironments, row.steps);
  if (all_sizes) expect_no_effect_of_size(model, row, nine);
  result.states = combined(nine.states);
  result.fields = model.sensors().empty() ? "-" : combined(nine.fields);
  result.gradients = gradients(model, kEnvironments, row.gradient_steps);
  return result;
}

std::string text(const Row& row) {
  std::ostringstream out;
  out << row.scene << ' ' << row.rounding << ' ' << row.steps << ' ' << row.gradient_steps << ' '
      << row.states << ' ' << row.fields << ' ' << row.gradients;
  return out.str();
}

/// Writes the table that would hold to the file that TANGERE_GOLDEN_OUTPUT names: hashes.txt after
/// a change of bits that is meant.
void print(const Table& table) {
  const char* path = std::getenv("TANGERE_GOLDEN_OUTPUT");
  if (path == nullptr) return;
  std::ofstream out(path);
  out << "mathematics " << table.mathematics << '\n';
  for (const Row& row : table.rows) out << text(row) << '\n';
}

TEST(GoldenScenes, KeepTheirBits) {
  Table table = read_table();
  ASSERT_GE(table.rows.size(), 80u) << kFile;
  const bool same_library = table.mathematics == mathematics();
  table.mathematics = mathematics();
  std::set<std::string> rewritten;
  for (const kernels::KernelTable* kernels : kernels::available_kernels()) {
    kernels::use_kernels(*kernels);
    const std::string rounding = testing::rounding(kernels->name);
    const bool first = rewritten.insert(rounding).second;
    for (Row& row : table.rows) {
      if (row.rounding != rounding) continue;
      const Row found = computed(row, kernels == kernels::available_kernels().front());
      // Instruction sets are compared with each other even where the C library is another one.
      if (same_library || !first) {
        EXPECT_EQ(text(found), text(row)) << "kernels: " << kernels->name;
      }
      if (first) row = found;
    }
  }
  print(table);
  if (!same_library)
    GTEST_SKIP() << "this C library rounds functions differently from the one of hashes.txt: "
                    "instruction sets and sizes of batches were compared with each other alone";
}

}  // namespace
}  // namespace tangere
