// SPDX-License-Identifier: Apache-2.0
// Two passes: shear and its largest length, then the division.
#include "engine/flow_map.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/error.hpp"

namespace tangere {
namespace {

template <class T>
void check(std::span<const ShearField<T>> fields, std::size_t room) {
  std::size_t numbers = 0;
  for (const ShearField<T>& field : fields) {
    if (field.force.size() % 3 != 0)
      throw InputError("a tactile field of " + std::to_string(field.force.size()) + " numbers; expected three a point");
    if (!field.before.empty() && field.before.size() != field.force.size())
      throw InputError("tactile fields of " + std::to_string(field.force.size()) + " and, before, " +
                       std::to_string(field.before.size()) + " numbers; expected the same sensor");
    numbers += field.force.size() / 3 * 2;
  }
  if (numbers != room)
    throw InputError("a flow map of " + std::to_string(room) + " numbers; expected " + std::to_string(numbers));
}

template <class T>
double normalise(std::span<const ShearField<T>> fields, std::span<T> flow, double smallest) {
  check(fields, flow.size());
  double longest = 0;
  T* to = flow.data();
  for (const ShearField<T>& field : fields) {
    for (std::size_t k = 0; k < field.force.size(); k += 3, to += 2) {
      for (std::size_t c = 0; c < 2; ++c)
        to[c] = field.before.empty() ? field.force[k + c] : field.force[k + c] - field.before[k + c];
      longest = std::max(longest, std::hypot(double(to[0]), double(to[1])));
    }
  }
  if (!(longest > smallest)) {
    std::fill(flow.begin(), flow.end(), T(0));
  } else {
    // Divided, not multiplied by the inverse, which is infinite for the smallest lengths.
    for (T& x : flow) x = static_cast<T>(double(x) / longest);
  }
  return longest;
}

}  // namespace

double normalised_flow(std::span<const ShearField<double>> fields, std::span<double> flow, double smallest) {
  return normalise(fields, flow, smallest);
}
double normalised_flow(std::span<const ShearField<float>> fields, std::span<float> flow, double smallest) {
  return normalise(fields, flow, smallest);
}

}  // namespace tangere
