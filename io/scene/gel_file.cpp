// SPDX-License-Identifier: Apache-2.0
// The attributes of a channel are the functions of the normal, each with its numbers for 1, x, y.
#include "io/scene/gel_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "engine/base/hash.hpp"
#include "io/files/png_file.hpp"
#include "io/files/text_file.hpp"
#include "io/scene/scene_node.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {
namespace {

constexpr const char* kColourNames[] = {"red", "green", "blue"};
constexpr const char* kShadeNames[] = {"nx", "ny", "nz", "nxx", "nxy", "nyy", "nxz", "nyz"};
constexpr double kLongestOfGel = 0.1;   // of a gel's lengths [m]
constexpr double kBrightestLamp = 1e5;  // a number of a lamp [grey levels]
static_assert(std::size(kColourNames) == kColours && std::size(kShadeNames) == kShades);

void read_channel(const SceneNode& node, std::size_t channel, GelLamps& lamps) {
  node.check_attributes({std::begin(kShadeNames), std::end(kShadeNames)});
  for (std::size_t j = 0; j < kShades; ++j) {
    const std::vector<double> x = node.numbers(kShadeNames[j], kShadePlaces);
    for (const double level : x)
      if (!(std::abs(level) <= kBrightestLamp))
        node.fail_at(
            kShadeNames[j],
            fmt::format("{}=\"{}\"; expected numbers from {} to {} grey levels", kShadeNames[j],
                        node.text(kShadeNames[j]), -kBrightestLamp, kBrightestLamp));
    std::copy(x.begin(), x.end(), lamps[channel][j].begin());
  }
}

/// Returns a length that a gel has [m].
double gel_length(const SceneNode& root, const char* attribute, double x) {
  if (!(x <= kLongestOfGel))
    root.fail_at(attribute,
                 fmt::format("{}=\"{}\"; expected {} m at most", attribute, x, kLongestOfGel));
  return x;
}

}  // namespace

Gel read_gel(const std::string& path, std::vector<std::string>& warnings) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 20;
  const std::string text = read_text_file(path, kMostBytes, "a gel, XML with the root <gel>");
  SceneContext context;
  context.file = path;
  tinyxml2::XMLDocument document;
  const SceneNode root(parse_xml(document, text, path, "the root <gel>", context.warnings),
                       context);
  if (root.name() != "gel") root.fail("not a gel; expected the root <gel background=\"…\">");
  root.check_attributes({"background", "pixel", "reach", "blur"});
  Gel gel;
  gel.name = std::filesystem::path(path).stem().string();
  if (root.has("pixel")) gel.pixel = gel_length(root, "pixel", root.positive("pixel"));
  if (root.has("reach")) gel.reach = gel_length(root, "reach", root.not_negative("reach"));
  gel.blur = gel_length(root, "blur", root.not_negative("blur", 0.0));
  std::array<bool, kColours> found{};
  for (const SceneNode& node : root.children({"red", "green", "blue", "fit"})) {
    if (node.name() == "fit") continue;
    const auto channel = static_cast<std::size_t>(std::ranges::find(kColourNames, node.name()) -
                                                  std::begin(kColourNames));
    if (found[channel]) node.fail("a second time in one <gel>; expected one");
    found[channel] = true;
    read_channel(node, channel, gel.lamps);
  }
  for (std::size_t c = 0; c < kColours; ++c)
    if (!found[c])
      root.fail(fmt::format("no <{}>; expected the lamps of each channel", kColourNames[c]));
  const std::string picture =
      (std::filesystem::path(path).parent_path() / root.text("background")).string();
  constexpr std::size_t kMostPicture = std::size_t{256} << 20;
  std::string bytes;
  try {
    bytes = read_text_file(picture, kMostPicture, "a picture as PNG");
  } catch (const IoError& error) {
    throw IoError(root.source().prefix() + "<gel>: " + error.what());
  }
  const Photograph photograph = parse_png(bytes, picture);
  gel.background = {
      photograph.rows, photograph.cols, {photograph.levels.begin(), photograph.levels.end()}};
  gel.checksum = hash_bytes(bytes, hash_bytes(text));
  warnings.insert(warnings.end(), context.warnings.begin(), context.warnings.end());
  return gel;
}

std::string gel_text(const Gel& gel, const std::string& background,
                     const std::vector<std::pair<std::string, std::string>>& notes) {
  std::string text = fmt::format("<gel background={}", quoted_text(background));
  if (gel.pixel > 0) text += fmt::format(" pixel=\"{:.6g}\"", gel.pixel);
  if (gel.reach) text += fmt::format(" reach=\"{:.6g}\"", *gel.reach);
  text += fmt::format(" blur=\"{:.6g}\">\n", gel.blur);
  if (!notes.empty()) {
    text += "  <fit";
    for (const auto& [name, value] : notes) text += fmt::format(" {}={}", name, quoted_text(value));
    text += "/>\n";
  }
  for (std::size_t c = 0; c < kColours; ++c) {
    text += fmt::format("  <{}", kColourNames[c]);
    for (std::size_t j = 0; j < kShades; ++j)
      text +=
          fmt::format("{}{}=\"{:.6g} {:.6g} {:.6g}\"", j % 2 == 0 && j > 0 ? "\n    " : " ",
                      kShadeNames[j], gel.lamps[c][j][0], gel.lamps[c][j][1], gel.lamps[c][j][2]);
    text += "/>\n";
  }
  return text + "</gel>\n";
}

}  // namespace tangere
