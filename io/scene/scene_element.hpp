// SPDX-License-Identifier: Apache-2.0
// An element of a scene file, read by the schema: allowed attributes, defaults, bounds and units.
#pragma once

#include "engine/scene/schema.hpp"
#include "io/scene/scene_node.hpp"

namespace tangere {

class SceneElement : public SceneNode {
 public:
  SceneElement(const SceneNode& node, Element of) : SceneNode(node), of_(of) {}

  [[nodiscard]] Element of() const { return of_; }
  /// Fails with a fault that is one (engine/scene/scene_faults.hpp).
  void refuse(const std::string& fault) const {
    if (!fault.empty()) fail(fault);
  }
  /// Refuses attributes that the element does not have. Warns of those that other types have.
  void check(std::string_view type = {}) const;
  /// The same for an element in <default>.
  void check_default() const;
  /// Values in SI, the schema's default where they are not given. `turns_or_linear`: the unit is
  /// Attribute::other.
  [[nodiscard]] double number(const char* name, bool turns_or_linear = false) const;
  [[nodiscard]] int integer(const char* name) const { return static_cast<int>(number(name)); }
  [[nodiscard]] std::vector<double> numbers(const char* name, std::size_t count = 0,
                                            bool turns_or_linear = false) const;
  [[nodiscard]] Vector3 vector(const char* name) const;
  [[nodiscard]] const Attribute& row(const char* name) const { return attribute_of(of_, name); }
  /// Index among Attribute::words.
  [[nodiscard]] std::size_t word(const char* name) const;
  /// Sets the members of `to` that the element gives, or that have a default.
  template <class T>
  void read(T& to, bool turns_or_linear = false, std::string_view type = {}) const;

 private:
  /// Whether a value is given or has a default. Fails if it is missing.
  [[nodiscard]] bool is_there(const Attribute& row) const;
  /// Values in SI. `count`: 0 for any number of them.
  [[nodiscard]] std::vector<double> values(const Attribute& row, std::size_t count,
                                           bool turns_or_linear) const;
  Element of_;
};

/// The names of these elements in scene files.
std::vector<std::string> element_names(std::uint64_t elements);
/// The children that the schema allows in an element.
std::vector<SceneNode> children_of(const SceneNode& node);
/// The elements in a section, which has no attributes.
std::vector<SceneElement> elements_in(const SceneNode& section);

template <class T>
void SceneElement::read(T& to, bool turns_or_linear, std::string_view type) const {
  for_each_member<T>(of_, [&](const Attribute& row, auto member) {
    if ((!type.empty() && !row.serves(type)) || !is_there(row)) return;
    using Value = std::remove_cvref_t<decltype(to.*member)>;
    if constexpr (std::is_same_v<Value, NormalAndShear>) {
      const std::vector<double> x = values(row, 0, turns_or_linear);
      if (x.empty() || x.size() > 2) fail_count(row.name, x.size(), "1 or 2");
      to.*member = {x.front(), x.back()};
    } else if constexpr (std::is_same_v<T, Pose> && std::is_same_v<Value, Quaternion>) {
      to.*member = quaternion(row.name);
    } else if constexpr (requires { (to.*member).size(); }) {
      const std::vector<double> x = values(row, std::tuple_size_v<Value> == 3 ? 3 : 0, false);
      if (x.size() != 3 && x.size() != 4) fail_count(row.name, x.size(), "3 or 4");
      std::copy(x.begin(), x.end(), (to.*member).begin());  // a colour's alpha stays 1
    } else {
      to.*member = static_cast<Value>(values(row, 1, turns_or_linear)[0]);
    }
  });
}

}  // namespace tangere
