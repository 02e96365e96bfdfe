// SPDX-License-Identifier: Apache-2.0
// --record transmissions: a trajectory holds what acts on the lengths, and what cannot is refused.
#include <gmock/gmock.h>

#include <fstream>

#include "tests/apps/arrays.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A ball on a cord with a spring and damping: the file has what acts on the cord.
TEST(TransmissionFiles, HoldForces) {
  const Folder folder;
  std::ofstream(folder.path("cord.xml")) << R"(<tangere><option unit="m-kg" gravity="0 0 0"
timestep="0.001"/><robot><link name="ball"><joint name="ball" type="prismatic" axis="1 0 0"/>
<body name="ball" type="sphere" radius="0.05" density="1000"/></link></robot><robot>
<link name="cord"><joint name="cord" type="prismatic" axis="1 0 0" stiffness="80" rest="0.25"
damping="0.4"/><body name="cord" type="abstract" mass="0" inertia="0 0 0"/></link></robot>
<transmission><path joint="cord"><point body="ball"/><point pos="0 0.3 0"/></path></transmission>
<actuator><motor joint="cord" ctrl="force" ctrl_range="-2 2"/></actuator>
<initial><joint name="ball" q="0.2"/></initial>
<control><constant value="0.25"/></control></tangere>)";
  const std::string cord = folder.path("cord.xml");
  const Outcome made = run(folder, {"simulate", cord, "-o", "run.h5", "--steps", "5", "--envs", "2",
                                    "--record", "transmissions"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const Array force = array_of(folder.path("run.h5"), "transmissions/force"),
              q = array_of(folder.path("run.h5"), "q"), v = array_of(folder.path("run.h5"), "v"),
              u = array_of(folder.path("run.h5"), "u");
  EXPECT_THAT(force.dims, ElementsAre(5, 2, 1));
  for (std::size_t k = 0; k < 10; ++k) {
    const double length = q.values[2 * (k + 2) + 1], rate = v.values[2 * (k + 2) + 1];
    EXPECT_NEAR(force.values[k], 80 * (0.25 - length) - 0.4 * rate + 2 * u.values[k], 1e-12);
  }
  const auto refused = [&](const Words& words) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_THAT(
      refused({"simulate", cord, "-o", "x.h5", "--steps", "2", "--record", "transmissions/2"}),
      HasSubstr("'transmissions' with times; expected it alone"));
  EXPECT_THAT(refused({"generate", cord, "-o", "x", "--episodes", "1", "--steps", "2", "--record",
                       "q,transmissions"}),
              HasSubstr("--record: 'transmissions', but a data set does not hold it"));
  EXPECT_THAT(refused({"simulate", scene("rolling_ball_small.xml"), "-o", "x.h5", "--record",
                       "transmissions"}),
              HasSubstr("'transmissions', but the scene has none"));
}

}  // namespace
}  // namespace tangere::apps
