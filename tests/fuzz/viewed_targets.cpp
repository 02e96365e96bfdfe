// SPDX-License-Identifier: Apache-2.0
// Files of a real scene, small enough for thousands of mutants: `view` compiles the scene that a
// file holds, and a run that starts from a file steps its states.
#include <functional>

#include "engine/base/error.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/dataset/dataset_from_model.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/scene/scene_reader.hpp"
#include "io/trajectory/saved_state.hpp"
#include "io/trajectory/trajectory_file.hpp"
#include "io/view/view_page.hpp"
#include "io/view/view_reader.hpp"
#include "tasks/run/episodes.hpp"
#include "tasks/run/rollout.hpp"
#include "tests/files.hpp"
#include "tests/fuzz/targets.hpp"

namespace tangere::fuzz {
namespace {

constexpr const char* kViewedScene = R"(<tangere model="viewed">
<option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3"/>
<ground pos="0 0 0" normal="0 0 1"/>
<default><general_primitive_contact kn="50" kt="1" mu="1" damping="1" ks="20"/>
<ground_contact kn="5e3" kt="1" mu="0.8" damping="0.3"/></default>
<robot><link name="pad"><joint name="pad" type="translational" pos="0 0 0.046" damping="1"/>
<body name="pad" type="cuboid" size="0.05 0.05 0.01" density="1000"
      general_contact_resolution="3 3 3"/></link></robot>
<robot><link name="ball"><joint name="ball" type="free3d" pos="0 0 0.02"/>
<body name="ball" type="sphere" radius="0.02" density="100"/></link></robot>
<actuator><motor joint="pad" ctrl="force" ctrl_range="-1 1"/></actuator>
<contact><ground_contact body="ball"/>
<general_primitive_contact general_body="pad" primitive_body="ball"/></contact>
<sensor><tactile name="skin" body="pad" type="rect_array" rect_pos0="-0.01 0.01 -0.005"
 rect_pos1="0.01 -0.01 -0.005" axis0="0 -1 0" axis1="1 0 0" resolution="3 4" every="2" kn="1"
 kt="0.01" mu="2" damping="0.003"><imperfections noise="0.002 0.001" delay="0.007" dead="0.1"/>
</tactile></sensor>
<variable><endeffector joint="ball" pos="0 0 0" radius="0.001"/></variable>
<outputs record="q,v,skin,skin.ideal,variables"/>
<control><piecewise end="1"><at time="0" value="0.1 0 -0.2"/>
<at time="0.02" value="-0.1 0 -0.2"/></piecewise></control>
<randomize><body name="ball" field="radius" uniform="0.018 0.021"/></randomize></tangere>)";

constexpr int kEnvironments = 2, kViewedSteps = 6;

/// The scene compiled, once for all mutants.
const Model& viewed_model() {
  static const Model one(parse_scene(kViewedScene, "viewed.xml").scene);
  return one;
}

ControlProgram viewed_controls() { return {viewed_model(), viewed_model().timestep(), 0}; }

std::vector<std::string> viewed_trajectories(const std::string& folder) {
  Batch batch(viewed_model(), kEnvironments, 1);
  Stepper stepper(viewed_model());
  RolloutOptions rollout;
  rollout.steps = kViewedSteps;
  const RunFacts facts =
      run_facts(viewed_model(), stepper, {"double", "0", "scalar", "tangere simulate", {}}, 1);
  const std::string path = folder + "/run.h5";
  TrajectoryFile file(path, rollout_recording(batch, stepper, rollout, facts), true);
  run_rollout(batch, std::span(&stepper, 1), viewed_controls(), rollout, file);
  file.commit();
  return {file_bytes(path)};
}

std::vector<std::string> viewed_shards(const std::string& folder) {
  EpisodeOptions run;
  run.episodes = kEnvironments, run.steps = kViewedSteps, run.every = 2;
  DatasetLayout set;
  set.episodes = run.episodes, set.steps = run.steps, set.every = run.every;
  set.precision = "double", set.version = "0", set.instruction_set = "scalar";
  DatasetWriter writer({folder}, dataset_layout_from(viewed_model(), Stepper(viewed_model()), set));
  run_episodes(viewed_model(), {}, viewed_controls(), run, writer);
  return {file_bytes(folder + "/shard-00000.h5")};
}

/// The page. Throws IoError where it is refused.
void show(const std::string& path) {
  try {
    static_cast<void>(render_view_page(read_view(path, {})));
  } catch (const InputError& error) {  // of an episode that is not there
    throw IoError(error.what());
  }
}

/// `simulate --state-from`, and the page.
void go_on(const std::string& path) {
  bool refused = false;
  try {
    const SavedState saved = read_state(path, std::nullopt);
    Batch batch(viewed_model(), kEnvironments, 1, saved.first_episode);
    restore_state(saved, true, batch);
    Stepper stepper(viewed_model());
    RolloutOptions rollout;
    rollout.steps = 1, rollout.first_step = saved.step;
    struct Nowhere : RowSink {
      void write(std::int64_t, std::size_t, const Numbers&) override {}
    } nowhere;
    run_rollout(batch, std::span(&stepper, 1), viewed_controls(), rollout, nowhere);
  } catch (const InputError&) {
    refused = true;
  } catch (const IoError&) {
    refused = true;
  }
  show(path);
  if (refused) throw IoError("refused");
}

}  // namespace

std::string small_scene() { return kViewedScene; }

std::vector<Target> viewed_targets() {
  return {{"viewed_trajectory", true, "run.h5", viewed_trajectories,
           [](const std::string& folder) { go_on(folder + "/run.h5"); }},
          {"viewed_shard", true, "shard-00000.h5", viewed_shards,
           [](const std::string& folder) { show(folder); }}};
}

}  // namespace tangere::fuzz
