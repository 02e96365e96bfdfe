// SPDX-License-Identifier: Apache-2.0
// Counts the memory that steps of shipped scenes leave in a batch, and compares it with what the
// memory checks of commands count for it.
#include <gtest/gtest.h>
#include <malloc.h>

#include <string>
#include <vector>

#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/sanitized.hpp"

namespace tangere {
namespace {

constexpr int kListedEnvironments = 16;

double allocated_bytes() {
  const struct mallinfo2 heap = mallinfo2();
  return double(heap.uordblks) + double(heap.hblkhd);
}

/// Takes steps of a scene's own controls. Returns the bytes that they leave.
double run(const Model& model, Stepper& stepper) {
  Batch batch(model, kListedEnvironments, 1);
  const ControlProgram controls(model, model.timestep(), 1);
  const auto nu = std::size_t(model.nu());
  std::vector<double> u(kListedEnvironments * nu);
  const double before = allocated_bytes();
  for (int step = 0; step < 300; ++step) {
    for (int e = 0; e < kListedEnvironments; ++e)
      controls.evaluate(step, e, std::span(u).subspan(std::size_t(e) * nu, nu));
    stepper.step(batch, u);
  }
  return allocated_bytes() - before;
}

TEST(CandidateBytes, CoverTheListsOfShippedScenes) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer's heap does not count";
  for (const std::string name : {"rolling_ball", "stable_grasp", "cap_opening", "insertion",
                                 "box_pushing", "mug", "hard/stack_equal"}) {
    const Model model(read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene);
    Stepper stepper(model);
    run(model, stepper);  // the stepper's own memory grows
    const double left = run(model, stepper) / kListedEnvironments;
    const auto counted = double(Stepper::candidate_bytes(model));
    EXPECT_LE(left, counted) << name;
    EXPECT_GE(left, counted / 16) << name;
  }
}

TEST(CandidateBytes, AreNoneWhereListsAreNotKept) {
  constexpr int kBoxes = 17;  // 136 pairs
  std::string links, pairs;
  for (int a = 0; a < kBoxes; ++a) {
    const std::string name = "b" + std::to_string(a);
    links +=
        "<robot><link name='" + name + "'><joint name='" + name + "' type='free3d'/><body name='" +
        name +
        "' type='cuboid' size='0.1 0.1 0.1' general_contact_resolution='2 2 2'/></link></robot>";
    for (int b = 0; b < a; ++b)
      pairs += "<general_primitive_contact general_body='" + name + "' primitive_body='b" +
               std::to_string(b) + "' kn='1e3'/>";
  }
  const Model model(
      parse_scene("<tangere><option unit='m-kg'/><default><body density='600'/></default>" + links +
                      "<contact>" + pairs + "</contact></tangere>",
                  "boxes")
          .scene);
  EXPECT_EQ(Stepper::candidate_bytes(model), 0u);
}

}  // namespace
}  // namespace tangere
