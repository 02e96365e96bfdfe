// SPDX-License-Identifier: Apache-2.0
// Treats bodies as free; joints and other contacts would change the duration of an impact.
#include "engine/model/short_touches.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"

namespace tangere {
namespace {

/// Share of the speed that a touch loses by damping that counts as none.
constexpr double kUndamped = 1e-4;
/// Steps of a touch with which a scheme loses less than a twentieth of the speed.
double steps_needed(Integrator integrator) { return integrator.scheme().order > 1 ? 20 : 100; }

/// Returns the speed of a body that has fallen through half of the scene's extent, or 1 m/s without
/// gravity [m/s].
double impact_speed(const CompiledModel& m) {
  const double gravity = std::sqrt(dot(m.view.gravity, m.view.gravity));
  return gravity > 0 ? gravity * m.fall_time : 1;
}

/// Returns the share of its speed that a body loses by the damping of a touch, where one point
/// touches. Law linear: 1 - exp(-π ζ/√(1 - ζ²)), ζ = c/(2 √(k_n m)). The others: 2/3 (k_d/k_n) v to
/// first order in the speed v.
double lost_share(ContactLaw law, double kn, double damping, double inverse_mass, double speed) {
  if (law != ContactLaw::linear) return 2.0 / 3 * damping / kn * speed;
  const double ratio = damping / 2 * std::sqrt(inverse_mass / kn);
  if (ratio >= 1) return 1;
  return 1 - std::exp(-std::numbers::pi * ratio / std::sqrt(1 - ratio * ratio));
}

/// Returns the largest value of a number that may vary; of a normal one, its mean and three
/// deviations.
double largest(const CompiledModel& m, const kernels::Parameter& p) {
  const auto row = std::ranges::find(m.randomized_row, p.row);
  if (p.row < 0 || row == m.randomized_row.end()) return p.value;
  const Distribution& d =
      m.scene.randomizations[std::size_t(row - m.randomized_row.begin())].distribution;
  switch (d.kind) {
    case Distribution::Kind::normal: return d.a + 3 * d.b;
    case Distribution::Kind::list: return std::ranges::max(d.values);
    default: return d.b;
  }
}

double inverse_mass(const CompiledModel& m, int link) {
  const double mass = link < 0 ? 0 : m.links[std::size_t(link)].mass;
  return mass > 0 ? 1 / mass : 0;
}

}  // namespace

std::vector<std::string> short_touches(const Model& model, Integrator integrator, double h) {
  const CompiledModel& m = compiled(model);
  std::vector<std::string> found;
  const double speed = impact_speed(m);
  const auto add = [&](const ContactInfo& contact, const kernels::ContactParameters& of,
                       ContactLaw law, double inverse) {
    if (!(of.kn.value > 0) || !(inverse > 0)) return;
    const double touch = std::numbers::pi / std::sqrt(of.kn.value * inverse),
                 damping = largest(m, of.damping),
                 lost = lost_share(law, of.kn.value, damping, inverse, speed);
    if (lost >= kUndamped || touch >= steps_needed(integrator) * h) return;
    const std::string what =
        damping > 0 ? fmt::format("has a damping that takes {:.2g} % of a speed of {:.2g} m/s",
                                  100 * lost, speed)
                    : "has no damping";
    found.push_back(fmt::format(
        "the contact of '{}' with '{}' {}, and a touch lasts {:.2g} s: "
        "how fast bodies leave it depends on the step of {:.2g} s; expected {}damping, "
        "or steps of {:.2g} s at most with {}",
        contact.first, contact.second, what, touch, h, of.damping.value > 0 ? "more " : "",
        touch / steps_needed(integrator), to_string(integrator)));
  };
  for (std::size_t k = 0; k < m.pairs.size(); ++k)
    if (m.pairs[k].layer_pad < 0)  // a layer relaxes
      add(model.contacts()[k], m.pairs[k].parameters, m.pairs[k].law,
          inverse_mass(m, m.pairs[k].link1) + inverse_mass(m, m.pairs[k].link2));
  for (std::size_t g = 0; g < m.grounds.size(); ++g)
    add(model.contacts()[m.pairs.size() + g], m.grounds[g].parameters, m.grounds[g].law,
        inverse_mass(m, m.grounds[g].link));
  return found;
}

}  // namespace tangere
