// SPDX-License-Identifier: Apache-2.0
// A tape of any scene: what tangere.torch.Simulation and tangere.jax.Simulation call.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/derivative/readout_pullback.hpp"
#include "engine/sense/readout.hpp"
#include "python/module/arrays.hpp"
#include "python/module/varying_numbers.hpp"
#include "python/module/whole_number.hpp"
#include "tasks/catalogue/scene_task.hpp"
#include "tasks/gradients/task_tape.hpp"

namespace tangere::python {

/// What SceneTape keeps of its arguments: other points or parameters compile the scene again.
struct TapeArguments {
  Scene scene;
  std::optional<std::vector<std::string>> readings;
  int every;
  int environments;
  TapeOptions options;
  std::vector<std::string> parameters = {};
};

/// Where a run starts instead of where the scene draws it.
struct TapeStart {
  std::optional<Argument<double>> q, v, shear_state;
  std::optional<NamedValues> numbers;
};

/// Parameters that are the same in all environments, and their values: the scene is compiled with
/// them.
using SharedNumbers = std::map<std::string, double>;

class SceneTape {
 public:
  explicit SceneTape(TapeArguments arguments);

  void add_parameters(const std::vector<std::string>& names);
  void reset(const Whole<std::uint64_t>& seed, const TapeStart& start,
             const std::optional<Argument<double>>& points, bool record);
  void step(const Argument<double>& controls, const std::optional<NamedValues>& numbers);
  void check_step(const Argument<double>& controls);
  Array<double> observations();
  Array<std::int8_t> status();
  nb::tuple reverse(const Argument<double>& observation_bar);
  nb::tuple reverse_start(const Argument<double>& observation_bar);
  void begin_reverse();
  Array<double> varying();
  Array<double> bodies(const Argument<double>& q, const Argument<double>& v,
                       const Argument<double>& varying);
  nb::tuple reverse_bodies(const Argument<double>& q, const Argument<double>& v,
                           const Argument<double>& varying, const Argument<double>& body_bar);

  /// Returns what `get` returns of the tape of now, as a copy: a reset or new parameters may
  /// compile another scene.
  template <class Get>
  auto current(Get get) {
    const InUse::Turn turn(in_use_);
    return get(std::as_const(*this));
  }
  [[nodiscard]] const TaskSpec& spec() const { return taped_->task.spec(); }
  [[nodiscard]] const Model& model() const { return taped_->task.model(); }
  [[nodiscard]] const std::vector<std::string>& parameters() const { return arguments_.parameters; }
  [[nodiscard]] std::vector<std::string> units() const;
  [[nodiscard]] SharedNumbers shared() const;
  [[nodiscard]] std::size_t count() const { return as_size(arguments_.environments); }
  [[nodiscard]] std::int64_t taken() const { return taped_->tape.taken(); }
  [[nodiscard]] std::size_t point_count() const;
  [[nodiscard]] std::size_t shear_points() const { return taped_->shear_points; }

 private:
  /// A compiled scene, its tape, and where its parameters are.
  struct Taped {
    Taped(const Scene& scene, const TapeArguments& arguments);
    SceneTask task;
    TaskTape tape;
    std::size_t number_count, shear_points;
    std::vector<std::size_t> rows;              ///< (parameters) among numbers with derivatives
    std::vector<std::string> units;             ///< (parameters)
    std::map<std::string, SceneNumber> shared;  ///< parameters that are the same in all
  };
  /// States whose bodies are read.
  struct Posed {
    explicit Posed(const Model& model, int environments)
        : batch(model, environments), readout(model), pullback(model) {}
    Batch batch;
    Readout readout;
    ReadoutPullback pullback;
  };

  [[nodiscard]] TaskTape& tape() { return taped_->tape; }
  [[nodiscard]] std::size_t nq() const { return as_size(model().nq()); }
  [[nodiscard]] std::size_t nv() const { return as_size(model().nv()); }
  [[nodiscard]] std::size_t width() const { return spec().observation_size(); }
  [[nodiscard]] std::size_t varying_count() const { return model().scene().randomizations.size(); }
  [[nodiscard]] Shape controls_shape() const {
    return {count(), as_size(arguments_.every), as_size(model().nu())};
  }
  void compile(TapeArguments arguments, std::vector<double> moved, SharedNumbers shared);
  void start(const TapeStart& start, bool record);
  void expect_reverse();
  void add_points(std::size_t environment, std::span<const double> own,
                  std::span<double> points) const;
  [[nodiscard]] std::vector<double> merged(const NamedValues& values, bool placed) const;
  void draw_numbers();
  void set_numbers(std::vector<double> numbers);
  void refuse_sensors(const NamedValues& values) const;
  [[nodiscard]] SharedNumbers shared_in(const NamedValues& values) const;
  void normalise_quaternions(std::span<double> q) const;
  std::vector<double> collect(std::span<const double> all, const std::vector<std::string>& given);
  Posed& posed(const Argument<double>& q, const Argument<double>& v,
               const Argument<double>& varying);

  TapeArguments arguments_;
  std::unique_ptr<Taped> taped_;
  std::optional<Batch> numbers_;  ///< its numbers are those of the last reset or step, checked
  std::optional<Posed> posed_;    ///< made when bodies are read
  std::uint64_t seed_ = 0;
  std::vector<double> drawn_, now_;  ///< (E, varying_count()) at the start, in the last step
  std::vector<double> first_q_;
  bool sheared_ = false;                         ///< the run starts with a given shear state
  std::vector<std::vector<std::string>> given_;  ///< names that each step was given
  std::size_t left_ = 0;                         ///< steps to reverse
  std::vector<double> carried_;  ///< (E, names) derivatives by what later steps were not given
  std::vector<double> moved_;    ///< (points, 7) of the compiled scene; empty: none
  SharedNumbers shared_;  ///< of the compiled scene; others are those of the arguments' scene
  InUse in_use_;
};

}  // namespace tangere::python
