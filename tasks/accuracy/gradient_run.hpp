// SPDX-License-Identifier: Apache-2.0
// Plays fixed episodes forward and back with one setting after another and compares derivatives
// with those of a reference.
#pragma once

#include "tasks/accuracy/accuracy_run.hpp"

namespace tangere {

class GradientRun : public AccuracyRun {
 public:
  GradientRun(const FixedEpisodes& episodes, int threads);
  AccuracyOutcome make_reference(const AccuracySetting& setting,
                                 const std::stop_token& stop) override;
  AccuracyOutcome compare(const AccuracySetting& setting, const std::stop_token& stop) override;

  /// Size of tapes and of the derivatives by every step of the finest reference [bytes].
  static double bytes(const FixedEpisodes& episodes, int threads);

 private:
  AccuracyOutcome play(const AccuracySetting& setting, const std::stop_token& stop,
                       std::vector<double>& derivatives) const;
  void weigh(const AccuracyOutcome& out);

  const FixedEpisodes& episodes_;
  int threads_;
  std::size_t rows_, width_;           ///< an environment's derivatives are (rows, width)
  std::vector<double> reference_;      ///< (E, rows, width)
  std::vector<double> weight_, norm_;  ///< (width) of a derivative; (E) squared
  std::vector<char> no_reference_;     ///< (E) the reference failed
};

}  // namespace tangere
