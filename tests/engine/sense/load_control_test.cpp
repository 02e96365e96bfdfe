// SPDX-License-Identifier: Apache-2.0
// Tests readings of a layer that carries the loads of the contacts: <layer load="contact">.
#include "engine/layer/load_control.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/layer_reading.hpp"
#include "io/files/text_file.hpp"
#include "tests/engine/load_control_scene.hpp"

namespace tangere {
namespace {

using testing::field_at;
using testing::gel_on_a_hinge;
using ::testing::HasSubstr;
using testing::loads_by_kernels;
using testing::loads_in_field;
using testing::LoadScene;
using testing::parsed;
using Numbers = std::vector<double>;

constexpr double kHalfPad = 6.6e-3;  // half of a pad's side, or less [m]

void expect_loads(const Batch& batch, const std::string& what, double pitch = 0.6e-3,
                  int sensor = 0) {
  const auto number = std::size_t(sensor);
  const std::array<double, 3> found = loads_in_field(batch.model(), field_at(batch, 0, sensor),
                                                     pitch, number),
                              wanted = loads_by_kernels(batch, 0, number);
  ASSERT_GT(wanted[0], 1e-3) << what;
  EXPECT_NEAR(found[0], wanted[0], 1e-12 * wanted[0]) << what;
  for (const std::size_t k : {1, 2})
    EXPECT_NEAR(found[k], wanted[k], 1e-12 * kHalfPad * wanted[0]) << what << " " << k;
}

struct LoadCase {
  const char* name;
  LoadScene scene;
};
void PrintTo(const LoadCase& c, std::ostream* out) { *out << c.name; }

constexpr const char* kPill = R"(<robot><link name="pill">
<joint name="pill" type="free3d" pos="-0.004 -0.003 0.0049"/>
<body name="pill" type="capsule" length="0.004" radius="0.005" density="3000"/>
</link></robot>)";

const LoadCase kLoadCases[] = {
    {"a ball without friction",
     {.contact = R"(<surface_contact body1="table" body2="ball" kn="4e7" kt="0" mu="0"/>)",
      .skin = R"(mu="0" ks="0" kt="0")"}},
    {"a ball that slides", {}},
    {"a table that is fixed", {.hinge = R"(type="fixed")"}},
    {"a ball that sticks",
     {.contact = R"(<surface_contact body1="ball" body2="table" kn="4e7" kt="2e4" mu="0.9"
 damping="1e8" ks="2e7"/>)",
      .skin = R"(mu="0.7")"}},
    {"a ball by its centre",
     {.contact = R"(<general_primitive_contact general_body="ball" primitive_body="table" kn="1500"
 kt="20" mu="0.5" damping="20"/>)"}},
    {"a cuboid that tilts",
     {.body = R"(type="cuboid" size="0.008 0.007 0.0392")",
      .contact = R"(<surface_contact body1="ball" body2="table" kn="4e7" kt="2e4" mu="0.5"
 damping="1e8"/>)"}},
    {"two bodies",
     {.body = R"(type="sphere" radius="0.006")",
      .contact = R"(<surface_contact body1="table" body2="ball" kn="4e7" kt="2e4" mu="0.5"/>
<surface_contact body1="table" body2="pill" kn="3e7" kt="2e4" mu="0.5" ks="1e7"/>)",
      .skin = R"(mu="0.7" ks="0" kt="4e5")",
      .more = kPill,
      .start = "0.003 0.002 0.0058"}}};

class LoadControlCases : public ::testing::TestWithParam<LoadCase> {};

/// The sum and both moments of the field are those of the contacts, in motion and with friction.
TEST_P(LoadControlCases, TheFieldHasTheLoadsOfTheContacts) {
  const Scene scene = parsed(gel_on_a_hinge(GetParam().scene));
  const Model model(scene);
  Batch batch(model, 1);
  Numbers q = testing::q_of(batch), v(std::size_t(model.nv()));
  v[1] = 0.05, v[2] = -0.03, v[4] = 0.8, v[5] = -0.5;
  batch.set_state(0, q, v);
  Stepper stepper(model, testing::options(scene.integrator, scene.timestep, 1e-12));
  for (int k = 0; k < 5; ++k) {
    expect_loads(batch, "step " + std::to_string(k));
    stepper.step(batch, {});
  }
}

INSTANTIATE_TEST_SUITE_P(Contacts, LoadControlCases, ::testing::ValuesIn(kLoadCases));

/// Two fingers grip a rod, lift it and hold it by springs that have memory.
TEST(LoadControl, AGraspHasTheLoadsOfItsContacts) {
  std::string text = read_text_file(TANGERE_SOURCE_DIR "/scenes/gel_grasp.xml", 1 << 20, "a scene");
  const auto replace = [&](const std::string& from, const std::string& to) {
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at))
      text.replace(at, from.size(), to), at += to.size();
  };
  replace(R"(<layer feedback="true")", R"(<layer load="contact")");
  replace(R"( ignores="left_finger")", "");
  replace(R"(thickness="4e-3")", R"(thickness="4e-3" feels="rod")");
  for (const std::string side : {"left", "right"})
    replace("</contact>", R"(<surface_contact body1="rod" body2=")" + side +
                              R"(_finger" kn="2e8" ks="8e7" mu="1" kt="4e5" damping="2e9"/>)" +
                              "</contact>");
  const Scene scene = parsed(text);
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(scene.integrator, scene.timestep, 1e-10));
  for (int k = 0; k < 120; ++k) {
    stepper.step(batch, std::vector<double>{k < 80 ? 0 : 0.01, 0.8, 0.8});
    if (k >= 60 && k % 10 == 0)
      for (const int sensor : {0, 1})
        expect_loads(batch, "step " + std::to_string(k), 1.2e-3, sensor);
  }
}

/// Where a layer has the loads of the contact by its depths alone, nothing shifts them.
TEST(LoadControl, EqualLoadsChangeNothing) {
  LoadScene s = kLoadCases[0].scene;
  s.contact = R"(<general_primitive_contact general_body="ball" primitive_body="table" kn="1500"
 kt="0" mu="0" damping="0"/>)";
  s.start = "0 0 0.0194", s.n = 24;
  Scene own = parsed(gel_on_a_hinge(s));
  Scene plain = own;
  plain.sensors[0].layer->load_control = false;
  const Numbers wanted = field_at(Batch(Model(plain), 1));
  const double ratio =
      loads_in_field(Model(plain), wanted)[0] / loads_by_kernels(Batch(Model(own), 1))[0];
  for (PairContactDescription& c : own.pair_contacts) c.coefficients.kn *= ratio;
  const Numbers found = field_at(Batch(Model(own), 1));
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], wanted[i], 1e-9) << i;
}

/// E does not matter for the sum, and hardly for the shape.
TEST(LoadControl, DoesNotDependOnTheScaleOfTheStiffness) {
  const Scene soft = parsed(gel_on_a_hinge());
  Scene stiff = soft;
  stiff.sensors[0].material->modulus *= 50;
  const auto loads = [](const Scene& s) {
    return loads_in_field(Model(s), field_at(Batch(Model(s), 1)));
  };
  EXPECT_NEAR(loads(stiff)[0], loads(soft)[0], 1e-11 * loads(soft)[0]);
}

TEST(LoadControl, WithoutContactThereIsNoField) {
  LoadScene s;
  s.start = "0 0 0.0201";
  for (const double x : field_at(Batch(Model(parsed(gel_on_a_hinge(s))), 1))) EXPECT_EQ(x, 0);
}

/// A ball beside the pad presses the table where the gel is not: the tilt ends at half the
/// thickness, the moment is that of the gel's edge, and the force is still the contact's.
TEST(LoadControl, WhatNoPointCanCarryIsCounted) {
  LoadScene s;
  s.body = R"(type="cuboid" size="0.02 0.008 0.0392")";
  s.start = "0.0125 0 0.0195";
  s.contact = R"(<surface_contact body1="ball" body2="table" kn="4e7" kt="0" mu="0"/>)";
  const Model model(parsed(gel_on_a_hinge(s)));
  Batch batch(model, 1);
  const std::array<double, 3> wanted = loads_by_kernels(batch);
  EXPECT_GT(wanted[1] / wanted[0], kHalfPad) << "the centre of pressure is beside the pad";
  Readout readout(model);
  Numbers field(std::size_t(3 * model.sensors()[0].points));
  EXPECT_EQ(readout.loads_not_carried(), 0);
  readout.tactile(batch, 0, 0, field);
  EXPECT_EQ(readout.loads_not_carried(), 1);
  const std::array<double, 3> found = loads_in_field(model, field);
  EXPECT_NEAR(found[0], wanted[0], 1e-12 * wanted[0]);
  EXPECT_GT(found[1] / found[0], 0.5 * kHalfPad);
  EXPECT_LT(found[1] / found[0], kHalfPad);
  // Where no point is below the body, nothing presses.
  s.start = "0.017 0 0.0195", s.body = R"(type="cuboid" size="0.008 0.008 0.0392")";
  const Model beside(parsed(gel_on_a_hinge(s)));
  Batch apart(beside, 1);
  EXPECT_GT(loads_by_kernels(apart)[0], 0.1);
  Readout other(beside);
  other.tactile(apart, 0, 0, field);
  for (const double x : field) EXPECT_EQ(x, 0);
  EXPECT_EQ(other.loads_not_carried(), 1);
}

/// A small ball that slides with much friction: where shift and tilts are not found, the field is
/// finite and the reading counts; elsewhere it has the force.
TEST(LoadControl, EveryReadingIsFinite) {
  LoadScene s;
  s.body = R"(type="sphere" radius="0.002")";
  s.start = "0 0 0.002";
  s.contact = R"(<surface_contact body1="ball" body2="table" kn="4e7" kt="2e5" mu="3"/>)";
  s.skin = R"(mu="3" ks="0" kt="4e7")";
  const Model model(parsed(gel_on_a_hinge(s)));
  Batch batch(model, 1);
  Readout readout(model);
  Numbers q = testing::q_of(batch), v(std::size_t(model.nv())),
          field(std::size_t(3 * model.sensors()[0].points));
  const auto share = [](int k, double step) { return std::fmod(k * step, 1.0) - 0.5; };
  int carried = 0;
  for (int k = 0; k < 150; ++k) {
    q[1] = 0.012 * share(k, 0.618034), q[2] = 0.012 * share(k, 0.414214);
    q[3] = -3e-4 + 4e-4 * share(k, 0.732051);
    for (std::size_t i = 1; i < v.size(); ++i) v[i] = 0.2 * share(k, 0.236068 * double(i));
    batch.set_state(0, q, v);
    const std::int64_t before = readout.loads_not_carried();
    readout.tactile(batch, 0, 0, field);
    for (const double x : field) ASSERT_TRUE(std::isfinite(x)) << k;
    if (readout.loads_not_carried() > before) continue;
    const double wanted = loads_by_kernels(batch)[0];
    EXPECT_NEAR(loads_in_field(model, field)[0], wanted, 1e-12 * wanted) << k;
    if (wanted > 0) ++carried;
  }
  EXPECT_GT(carried, 20);
  EXPECT_GT(readout.loads_not_carried(), 0);
}

/// Loads that change little by little change the field little by little: also where a tilt ends.
TEST(LoadControl, TheFieldIsContinuous) {
  LoadScene s;
  s.contact = R"(<surface_contact body1="ball" body2="table" kn="4e7" kt="0" mu="0"/>)";
  const Model model(parsed(gel_on_a_hinge(s)));
  Batch batch(model, 1);
  Numbers q = testing::q_of(batch), last, v(std::size_t(model.nv()));
  double most = 0, change = 0;
  for (int k = 0; k < 40; ++k) {
    q[1] = 0.01 + 1e-4 * k;
    batch.set_state(0, q, v);
    const Numbers field = field_at(batch);
    for (std::size_t i = 0; i < field.size() && k > 0; ++i) {
      most = std::max(most, std::abs(field[i]));
      change = std::max(change, std::abs(field[i] - last[i]));
    }
    last = field;
  }
  EXPECT_GT(most, 0.01);
  EXPECT_LT(change, 0.25 * most);
}

/// Bits are those of an environment alone, in a block, and after any other reading.
TEST(LoadControl, NeighboursAndEarlierReadingsDoNotMatter) {
  const Scene scene = parsed(gel_on_a_hinge());
  const Model model(scene);
  constexpr int kCount = 20;
  Batch batch(model, kCount);
  Numbers v(std::size_t(model.nv()));
  for (int e = 0; e < kCount; ++e) {
    Numbers q = testing::q_of(batch, e);
    q[1] += 2e-4 * e, q[3] -= 1e-5 * e;
    v[1] = 0.01 * e;
    batch.set_state(e, q, v);
  }
  const std::size_t numbers = std::size_t(3 * model.sensors()[0].points);
  std::vector<Numbers> together(16, Numbers(numbers));
  std::vector<std::span<double>> spans(together.begin(), together.end());
  Readout readout(model);
  readout.read_block(batch, 0, {0, FieldForm::field}, spans);
  for (int e = 15; e >= 0; --e) {
    Numbers field(numbers);
    readout.tactile(batch, e, 0, field);
    EXPECT_EQ(field, together[std::size_t(e)]) << e;
    EXPECT_EQ(field, field_at(batch, e)) << e;
  }
}

/// The pressing forces without friction are those of the same shift and tilts.
TEST(LoadControl, ThePressureLeavesFrictionOut) {
  const Model model(parsed(gel_on_a_hinge()));
  Batch batch(model, 1);
  Numbers v(std::size_t(model.nv()));
  v[1] = 0.05;
  batch.set_state(0, testing::q_of(batch), v);
  Numbers pressure(std::size_t(model.sensors()[0].points));
  std::vector<std::span<double>> one = {pressure};
  Readout(model).read_block(batch, 0, {0, FieldForm::pressure}, one);
  const Numbers field = field_at(batch);
  double different = 0;
  for (std::size_t i = 0; i < pressure.size(); ++i) {
    EXPECT_EQ(pressure[i] > 0, field[3 * i + 2] > 0);
    different = std::max(different, std::abs(pressure[i] - field[3 * i + 2]));
    EXPECT_NEAR(pressure[i], field[3 * i + 2], 0.5 * pressure[i]);
  }
  EXPECT_GT(different, 0) << "friction on a slope has a part along the normal";
}

TEST(LoadControl, WhatHasNoLoadsIsRefused) {
  const auto fault = [](const LoadScene& s) -> std::string {
    try {
      static_cast<void>(Model(parsed(gel_on_a_hinge(s))));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  LoadScene s;
  EXPECT_EQ(fault(s), "");
  s.contact.clear();
  EXPECT_THAT(fault(s), AllOf(HasSubstr("gel.xml:"),
                              HasSubstr("load=\"contact\", but no contact of "
                                        "'table' with 'ball'"),
                              HasSubstr("ignores=\"ball\"")));
  s = {};
  s.layer = R"(load="contact" feedback="true")";
  EXPECT_THAT(fault(s), HasSubstr("feedback and"));
  s = {};
  s.layer = R"(load="contacts")";
  EXPECT_THAT(fault(s), HasSubstr("did you mean 'contact'"));
}

}  // namespace
}  // namespace tangere
