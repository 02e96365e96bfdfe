// SPDX-License-Identifier: Apache-2.0
// Two passes: first shear and its largest length, then the division.
#include "engine/sense/flow_map.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

template <class T>
void check(std::span<const ShearField<T>> fields, std::size_t room) {
  std::size_t numbers = 0;
  for (const ShearField<T>& field : fields) {
    if (field.force.size() % 3 != 0)
      throw InputError("a tactile field of " + std::to_string(field.force.size()) +
                       " numbers; expected three a point");
    if (!field.before.empty() && field.before.size() != field.force.size())
      throw InputError("tactile fields of " + std::to_string(field.force.size()) +
                       " and, before, " + std::to_string(field.before.size()) +
                       " numbers; expected the same sensor");
    numbers += field.force.size() / 3 * 2;
  }
  if (numbers != room)
    throw InputError("a flow map of " + std::to_string(room) + " numbers; expected " +
                     std::to_string(numbers));
}

template <class T>
double normalise(std::span<const ShearField<T>> fields, std::span<T> flow, double smallest) {
  check(fields, flow.size());
  double longest = 0;
  T* to = flow.data();
  for (const ShearField<T>& field : fields) {
    for (std::size_t k = 0; k < field.force.size(); k += 3, to += 2) {
      for (std::size_t c = 0; c < 2; ++c)
        to[c] =
            field.before.empty() ? field.force[k + c] : field.force[k + c] - field.before[k + c];
      longest = std::max(longest, std::hypot(double(to[0]), double(to[1])));
    }
  }
  if (!(longest > smallest)) {
    std::fill(flow.begin(), flow.end(), T(0));
  } else {
    // Divided, because the inverse of the smallest lengths is infinite.
    for (T& x : flow) x = static_cast<T>(double(x) / longest);
  }
  return longest;
}

/// The shear of one point.
struct Shear {
  double x, y;
};
Shear shear_at(const ShearField<double>& field, std::size_t k) {
  if (field.before.empty()) return {field.force[k], field.force[k + 1]};
  return {field.force[k] - field.before[k], field.force[k + 1] - field.before[k + 1]};
}

void add_shear(const ShearCotangent& to, std::size_t k, double x, double y) {
  if (!to.force.empty()) to.force[k] += x, to.force[k + 1] += y;
  if (!to.before.empty()) to.before[k] -= x, to.before[k + 1] -= y;
}

}  // namespace

void normalised_flow_vjp(std::span<const ShearField<double>> fields,
                         std::span<const double> flow_cotangent,
                         std::span<const ShearCotangent> out, double smallest) {
  check(fields, flow_cotangent.size());
  if (out.size() != fields.size())
    throw InputError("derivatives by " + std::to_string(out.size()) + " fields; expected " +
                     std::to_string(fields.size()));
  double longest = 0, product = 0;  // Σ F̄·S
  std::size_t field_of_longest = 0, place = 0;
  const double* from = flow_cotangent.data();
  for (std::size_t f = 0; f < fields.size(); ++f)
    for (std::size_t k = 0; k < fields[f].force.size(); k += 3, from += 2) {
      const Shear s = shear_at(fields[f], k);
      const double length = std::hypot(s.x, s.y);
      if (length > longest) longest = length, field_of_longest = f, place = k;
      product += from[0] * s.x + from[1] * s.y;
    }
  if (!(longest > smallest)) return;
  from = flow_cotangent.data();
  for (std::size_t f = 0; f < fields.size(); ++f)
    for (std::size_t k = 0; k < fields[f].force.size(); k += 3, from += 2)
      add_shear(out[f], k, from[0] / longest, from[1] / longest);
  // F = S/L, where L is the length at `place`.
  const Shear s = shear_at(fields[field_of_longest], place);
  const double length_bar = -product / (longest * longest);
  add_shear(out[field_of_longest], place, length_bar * s.x / longest, length_bar * s.y / longest);
}

double normalised_flow(std::span<const ShearField<double>> fields, std::span<double> flow,
                       double smallest) {
  return normalise(fields, flow, smallest);
}
double normalised_flow(std::span<const ShearField<float>> fields, std::span<float> flow,
                       double smallest) {
  return normalise(fields, flow, smallest);
}

}  // namespace tangere
