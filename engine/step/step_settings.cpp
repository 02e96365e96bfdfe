// SPDX-License-Identifier: Apache-2.0
// Merges the options of caller and scene, and checks them.
#include "engine/step/step_settings.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace tangere {

namespace {

/// Substeps that keep an accuracy are solved to this share of it, so that the estimate measures the
/// error of the scheme. Residuals of solves accumulate over steps and enter no estimate. So their
/// tolerance is at most `kLooser` times that of plain steps.
constexpr double kShareOfAccuracy = 0.01, kTightest = 1e-9, kLoosest = 1e-4, kLooser = 10;

void check_accuracy(const StepperOptions& o, double accuracy) {
  if (!(accuracy >= 0 && accuracy < 1))
    throw InputError("accuracy " + std::to_string(accuracy) +
                     "; expected a share below 1 (0.01 is one percent), or 0 for plain steps");
  if (accuracy > 0 && o.integrator && o.integrator->scheme().estimate.empty())
    throw InputError(std::string(to_string(*o.integrator)) +
                     " has no estimate of its error, so it cannot keep an accuracy; expected "
                     "another scheme, or none");
}

void check_sleep(const Model& model, double sleep) {
  if (!(sleep >= 0 && sleep < 1))
    throw InputError(model.solver().sleep_source.prefix() + "sleep " + std::to_string(sleep) +
                     "; expected the share of its size that a body may move and still rest, below "
                     "1 (0.001 is usual), or 0 for bodies that never sleep");
  if (sleep > 0 && model.has_shear_state())
    throw InputError(
        model.solver().sleep_source.prefix() +
        "bodies cannot sleep in a scene with ks or friction of joints: its shear state would stand "
        "still, too; expected neither, or no sleep");
  if (sleep > 0 && model.has_followers())
    throw InputError(
        model.solver().sleep_source.prefix() +
        "bodies cannot sleep in a scene with joints that follow others; expected none, "
        "or no sleep");
}

}  // namespace

StepSettings step_settings(const Model& model, const StepperOptions& o) {
  const double accuracy = o.accuracy.value_or(model.solver().accuracy.value_or(0));
  check_accuracy(o, accuracy);
  StepSettings s = {
      .integrator = o.integrator.value_or(keeping_accuracy(model.scene().integrator, accuracy)),
      .timestep = o.timestep.value_or(model.timestep()),
      .tolerance = 0,
      .max_iterations = model.solver().max_iterations,
      .accuracy = accuracy,
      .spare = false,
      .bounded_energy = model.solver().bounded_energy,
      .keep_inert_contacts = o.differentiable || model.solver().keep_inert_contacts,
      .sleep = o.sleep.value_or(model.solver().sleep)};
  check_sleep(model, s.sleep);
  if (!(s.timestep > 0) || !std::isfinite(s.timestep))
    throw InputError("timestep " + std::to_string(s.timestep) + " s; expected a positive number");
  double following = model.following_tolerance(s.integrator, s.timestep);
  if (accuracy > 0)
    following =
        std::min(kLooser * following, std::clamp(kShareOfAccuracy * accuracy, kTightest, kLoosest));
  if (o.differentiable) {
    refuse_sleep(model, s);
    following = kGradientTolerance;
  }
  s.tolerance = o.tolerance.value_or(model.solver().tolerance.value_or(following));
  s.spare = !o.differentiable && !o.tolerance && !model.solver().tolerance;
  if (!(s.tolerance > 0) || !std::isfinite(s.tolerance))
    throw InputError("solver tolerance " + std::to_string(s.tolerance) +
                     "; expected a positive number");
  return s;
}

void refuse_sleep(const Model& model, const StepSettings& settings) {
  if (settings.sleep > 0)
    throw InputError(model.solver().sleep_source.prefix() +
                     "a body that sleeps has no derivatives; expected gradients without --sleep, "
                     "and a <solver_option> without sleep");
}

}  // namespace tangere
