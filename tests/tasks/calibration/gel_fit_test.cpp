// SPDX-License-Identifier: Apache-2.0
// Fits gels to pictures that a known gel gives, and to photographs.
#include "tasks/calibration/gel_fit.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "engine/picture/gel_camera.hpp"
#include "io/files/csv.hpp"
#include "io/files/png_file.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
constexpr int kPhotoRows = 120, kPhotoCols = 160;
constexpr double kPhotoPixel = 118e-6, kPhotoBall = 2e-3;  // [m]

/// A gel whose lamps vary with place, pressed at places all over the picture.
struct MadePresses {
  PictureDescription picture;
  std::vector<BallPress> presses;
  double ratio = 0.8;

  explicit MadePresses(double off) {
    Gel gel = default_gel();
    gel.reach = 1e-3, gel.blur = 3e-4;
    for (std::size_t c = 0; c < kColours; ++c)
      gel.lamps[c][3][0] = 15.0 * double(c), gel.lamps[c][0][1] = 30, gel.lamps[c][1][2] = -20;
    picture.rows = kPhotoRows, picture.cols = kPhotoCols;
    gel.background = {kPhotoRows, kPhotoCols, {}};
    gel.background.levels.assign(3 * kPhotoRows * kPhotoCols, 110.0F);
    picture.gel = std::make_shared<const Gel>(gel);
    for (int k = 0; k < 9; ++k) add(40.0 + 38 * (k % 3), 32.0 + 27 * (k / 3), 13.0 + k % 2, off);
  }

  /// `off`: how far the label lies beside the circle [pixels].
  void add(double x, double y, double radius, double off) {
    const int rows = kPhotoRows / 4, cols = kPhotoCols / 4;
    const double pitch = 4 * kPhotoPixel;
    GelCamera<float> camera(picture_grid(picture, rows, cols, pitch, pitch), picture, 0);
    std::vector<float> depth;
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < cols; ++j) {
        const double u = (j + 0.5) * pitch - x * kPhotoPixel,
                     v = (i + 0.5) * pitch - y * kPhotoPixel,
                     square = kPhotoBall * kPhotoBall - u * u - v * v;
        depth.push_back(static_cast<float>(
            square > 0
                ? std::max(0.0, std::sqrt(square) - kPhotoBall + ratio * radius * kPhotoPixel)
                : 0.0));
      }
    camera.set_depth(depth);
    std::vector<std::uint8_t> bytes(3 * kPhotoRows * kPhotoCols);
    camera.read(false, std::span<std::uint8_t>(bytes));
    const double sign = presses.size() % 2 == 0 ? 1 : -1;
    presses.push_back({{x + sign * off, y - sign * off, radius}, {bytes.begin(), bytes.end()}});
  }
};

TEST(GelFit, FindsTheGelThatMadeThePictures) {
  const MadePresses made(0);
  const GelFit fit = fit_gel(made.picture.gel->background, made.presses, kPhotoBall, kPhotoPixel);
  EXPECT_GT(fit.mean().psnr, 45);
  EXPECT_GT(fit.mean().ssim, 0.98);
  EXPECT_NEAR(*fit.gel.reach, 1e-3, 2e-4);
  EXPECT_NEAR(fit.gel.blur, 3e-4, 6e-5);
  EXPECT_NEAR(fit.depth_ratio, made.ratio, 0.06);
}

TEST(GelFit, MovesLabelsThatAreOff) {
  const MadePresses made(1.5);
  const GelFit fit = fit_gel(made.picture.gel->background, made.presses, kPhotoBall, kPhotoPixel);
  EXPECT_GT(fit.mean().aligned_psnr, fit.mean().psnr + 5);
  for (std::size_t k = 0; k < fit.scores.size(); ++k) {
    const double sign = k % 2 == 0 ? 1 : -1;
    EXPECT_NEAR(fit.scores[k].refined.x, made.presses[k].label.x - 1.5 * sign, 0.5) << k;
    EXPECT_NEAR(fit.scores[k].refined.y, made.presses[k].label.y + 1.5 * sign, 0.5) << k;
  }
}

TEST(GelFit, PredictsPhotographsFromOthers) {
  const std::string folder = std::string(TANGERE_TEST_DATA) + "/gel_photographs/";
  const Photograph untouched = read_png(folder + "background.png");
  const GelBackground background{
      untouched.rows, untouched.cols, {untouched.levels.begin(), untouched.levels.end()}};
  std::vector<BallPress> presses;
  const NamedFields table = read_named_fields(folder + "presses.csv");
  for (const NamedFields::Row& row : table.rows) {
    const Photograph photograph = read_png(folder + row.fields[0]);
    presses.push_back({{table.number(row, 1), table.number(row, 2), table.number(row, 3)},
                       {photograph.levels.begin(), photograph.levels.end()}});
  }
  ASSERT_EQ(presses.size(), 8U);
  const PressScore mean = fit_gel(background, presses, kPhotoBall, kPhotoPixel).mean();
  EXPECT_GT(mean.psnr, 26);  // the background alone: 17.9 dB
  EXPECT_GT(mean.aligned_psnr, 28);
  EXPECT_GT(mean.aligned_ssim, 0.85);
}

TEST(GelFit, LikenessIsThatOfItsDefinition) {
  std::vector<float> a(3 * 40 * 40, 100), b(a.size(), 110);
  const Likeness found = likeness(a, b, 40, 40, {20, 20, 10});
  EXPECT_NEAR(found.psnr, 20 * std::log10(255 / 10.0), 1e-6);
  const double c1 = 0.01 * 255 * 0.01 * 255;
  EXPECT_NEAR(found.ssim, (2 * 100 * 110 + c1) / (100 * 100 + 110 * 110 + c1), 1e-6);
  EXPECT_NEAR(likeness(a, a, 40, 40, {20, 20, 10}).ssim, 1, 1e-9);
}

TEST(GelFit, RefusesWhatItCannotFit) {
  const MadePresses made(0);
  const GelBackground& background = made.picture.gel->background;
  const auto refusal = [&](std::vector<BallPress> presses, double ball) -> std::string {
    try {
      fit_gel(background, presses, ball, kPhotoPixel);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal({made.presses[0], made.presses[1]}, kPhotoBall), HasSubstr("2 presses"));
  EXPECT_THAT(refusal(made.presses, 0.01), HasSubstr("a ball of 0.02 m in pictures of 0.0142 m"));
  std::vector<BallPress> other = made.presses;
  other[2].levels.pop_back();
  EXPECT_THAT(refusal(other, kPhotoBall), HasSubstr("of another size"));
  other = made.presses;
  other[1].label.x = 161;
  EXPECT_THAT(refusal(other, kPhotoBall), HasSubstr("an imprint at (161, 32)"));
  EXPECT_THAT(refusal(made.presses, 1e-3), HasSubstr("of a ball of radius 0.001 m"));
}

}  // namespace
}  // namespace tangere
