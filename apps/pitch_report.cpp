// SPDX-License-Identifier: Apache-2.0
// Pitches are shown in millimetres, to programs in metres.
#include "apps/pitch_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/scene/scene_number.hpp"

namespace tangere::apps {
namespace {

const std::string& name_of(const PitchSweep& sweep, const Model& model) {
  return model.sensors()[static_cast<std::size_t>(sweep.sensor)].name;
}

std::string points_text(const PitchPoint& p) { return fmt::format("{} x {}", p.rows, p.cols); }
std::string pitch_text(const PitchPoint& p) {
  if (p.pitch[0] == 0 || p.pitch[1] == 0 || std::abs(p.pitch[0] - p.pitch[1]) < 1e-6 * p.pitch[0])
    return fmt::format("{:.3g}", 1e3 * std::max(p.pitch[0], p.pitch[1]));
  return fmt::format("{:.3g} x {:.3g}", 1e3 * p.pitch[0], 1e3 * p.pitch[1]);
}

std::string row(const PitchPoint& p) {
  return fmt::format("\n{:>12}{} {:>15} {:>8} {:>12.3g} {:>12.3g}   {:.4g}", points_text(p),
                     p.own ? "*" : " ", pitch_text(p), percent(p.force_error), 1e3 * p.centre_error,
                     1e6 * p.read_seconds, p.rate);
}

std::string table(const PitchSweep& sweep, const Model& model) {
  const std::string& name = name_of(sweep, model);
  if (!sweep.left_out.empty())
    return fmt::format("\nThe pitch of '{}' is not swept: {}.", name, sweep.left_out);
  std::string text = fmt::format(
      "\nPitch of '{}' against {} points, kn, kt and damping by area (*: the scene's):\n"
      "{:>12}  {:>15} {:>8} {:>12} {:>12}   simulated seconds per CPU second",
      name, points_text(sweep.reference), "points", "pitch [mm]", "force", "centre [mm]",
      "reading [us]");
  for (const PitchPoint& p : sweep.points) text += row(p);
  return text;
}

Json point_json(const PitchPoint& p) {
  return {{"rows", p.rows},
          {"columns", p.cols},
          {"pitch", p.pitch},
          {"force_error", finite(p.force_error)},
          {"force_error_bound", finite(p.force_bound)},
          {"centre_error", finite(p.centre_error)},
          {"read_seconds", p.read_seconds},
          {"simulated_seconds_per_cpu_second", finite(p.rate)},
          {"own", p.own}};
}

}  // namespace

std::string pitch_table(std::span<const PitchSweep> sweeps, const Model& model) {
  std::string text;
  for (const PitchSweep& sweep : sweeps) text += table(sweep, model) + "\n";
  return text;
}

std::string pitch_advice(std::span<const PitchSweep> sweeps, const Model& model, double target) {
  std::string text;
  for (const PitchSweep& sweep : sweeps) {
    if (!sweep.left_out.empty() || sweep.points.empty()) continue;
    if (sweep.advice < 0) {
      text += fmt::format(" No pad tried keeps the force on '{}' within {}.", name_of(sweep, model),
                          percent(target));
      continue;
    }
    const PitchPoint& p = sweep.points[static_cast<std::size_t>(sweep.advice)];
    text += fmt::format(
        " A pad of {} points, {} mm apart, keeps the force on '{}' within {} and its centre within "
        "{:.2g} mm.",
        points_text(p), pitch_text(p), name_of(sweep, model), percent(target),
        1e3 * p.centre_error);
  }
  return text;
}

Json pitches_json(std::span<const PitchSweep> sweeps, const Model& model) {
  Json all = Json::array();
  for (const PitchSweep& sweep : sweeps) {
    Json points = Json::array();
    for (const PitchPoint& p : sweep.points) points.push_back(point_json(p));
    Json one = {{"sensor", name_of(sweep, model)}, {"points", points}};
    if (!sweep.left_out.empty()) {
      one["left_out"] = sweep.left_out;
    } else {
      one["reference"] = point_json(sweep.reference);
      one["advice"] = sweep.advice;
    }
    all.push_back(one);
  }
  return all;
}

}  // namespace tangere::apps
