// SPDX-License-Identifier: Apache-2.0
// The table of hard cases: one criterion and bound per row. The scene file describes the case.
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

/// Common properties of a family of cases.
struct Family {
  std::string criterion;
  Criterion measure;
  double bound;
  double seconds;
  Steps steps = usual();
  Schemes schemes = all();
};

/// Properties of one case.
struct Row {
  std::string name;
  std::string scene{};  ///< file below scenes/hard/ without ".xml"; "": the name
  StressVariant variant{};
  int environments = 1;
  double may_fail = 0;
  bool quick = true;
};

void add(Cases& cases, const Family& family, const std::vector<Row>& rows) {
  for (const Row& row : rows)
    cases.push_back({row.name, "hard/" + (row.scene.empty() ? row.name : row.scene) + ".xml",
                     family.criterion, family.measure, family.bound, family.seconds, family.steps,
                     family.schemes, row.variant, row.environments, row.may_fail, row.quick});
}

/// The same case for BDF1 and for the others, whose bounds on energy differ.
void add_energy_case(Cases& cases, const std::string& name, double seconds, bool quick) {
  const auto add_schemes = [&](const char* suffix, const Schemes& schemes, double bound) {
    add(cases, {"energy over the start's", energy_ratio, bound, seconds, usual(), schemes},
        {{.name = name + suffix, .scene = name, .quick = quick}});
  };
  add_schemes("", first_order(), kNoGain);
  add_schemes("_higher", higher(), kSlightGain);
}

Cases geometry() {
  Cases cases;
  add(cases, {"largest sink of a box [m]", largest_sink, 5e-3, 3},
      {{.name = "stack_equal"},
       {.name = "stack_shifted", .environments = 16},
       {.name = "stack_unequal", .environments = 16},
       {.name = "stack_three_points"}});
  add(cases, {"largest sink of the box [m]", largest_sink, 5e-3, 0.5},
      {{.name = "post_between_points"}});
  add(cases, {"largest sink of a card [m]", largest_sink, 5e-3, 2},
      {{.name = "card_house", .quick = false}});
  add(cases, {"depth of the box's middle below the plate's [m]", sinks_below(1, 0), 0, 0.3},
      {{.name = "box_through_plate"},
       {.name = "box_through_plate_fast",
        .scene = "box_through_plate",
        .variant = {.speed = 5 / 1.5}},
       {.name = "soft_plate"},
       {.name = "soft_plate_slow", .scene = "soft_plate", .variant = {.speed = 0.1}}});
  add(cases, {"depth of the ball's middle below the pad's [m]", sinks_below(1, 0), 0, 0.05},
      {{.name = "ball_through_pad"}});
  add(cases, {"depth of the box's middle below the ground [m]", sinks_below_ground(0), 0, 1},
      {{.name = "edge_drop"}});
  add(cases, {"largest sink of the box [m]", largest_sink, 1e-3, 0.35}, {{.name = "seam"}});
  add(cases, {"largest shift of a finger or the rod [m]", largest_shift, 0.01, 0.2},
      {{.name = "rod_between_fingers"}});
  return cases;
}

Cases impacts() {
  Cases cases;
  add_energy_case(cases, "ball_impact", 0.1, true);
  add_energy_case(cases, "impact_beside_spring", 0.1, true);
  add_energy_case(cases, "joint_limit", 0.2, true);
  add_energy_case(cases, "cradle", 0.4, true);
  add_energy_case(cases, "toss", 1, true);
  add_energy_case(cases, "painleve_rod", 1, false);
  add(cases,
      {"error of the speed after the touch", speed_error(0, 1), 0.05, 0.05, {1e-4, 1e-3, 5e-3}},
      {{.name = "rebound"}});
  add(cases, {"speed lost", speed_error(1, 1), 1e-6, 0.05}, {{.name = "pull_off"}});
  add(cases, {"speed over sqrt(kn/m) depth", release_speed(0, 9e-3), kSlightGain, 0.1},
      {{.name = "deep_overlap"}});
  return cases;
}

Cases masses() {
  Cases cases;
  add(cases, {"error of the way that the ball falls", fall_error(0), 0.02, 0.5, {5e-3, 1e-3}},
      {{.name = "light_beside_heavy"}});
  add(cases, {"error of the light box's depth", rest_depth_error(0, 0.05, 4, 1e6 + 1), 0.01, 2},
      {{.name = "heavy_on_light"}});
  add(cases, {"largest shift of a cube [m]", largest_shift, 1e-3, 1, {1e-3, 5e-3}},
      {{.name = "cube_pair"}});
  add(cases,
      {"depth of a box's middle below the ground [m]",
       sinks_below_ground(0),
       0,
       0.5,
       {5e-3, 20e-3}},
      {{.name = "hard_batch", .environments = 1024, .may_fail = 1e-4, .quick = false}});
  return cases;
}

Cases rotations() {
  Cases cases;
  add(cases, {"error of the angle [turns]", turn_error(0), 1e-6, 1}, {{.name = "fast_spin"}});
  add(cases, {"change of angular momentum", momentum_change, 0.02, 1, {5e-3, 1e-3}},
      {{.name = "tumbling_momentum", .scene = "tumbling"}});
  add(cases, {"change of energy", energy_change, 0.02, 1, {5e-3, 1e-3}},
      {{.name = "tumbling_energy", .scene = "tumbling"}});
  add(cases, {"error of the rate around the vertical", precession_error(0), 0.01, 5, {1e-3, 5e-3}},
      {{.name = "heavy_top", .quick = false}});
  add_energy_case(cases, "chain_whipped", 1, false);
  add_energy_case(cases, "chain_20", 2, false);
  add_energy_case(cases, "chain_100", 1, true);
  return cases;
}

Cases closed_forms() {
  Cases cases;
  add(cases, {"error of the depth", rest_depth_error(0, 0.01, 1), 1e-9, 2}, {{.name = "far_away"}});
  add(cases, {"error of the depth", rest_depth_error(0, 1e-6, 1), 0.01, 0.02, {1e-6, 1e-5}},
      {{.name = "tiny_ball"}});
  add(cases, {"error of the rolling speed", speed_error(0, 5.0 / 7), 1e-3, 1},
      {{.name = "rolling"}});
  add(cases, {"distance from the target [rad]", angle_error(0, 0.5), 1e-9, 0.5},
      {{.name = "motor_gain"}});
  add(cases, {"error of the creeping speed", creep_error(0, 4), 1e-6, 1},
      {{.name = "slope_below"}});
  add(cases, {"error of the acceleration", slide_error(0), 1e-3, 2}, {{.name = "slope_above"}});
  add(cases, {"error of the way until it stops", stop_error(0, 4), 0.02, 1, {5e-3, 1e-3}},
      {{.name = "sliding_cube"}});
  add(cases, {"error of the depth", rest_depth_error(0, 0.01, 1), 0.01, 2},
      {{.name = "ball_at_rest_1e2", .scene = "ball_at_rest"},
       {.name = "ball_at_rest_1e5", .scene = "ball_at_rest", .variant = {.kn = 1e3}},
       {.name = "ball_at_rest_1e8", .scene = "ball_at_rest", .variant = {.kn = 1e6}}});
  return cases;
}

/// Cases in which shear springs hold a body that tangential dampers let creep.
Cases held() {
  Cases cases;
  add(cases, {"way after the first second [m]", creep_after(1, 5e-3), 1e-6, 10},
      {{.name = "slope_kept", .scene = "slope_below", .variant = {.ks = 0.25}},
       {.name = "grasp_kept", .scene = "held_box"},
       {.name = "card_house_kept", .scene = "card_house", .variant = {.ks = 0.25}, .quick = false},
       {.name = "arch_kept", .scene = "arch"}});
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
