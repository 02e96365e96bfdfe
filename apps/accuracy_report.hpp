// SPDX-License-Identifier: Apache-2.0
// Reports what `tangere accuracy` found: rows for people, the advice in words, an object for
// programs, a table and a picture.
#pragma once

#include <span>
#include <string>

#include "apps/console.hpp"
#include "tasks/accuracy/accuracy_sweep.hpp"

namespace tangere::apps {

/// What all of a report refers to.
struct AccuracySubject {
  std::string scene;  ///< as given
  std::string name;   ///< of the model or the task
  std::string machine, isa;
  int environments = 0;
  double seconds = 0;  ///< length of the longest episode [s]
  AccuracyQuantity quantity = AccuracyQuantity::tactile;
  double target = 0;
};

std::string accuracy_heading(const AccuracySubject& subject, const FixedEpisodes& episodes);
std::string reference_row(const AccuracyReference& reference, int environments);
std::string accuracy_head();
/// One setting, in every precision.
std::string accuracy_row(std::span<const AccuracyPoint> points);
/// Measured orders of the schemes, laws that reduce them, and accuracies that cut steps miss. Empty
/// if no order was measured.
std::string order_text(const AccuracyReport& report, const Model& model);
/// One or two sentences: the advised setting, or the reason why there is none.
std::string advice_text(const AccuracySubject& subject, const AccuracyReport& report,
                        const Model& model);

Json accuracy_json(const AccuracySubject& subject, const AccuracyReport& report,
                   const Model& model);
std::string accuracy_csv(const AccuracySubject& subject, const AccuracyReport& report);
/// Whether a setting has both an error and a cost.
bool can_draw(const AccuracyReport& report);
std::string accuracy_svg(const AccuracySubject& subject, const AccuracyReport& report);

}  // namespace tangere::apps
