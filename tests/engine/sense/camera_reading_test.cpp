// SPDX-License-Identifier: Apache-2.0
// Tests cameras of a scene: what they see of bodies that move, that pictures are the same bytes in
// any batch and of any order of reading, noise, and what is refused.
#include "engine/sense/camera_reading.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "engine/scene/scene_number.hpp"
#include "engine/sense/form_map.hpp"
#include "engine/sense/readout.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using Numbers = std::vector<double>;
constexpr int kHigh = 40, kWide = 48;
constexpr std::size_t kMiddle = (kHigh / 2) * kWide + kWide / 2;

/// A ball that slides above the ground, a box and an abstract body beside it, and a camera 0.5 m
/// above the ground that points down.
Scene watched() {
  Scene s;
  s.gravity = {0, 0, 0};
  s.ground = GroundDescription{};
  s.links = {testing::link("ball", JointType::translational, {0, 0, 0.05}, SphereShape{0.03}, 1000),
             testing::link("box", JointType::fixed, {0.1, 0, 0.02},
                           CuboidShape{{0.04, 0.04, 0.04}, {2, 2, 2}}, 1000)};
  s.links[0].body.rgba = {1, 0, 0, 1};
  s.links[1].body.rgba = {0, 0, 1, 1};
  CameraDescription camera;
  camera.name = "eye";
  camera.position = {0, 0, 0.5};
  camera.up = {0, 1, 0};
  camera.rows = kHigh, camera.cols = kWide;
  camera.source = {"eye.xml", 12};
  s.cameras.push_back(camera);
  return s;
}

template <class T>
std::vector<T> read_view(Readout& readout, const Batch& batch, FieldForm form, int camera = 0) {
  std::vector<std::vector<T>> all;
  for (int e = 0; e < batch.environments(); ++e)
    all.emplace_back(numbers_of(batch.model(), {camera, form}));
  for (int block = 0; block < batch.blocks(); ++block) {
    std::vector<std::span<T>> to;
    for (int e = 16 * block; e < std::min(16 * block + 16, batch.environments()); ++e)
      to.emplace_back(all[std::size_t(e)]);
    readout.read_block(batch, block, {camera, form}, std::span<const std::span<T>>(to));
  }
  std::vector<T> flat;
  for (const std::vector<T>& one : all) flat.insert(flat.end(), one.begin(), one.end());
  return flat;
}

template <class T>
std::vector<T> view(const Scene& scene, FieldForm form, const Vector3& ball = {0, 0, 0},
                    int camera = 0) {
  const Model model(scene);
  Batch batch(model, 1, 3);
  batch.set_state(0, Numbers(ball.begin(), ball.end()), Numbers{0, 0, 0});
  Readout readout(model);
  return read_view<T>(readout, batch, form, camera);
}

std::string refusal(const Scene& scene) {
  try {
    const Model model(scene);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(CameraReading, SeesBodiesByTheirNumbersAndDepths) {
  const Scene scene = watched();
  const auto ids = view<std::int16_t>(scene, FieldForm::view_ids);
  const auto depth = view<float>(scene, FieldForm::view_depth);
  EXPECT_EQ(std::set<int>(ids.begin(), ids.end()), (std::set<int>{0, 1, 2}));  // 2: the ground
  EXPECT_EQ(ids[kMiddle], 0);
  EXPECT_NEAR(depth[kMiddle], 0.5 - 0.08, 1e-3);  // half a pixel beside its top
  const double focal = 0.5 * kHigh / std::tan(22.5 * M_PI / 180);
  const auto box = std::size_t(20 * kWide) + std::size_t(0.5 * kWide + 0.1 * focal / 0.46);
  EXPECT_EQ(ids[box], 1);
  EXPECT_NEAR(depth[box], 0.46, 1e-6);
  EXPECT_EQ(ids[0], 2);
  EXPECT_NEAR(depth[0], 0.5, 1e-6);
  const auto colours = view<std::uint8_t>(scene, FieldForm::view_rgb);
  EXPECT_GT(colours[3 * kMiddle], 100);
  EXPECT_EQ(colours[3 * kMiddle + 1], 0);
  EXPECT_GT(colours[3 * box + 2], 100);
  EXPECT_EQ(view<double>(scene, FieldForm::view_rgb), Numbers(colours.begin(), colours.end()));
}

TEST(CameraReading, FollowsBodiesAndTheBodyThatCarriesIt) {
  Scene scene = watched();
  const auto at = [&](const Vector3& ball) {
    const auto ids = view<std::int16_t>(scene, FieldForm::view_ids, ball);
    return std::find(ids.begin(), ids.end(), std::int16_t{0}) - ids.begin();
  };
  EXPECT_GT(at({0.04, 0, 0}) % kWide, at({0, 0, 0}) % kWide);  // x is along columns
  EXPECT_LT(at({0, 0.04, 0}), at({0, 0, 0}));                  // y is up in the picture
  scene.cameras[0].body = "ball";
  scene.cameras[0].position = {0, 0, 0.5};
  const auto still = view<std::int16_t>(scene, FieldForm::view_ids);
  const auto moved = view<std::int16_t>(scene, FieldForm::view_ids, {0.05, 0, 0});
  EXPECT_EQ(still[kMiddle], 0);
  EXPECT_EQ(moved[kMiddle], 0);  // the ball stays in the middle, the box does not
  EXPECT_NE(still, moved);
}

TEST(CameraReading, SeesSizesThatVaryAndLeavesOutWhatIsClear) {
  Scene scene = watched();
  const auto count = [](const std::vector<std::int16_t>& ids) {
    return std::count(ids.begin(), ids.end(), std::int16_t{0});
  };
  const auto usual = count(view<std::int16_t>(scene, FieldForm::view_ids));
  scene.randomizations.push_back({{NumberOwner::body, NumberField::radius, "ball"},
                                  {Distribution::Kind::uniform, 0.045, 0.045, {}},
                                  {}});
  EXPECT_NEAR(double(count(view<std::int16_t>(scene, FieldForm::view_ids))) / double(usual), 2.35,
              0.3);
  scene.links[0].body.rgba[3] = 0;
  EXPECT_EQ(count(view<std::int16_t>(scene, FieldForm::view_ids)), 0);
}

TEST(CameraReading, SeesMeshesAndTheSurfaceOfAbstractBodies) {
  Scene scene = watched();
  MeshShape box;
  for (int k = 0; k < 8; ++k)
    for (int i = 0; i < 3; ++i) box.vertices.push_back(k >> i & 1 ? 0.01 : -0.01);
  for (const std::array<int, 4>& f : {std::array{0, 4, 6, 2},
                                      {1, 3, 7, 5},
                                      {0, 1, 5, 4},
                                      {2, 6, 7, 3},
                                      {0, 2, 3, 1},
                                      {4, 5, 7, 6}})
    box.triangles.push_back({f[0], f[1], f[2]}), box.triangles.push_back({f[0], f[2], f[3]});
  box.scale = 2;
  box.resolution = 0;
  const auto solid = view<std::int16_t>(scene, FieldForm::view_ids);
  const auto solid_depth = view<float>(scene, FieldForm::view_depth);
  scene.links[1].body.shape = box;
  EXPECT_EQ(view<std::int16_t>(scene, FieldForm::view_ids), solid);
  const auto depth = view<float>(scene, FieldForm::view_depth);
  for (std::size_t k = 0; k < depth.size(); ++k) ASSERT_NEAR(depth[k], solid_depth[k], 1e-6) << k;
  AbstractShape abstract;
  abstract.mass = 1;
  abstract.inertia = {1e-3, 0, 0, 1e-3, 0, 1e-3};
  scene.links[1].body.shape = abstract;
  EXPECT_EQ(std::ranges::count(view<std::int16_t>(scene, FieldForm::view_ids), 1), 0);
  scene.links[1].body.surface = std::make_shared<const MeshShape>(box);
  EXPECT_EQ(view<std::int16_t>(scene, FieldForm::view_ids), solid);
}

TEST(CameraReading, BytesDoNotDependOnTheBatchOrTheOrderOfReading) {
  Scene scene = watched();
  scene.cameras[0].noise = 3, scene.cameras[0].gain = 0.1;
  scene.cameras.push_back(scene.cameras[0]);
  scene.cameras[1].name = "other";
  scene.cameras[1].position = {0.2, -0.3, 0.4};
  const Model model(scene);
  constexpr int kMany = 19;
  Batch many(model, kMany, 5);
  const auto place = [](int e) { return Numbers{0.002 * e, 0.001 * e, 0}; };
  for (int e = 0; e < kMany; ++e) many.set_state(e, place(e), Numbers{0, 0, 0});
  Readout readout(model);
  const auto colours = read_view<std::uint8_t>(readout, many, FieldForm::view_rgb, 1);
  const auto depth = read_view<float>(readout, many, FieldForm::view_depth, 1);
  EXPECT_EQ(read_view<std::uint8_t>(readout, many, FieldForm::view_rgb, 1), colours);
  for (const int e : {0, 7, 16, 18}) {
    Batch alone(model, 1, 5, e);
    alone.set_state(0, place(e), Numbers{0, 0, 0});
    Readout other(model, Precision::f64);
    const auto one = read_view<float>(other, alone, FieldForm::view_depth, 1);
    EXPECT_TRUE(std::equal(one.begin(), one.end(), depth.begin() + std::ptrdiff_t(one.size()) * e));
    const auto bytes = read_view<std::uint8_t>(other, alone, FieldForm::view_rgb, 1);
    EXPECT_TRUE(
        std::equal(bytes.begin(), bytes.end(), colours.begin() + std::ptrdiff_t(bytes.size()) * e));
  }
  // A picture that was kept is not shown when bodies were moved since.
  many.set_state(0, Numbers{0.1, 0.1, 0}, Numbers{0, 0, 0});
  EXPECT_NE(read_view<float>(readout, many, FieldForm::view_depth, 1), depth);
}

TEST(CameraReading, NoiseHasItsDeviationAndOtherCamerasOtherNoise) {
  Scene scene = watched();
  const auto plain = view<std::uint8_t>(scene, FieldForm::view_rgb);
  scene.cameras[0].noise = 4;
  const auto noisy = view<std::uint8_t>(scene, FieldForm::view_rgb);
  double square = 0, count = 0;
  for (std::size_t k = 0; k < plain.size(); ++k) {
    if (plain[k] < 30 || plain[k] > 225) continue;  // clamped
    square += std::pow(double(noisy[k]) - plain[k], 2), ++count;
  }
  EXPECT_NEAR(std::sqrt(square / count), 4, 0.15);
  scene.cameras[0].name = "other";
  EXPECT_NE(view<std::uint8_t>(scene, FieldForm::view_rgb), noisy);
  scene.cameras[0].noise = 0;
  EXPECT_EQ(view<std::uint8_t>(scene, FieldForm::view_rgb), plain);
}

/// The scene with the camera's pose and light drawn.
Scene with_draws(Scene scene) {
  using Field = NumberField;
  const auto draw = [&](Field field, int component, double low, double high) {
    scene.randomizations.push_back({{NumberOwner::camera, field, "eye", component},
                                    {Distribution::Kind::uniform, low, high, {}},
                                    {}});
  };
  draw(Field::pos, 0, -0.05, 0.05), draw(Field::pos, 2, 0.4, 0.6);
  draw(Field::look, 1, -0.03, 0.03);
  draw(Field::light, 0, -1, 1), draw(Field::light, 1, -1, 1);
  draw(Field::ambient, 0, 0.1, 0.6), draw(Field::brightness, 0, 0.5, 1.5);
  return scene;
}

/// Each environment has the picture of a scene with its numbers, alone and in any batch.
TEST(CameraReading, PoseAndLightAreThoseThatAreDrawn) {
  Scene scene = watched();
  scene.links[0].body.specular = 0.7;
  const Model model(with_draws(scene));
  constexpr int kCount = 19;
  Batch batch(model, kCount, 3);
  Readout readout(model);
  const auto all = read_view<std::uint8_t>(readout, batch, FieldForm::view_rgb);
  const std::size_t size = all.size() / kCount;
  std::set<std::vector<std::uint8_t>> different;
  for (const int e : {0, 1, 7, 16, 18}) {
    Scene same = scene;
    for (std::size_t k = 0; k < model.scene().randomizations.size(); ++k)
      number_in(same, model.scene().randomizations[k].number) =
          batch.randomized_value(e, static_cast<int>(k));
    const auto begin = all.begin() + std::ptrdiff_t(size) * e;
    const std::vector<std::uint8_t> own(begin, begin + std::ptrdiff_t(size));
    EXPECT_EQ(view<std::uint8_t>(same, FieldForm::view_rgb), own) << e;
    Batch alone(model, 1, 3, e);
    Readout other(model);
    EXPECT_EQ(read_view<std::uint8_t>(other, alone, FieldForm::view_rgb), own) << e;
    different.insert(own);
  }
  EXPECT_EQ(different.size(), 5U);
  const Batch otherwise(model, kCount, 4);
  EXPECT_NE(read_view<std::uint8_t>(readout, otherwise, FieldForm::view_rgb), all);
}

/// A number that is set later than the picture was kept is seen; a camera without a direction sees
/// nothing, and a lamp without one does not shine.
TEST(CameraReading, NumbersThatAreSetAreSeen) {
  const Model model(with_draws(watched()));
  Batch batch(model, 1, 3);
  Readout readout(model);
  const auto set = [&](int k, double value) {
    batch.set_randomized_value(0, k, value);
    return read_view<std::uint8_t>(readout, batch, FieldForm::view_rgb);
  };
  const auto dark = set(6, 0.5), bright = set(6, 1);
  EXPECT_NEAR(bright[3 * kMiddle], 2 * dark[3 * kMiddle], 1);
  const auto even = set(5, 1);  // light from everywhere
  EXPECT_EQ(even[3 * kMiddle], 255);
  const auto drawn_as_zero = [](NumberField field, const std::vector<int>& components) {
    Scene scene = watched();
    for (const int k : components)
      scene.randomizations.push_back(
          {{NumberOwner::camera, field, "eye", k}, {Distribution::Kind::list, 0, 0, {0}}, {}});
    return scene;
  };
  const Scene unlit = drawn_as_zero(NumberField::light, {0, 1, 2}),
              blind = drawn_as_zero(NumberField::pos, {2});
  EXPECT_EQ(view<std::uint8_t>(unlit, FieldForm::view_rgb)[3 * kMiddle],
            std::lround(255 * unlit.cameras[0].ambient));
  EXPECT_THAT(view<std::int16_t>(blind, FieldForm::view_ids), ::testing::Each(std::int16_t{-1}));
}

TEST(CameraReading, MaterialsOfBodiesAreSeen) {
  Scene scene = watched();
  scene.cameras[0].light = {0, 0, 1};
  const auto plain = view<std::uint8_t>(scene, FieldForm::view_rgb);
  scene.links[0].body.specular = 0.5, scene.links[0].body.shininess = 0.05;
  const auto shiny = view<std::uint8_t>(scene, FieldForm::view_rgb);
  EXPECT_EQ(plain[3 * kMiddle + 1], 0);
  EXPECT_GT(shiny[3 * kMiddle + 1], 60);  // half of the lamp's 0.65, about the top
  scene.links[0].body.specular = 0, scene.links[0].body.emission = 1;
  EXPECT_EQ(view<std::uint8_t>(scene, FieldForm::view_rgb)[3 * kMiddle], 255);
}

TEST(CameraReading, IsEmptyWhereNoPlaceIsKnown) {
  const auto ids = view<std::int16_t>(watched(), FieldForm::view_ids, {NAN, 0, 0});
  EXPECT_EQ(std::ranges::count(ids, 0), 0);
  Scene carried = watched();
  carried.cameras[0].body = "ball";
  EXPECT_THAT(view<std::int16_t>(carried, FieldForm::view_ids, {NAN, 0, 0}),
              ::testing::Each(std::int16_t{-1}));
}

TEST(CameraReading, RefusesWhatItCannotDo) {
  Scene scene = watched();
  const auto changed = [&](const auto& change) {
    Scene other = scene;
    change(other.cameras[0], other);
    return refusal(other);
  };
  EXPECT_EQ(changed([](auto&, auto&) {}), "");
  EXPECT_THAT(changed([](auto& c, auto&) { c.body = "bal"; }),
              HasSubstr("eye.xml:12: camera 'eye': no body is named 'bal'"));
  EXPECT_THAT(changed([](auto& c, auto&) {
                c.up = {0, 0, 1};
              }),
              HasSubstr("lies along the view from pos to look; expected another direction, such "
                        "as up=\"0 1 0\""));
  EXPECT_THAT(changed([](auto& c, auto&) { c.target = c.position; }), HasSubstr("same point"));
  EXPECT_THAT(changed([](auto& c, auto&) { c.light = {0, 0, 0}; }), HasSubstr("light has no"));
  EXPECT_THAT(changed([](auto& c, auto&) { c.fov = 171; }), HasSubstr("fov=\"171\""));
  EXPECT_THAT(changed([](auto& c, auto&) { c.rows = 0; }), HasSubstr("rows=\"0\""));
  EXPECT_THAT(changed([](auto& c, Scene& s) { s.cameras.push_back(c); }),
              HasSubstr("another camera has this name"));
  const Model model(scene);
  Batch batch(model, 1, 3);
  Readout readout(model);
  std::vector<double> few(3);
  const std::span<double> to(few);
  EXPECT_THROW(readout.read_block(batch, 0, {1, FieldForm::view_rgb}, {{to}}), InputError);
  EXPECT_THROW(readout.read_block(batch, 0, {0, FieldForm::view_rgb}, {{to}}), InputError);
  EXPECT_THROW((read_view<std::uint8_t>(readout, batch, FieldForm::view_depth)), InputError);
  EXPECT_THROW((read_view<std::int16_t>(readout, batch, FieldForm::view_rgb)), InputError);
  EXPECT_THROW(FormMap(model, {0, FieldForm::view_rgb}), InputError);
}

}  // namespace
}  // namespace tangere
