// SPDX-License-Identifier: Apache-2.0
// Pictures that a data set stores as JPEG files: those of the raw data set but for their loss, the
// same bytes on any number of threads, and every command that reads them.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/files/jpeg_file.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "io/view/view_reader.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kHigh = 24, kWide = 32;
constexpr const char* kRecord = "q,pad,eye.rgb,eye.ids,low.rgb/60";

/// The small rolling ball with two cameras.
std::string watched_scene(const Folder& folder) {
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  text.insert(text.find("</sensor>"),
              "<camera name=\"eye\" pos=\"0 -0.25 0.2\" look=\"0 0 0.02\" rows=\"24\" "
              "cols=\"32\" noise=\"2\"/>\n<camera name=\"low\" pos=\"0 -0.3 0.05\" look=\"0 0 "
              "0.02\" rows=\"24\" cols=\"32\"/>\n");
  return folder.write("watched.xml", text);
}

void make(const Folder& folder, const std::string& out, std::vector<std::string> more = {}) {
  std::vector<std::string> words{"generate",   watched_scene(folder),
                                 "--episodes", "17",
                                 "--steps",    "60",
                                 "--every",    "20",
                                 "--seed",     "3",
                                 "--output",   out,
                                 "--record",   kRecord};
  words.insert(words.end(), more.begin(), more.end());
  run_json(folder, words);
}

/// Root mean square difference of a JPEG file and a raw picture of the same demo [grey levels].
double difference(const h5::Id& files, const h5::Id& raw, hsize_t row) {
  std::vector<std::uint8_t> levels(3 * kHigh * kWide);
  h5::read_box<std::uint8_t>(raw, {row, 0, 0, 0}, {1, kHigh, kWide, 3}, levels.data());
  const Photograph found = parse_jpeg(h5::read_files(files, row, 1).front(), "a picture");
  EXPECT_EQ(found.rows * 100 + found.cols, 100 * kHigh + kWide);
  double square = 0;
  for (std::size_t k = 0; k < levels.size(); ++k)
    square += std::pow(double(found.levels[k]) - levels[k], 2);
  return std::sqrt(square / double(levels.size()));
}

TEST(JpegRecord, HasThePicturesOfARawDataSet) {
  const Folder folder;
  make(folder, "raw");
  make(folder, "files", {"--pictures", "jpeg:95"});
  const h5::Id raw = h5::open_file(folder.path("raw/shard-00000.h5")),
               file = h5::open_file(folder.path("files/shard-00000.h5"));
  for (const char* name : {"obs/eye.rgb", "final_obs/eye.rgb", "samples/low.rgb"})
    for (const int demo : {0, 16}) {
      const std::string path = "data/demo_" + std::to_string(demo) + "/" + name;
      const h5::Id files = h5::open_dataset(file, path), levels = h5::open_dataset(raw, path);
      const h5::Dims dims = h5::dimensions(files);
      ASSERT_THAT(dims, ElementsAre(h5::dimensions(levels).at(0))) << path;
      for (hsize_t row = 0; row < dims[0]; ++row)
        EXPECT_LT(difference(files, levels, row), 8) << path << " " << row;
    }
  const h5::Id obs = h5::open_group(file, "data/demo_0/obs");
  EXPECT_FALSE(h5::has_files(h5::open_dataset(obs, "eye.ids")));  // loss would mix bodies
  EXPECT_EQ(h5::read_text(h5::open_group(file, "scene"), "pictures"), "jpeg:95");
  EXPECT_EQ(H5Aexists(h5::open_group(raw, "scene").get(), "pictures"), 0);
  EXPECT_THAT(h5::read_text(file, "command"), HasSubstr(" --pictures jpeg:95"));
}

TEST(JpegRecord, HasTheSameBytesOnAnyNumberOfThreads) {
  const Folder folder;
  for (const std::string compress : {"none", "deflate"}) {
    std::vector<std::string> bytes;
    for (const std::string threads : {"1", "3"}) {
      const std::string out = compress + threads;
      make(folder, out, {"--pictures", "jpeg", "--compress", compress, "--threads", threads});
      bytes.push_back(file_bytes(folder.path(out + "/shard-00000.h5")));
      EXPECT_EQ(run(folder, {"validate", out}).exit_code, 0);
    }
    EXPECT_EQ(bytes[0], bytes[1]) << compress;
  }
}

TEST(JpegRecord, IsReadByEveryCommand) {
  const Folder folder;
  make(folder, "set", {"--pictures", "jpeg:80"});
  const ViewData data = read_view(folder.path("set"), {});
  ASSERT_EQ(data.pictures.size(), 2U);
  EXPECT_EQ(data.pictures[0].rows, kHigh);
  EXPECT_THAT(data.episodes[1].pictures[0].at, ElementsAre(0, 1, 2, 3));
  const h5::Id merged = h5::open_file(folder.path("set/robomimic.hdf5"));
  EXPECT_EQ(h5::dimensions(h5::open_dataset(merged, "data/demo_2/obs/eye.rgb")), (h5::Dims{3}));
  EXPECT_THAT(h5::link_names(h5::open_group(merged, "data/demo_2/next_obs")),
              ElementsAre("eye.ids", "eye_ids", "pad", "q"));
  EXPECT_THAT(h5::link_names(h5::open_group(merged, "data/demo_2/obs")),
              ElementsAre("eye.ids", "eye.rgb", "eye_ids", "eye_rgb", "pad", "q"));
  EXPECT_THAT(run(folder, {"merge", "set", "--overwrite"}).err, HasSubstr("eye.rgb"));
  EXPECT_EQ(run(folder, {"validate", "set"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"merge", "set", "--copy", "--overwrite"}).exit_code, 0);
  EXPECT_THAT(h5::link_names(h5::open_group(h5::open_file(folder.path("set/robomimic.hdf5")),
                                            "data/demo_2/obs")),
              ElementsAre("eye.ids", "eye.rgb", "eye_ids", "eye_rgb", "pad", "q"));
  EXPECT_EQ(run(folder, {"validate", "set"}).exit_code, 0);
  const Outcome told = run(folder, {"info", "set"});
  EXPECT_EQ(told.exit_code, 0);
  EXPECT_THAT(told.out, ::testing::ContainsRegex("eye.rgb .* files of up to [0-9]+ bytes"));
  const json table = run_json(folder, {"export", "set", "--csv", "t.csv"});
  EXPECT_THAT(table["left_out"].get<std::vector<std::string>>(), ::testing::Contains("eye.rgb"));
  make(folder, "set", {"--pictures", "jpeg:80", "--resume"});
  EXPECT_THAT(run(folder, {"generate", watched_scene(folder), "--episodes", "17", "--steps", "60",
                           "--every", "20", "--seed", "3", "--output", "set", "--record", kRecord,
                           "--resume"})
                  .err,
              HasSubstr("pictures: missing here"));
}

TEST(JpegRecord, DamageIsFound) {
  const Folder folder;
  make(folder, "set", {"--pictures", "jpeg:80"});
  const std::string path = folder.path("set/shard-00000.h5");
  std::string bytes = file_bytes(path);
  const std::size_t picture = bytes.find("JFIF", bytes.size() / 2);
  ASSERT_NE(picture, std::string::npos);
  const std::string whole = bytes;
  bytes[picture + 620] ^= 1;  // behind its tables, so that it still is a JPEG file
  std::ofstream(path, std::ios::binary) << bytes;
  EXPECT_THAT(run(folder, {"validate", "set"}).err + run(folder, {"validate", "set"}).out,
              HasSubstr("the checksum of its numbers is"));
  bytes = whole;
  bytes[picture - 6] = 'x';  // the mark at its start
  std::ofstream(path, std::ios::binary) << bytes;
  EXPECT_THAT(run(folder, {"validate", "set"}).err + run(folder, {"validate", "set"}).out,
              AllOf(HasSubstr(".rgb: row "), HasSubstr("expected a picture as JPEG")));
}

TEST(JpegRecord, MistakesSayWhatIsExpected) {
  const Folder folder;
  const std::string from = watched_scene(folder);
  const auto refusal = [&](const std::string& kind, const std::string& record) {
    return run(folder, {"generate", from, "--episodes", "1", "--steps", "20", "--output", "no",
                        "--pictures", kind, "--record", record})
        .err;
  };
  for (const char* kind : {"png", "jpeg:0", "jpeg:101", "jpeg:9x", "jpeg:"})
    EXPECT_THAT(refusal(kind, "eye.rgb"),
                HasSubstr(std::string("pictures '") + kind + "'; expected raw, or jpeg:QUALITY"));
  EXPECT_THAT(refusal("jpeg", "q,eye.ids"),
              HasSubstr("--pictures jpeg:95: no picture in colours is stored"));
}

}  // namespace
}  // namespace tangere::apps
