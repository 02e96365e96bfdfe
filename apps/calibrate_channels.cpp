// SPDX-License-Identifier: Apache-2.0
// The layout keeps its numbers: its stiffness is fitted by forces, without --channels.
#include "apps/calibrate_channels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/layout_text.hpp"
#include "apps/press_table.hpp"
#include "apps/text_output.hpp"
#include "engine/base/error.hpp"
#include "io/scene/channel_file.hpp"

namespace tangere::apps {
namespace {

constexpr double kUsualHoldOut = 0.2, kUsualNodes = 3;

ChannelRequest request_of(const ChannelCalibration& a, const ChannelRecording& recording) {
  ChannelRequest out;
  const std::vector<double> nodes =
      a.nodes.empty() ? std::vector{kUsualNodes, kUsualNodes} : a.nodes;
  for (const double n : nodes)
    if (n != std::floor(n) || n < 1 || n > kMostNodes)
      throw InputError(fmt::format("--nodes {},{}; expected whole numbers from 1 to {}", nodes[0],
                                   nodes[1], kMostNodes));
  out.rows = int(nodes[0]), out.cols = int(nodes[1]);
  if (!a.loads.empty() && a.loads != "pressure" && a.loads != "force")
    throw InputError(fmt::format("--loads {}; expected pressure or force", a.loads));
  out.shear = a.loads.empty() ? !recording.shear.empty() : a.loads == "force";
  out.unit = a.unit.empty() ? "1" : a.unit;
  out.zero = a.zero;
  out.hold_out = a.hold_out.value_or(kUsualHoldOut);
  return out;
}

std::string score_text(const char* what, const ChannelScore& score, const ChannelMap& map) {
  if (score.rows == 0) return "";
  const auto worst = std::ranges::min_element(score.each) - score.each.begin();
  return fmt::format("{}, {} rows: R² {:.3f} over all, {:.3f} in the mean, {:.3f} at least ({})\n",
                     what, score.rows, score.whole, score.mean(), score.each[std::size_t(worst)],
                     map.names[std::size_t(worst)]);
}

std::string table_text(const ChannelFit& fit, const ChannelScore& other) {
  std::string text = fmt::format("{:<20}{:>10}{:>12}{:>12}{:>12}\n", "channel", "R² fitted",
                                 "held out", "other", "offset");
  for (std::size_t c = 0; c < fit.map.channels(); ++c) {
    const auto at = [c](const ChannelScore& score) {
      return score.rows > 0 ? fmt::format("{:.3f}", score.each[c]) : std::string();
    };
    text += fmt::format("{:<20}{:>9}{:>12}{:>12}{:>12.5g}\n", fit.map.names[c], at(fit.fitted),
                        at(fit.held_out), at(other), fit.map.offset[c]);
  }
  return text;
}

Json score_json(const ChannelScore& score) {
  if (score.rows == 0) return nullptr;
  Json each = Json::array();
  for (const double r : score.each) each.push_back(finite(r));
  return {
      {"rows", score.rows}, {"whole", score.whole}, {"mean", finite(score.mean())}, {"each", each}};
}

std::string file_name(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

/// The layout with <channels> that name the map, as seen from the layout.
std::string layout_with(LayoutFile layout, const ChannelCalibration& a) {
  const auto folder = std::filesystem::absolute(a.output).parent_path();
  layout.set("channels", "file",
             std::filesystem::absolute(a.map).lexically_proximate(folder).generic_string());
  layout.add_comment(fmt::format("channels: fitted by 'tangere calibrate --channels' to {}",
                                 file_name(a.recording)));
  return layout.text();
}

}  // namespace

int run_calibrate_channels(const ChannelCalibration& a, const Console& console) {
  if (a.recording.empty() || a.sensor.empty())
    throw InputError("--channels without RECORDING or --sensor; expected both");
  const ChannelRecording recording = read_channel_press(a.recording, console);
  const std::optional<ChannelRecording> second =
      a.check.empty() ? std::nullopt : std::optional(read_channel_press(a.check, console));
  const LayoutFile layout(layout_text("--sensor", a.sensor), a.sensor);
  TextOutput map_file(a.map, a.overwrite), layout_file(a.output, a.overwrite);
  const ChannelRequest request = request_of(a, recording);
  const Scene scene = press_scene(layout, a.indenter);
  const ChannelFit fit = fit_channels(scene, request, recording);
  ChannelScore other;
  if (second) other = check_channels(scene, request, fit.map, *second);
  console.print(table_text(fit, other) + score_text("fitted", fit.fitted, fit.map) +
                score_text("held out", fit.held_out, fit.map) +
                score_text("the other recording", other, fit.map) +
                fmt::format("{} x {} nodes, {} loads, {} products, ridge {:.2g}", fit.map.rows,
                            fit.map.cols, fit.map.loads(), fit.map.pairs(), fit.ridge));
  map_file.write(
      channel_map_text(fit.map, {{"recording", file_name(a.recording)},
                                 {"rows", std::to_string(fit.fitted.rows)},
                                 {"held_out_rows", std::to_string(fit.held_out.rows)},
                                 {"held_out_r2", fmt::format("{:.4f}", fit.held_out.whole)}}),
      console);
  if (!a.output.empty()) layout_file.write(layout_with(layout, a), console);
  console.result({{"command", "calibrate"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"channels", fit.map.names},
                  {"nodes", {fit.map.rows, fit.map.cols}},
                  {"loads", fit.map.loads()},
                  {"ridge", fit.ridge},
                  {"fitted", score_json(fit.fitted)},
                  {"held_out", score_json(fit.held_out)},
                  {"other", score_json(other)}});
  return kDone;
}

}  // namespace tangere::apps
