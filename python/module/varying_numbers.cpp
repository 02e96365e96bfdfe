// SPDX-License-Identifier: Apache-2.0
// Names are those of docs/datasets.md: "contact pad ball kn", "body ball density".
#include "python/module/varying_numbers.hpp"

#include <algorithm>

#include "engine/scene/scene_number.hpp"
#include "engine/scene/variable_numbers.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere::python {
namespace {

std::vector<std::string> names_of(const std::vector<SceneNumber>& numbers) {
  std::vector<std::string> names;
  for (const SceneNumber& number : numbers) names.push_back(name_of(number));
  return names;
}

[[noreturn]] void fail_to_find(const std::string& name, const std::vector<std::string>& variable) {
  throw InputError(fmt::format("no number of the scene that may vary is named '{}'{}", name,
                               suggestion(name, variable)));
}

/// The index in Scene::randomizations of the parameter that has a name.
int varying_named(const Scene& scene, const std::string& name) {
  for (const RandomizationDescription& d : scene.randomizations)
    if (name_of(d.number) == name) return randomization_of(scene, d.number);
  const std::vector<std::string> variable = names_of(variable_numbers(scene));
  if (std::ranges::count(variable, name) > 0)
    throw InputError(
        fmt::format("'{}' is the same in all environments; expected a number that varies by "
                    "<randomize> or Scene.vary()",
                    name));
  fail_to_find(name, variable);
}

}  // namespace

Scene with_varying(Scene scene, const std::vector<std::string>& names) {
  const std::vector<SceneNumber> numbers = variable_numbers(scene);
  const std::vector<std::string> variable = names_of(numbers);
  for (const std::string& name : names) {
    const auto at = std::ranges::find(variable, name);
    if (at == variable.end()) fail_to_find(name, variable);
    let_vary(scene, numbers[as_size(at - variable.begin())]);
  }
  return scene;
}

std::vector<std::string> varying_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const RandomizationDescription& d : scene.randomizations) names.push_back(name_of(d.number));
  return names;
}

nb::dict randomized_arrays(const Batch& batch) {
  const std::vector<std::string> names = varying_names(batch.model().scene());
  nb::dict values;
  for (std::size_t k = 0; k < names.size(); ++k) {
    std::span<double> numbers;
    auto array = new_array<double>({as_size(batch.environments())}, numbers);
    for (int e = 0; e < batch.environments(); ++e)
      numbers[as_size(e)] = batch.randomized_value(e, static_cast<int>(k));
    values[names[k].c_str()] = array;
  }
  return values;
}

void set_randomized(Batch& batch, const NamedValues& values, const std::vector<int>& list) {
  std::vector<int> numbers;
  std::vector<double> rows(list.size() * values.size());
  for (const auto& [name, given] : values) {
    const std::size_t column = numbers.size();
    numbers.push_back(varying_named(batch.model().scene(), name));
    const bool one = given.ndim() == 0;
    const auto own = numbers_of(given, one ? Shape{} : Shape{list.size()}, name.c_str());
    for (std::size_t k = 0; k < list.size(); ++k)
      rows[k * values.size() + column] = own[one ? 0 : k];
  }
  batch.set_randomized_values(list, numbers, rows);
}

}  // namespace tangere::python
