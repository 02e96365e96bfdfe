// SPDX-License-Identifier: Apache-2.0
// Runs the readers of docs/datasets.md as printed there.
#include <gmock/gmock.h>

#include <cstdio>
#include <cstdlib>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

/// A Python that has h5py; empty when there is none.
std::string python() {
  for (const char* name : {"python3", "/usr/bin/python3"})
    if (std::system((std::string(name) + " -c 'import h5py, numpy' >/dev/null 2>&1").c_str()) == 0)
      return name;
  return {};
}

std::vector<std::string> readers() {
  std::string page = file_bytes(TANGERE_SOURCE_DIR "/docs/datasets.md");
  const std::string begin = "```python\n", end = "```";
  std::vector<std::string> blocks;
  for (std::size_t at = page.find(begin); at != std::string::npos; at = page.find(begin, at)) {
    at += begin.size();
    blocks.push_back(page.substr(at, page.find(end, at) - at));
  }
  return blocks;
}

/// Runs a program in the folder. Returns what it printed.
std::string run_python(const Folder& folder, const std::string& interpreter,
                       const std::string& program) {
  folder.write("reader.py", program);
  const std::string command =
      "cd " + folder.path() + " && " + interpreter + " reader.py >out.txt 2>err.txt";
  EXPECT_EQ(std::system(command.c_str()), 0) << program << folder.read("err.txt");
  return folder.read("out.txt");
}

TEST(Readers, OfThePageReadADataSet) {
  const std::string interpreter = python();
  if (interpreter.empty())
    GTEST_SKIP() << "no python3 with h5py: the readers of docs/datasets.md were NOT tried";
  const Folder folder;
  ASSERT_EQ(run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", "balls",
                         "--episodes", "32", "--seed", "1", "--quiet"})
                .exit_code,
            0);
  ASSERT_EQ(run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", "sparse",
                         "--episodes", "4", "--quiet"})
                .exit_code,
            0);
  ASSERT_EQ(
      run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", "derived", "--episodes",
                   "4", "--steps", "20", "--every", "5", "--gradients", "jacobians", "--quiet"})
          .exit_code,
      0);
  ASSERT_EQ(run(folder, {"generate", "box_pushing", "--output", "pushes", "--episodes", "32",
                         "--mix", "random=0.3", "--quiet"})
                .exit_code,
            0);
  std::string watched = file_bytes(scene("rolling_ball_small.xml"));
  watched.insert(watched.find("</sensor>"),
                 "<camera name=\"eye\" pos=\"0 -0.25 0.2\" look=\"0 0 0.02\" rows=\"24\" "
                 "cols=\"32\"/>\n");
  ASSERT_EQ(run(folder, {"generate", folder.write("watched.xml", watched), "--output", "files",
                         "--episodes", "1", "--steps", "20", "--every", "10", "--record",
                         "q,eye.rgb", "--pictures", "jpeg:95", "--quiet"})
                .exit_code,
            0);
  const std::vector<std::string> blocks = readers();
  ASSERT_GE(blocks.size(), 6U);
  int tried = 0;
  for (const std::string& block : blocks) {
    const bool needs_minari = block.find("import minari") != std::string::npos;
    if (needs_minari &&
        std::system((interpreter + " -c 'import minari' >/dev/null 2>&1").c_str()) != 0) {
      std::printf("Minari is not installed: its reader was NOT tried\n");
      continue;
    }
    EXPECT_FALSE(run_python(folder, interpreter, block).empty());
    ++tried;
  }
  EXPECT_GE(tried, 5);
}

/// Checks what h5py makes of types, texts and counts. HDF5's C library hides mistakes in these.
TEST(Readers, SeeDerivativesAndNextObservationsAsDescribed) {
  const std::string interpreter = python();
  if (interpreter.empty())
    GTEST_SKIP() << "no python3 with h5py: derivatives and next_obs were NOT read through it";
  const Folder folder;
  const std::vector<std::string> words{"generate",    scene("rolling_ball_small.xml"),
                                       "--output",    "set",
                                       "--episodes",  "20",
                                       "--steps",     "30",
                                       "--every",     "5",
                                       "--gradients", "jacobians",
                                       "--seed",      "18446744073709551615",
                                       "--quiet"};
  ASSERT_EQ(run(folder, words).exit_code, 0);
  EXPECT_EQ(run_python(folder, interpreter, R"(
import glob, h5py, numpy as np
with h5py.File("set/robomimic.hdf5", swmr=True, libver="latest") as f:  # as robomimic opens it
    said = f["scene/gradients"]
    assert f["scene"].attrs["gradients"] == "jacobians"
    derived = ["grad_state_by_action", "grad_state_by_previous", "grad_state_by_state"]
    assert sorted(said) == derived, sorted(said)
    na, states = len(f["scene"].attrs["action_names"]), 2 * len(f["scene"].attrs["v_names"])
    shapes = {"grad_state_by_action": (6, states, na)}
    for i in range(20):
        demo = f["data/demo_%d" % i]
        assert len(demo.attrs) == 3 and demo.attrs["num_samples"] == 6, dict(demo.attrs)
        assert len(demo.attrs["randomized"]) == len(f["scene"].attrs["randomized_names"])
        felt = np.any(demo["obs/pad"][:] != 0, axis=(1, 2, 3))
        assert demo.attrs["touching"] == felt.sum(), (i, felt)
        for name in said:
            d = demo[name]
            assert d.dtype == "<f8" and d.shape == shapes.get(name, (6, states, states)), (name, d)
            assert len(d.attrs) == 1 and isinstance(d.attrs["meaning"], str), dict(d.attrs)
            here = said[name].attrs
            assert d.attrs["meaning"] == here["meaning"] and len(d.attrs["meaning"]) > 20
            assert len(here["by_names"]) == len(here["by_units"]) == d.shape[-1]
            assert np.isfinite(d[:]).all() and d.is_virtual is False
        assert sorted(demo["next_obs"]) == sorted(demo["obs"]) == ["pad", "q", "v"]
        for name, d in demo["next_obs"].items():
            obs, last = demo["obs"][name], demo["final_obs"][name]
            assert d.is_virtual and d.dtype == obs.dtype and d.shape == obs.shape, (name, d)
            assert np.array_equal(d[:], np.concatenate([obs[1:], last]))
            assert np.array_equal(d[2], obs[3]) and np.array_equal(d[-1:], last)
for path in glob.glob("set/minari/*/*/data/main_data.hdf5"):
    with h5py.File(path) as f:
        assert len(f.attrs) == 2 and f.attrs["total_episodes"] == len(f) == 20
        episode = f["episode_19"]
        assert len(episode.attrs) == 4 and episode.attrs["id"] == 19
        assert episode.attrs["seed"] == 2**64 - 1 and sorted(episode["infos"]) == derived
        by_action = episode["infos/grad_state_by_action"]
        assert by_action.shape[0] == 6 and np.isfinite(by_action[:]).all()
        assert episode["observations/pad"].shape == (7, 32, 32, 3)
        assert episode["terminations"].dtype == bool and not episode["terminations"][:].any()
        assert list(episode["truncations"][:]) == [False] * 5 + [True]
        print("read")
)"),
            "read\n");
}

}  // namespace
}  // namespace tangere::apps
