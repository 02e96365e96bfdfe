// SPDX-License-Identifier: Apache-2.0
// How far one environment has come in a step that is cut into parts: h/2ⁿ long, each beginning at a
// multiple of its length. A step begins with a part of its whole length, so it depends on its state
// alone.
#pragma once

#include <algorithm>
#include <cmath>

namespace tangere {

class StepParts {
 public:
  static constexpr int kFinest = 8;  ///< the largest n of a step that keeps an accuracy

  /// `finest`: the largest n, at most kFinest.
  explicit StepParts(int finest = 0) : finest_(finest) {}

  [[nodiscard]] bool finished() const { return done_ == kUnits; }
  [[nodiscard]] bool finest() const { return halved_ == finest_; }
  [[nodiscard]] bool whole() const { return halved_ == 0; }
  /// Length of the next part, in steps.
  [[nodiscard]] double length() const { return std::ldexp(1.0, -halved_); }

  /// The next part will be shorter. `ratio`: estimated error over what is allowed; infinite where
  /// no root was found. Must not be called when finest().
  void shorten(double ratio) {
    const double requested = std::ceil(std::log2(ratio) / kPower);
    halved_ +=
        std::isfinite(requested) ? std::clamp(static_cast<int>(requested), 1, kMostHalvings) : 1;
    halved_ = std::min(halved_, finest_);
  }
  /// Call after an accepted part. Doubles the next length if the estimate predicts acceptance.
  void take(double ratio) {
    done_ += units();
    if (halved_ > 0 && ratio < kDouble && done_ % (2 * units()) == 0) --halved_;
  }

 private:
  static constexpr int kUnits = 1 << kFinest;
  /// The estimate falls with at least the square of the length where contacts are stiff.
  static constexpr double kPower = 2;
  static constexpr int kMostHalvings = 4;  // at once
  /// Twice the length brings 2^kPower times the error. Some of that is kept back.
  static constexpr double kDouble = 0.7 / 4;

  [[nodiscard]] int units() const { return kUnits >> halved_; }

  int finest_;
  int done_ = 0;    // of kUnits
  int halved_ = 0;  // the next part is h / 2^halved_
};

}  // namespace tangere
