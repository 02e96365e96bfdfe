// SPDX-License-Identifier: Apache-2.0
// Criteria of hard cases. Each is a function that returns one number, which should not exceed the
// bound of the case. Bodies are numbered from 0 in file order.
#pragma once

#include <functional>

#include "tasks/stress/stress_history.hpp"

namespace tangere {

/// A number from the history of one environment.
using Criterion = std::function<double(const StressHistory&)>;

/// The largest energy of motion and height over the start's. Energy counts from the least height
/// energy of the run, so without gravity this is the ratio of kinetic energies. Contacts and limits
/// only store energy, so no scheme should exceed 1.
double energy_ratio(const StressHistory& history);
/// How far the energy of motion and height is from the start's at any time, as a share of it.
double energy_change(const StressHistory& history);
/// How far the angular momentum is from the start's at any time, as a share of it.
double momentum_change(const StressHistory& history);
/// How far any body falls below its start [m].
double largest_sink(const StressHistory& history);
/// The largest distance of any body from its start [m].
double largest_shift(const StressHistory& history);
/// The largest displacement of any body from its position at time `start` [s], at any later time
/// [m]. If a body sinks by more than `fall` [m], the sink.
Criterion creep_after(double start, double fall);
/// How far body `moving` gets below body `fixed` at any time [m]. Negative: never below.
Criterion sinks_below(int moving, int fixed);
/// How far the body gets below the ground's level at any time [m]. Negative: never below.
Criterion sinks_below_ground(int body);

/// The error of the depth at which the body rests on the ground at the end, as a share of the
/// depth. `reach` is the distance from the body's centre to its lowest points [m]; `points` of them
/// carry `load` times its weight: depth = load m g/(points kn).
Criterion rest_depth_error(int body, double reach, int points, double load = 1);
/// The error of the speed at which the body creeps at the end, as a share of it. Viscous friction
/// must creep: speed = m g sin a/(points kt).
Criterion creep_error(int body, int points);
/// The error of the mean acceleration in the second half, as a share: g (sin a - mu cos a).
Criterion slide_error(int body);
/// The error of the way on which the body stops, as a share. With c = mu m g/(points kt), the speed
/// below which its points stick: (v² - c²)/(2 mu g) + m c/(points kt).
Criterion stop_error(int body, int points);
/// The error of the way that the body falls freely from rest, as a share: g t²/2.
Criterion fall_error(int body);
/// The largest speed of the body divided by sqrt(kn/m) depth, the speed at which a spring
/// compressed by that depth [m] releases it.
Criterion release_speed(int body, double depth);
/// The error of the body's speed at the end, as a share: `share` of that at the start.
Criterion speed_error(int body, double share);
/// The distance of the body's angle about z from `angle` at the end [rad].
Criterion angle_error(int body, double angle);
/// The error of the angle through which the body has turned about z at the end, as a share of a
/// turn. It spins freely about z.
Criterion turn_error(int body);
/// The error of the mean rate at which a top goes around the vertical, as a share. It stands on its
/// joint and starts on a steady way: with axis e, rate = |spin x e|/|up x e|.
Criterion precession_error(int body);

}  // namespace tangere
