// SPDX-License-Identifier: Apache-2.0
// Pictures of cameras in trajectories and data sets: names, shapes, types, times, and the same
// bytes on any number of threads.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "io/hdf5/h5.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

/// The small rolling ball with a camera of 12 x 16 pixels.
std::string watched_scene(const Folder& folder,
                          const std::string& size = R"(rows="12" cols="16")") {
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  text.insert(
      text.find("</sensor>"),
      "<camera name=\"eye\" pos=\"0 -0.25 0.2\" look=\"0 0 0.02\" noise=\"2\" " + size + "/>\n");
  return folder.write("watched.xml", text);
}

struct Found {
  h5::Dims dims;
  std::size_t bytes = 0;  // of a number
  bool is_signed = false;
  std::vector<double> numbers;
};
Found found(const std::string& path, const std::string& name) {
  const h5::Id file = h5::open_file(path), d = h5::open_dataset(file, name),
               type(H5Dget_type(d.get()));
  Found it{h5::dimensions(d), H5Tget_size(type.get()), H5Tget_sign(type.get()) == H5T_SGN_2, {}};
  std::size_t count = 1;
  for (const hsize_t n : it.dims) count *= n;
  it.numbers.resize(count);
  h5::read_box<double>(d, h5::Dims(it.dims.size(), 0), it.dims, it.numbers.data());
  return it;
}

TEST(CameraRecord, ATrajectoryHasPicturesAtTheirTimes) {
  const Folder folder;
  const std::string from = watched_scene(folder);
  run_json(folder, {"simulate", from, "--output", "run.h5", "--steps", "120", "--every", "60",
                    "--envs", "2", "--seed", "3", "--record", "eye.rgb,eye.depth/final,eye.ids"});
  const std::string file = folder.path("run.h5");
  const Found rgb = found(file, "cameras/eye/rgb"), depth = found(file, "cameras/eye/depth"),
              ids = found(file, "cameras/eye/ids");
  EXPECT_EQ(rgb.dims, (h5::Dims{2, 2, 12, 16, 3}));
  EXPECT_EQ(rgb.bytes, 1U);
  EXPECT_EQ(depth.dims, (h5::Dims{1, 2, 12, 16, 1}));
  EXPECT_EQ(depth.bytes, 4U);
  EXPECT_EQ(ids.dims, (h5::Dims{2, 2, 12, 16, 1}));
  EXPECT_EQ(ids.bytes, 2U);
  EXPECT_TRUE(ids.is_signed);
  EXPECT_THAT(ids.numbers, ::testing::Contains(1.0));  // the ball
  EXPECT_THAT(depth.numbers, ::testing::Each(::testing::Gt(0.1)));
  EXPECT_EQ(found(file, "cameras/eye/step").numbers, (std::vector<double>{60, 120}));
  EXPECT_EQ(found(file, "cameras/eye/depth_step").numbers, (std::vector<double>{120}));
  EXPECT_EQ(run(folder, {"info", "run.h5"}).exit_code, 0);
}

/// Episodes that are cut into pieces, with colours beside larger numbers.
TEST(CameraRecord, ColoursBesideDepthsAreCutBetweenChunks) {
  const Folder folder;
  const std::string from = watched_scene(folder, R"(rows="128" cols="128")");
  std::vector<std::vector<double>> rgb, depth;
  for (const std::string tactile : {"sparse", "dense"}) {
    run_json(folder,
             {"generate", from, "--episodes", "1", "--steps", "48", "--every", "1", "--output",
              tactile, "--tactile", tactile, "--record", "q,eye.rgb,eye.depth"});
    const std::string shard = folder.path(tactile + "/shard-00000.h5");
    rgb.push_back(found(shard, "data/demo_0/obs/eye.rgb").numbers);
    depth.push_back(found(shard, "data/demo_0/obs/eye.depth").numbers);
  }
  EXPECT_EQ(rgb[0], rgb[1]);
  EXPECT_EQ(depth[0], depth[1]);
  EXPECT_EQ(depth[0].size(), 48U * 128 * 128);
}

TEST(CameraRecord, ShardsHaveTheSameBytesOnAnyNumberOfThreads) {
  const Folder folder;
  const std::string from = watched_scene(folder);
  for (const std::string compress : {"none", "deflate"}) {
    std::vector<std::string> bytes;
    for (const std::string threads : {"1", "2"}) {
      const std::string out = compress + threads;
      run_json(folder, {"generate", from, "--episodes", "17", "--steps", "40", "--every", "20",
                        "--output", out, "--threads", threads, "--compress", compress, "--record",
                        "q,eye.rgb,eye.ids,eye.depth/40"});
      const std::string shard = folder.path(out + "/shard-00000.h5");
      bytes.push_back(file_bytes(shard));
      if (threads == "2") continue;
      const Found rgb = found(shard, "data/demo_3/obs/eye.rgb"),
                  ids = found(shard, "data/demo_3/obs/eye.ids"),
                  depth = found(shard, "data/demo_3/samples/eye.depth");
      EXPECT_EQ(rgb.dims, (h5::Dims{2, 12, 16, 3}));
      EXPECT_EQ(rgb.bytes, 1U);
      EXPECT_EQ(ids.dims, (h5::Dims{2, 12, 16, 1}));
      EXPECT_EQ(ids.bytes, 2U);
      EXPECT_TRUE(ids.is_signed);
      EXPECT_THAT(ids.numbers, ::testing::Contains(1.0));
      EXPECT_EQ(depth.dims, (h5::Dims{2, 12, 16, 1}));
      EXPECT_EQ(run(folder, {"validate", out}).exit_code, 0);
    }
    EXPECT_EQ(bytes[0], bytes[1]) << compress;
  }
}

TEST(CameraRecord, DemosHaveTheGainsOfTheirPictures) {
  const Folder folder;
  std::string text = file_bytes(watched_scene(folder));
  text.replace(text.find("noise=\"2\""), 9, "gain=\"0.1\"");
  const std::string gained = folder.write("gained.xml", text);
  text.replace(text.find(" gain=\"0.1\""), 11, "");
  const std::string plain = folder.write("plain.xml", text);
  for (const std::string& from : {gained, plain})
    run_json(folder,
             {"generate", from, "--episodes", "18", "--steps", "20", "--every", "20", "--seed", "5",
              "--output", from == gained ? "gained" : "plain", "--record", "q,eye.rgb"});
  run_json(folder, {"generate", gained, "--episodes", "2", "--steps", "20", "--every", "20",
                    "--output", "unseen", "--record", "q,eye.depth"});
  const std::string shard = folder.path("gained/shard-00000.h5");
  const h5::Id file = h5::open_file(shard);
  EXPECT_EQ(h5::read_texts(h5::open_group(file, "scene"), "picture_gain_names"),
            (std::vector<std::string>{"eye red", "eye green", "eye blue"}));
  std::vector<double> first;
  for (const std::string demo : {"data/demo_0", "data/demo_17"}) {
    const std::vector<double> gains =
        h5::read_numbers<double>(h5::open_group(file, demo), "picture_gains");
    ASSERT_EQ(gains.size(), 3U);
    EXPECT_NE(gains, first);
    first = gains;
    const Found with = found(shard, demo + "/obs/eye.rgb"),
                without = found(folder.path("plain/shard-00000.h5"), demo + "/obs/eye.rgb");
    for (std::size_t k = 0; k < with.numbers.size(); ++k)
      EXPECT_NEAR(with.numbers[k], std::min(255.0, gains[k % 3] * without.numbers[k]), 1.1) << k;
  }
  const h5::Id merged = h5::open_file(folder.path("gained/robomimic.hdf5"));
  EXPECT_EQ(h5::read_numbers<double>(h5::open_group(merged, "data/demo_17"), "picture_gains"),
            first);
  EXPECT_EQ(run(folder, {"validate", "gained"}).exit_code, 0);
  for (const char* set : {"plain", "unseen"})
    EXPECT_EQ(
        H5Aexists(h5::open_group(h5::open_file(folder.path(set) + "/shard-00000.h5"), "data/demo_0")
                      .get(),
                  "picture_gains"),
        0)
        << set;
}

TEST(CameraRecord, InspectSaysWhatAPictureCosts) {
  const Folder folder;
  const std::string from = watched_scene(folder);
  const json said = run_json(folder, {"inspect", from});
  EXPECT_EQ(said["cameras"][0]["name"], "eye");
  EXPECT_EQ(said["cameras"][0]["rays"], 192);
  EXPECT_EQ(said["cameras"][0]["rgb_bytes"], 576);
  EXPECT_EQ(said["cameras"][0]["ids_bytes"], 384);
  EXPECT_THAT(run(folder, {"inspect", from}).out,
              HasSubstr("eye in the world: 12 x 16 pixels, 45 degrees; a picture: 192 rays"));
}

}  // namespace
}  // namespace tangere::apps
