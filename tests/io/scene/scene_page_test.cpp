// SPDX-License-Identifier: Apache-2.0
// The tables of attributes in docs/scenes.md are made from the schema. With TANGERE_WRITE_DOCS=1 in
// the environment, this test writes them; else it compares.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "engine/scene/schema.hpp"
#include "engine/scene/shapes.hpp"
#include "io/scene/scene_element.hpp"

namespace tangere {
namespace {

const std::string kPage = std::string(TANGERE_SOURCE_DIR) + "/docs/scenes.md";

std::string page() {
  std::ifstream in(kPage);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Returns "cylinder, capsule: "; "not fixed: " where few types are left out; "" for all.
std::string types_text(const Attribute& a) {
  if (a.types == nullptr) return "";
  std::vector<std::string> all, left_out;
  if ((a.elements & kBody) != 0)
    for (const ShapeRow& row : shape_rows()) all.emplace_back(row.name);
  if ((a.elements & kJoint) != 0)
    for (int k = 0; k <= static_cast<int>(JointType::free); ++k)
      all.emplace_back(to_string(static_cast<JointType>(k)));
  for (const std::string& type : all)
    if (!a.serves(type)) left_out.push_back(type);
  const std::vector<std::string> types = words_of(a.types);
  return !all.empty() && left_out.size() < types.size()
             ? fmt::format("not {}: ", fmt::join(left_out, ", "))
             : fmt::format("{}: ", fmt::join(types, ", "));
}

std::string unit_text(const Attribute& a) {
  std::string text = a.unit == Unit::one ? "" : to_string(a.unit);
  if (a.other_unit != Unit::one) text += std::string(", ") + to_string(a.other_unit);
  return text;
}

std::string row_text(const Attribute& a) {
  std::string text = types_text(a);
  const std::vector<std::string> words =
      a.words == nullptr ? std::vector<std::string>{} : words_of(a.words);
  if (!words.empty() && words.size() < 10) text += fmt::format("{}; ", fmt::join(words, ", "));
  return fmt::format("| `{}` | {} | {} | {}{} | {}{} |\n", a.name,
                     a.default_text == nullptr ? "needed" : a.default_text, unit_text(a),
                     a.has(kVaries) ? "v" : "", a.has(kGradient) ? "g" : "", text, a.text);
}

std::string table(Element element) {
  std::string text = "| attribute | default | unit | | |\n|---|---|---|---|---|\n", pictures;
  for (const Attribute& a : schema()) {
    if ((a.elements & element) == 0 || a.has(kIgnored)) continue;
    if (a.has(kPicture))
      pictures += fmt::format("{}`{}`", pictures.empty() ? "" : ", ", a.name);
    else
      text += row_text(a);
  }
  return text + (pictures.empty() ? "" : "\nFor pictures: " + pictures + ".\n");
}

/// The page with every table anew, which stands between <!-- attributes NAME --> and <!-- end -->.
std::string with_tables(std::string text) {
  for (int k = 0; k < kElements; ++k) {
    const auto element = static_cast<Element>(1ULL << k);
    const std::string begin = fmt::format("<!-- attributes {} {} -->\n", k, to_string(element));
    const std::size_t from = text.find(begin);
    if (from == std::string::npos) continue;
    const std::size_t first = from + begin.size();
    text.replace(first, text.find("<!-- end -->", from) - first, "\n" + table(element) + "\n");
  }
  return text;
}

TEST(ScenePage, HasTheAttributesOfTheSchema) {
  const std::string found = page(), expected = with_tables(found);
  if (std::getenv("TANGERE_WRITE_DOCS") != nullptr) std::ofstream(kPage) << expected;
  EXPECT_EQ(page(), expected)
      << "TANGERE_WRITE_DOCS=1 io_test --gtest_filter='ScenePage.*' makes it";
}

/// Where a struct has a default of its own, it is the same.
TEST(Schema, DefaultsAreThoseOfTheStructs) {
  const auto check = [](Element element, const auto& of) {
    using T = std::remove_cvref_t<decltype(of)>;
    for_each_member<T>(element, [&](const Attribute& a, auto member) {
      using Value = std::remove_cvref_t<decltype(of.*member)>;
      if constexpr (std::is_arithmetic_v<Value>) {
        if (a.default_text == nullptr || *a.default_text == '\0') return;
        EXPECT_EQ(std::stod(a.default_text), double(of.*member)) << a.name;
      }
    });
  };
  check(kSolver, SolverOptions{});
  check(kJoint, JointEffects{});
  check(kBody, BodyDescription{});
  check(kMotor, MotorDescription{});
  check(kTactile, ContactCoefficients{});
  check(kImperfections, SensorImperfections{});
  check(kRandom, RandomControl{});
}

/// The table of shapes says which sizes each has, the schema for which types an attribute is.
TEST(Schema, SizesAreThoseOfTheShapes) {
  for (const ShapeRow& row : shape_rows())
    for (const char* const name : {"radius", "length", "size"}) {
      bool has = false;
      for (const NamedSize& size : named_sizes(row.make()))
        has = has || name == std::string(size.name);
      EXPECT_EQ(attribute_of(kBody, name).serves(row.name), has) << row.name << " " << name;
    }
}

/// Every element that has attributes stands somewhere, and one name in one place is one element.
TEST(Schema, EveryElementHasAHolder) {
  std::uint64_t all = 0;
  for (const Holder& holder : holders()) {
    const std::vector<std::string> names = element_names(holder.elements);
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
    EXPECT_EQ(elements_inside(holder.name), holder.elements) << holder.name;
    all |= holder.elements;
    if (holder.section && std::string(holder.name) == to_string(kRobot)) all |= kRobot;
  }
  EXPECT_EQ(all, (std::uint64_t{1} << kElements) - 1);
  EXPECT_EQ(elements_inside("joint"), 0U);
}

}  // namespace
}  // namespace tangere
