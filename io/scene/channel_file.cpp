// SPDX-License-Identifier: Apache-2.0
// Numbers have nine digits: channels are measured to six at best.
#include "io/scene/channel_file.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <span>

#include "engine/base/hash.hpp"
#include "io/files/text_file.hpp"
#include "io/scene/scene_node.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {
namespace {

constexpr std::size_t kLargestMap = std::size_t{16} << 20;
constexpr const char* kLoads[] = {"pressure", "force"};

int node_count(const SceneNode& root, double x) {
  if (!(x >= 1 && x <= kMostNodes && x == std::floor(x)))
    root.fail_at("nodes", fmt::format("nodes=\"{}\"; expected two whole numbers from 1 to {}",
                                      root.text("nodes"), kMostNodes));
  return static_cast<int>(x);
}

void read_channel(const SceneNode& node, ChannelMap& map) {
  node.check_attributes({"name", "offset", "linear", "quadratic"});
  map.names.push_back(node.text("name"));
  map.offset.push_back(node.number("offset"));
  const auto add = [&](const char* attribute, std::size_t count, std::vector<double>& to) {
    const std::vector<double> x = node.numbers(attribute, count);
    to.insert(to.end(), x.begin(), x.end());
  };
  add("linear", map.loads(), map.linear);
  const bool first = map.names.size() == 1;
  if (!first && node.has("quadratic") == map.quadratic.empty())
    node.fail("quadratic of some channels alone; expected those of all or of none");
  if (node.has("quadratic")) add("quadratic", map.pairs(), map.quadratic);
}

/// Numbers in lines that are easy to read.
std::string lines_of(std::span<const double> numbers) {
  constexpr std::size_t kEach = 8;
  std::string out;
  for (std::size_t k = 0; k < numbers.size(); ++k)
    out += fmt::format("{}{:.9g}", k == 0 ? "" : k % kEach == 0 ? "\n      " : " ", numbers[k]);
  return out;
}

}  // namespace

ChannelMap read_channel_map(const std::string& path, std::vector<std::string>& warnings) {
  const std::string text =
      read_text_file(path, kLargestMap, "a map of channels, XML with the root <channels>");
  SceneContext context;
  context.file = path;
  tinyxml2::XMLDocument document;
  const SceneNode root(parse_xml(document, text, path, "the root <channels>", context.warnings),
                       context);
  if (root.name() != "channels")
    root.fail("not a map of channels; expected the root <channels nodes=\"ROWS COLS\">");
  root.check_attributes({"nodes", "loads", "unit"});
  ChannelMap map;
  map.name = std::filesystem::path(path).stem().string();
  map.unit = root.text("unit", "1");
  const std::vector<double> nodes = root.numbers("nodes", 2);
  map.rows = node_count(root, nodes[0]);
  map.cols = node_count(root, nodes[1]);
  if (map.rows * map.cols > kMostNodes)
    root.fail_at("nodes", fmt::format("nodes=\"{}\"; expected at most {} in all",
                                      root.text("nodes"), kMostNodes));
  map.shear =
      root.has("loads") && root.choice("loads", {std::begin(kLoads), std::end(kLoads)}) == 1;
  for (const SceneNode& node : root.children({"channel", "fit"})) {
    if (node.name() == "fit") continue;
    if (map.channels() == kMostChannels)
      node.fail(fmt::format("more than {} channels", kMostChannels));
    read_channel(node, map);
  }
  if (const std::string fault = channel_map_fault(map, map.rows, map.cols); !fault.empty())
    root.fail(fault);
  map.checksum = hash_bytes(text);
  warnings.insert(warnings.end(), context.warnings.begin(), context.warnings.end());
  return map;
}

std::string channel_map_text(const ChannelMap& map,
                             const std::vector<std::pair<std::string, std::string>>& notes) {
  std::string text = fmt::format("<channels nodes=\"{} {}\" loads=\"{}\" unit={}>\n", map.rows,
                                 map.cols, kLoads[map.shear ? 1 : 0], quoted_text(map.unit));
  if (!notes.empty()) {
    text += "  <fit";
    for (const auto& [name, value] : notes) text += fmt::format(" {}={}", name, quoted_text(value));
    text += "/>\n";
  }
  for (std::size_t c = 0; c < map.channels(); ++c) {
    const auto part = [c](const std::vector<double>& all, std::size_t each) {
      return std::span(all).subspan(c * each, each);
    };
    text += fmt::format("  <channel name={} offset=\"{:.9g}\"\n    linear=\"{}\"",
                        quoted_text(map.names[c]), map.offset[c],
                        lines_of(part(map.linear, map.loads())));
    if (!map.quadratic.empty())
      text += fmt::format("\n    quadratic=\"{}\"", lines_of(part(map.quadratic, map.pairs())));
    text += "/>\n";
  }
  return text + "</channels>\n";
}

}  // namespace tangere
