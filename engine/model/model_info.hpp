// SPDX-License-Identifier: Apache-2.0
// Descriptions of the sensors, contacts, meshes and stages of a model.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "engine/scene/effects.hpp"
#include "engine/scene/field_form.hpp"

namespace tangere {

/// A tactile sensor after compilation.
struct SensorInfo {
  std::string name;
  std::string body;
  int rows = 0, cols = 0;  ///< of a rectangular array; points = rows * cols, row-major
  int points = 0;
  int every = 0;           ///< as in the scene; 0: the caller chooses
  int pressure_sign = 1;   ///< +1: the third component is positive under pressure; -1: negative
  bool imperfect = false;  ///< its readings differ from the ideal field (docs/sensors.md)
  int past_states = 0;     ///< earlier states on which a reading depends
  /// Pixels of its pictures from top to bottom and from left to right; 0: it has none.
  std::array<int, 2> picture{};
  int channels = 0;  ///< of its hardware; 0: it has none
};
/// Numbers of a whole reading of a sensor.
std::size_t numbers_of(const SensorInfo& sensor, FieldForm form);
/// Its shape: {rows, cols, numbers of a point}, {points, numbers}, {height, width, numbers of a
/// pixel}, {channels} or {6}.
std::vector<std::size_t> reading_shape(const SensorInfo& sensor, FieldForm form);

class Model;
/// The same of a sensor or camera of a model.
std::size_t numbers_of(const Model& model, const FieldOutput& output);
std::vector<std::size_t> reading_shape(const Model& model, const FieldOutput& output);

/// An end effector after compilation.
struct EndEffectorInfo {
  std::string name;
  std::string joint;
};

/// One contact declared in the scene, after compilation.
struct ContactInfo {
  std::string first, second;  ///< bodies; second is "ground" for a ground contact
  int points = 0;             ///< candidate points (1 for a sphere on the ground)
  std::string law;
};

/// A mesh that can be touched, after compilation.
struct MeshInfo {
  std::string body;
  std::array<int, 3> cells{};  ///< of its grid, x y z
  double cell = 0;             ///< edge of a cell [m]
  std::size_t bytes = 0;       ///< size of the grid; bodies with the same mesh share one
  /// Of the distance on the surface [m], and the share of the area where the grid is too coarse
  /// for it (engine/model/mesh_fit.hpp says by what).
  double error = 0, unresolved = 0;
  /// The share from which on programs warn. Edges alone stay below it.
  static constexpr double kMostUnresolved = 0.1;
};

/// A stage of the scene's step, its elements and its kernel variant.
struct StageInfo {
  std::string name, of, variant;
};

}  // namespace tangere
