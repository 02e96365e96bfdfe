// SPDX-License-Identifier: Apache-2.0
// A body's size is what a scene gives. The half lengths that kernels read, mass and inertia follow
// from it. A joint's place moves the frame of its first link.
#include "engine/model/compile_variations.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/model/compile_joints.hpp"
#include "engine/model/link_inertia.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {

using kernels::Frame;
using kernels::kBlock;
using kernels::Link;
using kernels::Vec3;

namespace {

/// Returns the entry of a link. Makes it on first use.
VaryingInertia& varying_inertia(CompiledModel& m, int link) {
  for (VaryingInertia& v : m.varying_inertia)
    if (v.link == link) return v;
  m.varying_inertia.push_back({link, 0, false, inertia_rows(m.links[std::size_t(link)]), {}});
  return m.varying_inertia.back();
}

/// Sums the inertia of all bodies of a link, in the order in which compile() adds them.
InertiaRows sum_anew(const CompiledModel& m, const VaryingInertia& varying, const double* column) {
  Link link{};
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    if (m.bodies[b].link != varying.link) continue;
    Shape shape = m.scene.links[b].body.shape;
    double density = m.scene.links[b].body.density;
    for (const VaryingSize& size : m.varying_sizes)
      for (const VaryingNumber& n : size.numbers)
        if (size.body == static_cast<int>(b)) *size_number(shape, n.which) = column[n.row * kBlock];
    for (const VaryingInertia::Part& part : varying.parts)
      if (part.body == static_cast<int>(b)) density = column[part.row * kBlock];
    const MassProperties properties = mass_properties(shape, density);
    CompiledBody body = m.bodies[b];
    body.mass = properties.mass;
    if (body.mass > 0) add_inertia(link, body, properties);
  }
  return inertia_rows(link);
}

/// Returns the least and the greatest value that a distribution of positive numbers may draw.
std::array<double, 2> bounds(const Distribution& d) {
  if (d.kind != Distribution::Kind::list) return {d.a, d.b};
  const auto [low, high] = std::minmax_element(d.values.begin(), d.values.end());
  return {*low, *high};
}

/// Returns what is wrong with a size some of whose numbers are drawn; "" if nothing is.
std::string drawn_slenderness_fault(const Scene& scene, BodyDescription& body) {
  double least = INFINITY, most = 0;
  for (const SizeNumber& s : row_of(body.shape).sizes) {
    std::array<double, 2> of = {*s.at(body.shape), *s.at(body.shape)};
    for (const RandomizationDescription& r : scene.randomizations)  // the last one applies
      if (r.number.owner == NumberOwner::body && r.number.field != NumberField::density &&
          r.number.name == body.name && size_index(r.number) == s.which)
        of = bounds(r.distribution);
    least = std::min(least, of[0]), most = std::max(most, of[1]);
  }
  return slenderness_fault(row_of(body.shape), least, most);
}

[[noreturn]] void fail(const RandomizationDescription& d, const std::string& why) {
  throw InputError(d.source.prefix() + "'" + name_of(d.number) + "' varies, but " + why);
}

void vary_density(CompiledModel& m, int body, const RandomizationDescription& d, int row) {
  const BodyDescription& b = m.scene.links[std::size_t(body)].body;
  const int link = m.bodies[std::size_t(body)].link;
  if (link < 0) fail(d, "it is fixed in the world");
  VaryingInertia& varying = varying_inertia(m, link);
  const InertiaRows per_density =
      inertia_rows(m.bodies[std::size_t(body)], mass_properties(b.shape, 1));
  for (std::size_t i = 0; i < per_density.size(); ++i)
    varying.constant[i] -= b.density * per_density[i];
  varying.parts.push_back({body, row, per_density});
}

void vary_size(CompiledModel& m, int body, const RandomizationDescription& d, int row) {
  BodyDescription& b = m.scene.links[std::size_t(body)].body;
  CompiledBody& compiled = m.bodies[std::size_t(body)];
  const int which = size_index(d.number);
  if (const std::string fault = drawn_slenderness_fault(m.scene, b); !fault.empty())
    fail(d, "that allows " + fault);
  for (const PairContactDescription& c : m.scene.pair_contacts) {
    if (c.general_body != d.number.name) continue;
    if (c.points.empty() && is_ball(b.shape))
      fail(d, "not where the sphere touches '" + c.primitive_body +
                  "' with its surface; expected it as primitive_body there");
    fail(d,
         "its contact points do not; expected a body that touches nothing with points of its own");
  }
  for (const TactileDescription& t : m.scene.sensors)
    if (t.body == d.number.name)
      fail(d,
           "the points of its tactile sensor '" + t.name + "' do not; expected a body without one");
  for (std::size_t k = 0; k < m.grounds.size(); ++k)
    if (m.scene.ground_contacts[k].body == d.number.name && !is_ball(b.shape))
      fail(d, "the points that touch the ground do not; expected a sphere there");
  if (compiled.size_row < 0) {
    compiled.size_row = static_cast<int>(m.varying_sizes.size());  // until add_derived_rows()
    m.varying_sizes.push_back({body, 0, {}});
    if (compiled.link >= 0 && compiled.mass > 0) varying_inertia(m, compiled.link).anew = true;
  }
  m.varying_sizes[std::size_t(compiled.size_row)].numbers.push_back({which, row});
}

}  // namespace

void vary_body(CompiledModel& m, int body, const RandomizationDescription& d, int row) {
  if (d.number.field == NumberField::density) {
    vary_density(m, body, d, row);
  } else {
    vary_size(m, body, d, row);
  }
}

void vary_place(CompiledModel& m, int joint, const RandomizationDescription& d, int row) {
  const int axis = d.number.component;
  for (VaryingPlace& place : m.varying_places)
    if (place.joint == joint) {
      place.numbers.push_back({axis, row});
      return;
    }
  const int parent = m.scene.links[std::size_t(joint)].parent;
  m.varying_places.push_back(
      {joint,
       0,
       parent < 0 ? Frame<double>{kIdentityFrame.R, Vec3<double>{0, 0, 0} - m.origin}
                  : m.joints[std::size_t(parent)].frame,
       {{axis, row}}});
}

int add_derived_rows(CompiledModel& m, int next) {
  for (VaryingInertia& varying : m.varying_inertia) {
    m.links[std::size_t(varying.link)].inertia_row = varying.row = next;
    next += static_cast<int>(varying.constant.size());
  }
  for (VaryingSize& size : m.varying_sizes) {
    const std::string& name = m.scene.links[std::size_t(size.body)].body.name;
    m.bodies[std::size_t(size.body)].size_row = size.row = next;
    for (std::size_t k = 0; k < m.pairs.size(); ++k)
      if (m.scene.pair_contacts[k].primitive_body == name) m.pairs[k].size_row = next;
    for (std::size_t k = 0; k < m.grounds.size(); ++k)
      if (m.scene.ground_contacts[k].body == name)
        m.grounds[k].radius_row = next, m.grounds[k].extent = 0;
    for (CompiledSensor& sensor : m.sensors)
      if (std::find(sensor.targets.begin(), sensor.targets.end(), size.body) !=
          sensor.targets.end())
        sensor.sizes_vary = true;
    next += 3;
  }
  for (VaryingPlace& place : m.varying_places) {
    Link& link = m.links[std::size_t(m.joints[std::size_t(place.joint)].first_link)];
    link.place_row = place.row = next;
    link.has_offset = true;
    next += 3;
  }
  return next;
}

void update_derived_rows(const CompiledModel& m, double* column) {
  const auto put = [&](int row, const Vec3<double>& x) {
    column[row * kBlock] = x.x, column[(row + 1) * kBlock] = x.y, column[(row + 2) * kBlock] = x.z;
  };
  for (const VaryingInertia& varying : m.varying_inertia) {
    InertiaRows sum = varying.constant;
    if (varying.anew) sum = sum_anew(m, varying, column);
    for (const VaryingInertia::Part& part : varying.parts)
      for (std::size_t i = 0; i < sum.size() && !varying.anew; ++i)
        sum[i] += column[part.row * kBlock] * part.per_density[i];
    for (std::size_t i = 0; i < sum.size(); ++i)
      column[(varying.row + static_cast<int>(i)) * kBlock] = sum[i];
  }
  for (const VaryingSize& size : m.varying_sizes) {
    Shape shape = m.scene.links[std::size_t(size.body)].body.shape;
    for (const VaryingNumber& n : size.numbers)
      *size_number(shape, n.which) = column[n.row * kBlock];
    put(size.row, vec3_of(size_in_kernels(shape)));
  }
  for (const VaryingPlace& place : m.varying_places) {
    Pose pose = m.scene.links[std::size_t(place.joint)].joint.pose;
    for (const VaryingNumber& n : place.numbers)
      pose.position[std::size_t(n.which)] = column[n.row * kBlock];
    put(place.row, compose(place.base, to_frame(pose)).p);
  }
}

}  // namespace tangere
