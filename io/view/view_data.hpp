// SPDX-License-Identifier: Apache-2.0
// What a page shows: shapes, sensors, and the frames of some episodes. Numbers are float32, because
// nothing on a screen needs more.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Places of a sensor's map and of its arrows. An array of many points is pooled: a cell is the
/// mean of its points.
struct ViewSensor {
  std::string name;
  int body = 0;                      ///< index in the scene's order
  int points = 0;                    ///< of the sensor
  int rows = 0, cols = 0;            ///< of the map; 0: the points have no places in a map
  double height = 0, width = 0;      ///< of the map [m]
  std::vector<float> position;       ///< (cells, 3), body frame [m]
  std::vector<float> axis0, axis1;   ///< (cells, 3), unit, body frame
  std::vector<float> press;          ///< (cells, 3), unit: where pressure pushes the body
  std::vector<std::int32_t> place;   ///< (cells, 2) row and column in the map; -1: none
  std::vector<float> turn;           ///< (cells, 4) from force along axis0, axis1 to down, right
  std::vector<std::int32_t> cell;    ///< (points) index of a point's cell; -1: left out
  std::vector<std::int32_t> shared;  ///< (cells) points of a cell

  [[nodiscard]] std::size_t cells() const { return shared.size(); }
};

/// A curve over the frames of an episode.
struct ViewTrace {
  std::string group, name, unit;
  std::vector<float> values;  ///< (frames); NaN: no value there
};

/// The fields of a sensor in an episode.
struct ViewField {
  std::vector<std::int32_t> at;  ///< (frames) index of the newest field; -1: none yet
  std::vector<float> values;     ///< (fields, cells, 3): f·axis0, f·axis1, pressure [N]
};

/// A gel or a camera whose pictures are shown.
struct ViewPicture {
  std::string name;        ///< of the output: "pad.rgb", "eye.rgb"
  int rows = 0, cols = 0;  ///< pixels
};

/// Its pictures in an episode.
struct ViewShown {
  std::vector<std::int32_t> at;    ///< (frames) index of the newest picture; -1: none yet
  std::vector<std::string> files;  ///< JPEG
};

struct ViewEpisode {
  std::string label;                 ///< "environment 3", "episode 12"
  int shapes = 0;                    ///< index in ViewData::shapes
  std::vector<std::int64_t> rows;    ///< (frames) rows of the file
  std::vector<float> time;           ///< (frames) [s]
  std::vector<float> poses;          ///< (frames, bodies, 7): x y z qw qx qy qz, world
  std::vector<float> end_effectors;  ///< (frames, end effectors, 3), world [m]
  std::vector<ViewTrace> traces;     ///< reward, coordinates, forces, status
  std::vector<ViewField> fields;     ///< (sensors)
  std::vector<ViewShown> pictures;   ///< (pictures)
};

struct ViewData {
  std::string title, source, kind;  ///< scene's name; path; "trajectory", "data set"
  Scene scene;                      ///< as the file holds it
  std::vector<std::vector<LinkDescription>> shapes;  ///< bodies, for each set of sizes that occurs
  std::vector<ViewSensor> sensors;
  std::vector<ViewPicture> pictures;
  std::vector<ViewEpisode> episodes;
  std::vector<std::string> notes;  ///< what was left out, in words
  std::int64_t stride = 1;         ///< rows of the file for a frame
};

/// What of a file a page shows.
struct ViewOptions {
  std::string scene;                    ///< path beside which files of the scene lie; "": unknown
  std::optional<std::int64_t> episode;  ///< this one alone: of a trajectory, the environment
  int episodes = 16;                    ///< else the first so many
  int frames = 1000;                    ///< most frames of an episode
  double bytes = 50e6;                  ///< most bytes of a page; frames are thinned to keep it
};

}  // namespace tangere
