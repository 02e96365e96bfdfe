// SPDX-License-Identifier: Apache-2.0
// A gradient against central differences, over a sweep of step sizes, and against a derivative
// along one direction: input by input, of whatever a rollout or an episode comes to.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

/// One kind of input. Errors are relative to the norm of the gradient by it, (numbers of the scene:
/// by their relative change).
struct CheckedInput {
  std::string name;          ///< "u" or "actions", "q", "v", "numbers", "points"
  std::size_t entries = 0;   ///< the gradient has
  std::size_t compared = 0;  ///< with differences
  std::size_t kinks =
      0;            ///< left out: differences that do not settle, or whose runs find no solution
  double norm = 0;  ///< of the gradient
  double scale =
      0;  ///< what errors are measured by: that, or the norm of the differences if it is larger
  bool influence = true;        ///< false: derivatives and differences are nothing beside the loss;
                                ///< nothing is compared
  double difference_error = 0;  ///< largest among those compared
  std::string worst;            ///< where
  double tangent_error = 0;     ///< |g·d - tangent|/(|g| |d|) along a random direction
};

/// Step sizes of a sweep, each a quarter of the one before, forward and back: a block of
/// environments.
inline constexpr int kSweepLevels = 8;
/// Changes of an input whose entries are of size `scale`: +, -, of the largest step size first.
std::array<double, 2 * kSweepLevels> sweep(double scale);

/// The central difference at which three neighbouring step sizes agree best, and how well.
struct Difference {
  double value, doubt;
};
/// `values`: of the function after the changes of sweep(scale).
Difference best_difference(std::span<const double> values, double scale);

/// Changes of positions are as they are, times 1 m or rad; velocities and controls change more.
inline constexpr double kVelocityScale = 10, kControlScale = 10;

struct CompareOptions {
  int entries =
      24;  ///< of each input that differences are taken of, drawn if there are more; 0: all
  std::uint64_t seed = 0;  ///< of that draw and of the directions
  double settled = 3e-6;   ///< of the gradient's norm: neighbouring step sizes agree so far, or it
                           ///< counts as a kink
};

/// What is compared of one input.
struct Comparison {
  std::string name;
  std::span<const double> gradient;
  std::vector<std::size_t> among;                     ///< entries that can be moved
  std::function<Difference(std::size_t)> difference;  ///< by entry
  std::function<std::string(std::size_t)> entry_name;
};
/// `loss`: what an influence is measured by; `purpose` keys the draw of entries.
CheckedInput compare(const Comparison& c, double loss, const CompareOptions& options,
                     std::uint32_t purpose);
/// `along`: the derivative along `direction` by another way.
void compare_along(CheckedInput& c, std::span<const double> gradient,
                   std::span<const double> direction, double along);

/// A gradient by numbers of a scene, by their relative change.
struct RelativeGradient {
  std::vector<double> has, gradient;  ///< what the environment has of them; times what it was
  std::vector<std::size_t> given;     ///< not zero: there is something to change a little

  /// `varying`: values of what the scene randomises, in its order.
  RelativeGradient(const NumberGradients& parameters, const Scene& scene,
                   std::span<const double> varying, std::span<const double> gradient);
  [[nodiscard]] std::vector<double> change(std::span<const double> relative) const;
};

struct GradientCheck {
  double loss = 0;
  std::vector<CheckedInput> inputs;
  [[nodiscard]] double max_relative_error() const;
  [[nodiscard]] std::size_t entries() const;  ///< compared
  [[nodiscard]] std::size_t kinks() const;
};

/// The inputs of a rollout or an episode.
struct CheckInputs {
  std::vector<double> q, v;  ///< (nq), (nv) where it begins
  std::vector<double> u;     ///< (steps, nu) controls, or (A, action) of a task
};

/// Changes of them; empty: none.
struct InputDirection {
  std::span<const double> u, q, v;  ///< as in CheckInputs, q along the dofs: (nv)
  std::span<const double> numbers;  ///< as rows of BlockCotangent::parameters
};

/// Checks a gradient by all its inputs, one after the other. Of what, a scene's loss or a task's
/// return, says a class derived from it.
class GradientChecker {
 public:
  virtual ~GradientChecker() = default;
  GradientChecker(const GradientChecker&) = delete;
  GradientChecker& operator=(const GradientChecker&) = delete;

  /// By controls or actions, if there are any, first state and the scene's numbers.
  void check();
  [[nodiscard]] const GradientCheck& result() const { return out_; }

 protected:
  GradientChecker(const Model& model, const CompareOptions& options)
      : model_(model), options_(options), parameters_(model) {}

  /// What each of `inputs` comes to, side by side, NaN where a step finds no solution; in `other`,
  /// or in the scene as it is when that is null. `varying`: what the scene randomises, in its
  /// order.
  [[nodiscard]] virtual std::vector<double> values(const Scene* other,
                                                   const std::vector<CheckInputs>& inputs,
                                                   const std::vector<double>& varying) const = 0;
  [[nodiscard]] virtual double along(const InputDirection& direction) = 0;
  /// Whose environment 0 has the numbers of the scene that are changed.
  [[nodiscard]] virtual const Batch& batch() const = 0;
  [[nodiscard]] virtual std::string control_name(std::size_t entry) const = 0;

  /// `along`: the derivative along a direction by another way.
  void add(const Comparison& c, std::uint32_t purpose,
           const std::function<double(const std::vector<double>&)>& along);
  void check_controls();
  void check_positions();
  void check_velocities();
  void check_numbers();
  /// change(inputs, e): one entry of the inputs moved by e.
  [[nodiscard]] Difference difference(
      double scale, const std::function<void(CheckInputs&, double)>& change) const;
  /// change(scene, varying, e): numbers of the scene, by their relative change.
  [[nodiscard]] Difference difference_of_scene(
      const std::function<void(Scene&, std::vector<double>&, double)>& change) const;

  const Model model_;
  const CompareOptions options_;
  NumberGradients parameters_;
  CheckInputs at_;
  std::vector<double> varying_;
  std::vector<double> by_u_, by_q_, by_v_, by_numbers_;  // the gradient
  const char* u_name_ = "u";
  GradientCheck out_;
};

std::vector<std::size_t> all_of(std::size_t count);
/// Numbers in [-1, 1].
std::vector<double> random_direction(std::size_t n, std::uint64_t seed, std::uint32_t purpose);

}  // namespace tangere
