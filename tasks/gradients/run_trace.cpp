// SPDX-License-Identifier: Apache-2.0
// Decisions are read from states alone, so whatever stepped a batch needs no hook.
#include "tasks/gradients/run_trace.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/as_size.hpp"

namespace tangere {
namespace {

std::string range_text(const NormalAndShear& x) {
  return x.normal == x.shear
             ? fmt::format("{:g} N", x.normal)
             : fmt::format("{:g} N (pressure) and {:g} N (shear)", x.normal, x.shear);
}

const char* limit_text(int beyond) {
  return beyond < 0   ? "below its lower limit"
         : beyond > 0 ? "above its upper limit"
                      : "within its limits";
}

}  // namespace

RunTrace::RunTrace(const Model& model) : model_(model) {}

void RunTrace::add(const Batch& batch) {
  const Model& model = batch.model();
  ContactStateReader contacts(model);
  Readout readout(model);
  std::vector<ContactState> read = contacts.read(batch, 0);
  std::vector<Decisions>& row = states_.emplace_back(read.size());
  for (std::size_t e = 0; e < read.size(); ++e) {
    row[e].contact = std::move(read[e]);
    row[e].status = batch.status(static_cast<int>(e));
  }
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    DenseFrame<double> frame(model, static_cast<int>(s), FieldForm::ideal);
    for (std::size_t e = 0; e < row.size(); ++e) {
      readout.read(batch, static_cast<int>(e), frame);
      const std::span<const double> field = frame.values();
      int loaded_points = 0;
      for (std::size_t i = 0; i + 2 < field.size(); i += 3)
        loaded_points += field[i] != 0 || field[i + 1] != 0 || field[i + 2] != 0 ? 1 : 0;
      row[e].loaded_points.push_back(loaded_points);
    }
  }
}

void RunTrace::compare(std::size_t state, const Decisions& a, const Decisions& b,
                       std::vector<bool>& reported, std::vector<std::string>& to) const {
  std::size_t at = 0;
  const auto say = [&](bool differs, const auto& text) {
    if (differs && !reported[at]) to.push_back(fmt::format("in state {} {}", state, text()));
    reported[at] = reported[at] || differs;
    ++at;
  };
  say(a.status != b.status, [&] {
    return fmt::format("the status is '{}' in one run and '{}' in the other", to_string(a.status),
                       to_string(b.status));
  });
  for (std::size_t k = 0; k < model_.contacts().size(); ++k)
    say(a.contact.touching[k] != b.contact.touching[k], [&] {
      const ContactInfo& c = model_.contacts()[k];
      return fmt::format(
          "{} points of the contact of '{}' with '{}' touch in one run and {} in the "
          "other",
          a.contact.touching[k], c.first, c.second, b.contact.touching[k]);
    });
  for (std::size_t i = 0; i < a.contact.beyond.size(); ++i)
    say(a.contact.beyond[i] != b.contact.beyond[i], [&] {
      return fmt::format("'{}' is {} in one run and {} in the other", model_.v_names()[i],
                         limit_text(a.contact.beyond[i]), limit_text(b.contact.beyond[i]));
    });
  for (std::size_t s = 0; s < a.loaded_points.size(); ++s)
    say(a.loaded_points[s] != b.loaded_points[s], [&] {
      return fmt::format("{} points of sensor '{}' feel a force in one run and {} in the other",
                         a.loaded_points[s], model_.sensors()[s].name, b.loaded_points[s]);
    });
}

std::vector<std::string> RunTrace::differences(int environment, const RunTrace& other,
                                               int environment_of_other) const {
  std::vector<std::string> texts;
  std::vector<bool> reported(1 + model_.contacts().size() + as_size(model_.nv()) +
                             model_.sensors().size());
  for (std::size_t t = 0; t < std::min(states_.size(), other.states_.size()); ++t)
    compare(t, states_[t][as_size(environment)], other.states_[t][as_size(environment_of_other)],
            reported, texts);
  return texts;
}

std::vector<std::string> sensors_without_derivative(const Model& model) {
  std::vector<std::string> texts;
  for (const TactileDescription& sensor : model.scene().sensors) {
    const SensorImperfections& flaws = sensor.imperfections;
    if (flaws.quantisation != NormalAndShear{})
      texts.push_back(
          fmt::format("readings of sensor '{}' are multiples of {} (quantisation): their "
                      "derivative is 0 almost "
                      "everywhere, and the gradient is that of the reading before it is rounded",
                      sensor.name, range_text(flaws.quantisation)));
    if (flaws.saturation != NormalAndShear{})
      texts.push_back(fmt::format(
          "readings of sensor '{}' end at {} (saturation): there is a kink where one gets there, "
          "and beyond it the derivative is 0",
          sensor.name, range_text(flaws.saturation)));
  }
  return texts;
}

}  // namespace tangere
