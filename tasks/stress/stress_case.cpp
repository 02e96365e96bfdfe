// SPDX-License-Identifier: Apache-2.0
// The table of hard cases. A row puts into numbers what the comment in its scene file says.
#include "tasks/stress/stress_case.hpp"

namespace tangere {
namespace {

using Cases = std::vector<StressCase>;
using Schemes = std::vector<Integrator>;
using Steps = std::vector<double>;

// Functions, because Integrator's own constants may not be there yet when a constant here is made.
Schemes all() { return {integrators().begin(), integrators().end()}; }
Schemes first_order() {
  Schemes schemes = all();
  std::erase_if(schemes, [](Integrator i) { return i.scheme().order > 1; });
  return schemes;
}
Schemes higher() {
  Schemes schemes = all();
  std::erase_if(schemes, [](Integrator i) { return i.scheme().order == 1; });
  return schemes;
}
Steps usual() { return {5e-3, 1e-3, 20e-3}; }

constexpr double kNoGain = 1 + 1e-9;  // of energy, for BDF1
constexpr double kSlightGain = 1.01;  // for the other schemes
constexpr double kRelaxation = 5e-3;  // kt over ks of a contact that is given ks [s]

/// The same case for BDF1 and for the others, whose bounds on energy differ.
void add_energy_case(Cases& cases, StressCase of) {
  of.criterion = "energy over the start's";
  of.measure = energy_ratio;
  const auto add = [&](const char* suffix, const Schemes& schemes, double bound) {
    cases.push_back(of);
    StressCase& added = cases.back();
    added.name += suffix;
    added.schemes = schemes;
    added.bound = bound;
  };
  add("", first_order(), kNoGain);
  add("_higher", higher(), kSlightGain);
}

Cases geometry() {
  return {
      {.name = "stack_equal",
       .scene = "hard/stack_equal.xml",
       .criterion = "largest sink of a box [m]",
       .measure = largest_sink,
       .bound = 5e-3,
       .seconds = 3,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "stack_shifted",
       .scene = "hard/stack_shifted.xml",
       .criterion = "largest sink of a box [m]",
       .measure = largest_sink,
       .bound = 5e-3,
       .seconds = 3,
       .steps = usual(),
       .schemes = all(),
       .environments = 16,
       .quick = true},
      {.name = "stack_unequal",
       .scene = "hard/stack_unequal.xml",
       .criterion = "largest sink of a box [m]",
       .measure = largest_sink,
       .bound = 5e-3,
       .seconds = 3,
       .steps = usual(),
       .schemes = all(),
       .environments = 16,
       .quick = true},
      {.name = "post_between_points",
       .scene = "hard/post_between_points.xml",
       .criterion = "largest sink of the box [m]",
       .measure = largest_sink,
       .bound = 5e-3,
       .seconds = 0.5,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "card_house",
       .scene = "hard/card_house.xml",
       .criterion = "largest sink of a card [m]",
       .measure = largest_sink,
       .bound = 5e-3,
       .seconds = 2,
       .steps = usual(),
       .schemes = all()},
      {.name = "box_through_plate",
       .scene = "hard/box_through_plate.xml",
       .criterion = "depth of the box's middle below the plate's [m]",
       .measure = sinks_below(1, 0),
       .bound = 0,
       .seconds = 0.3,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "box_through_plate_fast",
       .scene = "hard/box_through_plate.xml",
       .criterion = "depth of the box's middle below the plate's [m]",
       .measure = sinks_below(1, 0),
       .bound = 0,
       .seconds = 0.3,
       .steps = usual(),
       .schemes = all(),
       .variant = {.speed = 5 / 1.5},
       .quick = true},
      {.name = "ball_through_pad",
       .scene = "hard/ball_through_pad.xml",
       .criterion = "depth of the ball's middle below the pad's [m]",
       .measure = sinks_below(1, 0),
       .bound = 0,
       .seconds = 0.05,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "edge_drop",
       .scene = "hard/edge_drop.xml",
       .criterion = "depth of the box's middle below the ground [m]",
       .measure = sinks_below_ground(0),
       .bound = 0,
       .seconds = 1,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
  };
}

Cases impacts() {
  Cases cases;
  add_energy_case(cases, {.name = "ball_impact",
                          .scene = "hard/ball_impact.xml",
                          .seconds = 0.1,
                          .steps = usual(),
                          .quick = true});
  add_energy_case(cases, {.name = "joint_limit",
                          .scene = "hard/joint_limit.xml",
                          .seconds = 0.2,
                          .steps = usual(),
                          .quick = true});
  add_energy_case(cases, {.name = "cradle",
                          .scene = "hard/cradle.xml",
                          .seconds = 0.4,
                          .steps = usual(),
                          .quick = true});
  add_energy_case(
      cases,
      {.name = "toss", .scene = "hard/toss.xml", .seconds = 1, .steps = usual(), .quick = true});
  add_energy_case(
      cases,
      {.name = "painleve_rod", .scene = "hard/painleve_rod.xml", .seconds = 1, .steps = usual()});
  cases.push_back({.name = "rebound",
                   .scene = "hard/rebound.xml",
                   .criterion = "error of the speed after the touch",
                   .measure = speed_error(0, 1),
                   .bound = 0.05,
                   .seconds = 0.05,
                   .steps = {1e-4, 1e-3, 5e-3},
                   .schemes = all(),
                   .quick = true});
  cases.push_back({.name = "pull_off",
                   .scene = "hard/pull_off.xml",
                   .criterion = "speed lost",
                   .measure = speed_error(1, 1),
                   .bound = 1e-6,
                   .seconds = 0.05,
                   .steps = usual(),
                   .schemes = all(),
                   .quick = true});
  cases.push_back({.name = "deep_overlap",
                   .scene = "hard/deep_overlap.xml",
                   .criterion = "speed over sqrt(kn/m) depth",
                   .measure = release_speed(0, 9e-3),
                   .bound = kSlightGain,
                   .seconds = 0.1,
                   .steps = usual(),
                   .schemes = all(),
                   .quick = true});
  return cases;
}

Cases masses() {
  return {
      {.name = "light_beside_heavy",
       .scene = "hard/light_beside_heavy.xml",
       .criterion = "error of the way that the ball falls",
       .measure = fall_error(0),
       .bound = 0.02,
       .seconds = 0.5,
       .steps = {5e-3, 1e-3},
       .schemes = all(),
       .quick = true},
      {.name = "heavy_on_light",
       .scene = "hard/heavy_on_light.xml",
       .criterion = "error of the light box's depth",
       .measure = rest_depth_error(0, 0.05, 4, 1e6 + 1),
       .bound = 0.01,
       .seconds = 2,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "cube_pair",
       .scene = "hard/cube_pair.xml",
       .criterion = "largest shift of a cube [m]",
       .measure = largest_shift,
       .bound = 1e-3,
       .seconds = 1,
       .steps = {1e-3, 5e-3},
       .schemes = all(),
       .quick = true},
      {.name = "hard_batch",
       .scene = "hard/hard_batch.xml",
       .criterion = "depth of a box's middle below the ground [m]",
       .measure = sinks_below_ground(0),
       .bound = 0,
       .seconds = 0.5,
       .steps = {5e-3, 20e-3},
       .schemes = all(),
       .environments = 1024,
       .may_fail = 1e-4},
  };
}

Cases rotations() {
  Cases cases{
      {.name = "fast_spin",
       .scene = "hard/fast_spin.xml",
       .criterion = "error of the angle [turns]",
       .measure = turn_error(0),
       .bound = 1e-6,
       .seconds = 1,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "tumbling_momentum",
       .scene = "hard/tumbling.xml",
       .criterion = "change of angular momentum",
       .measure = momentum_change,
       .bound = 0.02,
       .seconds = 1,
       .steps = {5e-3, 1e-3},
       .schemes = all(),
       .quick = true},
      {.name = "tumbling_energy",
       .scene = "hard/tumbling.xml",
       .criterion = "change of energy",
       .measure = energy_change,
       .bound = 0.02,
       .seconds = 1,
       .steps = {5e-3, 1e-3},
       .schemes = all(),
       .quick = true},
      {.name = "heavy_top",
       .scene = "hard/heavy_top.xml",
       .criterion = "error of the rate around the vertical",
       .measure = precession_error(0),
       .bound = 0.01,
       .seconds = 5,
       .steps = {1e-3, 5e-3},
       .schemes = all()},
  };
  add_energy_case(
      cases,
      {.name = "chain_whipped", .scene = "hard/chain_whipped.xml", .seconds = 1, .steps = usual()});
  add_energy_case(
      cases, {.name = "chain_20", .scene = "hard/chain_20.xml", .seconds = 2, .steps = usual()});
  add_energy_case(cases, {.name = "chain_100",
                          .scene = "hard/chain_100.xml",
                          .seconds = 1,
                          .steps = usual(),
                          .quick = true});
  return cases;
}

Cases closed_forms() {
  Cases cases{
      {.name = "far_away",
       .scene = "hard/far_away.xml",
       .criterion = "error of the depth",
       .measure = rest_depth_error(0, 0.01, 1),
       .bound = 1e-9,
       .seconds = 2,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "rolling",
       .scene = "hard/rolling.xml",
       .criterion = "error of the rolling speed",
       .measure = speed_error(0, 5.0 / 7),
       .bound = 1e-3,
       .seconds = 1,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "motor_gain",
       .scene = "hard/motor_gain.xml",
       .criterion = "distance from the target [rad]",
       .measure = angle_error(0, 0.5),
       .bound = 1e-9,
       .seconds = 0.5,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "slope_below",
       .scene = "hard/slope_below.xml",
       .criterion = "error of the creeping speed",
       .measure = creep_error(0, 4),
       .bound = 1e-6,
       .seconds = 1,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "slope_above",
       .scene = "hard/slope_above.xml",
       .criterion = "error of the acceleration",
       .measure = slide_error(0),
       .bound = 1e-3,
       .seconds = 2,
       .steps = usual(),
       .schemes = all(),
       .quick = true},
      {.name = "sliding_cube",
       .scene = "hard/sliding_cube.xml",
       .criterion = "error of the way until it stops",
       .measure = stop_error(0, 4),
       .bound = 0.02,
       .seconds = 1,
       .steps = {5e-3, 1e-3},
       .schemes = all(),
       .quick = true},
  };
  for (const auto& [name, factor] :
       {std::pair{"ball_at_rest_1e2", 1.0}, std::pair{"ball_at_rest_1e5", 1e3},
        std::pair{"ball_at_rest_1e8", 1e6}})
    cases.push_back({.name = name,
                     .scene = "hard/ball_at_rest.xml",
                     .criterion = "error of the depth",
                     .measure = rest_depth_error(0, 0.01, 1),
                     .bound = 0.01,
                     .seconds = 2,
                     .steps = usual(),
                     .schemes = all(),
                     .variant = {.kn = factor},
                     .quick = true});
  return cases;
}

/// Friction that remembers holds what dampers let creep.
Cases held() {
  Cases cases;
  const auto add = [&](const char* name, const char* scene, const StressVariant& variant,
                       bool quick) {
    cases.push_back({.name = name,
                     .scene = scene,
                     .criterion = "way after the first second [m]",
                     .measure = creep_after(1, 5e-3),
                     .bound = 1e-6,
                     .seconds = 10,
                     .steps = usual(),
                     .schemes = all(),
                     .variant = variant,
                     .quick = quick});
  };
  add("slope_kept", "hard/slope_below.xml", {.ks = 0.25}, true);
  add("grasp_kept", "hard/held_box.xml", {}, true);
  add("card_house_kept", "hard/card_house.xml", {.ks = 0.25}, false);
  add("arch_kept", "hard/arch.xml", {}, true);
  return cases;
}

/// The scenes of the tasks with stiffer contacts, at their own schemes and steps.
Cases stiff_scenes() {
  Cases cases;
  for (const char* scene :
       {"rolling_ball_small", "box_pushing", "cap_opening", "insertion", "stable_grasp"}) {
    const auto add = [&](const char* suffix, const StressVariant& variant) {
      cases.push_back({.name = std::string(scene) + suffix,
                       .scene = std::string(scene) + ".xml",
                       .criterion = "passes over the ordinary scene's",
                       .bound = 2.5,
                       .variant = variant,
                       .environments = 16});
    };
    add("_kn_1e3", {.kn = 1e3});
    add("_kn_1e6", {.kn = 1e6});
    add("_kt_1e4", {.kt = 1e4});
  }
  return cases;
}

void scale(RandomizationDescription& drawn, const StressVariant& variant) {
  const NumberOwner owner = drawn.number.owner;
  if (owner != NumberOwner::contact && owner != NumberOwner::ground) return;
  const double factor = drawn.number.field == NumberField::kn   ? variant.kn
                        : drawn.number.field == NumberField::kt ? variant.kt
                                                                : 1;
  drawn.distribution.a *= factor;
  drawn.distribution.b *= factor;
  for (double& value : drawn.distribution.values) value *= factor;
}

}  // namespace

std::span<const StressCase> stress_cases() {
  static const Cases table = [] {
    Cases cases;
    for (const auto part : {geometry, impacts, masses, rotations, closed_forms, held, stiff_scenes})
      for (StressCase& of : part()) cases.push_back(std::move(of));
    return cases;
  }();
  return table;
}

Scene varied(Scene scene, const StressVariant& variant) {
  const auto stiffen = [&](ContactCoefficients& c) {
    c.kn *= variant.kn;
    c.kt *= variant.kt;
    if (variant.ks == 0) return;
    c.ks = variant.ks * c.kn;
    c.kt = kRelaxation * c.ks;
  };
  for (GroundContactDescription& c : scene.ground_contacts) stiffen(c.coefficients);
  for (PairContactDescription& c : scene.pair_contacts) stiffen(c.coefficients);
  for (InitialState& state : scene.initial)
    for (double& v : state.v) v *= variant.speed;
  for (RandomizationDescription& drawn : scene.randomizations) scale(drawn, variant);
  return scene;
}

}  // namespace tangere
