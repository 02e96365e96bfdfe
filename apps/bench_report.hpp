// SPDX-License-Identifier: Apache-2.0
// Reports what `tangere bench` measured: a table for people, an object for programs, a CSV table
// and a picture.
#pragma once

#include <string>
#include <vector>

#include "apps/scene_run.hpp"
#include "engine/model/model.hpp"
#include "tasks/run/benchmark_run.hpp"

namespace tangere::apps {

/// What all runs of one call share.
struct BenchSetting {
  std::string scene;  ///< path
  std::string model, machine, isa;
  int environments = 0;
  BenchmarkOptions options;  ///< its threads have no meaning here
  int every = 0;             ///< steps between fields; 0: none, or sensors differ
  std::string record;        ///< names of the readings; empty: none
  double sleep = 0;          ///< as of a stepper
  int moving_bodies = 0;
};

struct BenchRun {
  int threads = 1;
  BenchmarkResult result;
};

/// Failures of the environments of a run.
std::vector<Failure> failures_of(const BenchRun& run);

/// Steps between fields when all sensors agree, else 0.
int common_interval(const Model& model, const RolloutOptions& rollout);

/// The lines above the table and the two lines of its head.
std::string bench_heading(const BenchSetting& setting);
/// One line of the table. The speed-up refers to the run `first`.
std::string bench_row(const BenchRun& run, const BenchRun& first);
/// The line below the table, with what does not depend on threads.
std::string bench_footing(const BenchSetting& setting, const BenchRun& run);

/// One entry of "runs".
Json bench_entry(const BenchSetting& setting, const BenchRun& run);
/// Scene, machine and the keys of the entries as columns, one row per entry; failures are counted.
std::string bench_csv(const BenchSetting& setting, const Json& entries);
std::string bench_svg(const BenchSetting& setting, const std::vector<BenchRun>& runs);

}  // namespace tangere::apps
