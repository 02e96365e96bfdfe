// SPDX-License-Identifier: Apache-2.0
// Distances to coarser runs of the same scheme show errors that two schemes at one step share.
#include "tasks/accuracy/measured_order.hpp"

#include <algorithm>
#include <cmath>

#include "engine/scene/scene_number.hpp"

namespace tangere {
namespace {

/// Whether a contact or a sensor has ks in some environment.
bool has_ks(const Scene& scene, const SceneNumber& ks, const ContactCoefficients& coefficients) {
  return coefficients.ks != 0 || randomization_of(scene, ks) >= 0;
}

}  // namespace

RichardsonEstimate richardson(double to_twice, double to_four_times) {
  if (to_twice == 0) return {RichardsonEstimate::kMostOrder, 0};
  if (!std::isfinite(to_twice)) return {RichardsonEstimate::kLeastOrder, HUGE_VAL};
  const double power = to_four_times / to_twice - 1;
  const double order = power > 0 ? std::log2(power) : 0;
  const double q =
      std::clamp(order, RichardsonEstimate::kLeastOrder, RichardsonEstimate::kMostOrder);
  return {q, to_twice / (std::exp2(q) - 1)};
}

std::vector<std::string> first_order_laws(const Scene& scene) {
  std::vector<std::string> laws;
  const auto add = [&](const std::string& what, const SceneNumber& ks,
                       const ContactCoefficients& coefficients) {
    if (has_ks(scene, ks, coefficients)) laws.push_back("ks of " + what);
  };
  for (const PairContactDescription& d : scene.pair_contacts)
    add("the contact of '" + d.general_body + "' with '" + d.primitive_body + "'",
        {NumberOwner::contact, NumberField::ks, d.general_body, 0, d.primitive_body},
        d.coefficients);
  for (const GroundContactDescription& d : scene.ground_contacts)
    add("the contact of '" + d.body + "' with the ground",
        {NumberOwner::ground, NumberField::ks, d.body}, d.coefficients);
  for (const TactileDescription& d : scene.sensors)
    add("sensor '" + d.name + "'", {NumberOwner::tactile, NumberField::ks, d.name}, d.coefficients);
  for (const MotorDescription& d : scene.motors)
    if (d.control == MotorControl::position && d.timing == MotorTiming::start)
      laws.push_back("timing=\"start\" of the motor of '" + d.joint + "'");
  return laws;
}

}  // namespace tangere
