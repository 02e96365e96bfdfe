// SPDX-License-Identifier: Apache-2.0
// Opens a page of `tangere view` in Chromium, without a window and without a network, and looks at
// its elements and at its picture. Skipped where there is no Chromium.
#include <gmock/gmock.h>
#include <libdeflate.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <set>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// What a shell command prints.
std::string output_of(const std::string& command) {
  std::string text;
  FILE* const pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return text;
  std::array<char, 4096> buffer{};
  while (const std::size_t size = std::fread(buffer.data(), 1, buffer.size(), pipe))
    text.append(buffer.data(), size);
  pclose(pipe);
  return text;
}

/// The path of a Chromium; "" if there is none.
std::string chromium() {
  std::string path =
      output_of("command -v chromium || command -v chromium-browser || command -v google-chrome");
  return path.substr(0, path.find('\n'));
}

/// Opens `page` (an address) with these options.
std::string browse(const Folder& folder, const std::string& page, const std::string& options) {
  return output_of("timeout 240 '" + chromium() +
                   "' --headless=new --no-sandbox --use-angle=swiftshader"
                   " --enable-unsafe-swiftshader --no-first-run --disable-background-networking"
                   " --disable-extensions --hide-scrollbars --proxy-server=127.0.0.1:9"
                   " --virtual-time-budget=20000 --window-size=1200,800 --user-data-dir='" +
                   folder.path("profile") + "' " + options + " 'file://" + folder.path(page) +
                   "' 2>/dev/null </dev/null");
}

std::uint32_t big_endian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k)
    value = value << 8 | static_cast<unsigned char>(bytes[at + k]);
  return value;
}

/// The pixels of a PNG of 8 bits without interlacing, (height, width, channels).
struct Picture {
  std::size_t width = 0, height = 0, channels = 0;
  std::vector<unsigned char> pixels;
};

Picture decoded(const std::string& png) {
  Picture p;
  p.width = big_endian(png, 16), p.height = big_endian(png, 20);
  p.channels = png[25] == 6 ? 4 : 3;
  std::string packed;
  for (std::size_t at = 8; at + 12 <= png.size(); at += 12 + big_endian(png, at))
    if (png.compare(at + 4, 4, "IDAT") == 0) packed += png.substr(at + 8, big_endian(png, at));
  const std::size_t row = p.width * p.channels;
  std::vector<unsigned char> raw((row + 1) * p.height);
  libdeflate_decompressor* const z = libdeflate_alloc_decompressor();
  EXPECT_EQ(
      libdeflate_zlib_decompress(z, packed.data(), packed.size(), raw.data(), raw.size(), nullptr),
      LIBDEFLATE_SUCCESS);
  libdeflate_free_decompressor(z);
  p.pixels.resize(row * p.height);
  for (std::size_t y = 0; y < p.height; ++y)
    for (std::size_t x = 0; x < row; ++x) {
      const auto before = [&](std::size_t dy, std::size_t dx) -> int {
        return y < dy || x < dx ? 0 : p.pixels[(y - dy) * row + x - dx];
      };
      const int a = before(0, p.channels), b = before(1, 0), c = before(1, p.channels);
      const int guess = a + b - c, da = std::abs(guess - a), db = std::abs(guess - b),
                dc = std::abs(guess - c);
      const int paeth = da <= db && da <= dc ? a : db <= dc ? b : c;
      const std::array<int, 5> filters{0, a, b, (a + b) / 2, paeth};
      p.pixels[y * row + x] =
          static_cast<unsigned char>(raw[y * (row + 1) + 1 + x] + filters.at(raw[y * (row + 1)]));
    }
  return p;
}

TEST(ViewInABrowser, ShowsFramesFieldsAndCurves) {
  if (chromium().empty()) GTEST_SKIP() << "there is no Chromium here: apt-get install chromium";
  const Folder folder;
  ASSERT_EQ(run(folder, {"simulate", scene("rolling_ball_small.xml"), "--steps", "160", "--envs",
                         "2", "-o", "run.h5"})
                .exit_code,
            0);
  ASSERT_EQ(run(folder, {"view", "run.h5", "-o", "run.html"}).exit_code, 0);
  const std::string dom = browse(folder, "run.html#frame=150&episode=1&theme=dark", "--dump-dom");
  ASSERT_THAT(dom, HasSubstr("data-ready=\"yes\""));
  EXPECT_THAT(dom, Not(HasSubstr("data-failure")));
  for (const char* expected :
       {"data-frames=\"161\"", "data-frame=\"150\"", "data-theme=\"dark\"", "t = 0.750 s",
        "row 150 · 0.750 of 0.800 s", "<h1 id=\"title\">rolling_ball_small</h1>",
        "data-sensor=\"pad\"", "data-group=\"force [N]\"", "data-group=\"solver status\"",
        "environment 1</option>", "grid 20 mm", "per point"})
    EXPECT_THAT(dom, HasSubstr(expected));
  EXPECT_THAT(dom, Not(HasSubstr("data-arrows=\"0\""))) << "the ball is pressed: there are arrows";
  const std::string before = browse(folder, "run.html#frame=0", "--dump-dom");
  EXPECT_THAT(before, HasSubstr("data-arrows=\"0\"")) << "nothing is touched yet";
}

TEST(ViewInABrowser, ItsPictureIsNotBlank) {
  if (chromium().empty()) GTEST_SKIP() << "there is no Chromium here: apt-get install chromium";
  const Folder folder;
  ASSERT_EQ(
      run(folder, {"simulate", scene("rolling_ball_small.xml"), "--steps", "160", "-o", "run.h5"})
          .exit_code,
      0);
  ASSERT_EQ(run(folder, {"view", "run.h5", "-o", "run.html"}).exit_code, 0);
  browse(folder, "run.html#frame=150&theme=light",
         "--screenshot='" + folder.path("page.png") + "'");
  const Picture p = decoded(file_bytes(folder.path("page.png")));
  ASSERT_EQ(p.width, 1200U);
  std::set<std::array<int, 3>> colours;
  std::size_t orange = 0;  // the ball: rgba 0.8 0.4 0.2
  for (std::size_t y = 60; y < p.height / 2; ++y)
    for (std::size_t x = 20; x < 700; ++x) {
      const unsigned char* c = &p.pixels[(y * p.width + x) * p.channels];
      colours.insert({c[0], c[1], c[2]});
      orange += c[0] > 100 && c[0] > 3 * c[1] / 2 && c[1] > c[2] ? 1 : 0;
    }
  EXPECT_GT(colours.size(), 200U) << "colours of the scene: lights, shadows, grid";
  EXPECT_GT(orange, 500U) << "pixels of the ball";
}

TEST(ViewInABrowser, APageWithoutItsDataSaysSo) {
  if (chromium().empty()) GTEST_SKIP() << "there is no Chromium here: apt-get install chromium";
  const Folder folder;
  ASSERT_EQ(
      run(folder, {"simulate", scene("rolling_ball_small.xml"), "--steps", "4", "-o", "run.h5"})
          .exit_code,
      0);
  ASSERT_EQ(run(folder, {"view", "run.h5", "-o", "run.html"}).exit_code, 0);
  std::string page = folder.read("run.html");
  page.erase(page.find("\"episodes\":"), 40);
  folder.write("cut.html", page);
  EXPECT_THAT(browse(folder, "cut.html", "--dump-dom"), HasSubstr("This page cannot be shown: "));
}

}  // namespace
}  // namespace tangere::apps
