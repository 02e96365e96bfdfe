// SPDX-License-Identifier: Apache-2.0
// Compares a gradient, input by input, with central differences over a sweep of step sizes and with
// a derivative along one direction. It works for any function of a rollout or an episode.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

class RunTrace;

/// One kind of input. Errors are relative to the norm of the gradient by it; for numbers of the
/// scene, by their relative changes.
struct CheckedInput {
  std::string name;          ///< "u" or "actions", "q", "v", "numbers", "points"
  std::size_t entries = 0;   ///< in the gradient
  std::size_t compared = 0;  ///< with differences
  std::size_t kinks =
      0;  ///< entries left out: their differences do not settle, or their runs find no solution
  double norm = 0;  ///< of the gradient
  double scale =
      0;  ///< reference of the errors: that norm, or the norm of the differences if larger
  bool influence = true;  ///< false: all derivatives and differences are negligible, none compared
  double difference_error = 0;          ///< largest among the compared entries
  std::string worst;                    ///< the entry of that error
  std::vector<std::size_t> to_explain;  ///< the first entries at kinks; that error's if too large
  double tangent_error = 0;             ///< |g·d - tangent|/(|g| |d|) along a random direction
};

/// Number of step sizes of a sweep. Each is a quarter of the one before and is taken in both
/// directions, so a sweep fills a block of environments.
inline constexpr int kSweepLevels = 8;
/// Changes of an input whose entries have size `scale`: +, -, largest step size first.
std::array<double, 2 * kSweepLevels> sweep(double scale);

/// The central difference at which three neighbouring step sizes agree best, and how well.
struct Difference {
  double value, doubt;
};
/// `values`: the function after each change of sweep(scale).
Difference best_difference(std::span<const double> values, double scale);

/// Scales of changes. Positions use 1 (m or rad); velocities and controls change more.
inline constexpr double kVelocityScale = 10, kControlScale = 10;

struct CompareOptions {
  int entries = 24;        ///< compared entries per input, drawn if there are more; 0: all
  std::uint64_t seed = 0;  ///< for that draw and the directions
  double settled =
      3e-6;  ///< agreement of neighbouring step sizes, of the gradient's norm; else a kink
  double tolerance = 1e-4;  ///< largest error of a check that passes, of a gradient's norm
};

/// One input to compare.
struct Comparison {
  std::string name;
  std::span<const double> gradient;
  std::vector<std::size_t> among;                     ///< entries that can be moved
  std::function<Difference(std::size_t)> difference;  ///< by entry
  std::function<std::string(std::size_t)> entry_name;
  /// What runs on both sides of the input decide differently, in sentences.
  std::function<std::vector<std::string>(std::size_t)> decisions;
};
/// `loss`: reference for the influence of the input. `purpose`: key for the draw of entries.
CheckedInput compare(const Comparison& c, double loss, const CompareOptions& options,
                     std::uint32_t purpose);
/// `along`: the derivative along `direction`, computed another way.
void compare_along(CheckedInput& c, std::span<const double> gradient,
                   std::span<const double> direction, double along);

/// A gradient by relative changes of a scene's numbers.
struct RelativeGradient {
  std::vector<double> has, gradient;  ///< values in the environment; gradient times values
  std::vector<std::size_t>
      given;  ///< indices of values that are not zero, which a relative change moves

  /// `varying`: values of what the scene randomises, in its order.
  RelativeGradient(const NumberGradients& parameters, const Scene& scene,
                   std::span<const double> varying, std::span<const double> gradient);
  [[nodiscard]] std::vector<double> change(std::span<const double> relative) const;
};

struct GradientCheck {
  double loss = 0;
  std::vector<CheckedInput> inputs;
  double tolerance = 0;  ///< that of the options
  /// Sentences on why derivatives may not exist: at kinks, and where an error is too large.
  std::vector<std::string> reasons;
  /// Whether something was compared, and no error exceeds the tolerance.
  [[nodiscard]] bool passed() const { return entries() > 0 && max_relative_error() <= tolerance; }
  [[nodiscard]] double max_relative_error() const;
  [[nodiscard]] std::size_t entries() const;  ///< that are compared
  [[nodiscard]] std::size_t kinks() const;
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
  GradientChecker(const Model& model, const CompareOptions& options)
      : model_(model), options_(options), parameters_(model) {}

  /// Returns the function's value for each of `inputs`, all in one batch; NaN where a step finds no
  /// solution. Uses the scene `other`, or the unchanged scene if that is null. `varying`: values of
  /// what the scene randomises, in its order. Adds the states of the runs to `trace`, if any.
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
  /// What the runs on both sides decide differently at the smallest change at which they do.
  [[nodiscard]] std::vector<std::string> decisions(double scale, const MoveInput& move) const;
  [[nodiscard]] std::vector<std::string> decisions_of_scene(const MoveScene& move) const;

  const Model model_;
  const CompareOptions options_;
  NumberGradients parameters_;
  CheckInputs at_;
  std::vector<double> varying_;
  std::vector<double> by_u_, by_q_, by_v_, by_numbers_;  // the gradient
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
