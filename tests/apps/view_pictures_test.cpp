// SPDX-License-Identifier: Apache-2.0
// Pictures in the page of `tangere view`: those of the file, as JPEG, the newest at each frame, and
// never more than the page has room for.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/files/jpeg_file.hpp"
#include "io/hdf5/h5.hpp"
#include "io/view/view_page.hpp"
#include "io/view/view_reader.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kHigh = 24, kWide = 32;

std::string watched_ball(const Folder& folder, const std::string& noise = "0") {
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  text.insert(text.find("</sensor>"),
              "<camera name=\"eye\" pos=\"0 -0.25 0.2\" look=\"0 0 0.02\" rows=\"24\" "
              "cols=\"32\" noise=\"" +
                  noise + "\"/>\n");
  return folder.write("watched.xml", text);
}

/// Root mean square difference of a file of the page and levels [grey levels].
double difference(const std::string& file, const std::vector<std::uint8_t>& levels) {
  const Photograph found = parse_jpeg(file, "picture");
  EXPECT_EQ(found.rows * 100 + found.cols, 100 * kHigh + kWide);
  double square = 0;
  for (std::size_t k = 0; k < levels.size(); ++k)
    square += std::pow(double(found.levels[k]) - levels[k], 2);
  return std::sqrt(square / double(levels.size()));
}

TEST(ViewPictures, AreThoseOfATrajectoryTheNewestAtEachFrame) {
  const Folder folder;
  run_json(folder, {"simulate", watched_ball(folder), "--output", "run.h5", "--steps", "8",
                    "--envs", "2", "--seed", "3", "--record", "q,pad,eye.rgb/3"});
  const ViewData data = read_view(folder.path("run.h5"), {});
  ASSERT_EQ(data.pictures.size(), 1U);
  EXPECT_EQ(data.pictures[0].name, "eye.rgb");
  const h5::Id file = h5::open_file(folder.path("run.h5")),
               dataset = h5::open_dataset(file, "cameras/eye/rgb");
  for (std::size_t e = 0; e < 2; ++e) {
    const ViewShown& shown = data.episodes[e].pictures[0];
    EXPECT_THAT(shown.at, ElementsAre(-1, -1, -1, 0, 0, 0, 1, 1, 1));
    ASSERT_EQ(shown.files.size(), 2U);
    for (std::size_t k = 0; k < 2; ++k) {
      std::vector<std::uint8_t> levels(3 * kHigh * kWide);
      h5::read_box<std::uint8_t>(dataset, {k, e, 0, 0, 0}, {1, 1, kHigh, kWide, 3}, levels.data());
      EXPECT_LT(difference(shown.files[k], levels), 12) << k;
    }
  }
  EXPECT_THAT(render_view_page(data), HasSubstr("\"pictures\":[{\"name\":\"eye.rgb\""));
}

TEST(ViewPictures, AreThoseOfADataSetWithItsLastState) {
  const Folder folder;
  run_json(folder, {"generate", watched_ball(folder), "--episodes", "2", "--steps", "40", "--every",
                    "10", "--output", "set", "--record", "q,eye.rgb"});
  const ViewData data = read_view(folder.path("set"), {});
  ASSERT_EQ(data.pictures.size(), 1U);
  EXPECT_THAT(data.episodes[1].pictures[0].at, ElementsAre(0, 1, 2, 3, 4));
  const h5::Id file = h5::open_file(folder.path("set/shard-00000.h5")),
               last = h5::open_dataset(file, "data/demo_1/final_obs/eye.rgb");
  std::vector<std::uint8_t> levels(3 * kHigh * kWide);
  h5::read_box<std::uint8_t>(last, {0, 0, 0, 0}, {1, kHigh, kWide, 3}, levels.data());
  EXPECT_LT(difference(data.episodes[1].pictures[0].files[4], levels), 12);
}

TEST(ViewPictures, StayBelowTheSizeOfThePage) {
  const Folder folder;
  run_json(folder, {"simulate", watched_ball(folder, "30"), "--output", "run.h5", "--steps", "400",
                    "--envs", "4", "--every", "1", "--seed", "3", "--record", "q,eye.rgb"});
  const ViewData whole = read_view(folder.path("run.h5"), {});
  EXPECT_EQ(whole.episodes[0].pictures[0].files.size(), 400U);
  ViewOptions options;
  options.bytes = 3e6;
  const ViewData data = read_view(folder.path("run.h5"), options);
  EXPECT_LE(static_cast<double>(render_view_page(data).size()), options.bytes);
  EXPECT_LT(data.episodes[0].pictures[0].files.size(), 400U);
  EXPECT_GT(data.episodes[0].pictures[0].files.size(), 20U);
  EXPECT_THAT(data.notes, ::testing::Contains(HasSubstr("pictures is shown")));
  const ViewShown& shown = data.episodes[3].pictures[0];
  EXPECT_EQ(shown.at.back() + 1, std::ssize(shown.files));
}

}  // namespace
}  // namespace tangere::apps
