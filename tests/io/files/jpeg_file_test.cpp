// SPDX-License-Identifier: Apache-2.0
// Tests JPEG files: what is read is near what was written, equal pictures have equal bytes, and
// damaged files are refused.
#include "io/files/jpeg_file.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr int kPictureRows = 40, kPictureCols = 52;

/// Smooth in place, other in each channel.
std::vector<std::uint8_t> levels() {
  std::vector<std::uint8_t> all;
  for (int i = 0; i < kPictureRows; ++i)
    for (int j = 0; j < kPictureCols; ++j)
      for (int c = 0; c < 3; ++c)
        all.push_back(static_cast<std::uint8_t>(
            std::lround(128 + 100 * std::sin(0.07 * i + 0.05 * (c + 1) * j))));
  return all;
}

std::string jpeg_refusal(const std::string& bytes) {
  try {
    static_cast<void>(parse_jpeg(bytes, "a.jpg"));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(JpegFile, IsReadAsItWasWrittenButForItsLoss) {
  const std::vector<std::uint8_t> given = levels();
  double last = 1e9;
  std::size_t size = 0;
  for (const int quality : {30, 75, 95}) {
    const std::string file = jpeg_bytes(kPictureRows, kPictureCols, given, quality);
    const Photograph found = parse_jpeg(file, "a.jpg");
    ASSERT_EQ(found.rows * 100 + found.cols, 100 * kPictureRows + kPictureCols);
    double square = 0;
    for (std::size_t k = 0; k < given.size(); ++k)
      square += std::pow(double(found.levels[k]) - given[k], 2) / double(given.size());
    EXPECT_LT(square, last) << quality;
    EXPECT_GT(file.size(), size) << quality;
    last = square, size = file.size();
  }
  EXPECT_GT(10 * std::log10(255 * 255 / last), 38);  // [dB] at 95
}

TEST(JpegFile, HasTheSameBytesForTheSamePicture) {
  EXPECT_EQ(jpeg_bytes(kPictureRows, kPictureCols, levels(), 90),
            jpeg_bytes(kPictureRows, kPictureCols, levels(), 90));
}

TEST(JpegFile, IsRefusedWhereItIsNone) {
  const std::string file = jpeg_bytes(kPictureRows, kPictureCols, levels(), 90);
  EXPECT_THAT(jpeg_refusal(""), AllOf(StartsWith("a.jpg: "), HasSubstr("a picture as JPEG")));
  EXPECT_THAT(jpeg_refusal("no picture"), HasSubstr("Not a JPEG file"));
  EXPECT_THAT(jpeg_refusal(file.substr(0, file.size() / 2)), StartsWith("a.jpg: "));
  std::string damaged = file;
  for (std::size_t k = 2; k < 40; ++k) damaged[k] = static_cast<char>(k * 37);
  EXPECT_THAT(jpeg_refusal(damaged), StartsWith("a.jpg: "));
}

}  // namespace
}  // namespace tangere
