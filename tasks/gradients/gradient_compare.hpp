// SPDX-License-Identifier: Apache-2.0
// Compares a gradient, input by input, with central differences over a sweep of step sizes and with
// a derivative along one direction. It works for any function of a rollout or an episode.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/step/batch.hpp"
#include "tasks/gradients/gradient_check.hpp"

namespace tangere {

class RunTrace;

/// The central difference at which three neighbouring step sizes agree best, and how well.
struct Difference {
  double value, uncertainty;
};

/// One input to compare.
struct Comparison {
  std::string name;
  std::span<const double> gradient;
  std::vector<std::size_t> among;                     ///< entries that can be moved
  std::function<Difference(std::size_t)> difference;  ///< by entry
  std::function<std::string(std::size_t)> entry_name;
  /// Active-set differences between the runs on both sides of the input, in sentences.
  std::function<std::vector<std::string>(std::size_t)> decisions;
};

/// The inputs of a rollout or an episode.
struct CheckInputs {
  std::vector<double> q, v;  ///< (nq), (nv) where it begins
  std::vector<double> u;     ///< (steps, nu) controls, or (A, action) of a task
};

/// Changes of the inputs; an empty span means no change.
struct InputDirection {
  std::span<const double> u, q, v;  ///< as in CheckInputs, q along the dofs: (nv)
  std::span<const double> numbers;  ///< as rows of BlockCotangent::parameters
};

/// Checks a gradient by all its inputs, one after the other. A derived class defines the function:
/// a scene's loss or a task's return.
class GradientChecker {
 public:
  virtual ~GradientChecker() = default;
  GradientChecker(const GradientChecker&) = delete;
  GradientChecker& operator=(const GradientChecker&) = delete;

  /// Checks by controls or actions, if there are any, by the first state and by the scene's
  /// numbers.
  void check();
  /// Adds the flaws of sensors to the reasons, where there is something to explain.
  void explain();
  [[nodiscard]] const GradientCheck& result() const { return out_; }

 protected:
  GradientChecker(const Model& model, const CheckOptions& options)
      : model_(model), options_(options), parameters_(model) {}

  /// Returns the function's value for each of `inputs`, all in one batch; NaN where a step finds no
  /// solution. Uses the scene `other`, or the unchanged scene if that is null. `varying`: values of
  /// <randomize>, in its order. Adds the states of the runs to `trace`, if any.
  [[nodiscard]] virtual std::vector<double> values(const Scene* other,
                                                   const std::vector<CheckInputs>& inputs,
                                                   const std::vector<double>& varying,
                                                   RunTrace* trace) const = 0;
  [[nodiscard]] virtual double along(const InputDirection& direction) = 0;
  /// The batch whose environment 0 has the scene's numbers to change.
  [[nodiscard]] virtual const Batch& batch() const = 0;
  [[nodiscard]] virtual std::string control_name(std::size_t entry) const = 0;
  /// Whether the function reads tactile fields.
  [[nodiscard]] virtual bool reads_fields() const = 0;

  /// `along`: the derivative along a direction, computed another way.
  void add(const Comparison& c, std::uint32_t purpose,
           const std::function<double(const std::vector<double>&)>& along);
  double along_start(std::vector<double> q, std::vector<double> v, std::span<const double> numbers);
  void check_controls();
  void check_positions();
  void check_velocities();
  void check_numbers();
  /// Moves one entry of the inputs by e.
  using MoveInput = std::function<void(CheckInputs&, double e)>;
  /// Changes numbers of the scene by the relative amount e.
  using MoveScene = std::function<void(Scene&, std::vector<double>& varying, double e)>;
  [[nodiscard]] Difference difference(double scale, const MoveInput& move) const;
  [[nodiscard]] Difference difference_of_scene(const MoveScene& move) const;
  /// Active-set differences between the runs on both sides, at the smallest change that has any.
  [[nodiscard]] std::vector<std::string> decisions(double scale, const MoveInput& move) const;
  [[nodiscard]] std::vector<std::string> decisions_of_scene(const MoveScene& move) const;

  const Model model_;
  const CheckOptions options_;
  NumberGradients parameters_;
  CheckInputs at_;
  std::vector<double> varying_;
  std::vector<double> grad_u_, grad_q_, grad_v_, grad_numbers_;  // the gradient
  const char* u_name_ = "u";
  GradientCheck out_;

 private:
  /// The inputs after each change of sweep(scale).
  [[nodiscard]] std::vector<CheckInputs> moved(double scale, const MoveInput& move) const;
  [[nodiscard]] double value_of_scene(const MoveScene& move, double e, RunTrace* trace) const;
};

std::vector<std::size_t> all_of(std::size_t count);
/// Returns n random numbers in [-1, 1].
std::vector<double> random_direction(std::size_t n, std::uint64_t seed, std::uint32_t purpose);

}  // namespace tangere
