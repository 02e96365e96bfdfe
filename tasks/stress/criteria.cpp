// SPDX-License-Identifier: Apache-2.0
// The formulas stand in the header, beside the names. Coefficients are those of the scene.
#include "tasks/stress/criteria.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/base/as_size.hpp"

namespace tangere {
namespace {

double length(const Vector3& x) { return std::sqrt(dot(x, x)); }

/// Kinetic energy and that of height over the least height energy of the run.
struct Energies {
  double start = 0, least = HUGE_VAL, largest = 0;
};
Energies energies_of(const StressHistory& h) {
  double floor = HUGE_VAL;
  for (int k = 0; k < h.frames(); ++k) floor = std::min(floor, h.height_energy(k));
  Energies found;
  for (int k = 0; k < h.frames(); ++k) {
    const double energy = h.kinetic_energy(k) + h.height_energy(k) - floor;
    if (k == 0) found.start = energy;
    // Comparisons with NaN are false, so it is tested separately.
    if (!std::isfinite(energy)) return {found.start, energy, energy};
    found.least = std::min(found.least, energy);
    found.largest = std::max(found.largest, energy);
  }
  return found;
}

/// The largest value of `f` over all frames; NaN where one is NaN.
template <class F>
double largest(const StressHistory& h, const F& f) {
  double most = -HUGE_VAL;
  for (int k = 0; k < h.frames(); ++k) {
    const double value = f(k);
    if (!(value <= most)) most = value;
    if (std::isnan(most)) return most;
  }
  return most;
}

double ground_height(const StressHistory& h, const Vector3& x) {
  const GroundDescription& ground = h.scene().ground.value();
  return dot(ground.normal, x - ground.position);
}

/// Gravity along the ground and into it [m/s²], both positive.
struct Slope {
  Vector3 along;
  double down, into;
};
Slope slope_of(const StressHistory& h) {
  const Vector3 n = h.scene().ground.value().normal, g = h.scene().gravity;
  const double into = -dot(g, n);
  const Vector3 along = g + into * n;
  const double down = length(along);
  return {down > 0 ? (1 / down) * along : along, down, into};
}

/// Of a body at the end that turns about z alone [rad].
double angle_about_z(const StressHistory& h, int body) {
  const Quaternion q = h.orientation(h.last(), body);
  return 2 * std::atan2(q[3], q[0]);
}

const ContactCoefficients& on_ground(const StressHistory& h, int body) {
  const std::string& name = h.scene().links[as_size(body)].body.name;
  const auto& contacts = h.scene().ground_contacts;
  const auto found =
      std::find_if(contacts.begin(), contacts.end(),
                   [&](const GroundContactDescription& c) { return c.body == name; });
  if (found == contacts.end()) throw InputError("body '" + name + "' has no ground contact");
  return found->coefficients;
}

}  // namespace

double energy_ratio(const StressHistory& h) {
  const Energies e = energies_of(h);
  return e.largest / e.start;
}

double energy_change(const StressHistory& h) {
  const Energies e = energies_of(h);
  return std::max(e.largest / e.start - 1, 1 - e.least / e.start);
}

double momentum_change(const StressHistory& h) {
  const Vector3 start = h.angular_momentum(0);
  return largest(h, [&](int k) { return length(h.angular_momentum(k) - start) / length(start); });
}

double largest_sink(const StressHistory& h) {
  return largest(h, [&](int k) {
    double most = 0;
    for (int b = 0; b < h.bodies(); ++b)
      most = std::max(most, h.position(0, b)[2] - h.position(k, b)[2]);
    return most;
  });
}

double largest_shift(const StressHistory& h) {
  return largest(h, [&](int k) {
    double most = 0;
    for (int b = 0; b < h.bodies(); ++b)
      most = std::max(most, length(h.position(k, b) - h.position(0, b)));
    return most;
  });
}

Criterion creep_after(double start, double fall) {
  return [=](const StressHistory& h) {
    const double sink = largest_sink(h);
    if (!(sink <= fall)) return sink;
    const int first = std::min(h.last(), static_cast<int>(std::lround(start / h.step())));
    return largest(h, [&](int k) {
      double most = 0;
      for (int b = 0; b < h.bodies() && k > first; ++b)
        most = std::max(most, length(h.position(k, b) - h.position(first, b)));
      return most;
    });
  };
}

Criterion sinks_below(int moving, int fixed) {
  return [=](const StressHistory& h) {
    return largest(h, [&](int k) { return h.position(k, fixed)[2] - h.position(k, moving)[2]; });
  };
}

Criterion sinks_below_ground(int body) {
  return [=](const StressHistory& h) {
    return largest(h, [&](int k) { return -ground_height(h, h.position(k, body)); });
  };
}

Criterion rest_depth_error(int body, double reach, int points, double load) {
  return [=](const StressHistory& h) {
    const double expected =
        load * h.mass(body) * slope_of(h).into / (points * on_ground(h, body).kn);
    const double depth = reach - ground_height(h, h.position(h.last(), body));
    return std::abs(depth / expected - 1);
  };
}

Criterion creep_error(int body, int points) {
  return [=](const StressHistory& h) {
    const Slope slope = slope_of(h);
    const double expected = h.mass(body) * slope.down / (points * on_ground(h, body).kt);
    return std::abs(dot(slope.along, h.velocity(h.last(), body)) / expected - 1);
  };
}

Criterion slide_error(int body) {
  return [=](const StressHistory& h) {
    const Slope slope = slope_of(h);
    const double expected = slope.down - on_ground(h, body).mu * slope.into;
    const int half = h.last() / 2;
    const Vector3 gained = h.velocity(h.last(), body) - h.velocity(half, body);
    return std::abs(dot(slope.along, gained) / ((h.last() - half) * h.step()) / expected - 1);
  };
}

Criterion stop_error(int body, int points) {
  return [=](const StressHistory& h) {
    const ContactCoefficients& c = on_ground(h, body);
    const double g = slope_of(h).into, v = length(h.velocity(0, body));
    const double sticks = c.mu * h.mass(body) * g / (points * c.kt);
    const double expected =
        (v * v - sticks * sticks) / (2 * c.mu * g) + h.mass(body) * sticks / (points * c.kt);
    Vector3 way = h.position(h.last(), body) - h.position(0, body);
    way = way - dot(way, h.scene().ground.value().normal) * h.scene().ground.value().normal;
    return std::abs(length(way) / expected - 1);
  };
}

Criterion fall_error(int body) {
  return [=](const StressHistory& h) {
    const double t = h.last() * h.step();
    const double expected = length(h.scene().gravity) * t * t / 2;
    return length(h.position(h.last(), body) - h.position(0, body) -
                  (t * t / 2) * h.scene().gravity) /
           expected;
  };
}

Criterion release_speed(int body, double depth) {
  return [=](const StressHistory& h) {
    const double bound = std::sqrt(on_ground(h, body).kn / h.mass(body)) * depth;
    return largest(h, [&](int k) { return length(h.velocity(k, body)) / bound; });
  };
}

Criterion speed_error(int body, double share) {
  return [=](const StressHistory& h) {
    const double expected = share * length(h.velocity(0, body));
    return std::abs(length(h.velocity(h.last(), body)) / expected - 1);
  };
}

Criterion angle_error(int body, double angle) {
  return [=](const StressHistory& h) {
    return std::abs(std::remainder(angle_about_z(h, body) - angle, 2 * std::numbers::pi));
  };
}

Criterion turn_error(int body) {
  return [=](const StressHistory& h) {
    constexpr double kTurn = 2 * std::numbers::pi;
    const double expected = h.spin(0, body)[2] * h.last() * h.step();
    return std::abs(std::remainder(angle_about_z(h, body) - expected, kTurn)) / kTurn;
  };
}

Criterion precession_error(int body) {
  return [=](const StressHistory& h) {
    const auto arm = [&](int k) {  // from the joint, which stays, to the centre
      return h.position(k, body) - h.scene().links[as_size(body)].joint.pose.position;
    };
    const auto azimuth = [&](int k) { return std::atan2(arm(k)[1], arm(k)[0]); };
    double angle = 0;
    for (int k = 1; k < h.frames(); ++k)
      angle += std::remainder(azimuth(k) - azimuth(k - 1), 2 * std::numbers::pi);
    const Vector3 axis = unit(arm(0)), up{0, 0, 1};
    const double rate = length(cross(h.spin(0, body), axis)) / length(cross(up, axis));
    return std::abs(angle / (rate * h.last() * h.step()) - 1);
  };
}

}  // namespace tangere
