// SPDX-License-Identifier: Apache-2.0
// Takes bodies as if they were free: what holds them makes their touches longer or shorter.
#include "engine/model/short_touches.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"

namespace tangere {
namespace {

/// Steps of a touch with which a scheme loses less than a twentieth of the speed.
double steps_needed(Integrator integrator) { return integrator.scheme().order > 1 ? 20 : 100; }

double inverse_mass(const CompiledModel& m, int link) {
  const double mass = link < 0 ? 0 : m.links[std::size_t(link)].mass;
  return mass > 0 ? 1 / mass : 0;
}

}  // namespace

std::vector<std::string> short_touches(const Model& model, Integrator integrator, double h) {
  const CompiledModel& m = compiled(model);
  std::vector<std::string> found;
  const auto look = [&](const ContactInfo& contact, const kernels::ContactParameters& of,
                        double inverse) {
    const bool damped = of.damping.value > 0 || of.damping.row >= 0;
    if (damped || !(of.kn.value > 0) || !(inverse > 0)) return;
    const double touch = std::numbers::pi / std::sqrt(of.kn.value * inverse);
    if (touch >= steps_needed(integrator) * h) return;
    found.push_back(
        fmt::format("the contact of '{}' with '{}' has no damping, and a touch lasts {:.2g} s: "
                    "how fast bodies leave it depends on the step of {:.2g} s; expected damping, "
                    "or steps of {:.2g} s at most with {}",
                    contact.first, contact.second, touch, h, touch / steps_needed(integrator),
                    to_string(integrator)));
  };
  for (std::size_t k = 0; k < m.pairs.size(); ++k)
    look(model.contacts()[k], m.pairs[k].parameters,
         inverse_mass(m, m.pairs[k].link1) + inverse_mass(m, m.pairs[k].link2));
  for (std::size_t g = 0; g < m.grounds.size(); ++g)
    look(model.contacts()[m.pairs.size() + g], m.grounds[g].parameters,
         inverse_mass(m, m.grounds[g].link));
  return found;
}

}  // namespace tangere
