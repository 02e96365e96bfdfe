// SPDX-License-Identifier: Apache-2.0
// Contact of the whole surfaces of two bodies, or of a body and the ground, with stiffness by area.
//
// The force is the integral of the contact law over a surface. A body's surface is covered by
// points (surface_points.hpp), which touch the other body's distance function. Where both bodies
// have points, each has half of the stiffness. The ground and planes have none.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// The name by which contacts and files call the ground.
inline constexpr const char* kGroundName = "ground";

struct SurfaceContactDescription {
  std::string body1, body2;  ///< body2 may be "ground", unless a body has this name
  /// By area: kn, ks [N/m³], kt [N s/m³], damping [N s/m⁴]; mu.
  ContactCoefficients coefficients{};
  ContactLaw law = ContactLaw::clamped;  ///< clamped or paper
  /// Distance of neighbouring points of both surfaces [m]. None: that of fitting_pitch().
  std::optional<double> pitch{};
  Source source;
};

/// Distances of neighbouring points of one surface.
struct SurfacePitch {
  double across, along;  ///< as surface_points() takes them [m]
  double target;         ///< `across` without the bound on the number of points [m]
  bool bounded = false;  ///< `target` would take too many points
  bool coarse = false;   ///< the contact is uneven, because `across` is far from `target`
};

/// Returns distances at which points of a body resolve its contact with another one, or the ground:
/// an eighth of the second smallest width of either; if one of them is round, 0.7 times the half
/// width of the place of contact under the weight of the lighter body; and where a round body meets
/// faces, 1/2.5 of the other's smallest width. Both bodies of the contact must exist. `first`:
/// points of body1, else of body2.
SurfacePitch fitting_pitch(const Scene& scene, const SurfaceContactDescription& contact,
                           bool first);

/// Returns an error text; "" if the contact is valid.
std::string contact_fault(const Scene& scene, const SurfaceContactDescription& contact);

/// Adds the contact as one or two pair contacts with points. Returns warnings: points that cannot
/// be near enough, and bodies that are too thin for the stiffness. Throws InputError (file:line)
/// for a fault.
std::vector<std::string> add_surface_contact(Scene& scene,
                                             const SurfaceContactDescription& contact);

}  // namespace tangere
