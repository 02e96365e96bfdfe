// SPDX-License-Identifier: Apache-2.0
// Costs of effects as a table for people and as JSON.
#include "apps/inspect_effects.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "io/picture/share_plot.hpp"

namespace tangere::apps {
namespace {

std::string microseconds(double seconds) { return fmt::format("{:.3g} µs", 1e6 * seconds); }

std::string share_text(const MeasuredShare& m) {
  return fmt::format("{:.1f} % ± {:.1f}", 100 * m.share + 0.0, 100 * m.spread);
}

/// Pads by what is seen: "µ" and "±" are two bytes each.
std::string padded(const std::string& text, std::size_t width, bool right = false) {
  const auto columns = std::size_t(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
  }));
  const std::string blanks(width > columns ? width - columns : 0, ' ');
  return right ? blanks + text : text + blanks;
}

/// The lines that call for an effect, at most three of them.
std::string first_lines(EffectInfo effect) {
  constexpr std::size_t kShown = 3;
  const std::size_t all = effect.sources.size();
  if (all > kShown) effect.sources.resize(kShown);
  std::string text = lines_of(effect);
  if (all > kShown) text += fmt::format(" and {} more", all - kShown);
  return text;
}

int elements_of(const EffectCosts& costs, EffectKind kind) {
  return static_cast<int>(
      std::count_if(costs.effects.begin(), costs.effects.end(), [&](const EffectCost& c) {
        return c.effect.effect.kind == kind && c.effect.effect.element >= 0;
      }));
}

/// Whether the table has the row: a kind with one element has no second row, and elements that are
/// not timed one by one are in --json only.
bool is_shown(const EffectCosts& costs, const EffectCost& cost) {
  const int elements = elements_of(costs, cost.effect.effect.kind);
  // Without contacts or sensors, their parts need no rows.
  if (elements == 0 && is_part(cost.effect.effect.kind)) return false;
  if (cost.effect.effect.element < 0) return elements != 1;
  return times_elements(cost.effect.effect.kind, elements);
}

std::string steps_text(const EffectCosts& costs) {
  return costs.planned_steps > costs.run_steps
             ? fmt::format("the first {} of {} steps", costs.run_steps, costs.planned_steps)
             : fmt::format("{} steps", costs.run_steps);
}

std::string row(const EffectCost& c, std::size_t width) {
  const std::string lines = first_lines(c.effect);
  std::string why = lines.empty() ? c.effect.reason : lines + ": " + c.effect.reason;
  if (!c.effect.variant.empty()) why += "; kernel: " + c.effect.variant;
  if (!c.note.empty()) why += "; " + c.note;
  return fmt::format("  {} {} {} {} {:>7}  {}\n", padded(c.effect.name, width),
                     padded(c.measured ? share_text(*c.measured) : "-", 14, true),
                     padded(c.measured ? microseconds(c.seconds_without) : "-", 9, true),
                     padded(c.measured ? fmt::format("{:.2f}", c.passes_without) : "-", 6, true),
                     c.bytes, why);
}

/// Rows of a table of their own: they are no part of a step.
std::string run_costs_text(const EffectCosts& costs) {
  if (costs.run_costs.empty()) return "";
  std::size_t width = 10;
  for (const RunCost& c : costs.run_costs) width = std::max(width, c.name.size());
  std::string text = fmt::format(
      "\n  {} {} {} {:>7}  {}\n", padded("what a run adds", std::max<std::size_t>(width, 15)),
      padded("share", 9, true), padded("time", 9, true), "bytes", "requested by");
  for (const RunCost& c : costs.run_costs)
    text +=
        fmt::format("  {} {} {} {:>7}  {}{}\n", padded(c.name, std::max<std::size_t>(width, 15)),
                    padded(fmt::format("{:.1f} %", 100 * c.share), 9, true),
                    padded(microseconds(c.seconds), 9, true), c.bytes,
                    c.on ? "" : "not unless requested: ", c.requested_by);
  return text;
}

Json effect_json(const EffectInfo& effect) {
  Json lines = Json::array();
  for (const Source& source : effect.sources)
    lines.push_back(fmt::format("{}:{}", source.file, source.line));
  return {{"kind", to_string(effect.effect.kind)},
          {"on", effect.on},
          {"why", effect.reason},
          {"lines", lines},
          {"variant", effect.variant.empty() ? Json() : Json(effect.variant)}};
}

/// The name, or with stars behind it if there is such a key: a sensor may be called "shear".
std::string free_key(const Json& taken, std::string name) {
  while (taken.contains(name)) name += "*";
  return name;
}

}  // namespace

Json effects_json(std::span<const EffectInfo> effects) {
  Json out = Json::object();
  for (const EffectInfo& effect : effects) out[free_key(out, effect.name)] = effect_json(effect);
  return out;
}

Json effect_costs_json(const EffectCosts& costs) {
  Json out = Json::object();
  for (const EffectCost& c : costs.effects) {
    const bool m = c.measured.has_value();
    Json effect = effect_json(c.effect);
    effect.update(Json{{"bytes", c.bytes},
                       {"share", m ? Json(c.measured->share) : Json()},
                       {"spread", m ? Json(c.measured->spread) : Json()},
                       {"step_seconds_without", m ? Json(c.seconds_without) : Json()},
                       {"newton_without", m ? Json(c.passes_without) : Json()},
                       {"note", c.note}});
    out[free_key(out, c.effect.name)] = std::move(effect);
  }
  return out;
}

Json effect_measurement_json(const EffectCosts& costs) {
  return {{"environments", costs.environments},
          {"failed", costs.failed},
          {"run_steps", costs.run_steps},
          {"planned_steps", costs.planned_steps < 0 ? Json() : Json(costs.planned_steps)},
          {"uncut", costs.uncut},
          {"instants", costs.instants},
          {"rounds", costs.rounds},
          {"step_seconds", costs.times.whole()},
          {"field_seconds", costs.times.reading},
          {"newton", costs.times.passes},
          {"share_of_nothing", costs.itself.share},
          {"spread_of_nothing", costs.itself.spread}};
}

std::string effect_costs_text(const EffectCosts& costs, const std::string& instruction_set) {
  std::size_t width = 10;
  for (const EffectCost& c : costs.effects)
    if (c.effect.on && is_shown(costs, c)) width = std::max(width, c.effect.name.size());
  std::string text = fmt::format(
      "effects, and what they cost\n"
      "  a step of one environment takes {}{}, {:.2f} Newton passes ({})\n"
      "  measured with {} environments from {} instants of {}, {} rounds; the scene against itself "
      "shows {}\n"
      "  shares are work, and need not add up to 100 %; passes: those of a step from the same "
      "states without it\n\n",
      microseconds(costs.times.whole()),
      costs.times.reading > 0 ? ", of it " + microseconds(costs.times.reading) + " to read fields"
                              : "",
      costs.times.passes, instruction_set, costs.environments, costs.instants, steps_text(costs),
      costs.rounds, share_text(costs.itself));
  if (costs.uncut)
    text += "  the scene's accuracy cuts steps; the times are those of whole ones\n\n";
  if (costs.failed > 0)
    text +=
        fmt::format("  {} of {} environments fail along the run and are left out from there on\n\n",
                    costs.failed, costs.environments);
  text +=
      fmt::format("  {} {} {} {} {:>7}  {}\n", padded("on", width), padded("share", 14, true),
                  padded("without", 9, true), padded("passes", 6, true), "bytes", "called for by");
  std::vector<std::string> off;
  for (const EffectCost& c : costs.effects) {
    if (!is_shown(costs, c)) continue;
    if (c.effect.on)
      text += row(c, width);
    else
      off.push_back(fmt::format("{} ({})", c.effect.name, c.effect.reason));
  }
  if (!off.empty()) text += fmt::format("\n  off, at no cost: {}\n", fmt::join(off, ", "));
  text += run_costs_text(costs);
  return text;
}

Json run_costs_json(const EffectCosts& costs) {
  Json list = Json::array();
  for (const RunCost& c : costs.run_costs)
    list.push_back({{"name", c.name},
                    {"on", c.on},
                    {"requested_by", c.requested_by},
                    {"share", c.share},
                    {"seconds", c.seconds},
                    {"bytes", c.bytes}});
  return list;
}

std::string effect_costs_svg(const EffectCosts& costs, const std::string& scene,
                             const std::string& machine) {
  ShareBars shares;
  shares.title = "where a step's time goes: " + scene;
  shares.captions = {
      fmt::format("a step of one environment takes {}{}, {:.2f} Newton passes",
                  microseconds(costs.times.whole()),
                  costs.times.reading > 0
                      ? ", of it " + microseconds(costs.times.reading) + " to read sensors"
                      : "",
                  costs.times.passes),
      fmt::format("{}; {} environments, {} instants of {}; chance alone shows {}", machine,
                  costs.environments, costs.instants, steps_text(costs), share_text(costs.itself))};
  shares.groups = {"effects of the scene, as shares of a step",
                   "part of a contact or sensor above it",
                   "what a run adds to a step because it is requested"};
  for (const EffectCost& c : costs.effects)
    if (c.effect.on && c.measured && is_shown(costs, c))
      shares.bars.push_back({c.effect.name, c.measured->share, c.measured->spread,
                             is_part(c.effect.effect.kind) ? 1 : 0});
  for (const RunCost& c : costs.run_costs) shares.bars.push_back({c.name, c.share, 0, 2});
  return render_share_svg(shares);
}

}  // namespace tangere::apps
