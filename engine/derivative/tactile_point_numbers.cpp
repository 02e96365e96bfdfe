// SPDX-License-Identifier: Apache-2.0
// Counts tactile points, and lists those of an array one by one.
#include "engine/derivative/tactile_point_numbers.hpp"

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

static_assert(kPointNumbers == kernels::kPointNumbers && kPointNumbers == 3 + kPointCoefficients);

const char* point_number_name(int k) {
  constexpr const char* kPlace[] = {"x", "y", "z"};
  return k < 3 ? kPlace[k] : number_kind(NumberOwner::tactile, coefficient_field(k - 3)).name;
}

const char* point_number_unit(int k, ContactLaw law) {
  return k < 3 ? "m"
               : to_string(number_kind(NumberOwner::tactile, coefficient_field(k - 3))
                               .unit_of(law == ContactLaw::linear));
}

int first_tactile_point(const Model& model, int sensor) {
  int count = 0;
  for (int k = 0; k < sensor; ++k) count += model.sensors()[std::size_t(k)].points;
  return count;
}

int tactile_points(const Model& model) {
  return first_tactile_point(model, static_cast<int>(model.sensors().size()));
}

ContactCoefficients sensor_coefficients(const Batch& batch, int environment, int sensor) {
  const kernels::ContactParameters& c =
      compiled(batch.model()).sensors[std::size_t(sensor)].parameters;
  const double* column = batch.block(environment / kernels::kBlock) + environment % kernels::kBlock;
  const auto in_force = [column](const kernels::Parameter& p) {
    return p.row < 0 ? p.value : column[p.row * kernels::kBlock];
  };
  return transformed(c, in_force);
}

void add_to_points(TactileDescription& sensor, std::span<const double> change) {
  if (sensor.points.empty()) sensor.points = tactile_points(sensor);
  const std::size_t expected = sensor.points.size() * kPointNumbers;
  if (change.size() != expected)
    throw InputError(sensor.source.prefix() + "tactile sensor '" + sensor.name +
                     "': " + std::to_string(change.size()) + " numbers for its points; expected " +
                     std::to_string(expected));
  const ContactCoefficients& c = sensor.coefficients;
  const double* own = change.data();
  for (TactilePoint& p : sensor.points) {
    for (std::size_t k = 0; k < 3; ++k) p.position[k] += own[k];
    for (std::size_t k = 0; k < kPointCoefficients; ++k) {
      if (own[3 + k] == 0) continue;
      if (c[k] == 0)
        throw InputError(
            sensor.source.prefix() + "points with '" +
            name_of({NumberOwner::tactile, coefficient_field(static_cast<int>(k)), sensor.name}) +
            "' of their own; expected a sensor whose own is not 0");
      p.factors[k] += own[3 + k] / c[k];
    }
    own += kPointNumbers;
  }
}

}  // namespace tangere
