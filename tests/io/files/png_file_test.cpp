// SPDX-License-Identifier: Apache-2.0
// Tests PNG files that other programs write: depths of bits, grey levels, and what is refused. The
// files are made by Python's zlib.
#include "io/files/png_file.hpp"

#include <gmock/gmock.h>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const char* const kSixteenBits =  // RGB, 2 pixels
    "89504e470d0a1a0a0000000d49484452000000020000000110020000002bd0349e000000154944415478da636868"
    "6060f8ffdfc141c884a101001ea20445a9e4cada0000000049454e44ae426082";
const char* const kGreyLevels =  // 3 pixels
    "89504e470d0a1a0a0000000d49484452000000030000000108000000003e8b4b680000000c4944415478da636068"
    "f80f00020301801a9c263b0000000049454e44ae426082";
const char* const kTransparent =  // RGBA, a pixel
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d4944415478da63e012"
    "916b0000012500bd31182b0e0000000049454e44ae426082";

std::string png_of(const std::string& digits) {
  std::string bytes;
  for (std::size_t k = 0; k < digits.size(); k += 2)
    bytes += static_cast<char>(std::stoi(digits.substr(k, 2), nullptr, 16));
  return bytes;
}

std::string png_refusal(const std::string& bytes) {
  try {
    static_cast<void>(parse_png(bytes, "a.png"));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(PngFile, OfSixteenBitsHasTheNearestBytes) {
  const Photograph found = parse_png(png_of(kSixteenBits), "a.png");
  EXPECT_EQ(found.rows, 1);
  EXPECT_EQ(found.cols, 2);
  // 0x8080, 0, 0xffff; 0x4040, 0x1234, 0x0080
  EXPECT_THAT(found.levels, ElementsAre(128, 0, 255, 64, 18, 0));
}

TEST(PngFile, OfGreyLevelsHasEqualChannels) {
  EXPECT_THAT(parse_png(png_of(kGreyLevels), "a.png").levels,
              ElementsAre(0, 0, 0, 128, 128, 128, 255, 255, 255));
}

TEST(PngFile, WithTransparencyIsRefused) {
  EXPECT_THAT(png_refusal(png_of(kTransparent)),
              AllOf(StartsWith("a.png: it has transparency"), HasSubstr("a picture as PNG")));
}

TEST(PngFile, ThatIsCutOffIsRefused) {
  const Photograph photograph{
      3, 2, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18}};
  const std::string whole = png_bytes(photograph);
  EXPECT_EQ(parse_png(whole, "a.png").levels, photograph.levels);
  // The last 12 bytes say that the file ends; the pixels are there without them.
  for (std::size_t size = 0; size + 13 < whole.size(); ++size)
    ASSERT_THAT(png_refusal(whole.substr(0, size)), StartsWith("a.png: ")) << size;
}

}  // namespace
}  // namespace tangere
