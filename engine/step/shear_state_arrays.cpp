// SPDX-License-Identifier: Apache-2.0
// Names of points with shear springs, and their order in files.
#include "engine/step/shear_state_arrays.hpp"

#include <algorithm>

#include "engine/model/compiled_model.hpp"
#include "engine/scene/scene_number.hpp"

namespace tangere {
namespace {

std::string name_of_contact(const CompiledModel& m, const kernels::ShearSpringContact& of) {
  const auto body = [&](int index) { return m.scene.links[std::size_t(index)].body.name; };
  if (of.sensor >= 0)
    return owner_of({NumberOwner::tactile, NumberField::kn,
                     m.scene.sensors[std::size_t(of.sensor)].name}) +
           " " + body(of.contact.body2);
  if (of.ground) return owner_of({NumberOwner::ground, NumberField::kn, body(of.contact.body1)});
  const PairContactDescription& d = m.scene.pair_contacts[std::size_t(of.pair)];
  return owner_of({NumberOwner::contact, NumberField::kn, d.first_name(), 0, d.primitive_body});
}

}  // namespace

void ShearStateArrays::write(std::span<const ShearEntry> memory, std::span<double> array) const {
  std::fill(array.begin(), array.end(), 0.0);
  for (const ShearEntry& e : memory) std::copy_n(e.s, 3, &array[first_of(e)]);
}

ShearState ShearStateArrays::read_all(std::span<const double> array) const {
  ShearState memory;
  for (std::size_t point = 0; point < count(); ++point) {
    memory.push_back({static_cast<std::int32_t>(point), {}});
    std::copy_n(&array[first_of(memory.back())], 3, memory.back().s);
  }
  return memory;
}

ShearState ShearStateArrays::read(std::span<const double> array) const {
  ShearState memory = read_all(array);
  std::erase_if(memory,
                [](const ShearEntry& e) { return e.s[0] == 0 && e.s[1] == 0 && e.s[2] == 0; });
  return memory;
}

ShearStateArrays shear_state_arrays(const Model& model) {
  const CompiledModel& m = compiled(model);
  ShearStateArrays out;
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    const auto n = std::size_t(of.contact.n_points);
    const bool anchors = m.shear_interval(of) > 0;
    for (const char* part : {anchors ? " b" : "", " a"}) {
      ShearSpringPlaces contact{name_of_contact(m, of) + part, std::vector<Vector3>(n)};
      const auto first = static_cast<int>(out.row_of.size());
      for (std::size_t k = 0; k < n; ++k) {
        const std::size_t at =
            of.sensor < 0 ? k : std::size_t(m.sensors[std::size_t(of.sensor)].in_field[k]);
        std::copy_n(of.contact.points + 3 * k, 3, contact.places[at].begin());
        out.row_of.push_back(first + static_cast<int>(at));
      }
      out.contacts.push_back(std::move(contact));
      if (!anchors) break;
    }
  }
  for (const LinkDescription& link : m.scene.links) {
    const auto dry = std::ranges::count_if(m.dry_dofs, [&](const DryDof& dof) {
      const int first = m.joints[std::size_t(&link - m.scene.links.data())].v;
      return dof.v >= first && dof.v < first + dof_count(link.joint.type);
    });
    if (dry == 0) continue;
    out.contacts.push_back({owner_of({NumberOwner::joint, NumberField::friction, link.joint.name}),
                            std::vector<Vector3>(std::size_t(dry))});
    for (std::ptrdiff_t k = 0; k < dry; ++k)
      out.row_of.push_back(static_cast<int>(out.row_of.size()));
  }
  return out;
}

}  // namespace tangere
