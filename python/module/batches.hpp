// SPDX-License-Identifier: Apache-2.0
// A batch with all that steps and reads it: a stepper and a readout for each thread.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/sense/readout.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "engine/step/stepper.hpp"
#include "python/module/arrays.hpp"
#include "python/module/varying_numbers.hpp"
#include "python/module/whole_number.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere::python {

struct BatchOptions {
  std::uint64_t seed = 0;
  std::int64_t first_episode = 0;
  int threads = 1;
  Precision precision = Precision::mixed;
  StepperOptions stepper;
};

/// What a run leaves, F = steps / every frames: (F, E, …).
struct Run {
  Model model;
  double interval;  ///< between frames [s]
  nb::dict randomized;
  Array<double> q, v;
  std::map<std::string, nb::object> readings;
  Array<std::int8_t> status;  ///< (E) of the last step
};

/// Numbers of a batch in place: blocks, lanes, numbers.
using View = nb::ndarray<nb::numpy, const double, nb::ndim<3>>;

class PythonBatch {
 public:
  PythonBatch(const Model& model, int environments, const BatchOptions& options);

  void step(const Argument<double>& u);
  Run run(const Argument<double>& u, const Whole<int>& interval,
          const std::vector<std::string>& readings, const nb::object& environments);
  nb::object tactile(const std::string& reading, const nb::object& out);
  [[nodiscard]] Array<double> q();
  [[nodiscard]] Array<double> v();
  [[nodiscard]] View q_view(nb::handle owner) const { return view(owner, &Batch::q_lanes); }
  [[nodiscard]] View v_view(nb::handle owner) const { return view(owner, &Batch::v_lanes); }
  [[nodiscard]] Array<double> end_effectors();
  nb::tuple bodies();
  nb::tuple faces(const Whole<int>& environment, double half_space);
  nb::dict randomized();
  nb::dict counts();
  void set_randomized(const NamedValues& values, const nb::object& environments);
  [[nodiscard]] Array<std::int8_t> status();
  void set_state(const Argument<double>& q, const Argument<double>& v,
                 const nb::object& environments);
  [[nodiscard]] Array<std::int64_t> steps();
  void set_steps(const std::vector<Whole<std::int64_t>>& steps, const nb::object& environments);
  [[nodiscard]] Array<double> transmission_forces(const Argument<double>& u);
  [[nodiscard]] Array<double> shear_state();
  void set_shear_state(const Argument<double>& state, const nb::object& environments);
  void reset(const nb::object& environments,
             const std::optional<std::vector<Whole<std::int64_t>>>& episodes);
  Array<double> scene_controls(const Whole<std::int64_t>& count_of_steps);

  [[nodiscard]] const Model& model() const { return batch_.model(); }
  [[nodiscard]] int environments() const { return batch_.environments(); }
  [[nodiscard]] int threads() const { return static_cast<int>(workers_.size()); }
  [[nodiscard]] std::uint64_t seed() const { return batch_.seed(); }
  [[nodiscard]] std::int64_t loads_not_carried() const {
    std::int64_t sum = 0;
    for (const Worker& worker : workers_) sum += worker.readout.loads_not_carried();
    return sum;
  }

 private:
  struct Waiting;
  struct Worker {
    Stepper stepper;
    Readout readout;
  };

  using GetCoordinates = void (Batch::*)(int, std::span<double>) const;
  using GetLanes = std::span<const double> (Batch::*)(int) const;

  [[nodiscard]] Array<double> coordinates(int width, GetCoordinates get);
  [[nodiscard]] View view(nb::handle owner, GetLanes get) const;
  [[nodiscard]] std::size_t count() const { return as_size(environments()); }
  void take_step(Worker& worker, int block, std::span<const double> u);
  [[nodiscard]] FieldOutput reading_named(const std::string& name) const;
  [[nodiscard]] Shape shape_of_reading(FieldOutput output) const;
  [[nodiscard]] std::vector<int> listed(const nb::object& environments) const;
  template <class T>
  nb::object read(FieldOutput output, const nb::object& out);
  template <class T>
  Run run_as(std::span<const double> u, std::size_t steps, std::size_t every,
             const std::vector<std::string>& readings, const std::vector<int>& moving);

  Batch batch_;
  ShearStateArrays shear_arrays_;
  Precision precision_;
  std::vector<StepCounts> counts_;  // of each environment's episode
  std::vector<Worker> workers_;     // by the thread's index in the arena
  BlockThreads threads_;
  InUse in_use_;
};

}  // namespace tangere::python
