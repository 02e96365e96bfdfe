// SPDX-License-Identifier: Apache-2.0
// Tests that every number has one identity: its name in <randomize>, its name and unit, its place
// in the scene, its row in a block and in a gradient, and its description in files.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/derivative/number_gradients.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/rows/sensor_layout.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"
#include "io/dataset/dataset_from_model.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

/// Uses one name for everything that can have one: a sensor, a joint, a motor and a body called
/// "skin".
std::string scene_with(const std::string& lines) {
  return R"(<tangere model="numbers">
<option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3" integrator="BDF2"/>
<ground pos="0 0 0" normal="0 0 1"/>
<robot>
<link name="skin">
<joint name="skin" type="revolute" axis="0 0 1" damping="0.2" armature="0.1" stiffness="3" )"
         R"(friction="0.7" )"
         R"(lim="-1 1" lim_stiffness="5"/>
<body name="skin" type="cuboid" size="0.05 0.05 0.01" density="1000" )"
         R"(general_contact_resolution="4 4 2"/>
</link>
<link name="slide">
<joint name="slide" type="prismatic" axis="1 0 0" pos="0 0 0.1" damping="0.3" stiffness="4" )"
         R"(lim="-1 1" lim_stiffness="6"/>
<body name="can" type="cylinder" length="0.04" radius="0.02" density="400"/>
</link>
<link name="ball">
<joint name="ball" type="free3d" pos="0 0 0.02"/>
<body name="ball" type="sphere" radius="0.02" density="100"/>
</link>
<link name="puck">
<joint name="puck" type="free2d" pos="0.3 0 0.2" damping="0.4" stiffness="0.5"/>
<body name="puck" type="abstract" mass="0.2" inertia="1e-4 1e-4 1e-4"/>
</link>
<link name="brick">
<joint name="brick" type="translational" pos="0.6 0 0.2"/>
<body name="brick" type="cuboid" size="0.03 0.04 0.05" density="700"/>
</link>
<link name="wedge">
<joint name="wedge" type="translational" pos="0.9 0 0.2"/>
<body name="wedge" type="mesh" filename=")" TANGERE_TEST_DATA
         R"(/scenes/wedge.obj" transform_type="OBJ_TO_JOINT" scale="0.01 0.01 0.01" )"
         R"(resolution="0" density="300"/>
</link>
</robot>
<actuator><motor joint="skin" ctrl="position" P="7" D="0.8"/>)"
         R"(<motor joint="slide" ctrl="position" P="9" D="0.6"/></actuator>
<contact>
<ground_contact body="ball" kn="5e3" kt="1" mu="0.8" damping="0.03"/>
<general_primitive_contact general_body="skin" primitive_body="ball" kn="5" kt="2" mu="0.7" )"
         R"(damping="1"/>
</contact>
<loop>
<connect name="pin" body1="brick" body2="wedge" stiffness="800" damping="12"/>
<weld name="tie" body1="can" body2="puck" stiffness="900" turning_stiffness="14" )"
         R"(turning_damping="0.13"/>
</loop>
<sensor>
<tactile name="skin" body="skin" type="rect_array" rect_pos0="-0.02 0.02 -0.005" )"
         R"(rect_pos1="0.02 -0.02 -0.005" axis0="0 -1 0" axis1="1 0 0" resolution="5 7" )"
         R"(kn="11" kt="0.01" mu="2" damping="0.003"/>
<tactile name="gel" body="skin" type="rect_array" rect_pos0="-0.004 0.004 -0.005" )"
         R"(rect_pos1="0.004 -0.004 -0.005" axis0="0 -1 0" axis1="1 0 0" resolution="9 9" )"
         R"(modulus="4e5" thickness="4e-3" mu="1" ks="0"><layer poisson="0.45"/></tactile>
<camera name="eye" pos="0.1 0.2 0.3" look="0.4 0.5 0.6" light="0.7 0.8 0.9" ambient="0.25"/>
</sensor>
<randomize>
)" + lines +
         "\n</randomize>\n</tangere>\n";
}

/// A row of the table as a scene writes it. `xml` empty: <randomize> does not accept it.
struct Row {
  const char* xml;
  const char *name, *unit;
  bool has_gradient;
  double value;  ///< in the scene; NAN: the scene does not give the start
};
const Row kNumberRows[] = {
    {R"(general_primitive_contact general_body="skin" primitive_body="ball" field="kn")",
     "contact skin ball kn", "N/m", true, 5},
    {R"(general_primitive_contact general_body="skin" primitive_body="ball" field="kt")",
     "contact skin ball kt", "N s/m", true, 2},
    {R"(general_primitive_contact general_body="skin" primitive_body="ball" field="mu")",
     "contact skin ball mu", "1", true, 0.7},
    {R"(general_primitive_contact general_body="skin" primitive_body="ball" field="damping")",
     "contact skin ball damping", "N s/m^2", true, 1},
    {R"(general_primitive_contact general_body="skin" primitive_body="ball" field="ks")",
     "contact skin ball ks", "N/m", true, 0},
    {R"(ground_contact body="ball" field="kn")", "ground ball kn", "N/m", true, 5e3},
    {R"(ground_contact body="ball" field="kt")", "ground ball kt", "N s/m", true, 1},
    {R"(ground_contact body="ball" field="mu")", "ground ball mu", "1", true, 0.8},
    {R"(ground_contact body="ball" field="damping")", "ground ball damping", "N s/m", true, 0.03},
    {R"(ground_contact body="ball" field="ks")", "ground ball ks", "N/m", true, 0},
    {R"(tactile name="skin" field="kn")", "tactile skin kn", "N/m", true, 11},
    {R"(tactile name="skin" field="kt")", "tactile skin kt", "N s/m", true, 0.01},
    {R"(tactile name="skin" field="mu")", "tactile skin mu", "1", true, 2},
    {R"(tactile name="skin" field="damping")", "tactile skin damping", "N s/m^2", true, 0.003},
    {R"(tactile name="skin" field="ks")", "tactile skin ks", "N/m", true, 0},
    {"", "tactile gel thickness", "m", true, 4e-3},
    {"", "tactile gel poisson", "1", true, 0.45},
    {R"(body name="can" field="density")", "body can density", "kg/m^3", true, 400},
    {"", "body puck mass", "kg", true, 0.2},
    {R"(body name="can" field="radius")", "body can radius", "m", true, 0.02},
    {R"(body name="can" field="length")", "body can length", "m", true, 0.04},
    {R"(body name="brick" size="2")", "body brick size[2]", "m", true, 0.05},
    {R"(body name="wedge" field="scale")", "body wedge scale", "1", true, 1},
    {R"(joint name="skin" q="0")", "joint skin q[0]", "rad", false, NAN},
    {R"(joint name="slide" q="0")", "joint slide q[0]", "m", false, NAN},
    {R"(joint name="ball" q="3")", "joint ball q[3]", "1", false, NAN},
    {R"(joint name="ball" v="2")", "joint ball v[2]", "m/s", false, NAN},
    {R"(joint name="ball" v="3")", "joint ball v[3]", "rad/s", false, NAN},
    {R"(joint name="slide" pos="2")", "joint slide pos[2]", "m", true, 0.1},
    {R"(joint name="skin" field="damping")", "joint skin damping", "N m s/rad", true, 0.2},
    {R"(joint name="slide" field="damping")", "joint slide damping", "N s/m", true, 0.3},
    {R"(joint name="skin" field="armature")", "joint skin armature", "kg m^2", true, 0.1},
    {R"(joint name="skin" field="stiffness")", "joint skin stiffness", "N m/rad", true, 3},
    {R"(joint name="skin" field="friction")", "joint skin friction", "N m", true, 0.7},
    {R"(joint name="slide" field="lim_stiffness")", "joint slide lim_stiffness", "N/m", true, 6},
    {"", "joint puck damping", "N s/m", true, 0.4},
    {"", "joint puck turning damping", "N m s/rad", true, 0.4},
    {"", "joint puck turning stiffness", "N m/rad", true, 0.5},
    {R"(motor joint="skin" field="P")", "motor skin P", "N m/rad", true, 7},
    {R"(motor joint="slide" field="D")", "motor slide D", "N s/m", true, 0.6},
    {R"(connect name="pin" field="stiffness")", "loop pin stiffness", "N/m", true, 800},
    {R"(connect name="pin" field="damping")", "loop pin damping", "N s/m", true, 12},
    {R"(weld name="tie" field="turning_stiffness")", "loop tie turning_stiffness", "N m/rad", true,
     14},
    {R"(weld name="tie" field="turning_damping")", "loop tie turning_damping", "N m s/rad", true,
     0.13},
    {R"(camera name="eye" pos="0")", "camera eye pos[0]", "m", false, 0.1},
    {R"(camera name="eye" look="1")", "camera eye look[1]", "m", false, 0.5},
    {R"(camera name="eye" light="2")", "camera eye light[2]", "1", false, 0.9},
    {R"(camera name="eye" field="ambient")", "camera eye ambient", "1", false, 0.25},
    {R"(camera name="eye" field="brightness")", "camera eye brightness", "1", false, 1},
};

Scene read(const std::string& lines) { return parse_scene(scene_with(lines), "s.xml").scene; }

const NumberInfo* find(const NumberGradients& gradients, const std::string& name) {
  for (const NumberInfo& info : gradients.infos())
    if (info.name == name) return &info;
  return nullptr;
}

/// Every row that <randomize> takes: from its element to the same address everywhere.
TEST(SceneNumbers, HaveOneNameAndUnitFromTheSceneToTheFile) {
  for (const Row& row : kNumberRows) {
    if (*row.xml == '\0') continue;
    SCOPED_TRACE(row.xml);
    const Scene scene = read("<" + std::string(row.xml) + " uniform=\"0.125 0.25\"/>");
    ASSERT_THAT(scene.randomizations, SizeIs(1));
    const SceneNumber& number = scene.randomizations[0].number;
    EXPECT_EQ(name_of(number), row.name);
    EXPECT_EQ(unit_of(scene, number), row.unit);
    EXPECT_EQ(scene.randomizations[0].distribution.b, 0.25) << "SI as it stands";
    EXPECT_EQ(randomization_of(scene, number), 0);
    if (!std::isnan(row.value)) {
      EXPECT_EQ(number_in(scene, number), row.value);
      Scene other = scene;
      number_in(other, number) = 99;
      EXPECT_EQ(number_in(other, number), 99);
    }
    const Model model(scene);
    Batch batch(model, 3, 7);
    const int block_row = compiled(model).randomized_row[0];
    const bool of_quaternion = number.field == NumberField::q && std::string(row.unit) == "1";
    if (!of_quaternion) {  // made of length 1 after the draw
      EXPECT_EQ(batch.block(0)[block_row * kernels::kBlock + 1], batch.randomized_value(1, 0));
    }
    EXPECT_EQ(batch.is_parameter(0), !is_of_start(number));
    if (batch.is_parameter(0)) {
      batch.set_randomized_value(1, 0, 0.2);
      EXPECT_EQ(batch.block(0)[block_row * kernels::kBlock + 1], 0.2);
    }
    const NumberGradients gradients(model);
    const NumberInfo* const info = find(gradients, row.name);
    ASSERT_EQ(info != nullptr, row.has_gradient);
    if (info != nullptr) {
      EXPECT_EQ(info->number, number);
      EXPECT_EQ(info->unit, row.unit);
      EXPECT_EQ(info->value, row.value);
    }
    const Stepper stepper(model);
    const RunFacts facts = run_facts(model, stepper, {}, 0);
    const DatasetLayout dataset = dataset_layout_from(model, stepper, {});
    const std::vector<std::string> name = {row.name}, unit = {row.unit};
    EXPECT_EQ(facts.randomized_names, name);
    EXPECT_EQ(facts.randomized_units, unit);
    EXPECT_EQ(dataset.randomized_names, name);
    EXPECT_EQ(dataset.randomized_units, unit);
  }
}

/// Every row of the table has a case here. Rows that <randomize> leaves out have gradients, too.
TEST(SceneNumbers, NoKindIsForgotten) {
  const Scene scene = read("");
  const Model model(scene);
  const NumberGradients gradients(model);
  for (const Row& row : kNumberRows) {
    const NumberInfo* const info = find(gradients, row.name);
    // Without ks there is no memory to take a derivative of; <randomize> above gives it one.
    const bool idle = std::string(row.name).ends_with(" ks");
    ASSERT_EQ(info != nullptr, row.has_gradient && !idle) << row.name;
    if (info == nullptr) continue;
    EXPECT_EQ(info->unit, row.unit) << row.name;
    EXPECT_EQ(info->value, row.value) << row.name;
    EXPECT_EQ(unit_of(scene, info->number), row.unit);
  }
  for (const Attribute& kind : schema()) {
    if (!kind.field) continue;
    for (const auto owner :
         {NumberOwner::contact, NumberOwner::ground, NumberOwner::tactile, NumberOwner::body,
          NumberOwner::joint, NumberOwner::motor, NumberOwner::loop, NumberOwner::camera}) {
      if ((kind.elements & element_of(owner)) == 0) continue;
      const std::string of = owner_of({owner, *kind.field, ""});
      const bool indexed = kind.has(kIndexed);
      const auto is_of = [&](const Row& row) {
        const std::string name = row.name,
                          end = std::string(" ") + kind.name + (indexed ? "[" : "");
        const std::size_t at = name.rfind(end);
        return name.starts_with(of.substr(0, of.find(' ') + 1)) && at != std::string::npos &&
               (indexed || at + end.size() == name.size()) &&
               row.has_gradient == kind.has(kGradient);
      };
      EXPECT_TRUE(std::any_of(std::begin(kNumberRows), std::end(kNumberRows), is_of))
          << of << kind.name;
    }
  }
}

/// A sensor, a joint, a motor and a body may have one name, but no two numbers may.
/// Draws of a skin whose coefficients count per area do so as well, in any unit; mu has no area.
TEST(SceneNumbers, DrawsOfASkinByAreaAreByArea) {
  for (const char* unit : {"m-kg", "cm-g"}) {
    const Scene scene = parse_scene(fmt::format(R"(<tangere model="skin">
<option unit="{}" gravity="0 0 -9.8" timestep="5e-3" integrator="BDF2"/>
<robot><link name="pad"><joint name="pad" type="prismatic" axis="0 0 1"/>
<body name="pad" type="cuboid" size="4 4 1" density="1"/></link></robot>
<sensor><tactile name="pad" body="pad" type="rect_array" rect_pos0="-1 -1 -0.5"
rect_pos1="1 1 -0.5" axis0="1 0 0" axis1="0 1 0" resolution="5 9" per="area" kn="7" kt="3" mu="0.5"
damping="2"/></sensor>
<randomize><tactile name="pad" field="kn" uniform="7 14"/>
<tactile name="pad" field="damping" list="2 4"/><tactile name="pad" field="mu" list="0.5"/>
</randomize></tangere>)",
                                                unit),
                                    "skin.xml")
                            .scene;
    const ContactCoefficients& own = scene.sensors[0].coefficients;
    ASSERT_THAT(scene.randomizations, SizeIs(3));
    EXPECT_DOUBLE_EQ(scene.randomizations[0].distribution.a, own.kn) << unit;
    EXPECT_DOUBLE_EQ(scene.randomizations[0].distribution.b, 2 * own.kn) << unit;
    EXPECT_DOUBLE_EQ(scene.randomizations[1].distribution.values[0], own.damping) << unit;
    EXPECT_DOUBLE_EQ(scene.randomizations[2].distribution.values[0], own.mu) << unit;
  }
}

TEST(SceneNumbers, NoTwoHaveOneName) {
  std::string lines;
  std::size_t count = 0;
  for (const Row& row : kNumberRows)
    if (*row.xml != '\0') lines += "<" + std::string(row.xml) + " uniform=\"0.1 0.2\"/>\n", ++count;
  const Scene scene = read(lines);
  ASSERT_THAT(scene.randomizations, SizeIs(count));
  std::vector<std::string> names;
  for (const RandomizationDescription& d : scene.randomizations) names.push_back(name_of(d.number));
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
  EXPECT_TRUE(std::binary_search(names.begin(), names.end(), "tactile skin damping"));
  EXPECT_TRUE(std::binary_search(names.begin(), names.end(), "joint skin damping"));
  std::vector<std::string> of_gradients;
  const Model model(read(""));
  const NumberGradients gradients(model);
  for (const NumberInfo& info : gradients.infos()) of_gradients.push_back(info.name);
  std::sort(of_gradients.begin(), of_gradients.end());
  EXPECT_EQ(std::adjacent_find(of_gradients.begin(), of_gradients.end()), of_gradients.end());
}

std::string refusal(const Scene& scene) {
  try {
    const Model model(scene);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(SceneNumbers, ContactsOfTheSameBodiesAreAnError) {
  Scene pairs = read(""), grounds = pairs;
  pairs.pair_contacts.push_back(pairs.pair_contacts[0]);
  EXPECT_THAT(refusal(pairs), HasSubstr("contact name 'skin ball' is used twice"));
  grounds.ground_contacts.push_back(grounds.ground_contacts[0]);
  EXPECT_THAT(refusal(grounds), HasSubstr("ground contact name 'ball' is used twice"));
}

TEST(SceneNumbers, WhatIsNotThereIsAnError) {
  Scene scene = read("");
  const auto message = [&](const SceneNumber& number) {
    try {
      number_in(scene, number) = 1;
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("found");
  };
  using enum NumberOwner;
  EXPECT_EQ(message({tactile, NumberField::kn, "skin"}), "found");
  for (const SceneNumber& number :
       std::vector<SceneNumber>{{tactile, NumberField::kn, "ball"},
                                {contact, NumberField::kn, "ball", 0, "skin"},
                                {body, NumberField::radius, "brick"},
                                {body, NumberField::size, "brick", 3},
                                {body, NumberField::mass, "brick"},
                                {joint, NumberField::pos, "skin", 3},
                                {joint, NumberField::q, "skin"},
                                {joint, NumberField::turning_damping, "skin"},
                                {motor, NumberField::P, "ball"}})
    EXPECT_THAT(message(number), HasSubstr("the scene has no number '" + name_of(number) + "'"));
  EXPECT_THAT(message({joint, NumberField::P, "skin"}), HasSubstr("a joint has no 'P'; a motor"));
  EXPECT_THAT(refusal([&] {
                Scene twice = scene;
                RandomizationDescription d;
                d.number = {motor, NumberField::damping, "skin"};
                twice.randomizations = {d};
                return twice;
              }()),
              HasSubstr("a motor has no 'damping'"));
  const auto reading = [](const std::string& lines) {
    try {
      read(lines);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const std::string line = R"(<tactile name="skin" field="mu" uniform="1 2"/>)";
  EXPECT_THAT(reading(line + "\n" + line), HasSubstr("'tactile skin mu' already varies"));
}

}  // namespace
}  // namespace tangere
