// SPDX-License-Identifier: Apache-2.0
// A tip goes through four places and back: pressing, pressing and turned, away and turned, away.
// Between two of them each angle goes along (3 - 2 s) s², s: share of the time.
//
// Angles of a tip at distance ρ from the palm's axis, φ around it and height z, where D and H are
// distance and depth of the hip's axis, a and b lengths of the links:
//   y = ρ sin φ,  x = D - ρ cos φ,  k = H - z,  d² = y² + k²,  r² = x² + d²
//   swing = atan2(y, k),  cos lower = (r² - a² - b²)/(2 a b)
//   upper = atan2(x, d) - atan2(b sin lower, a + b cos lower)
// A finger presses with force F towards the axis if its motors of gain P have targets
//   q - P⁻¹ F ∂ρ/∂q,  with x = a sin upper + b sin(upper + lower) and d the same with cosines
#include "tasks/catalogue/in_hand_gait.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/AutoDiff>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using Dual = Eigen::AutoDiffScalar<Eigen::Vector4d>;  // derivatives by the action

constexpr int kTurnFrom = 5, kTurnTo = 70;          // all fingers go around [step]
constexpr std::array<int, 2> kRelease{165, 85};     // fingers 1 and 3, 2 and 4 let go [step]
constexpr int kOff = 20, kBack = 45, kClosed = 65;  // ends of the three moves after it [steps]
constexpr double kNominal = 0.035;  // distance of a touching tip's middle from the axis [m]
constexpr double kClear = 8e-3;     // a tip goes back so much farther from it [m]
constexpr double kOpen = 0.012;     // the same at the start [m]

/// Returns the share of the way at time t of [from, to].
double smooth_share(int t, int from, int to) {
  const double s = std::clamp(static_cast<double>(t - from) / (to - from), 0.0, 1.0);
  return s * s * (3 - 2 * s);
}

}  // namespace

InHandGait::InHandGait(const Scene& scene, const std::string& object) {
  bool held = false;
  double hip_height = 0, place_height = 0;
  for (const LinkDescription& link : scene.links) {
    const Vector3& p = link.joint.pose.position;
    if (link.joint.name == "palm") hip_height += p[2];
    if (link.joint.name == "swing_1") hip_ = std::hypot(p[0], p[1]), hip_height += p[2];
    if (link.joint.name == "lower_1") upper_ = -p[2];
    if (link.joint.name == "tip_1") lower_ = -p[2];
    if (link.joint.name == object) place_height = p[2], held = true;
  }
  for (const MotorDescription& motor : scene.motors)
    for (std::size_t k = 0; k < 3; ++k)
      if (motor.joint == std::array{"swing_1", "upper_1", "lower_1"}[k]) gain_[k] = motor.P;
  below_ = hip_height - place_height;
  if (!held || std::min({hip_, upper_, lower_, below_, gain_[0], gain_[1], gain_[2]}) <= 0)
    throw InputError(scene.path +
                     ": in_hand needs the joints palm, swing_1, lower_1, tip_1 and, below the "
                     "palm, " +
                     object + ", and position motors of swing_1, upper_1 and lower_1");
  std::array<double, kAngles> u{};
  for (const double turn : {-1.0, 1.0})
    for (const double lift : {-1.0, 1.0}) {
      targets(std::array{turn, lift, 0.0, 0.0}, kRelease[0] + kOff, u);
      if (!std::ranges::all_of(u, [](double q) { return std::isfinite(q); }))
        throw InputError(scene.path +
                         ": in_hand: the fingers are too short for the object's place");
    }
}

template <class S>
InHandGait::Angles<S> InHandGait::angles_at(const Place<S>& place) const {
  using std::acos, std::atan2, std::cos, std::sin, std::sqrt;
  const S y = place.out * sin(place.around), x = hip_ - place.out * cos(place.around),
          k = below_ - place.height;
  const S d = sqrt(S(y * y + k * k));
  const S lower =
      acos(S((x * x + d * d - (upper_ * upper_ + lower_ * lower_)) / (2 * upper_ * lower_)));
  const S elbow = atan2(S(lower_ * sin(lower)), S(upper_ + lower_ * cos(lower)));
  return {atan2(y, k), atan2(x, d) - elbow, lower};
}

template <class S>
InHandGait::Angles<S> InHandGait::pressing(const Place<S>& place, const S& force) const {
  using std::cos, std::sin;
  const Angles<S> q = angles_at(place);
  const S sum = q[1] + q[2], sine = sin(q[0]), cosine = cos(q[0]);
  const S x = upper_ * sin(q[1]) + lower_ * sin(sum), d = upper_ * cos(q[1]) + lower_ * cos(sum);
  // ρ² = (D - x)² + (d sin swing)²; half its derivatives.
  const S out = hip_ - x, y = d * sine;
  const Angles<S> slope{y * d * cosine, -out * d - y * sine * x,
                        -out * lower_ * cos(sum) - y * sine * lower_ * sin(sum)};
  Angles<S> target;
  for (std::size_t k = 0; k < 3; ++k) target[k] = q[k] - force * slope[k] / (place.out * gain_[k]);
  return target;
}

/// Returns the targets of the fingers of a pair: 0 for fingers 1 and 3, 1 for fingers 2 and 4.
template <class S>
InHandGait::Angles<S> InHandGait::targets_of_pair(std::span<const S> action, int step,
                                                  std::size_t pair) const {
  const S force = kGrip + kMore * action[2 + pair], zero(0);
  const S turn = kTurn * action[0], height = kLift * action[1];
  const S near(kNominal), far(kNominal + kClear);
  const auto between = [](const Angles<S>& from, const Angles<S>& to, double share) {
    Angles<S> q;
    for (std::size_t k = 0; k < 3; ++k) q[k] = from[k] + share * (to[k] - from[k]);
    return q;
  };
  const int after = step - kRelease[pair];
  const auto grip = [&] { return pressing(Place<S>{near, zero, zero}, force); };
  const auto turned = [&] { return pressing(Place<S>{near, turn, height}, force); };
  const auto turned_away = [&] { return angles_at(Place<S>{far, turn, height}); };
  const auto away = [&] { return angles_at(Place<S>{far, zero, zero}); };
  if (after < 0) return between(grip(), turned(), smooth_share(step, kTurnFrom, kTurnTo));
  if (after < kOff) return between(turned(), turned_away(), smooth_share(after, 0, kOff));
  if (after < kBack) return between(turned_away(), away(), smooth_share(after, kOff, kBack));
  return between(away(), grip(), smooth_share(after, kBack, kClosed));
}

void InHandGait::targets(std::span<const double> action, int step, std::span<double> u) const {
  for (std::size_t pair = 0; pair < 2; ++pair) {
    const Angles<double> q = targets_of_pair(action, step, pair);
    for (std::size_t finger = pair; finger < kFingers; finger += 2)
      std::copy(q.begin(), q.end(), &u[3 * finger]);
  }
}

void InHandGait::closing(double share, std::span<double> u) const {
  const Angles<double> open = angles_at(Place<double>{kNominal + kOpen, 0, 0}),
                       grip = pressing(Place<double>{kNominal, 0, 0}, kGrip);
  for (std::size_t k = 0; k < kAngles; ++k) {
    const std::size_t c = k % 3;
    u[k] = open[c] + share * (grip[c] - open[c]);
  }
}

void InHandGait::targets_vjp(std::span<const double> action, int step,
                             std::span<const double> weight, std::span<double> action_bar) const {
  std::array<Dual, kAction> a;
  for (int k = 0; k < 4; ++k) a[std::size_t(k)] = Dual(action[std::size_t(k)], 4, k);
  for (std::size_t pair = 0; pair < 2; ++pair) {
    const Angles<Dual> q = targets_of_pair<Dual>(a, step, pair);
    for (std::size_t finger = pair; finger < kFingers; finger += 2)
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t c = 0; c < kAction; ++c)
          action_bar[c] += weight[3 * finger + k] * q[k].derivatives()[Eigen::Index(c)];
  }
}

}  // namespace tangere
