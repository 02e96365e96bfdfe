// SPDX-License-Identifier: Apache-2.0
// Mass and inertia of a body on its link.
#include "engine/model/link_inertia.hpp"

namespace tangere {

InertiaRows inertia_rows(const kernels::Link& link) {
  const auto& I = link.inertia.m;
  return {link.mass,
          link.mass_times_com.x,
          link.mass_times_com.y,
          link.mass_times_com.z,
          I[0][0],
          I[0][1],
          I[0][2],
          I[1][1],
          I[1][2],
          I[2][2]};
}
InertiaRows inertia_rows(const CompiledBody& body, const MassProperties& properties) {
  kernels::Link link{};
  CompiledBody copy = body;
  copy.mass = properties.mass;
  add_inertia(link, copy, properties);
  return inertia_rows(link);
}

InertiaRows inertia_slopes(const CompiledBody& body, const MassProperties& properties,
                           const MassProperties& by) {
  const kernels::Mat3<double>& R = body.frame.R;
  const kernels::Vec3<double> centre = R * properties.centre + body.frame.p, moves = R * by.centre;
  const kernels::Mat3<double> p = kernels::skew(centre), dp = kernels::skew(moves);
  kernels::Link link{};
  link.mass = by.mass;
  link.mass_times_com = by.mass * centre + properties.mass * moves;
  link.inertia = R * by.inertia * kernels::transpose(R) - by.mass * (p * p) -
                 properties.mass * (p * dp + dp * p);
  return inertia_rows(link);
}

void add_inertia(kernels::Link& link, const CompiledBody& body, const MassProperties& properties) {
  const kernels::Mat3<double>& R = body.frame.R;
  const kernels::Vec3<double> centre = R * properties.centre + body.frame.p;
  const kernels::Mat3<double> p = kernels::skew(centre);
  link.has_mass = true;
  link.mass += body.mass;
  link.mass_times_com += body.mass * centre;
  link.inertia += R * properties.inertia * kernels::transpose(R) - body.mass * (p * p);
}

}  // namespace tangere
