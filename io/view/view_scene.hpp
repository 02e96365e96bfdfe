// SPDX-License-Identifier: Apache-2.0
// The model behind a page: compiled from the scene that the file holds, it turns q into poses.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/scene/included_texts.hpp"
#include "io/view/view_data.hpp"

namespace tangere {

/// What an episode has beside q: the numbers that vary, by their names (docs/datasets.md).
struct ViewNumbers {
  std::vector<std::string> names;
  std::vector<double> values;
};

/// Compiles scenes with the sizes and places of an episode, and computes what moves.
class ViewScene {
 public:
  /// `path`: of the file, for messages. `included`: texts that the file holds with the scene.
  /// Throws IoError where the text is no scene or a file that it names is not there.
  ViewScene(const std::string& text, const std::string& name, const std::string& path,
            const ViewOptions& options, const IncludedTexts& included = {});
  ~ViewScene();
  ViewScene(const ViewScene&) = delete;
  ViewScene& operator=(const ViewScene&) = delete;

  [[nodiscard]] const Scene& scene() const { return scene_; }
  /// The scene's sensors, in file order.
  [[nodiscard]] std::vector<ViewSensor> sensors() const;
  /// Throws IoError unless the file's coordinates are the scene's.
  void check_names(std::span<const std::string> q_names) const;
  [[nodiscard]] std::vector<std::string> q_units() const;

  /// Takes an episode's numbers. Returns the index of its shapes in `data`, where they are added.
  int begin_episode(const ViewNumbers& numbers, ViewData& data);
  /// Appends poses and end effectors of a state q (nq) to an episode.
  void add_state(std::span<const double> q, ViewEpisode& episode);

 private:
  struct Posed;
  Scene scene_;
  std::string path_;
  std::unique_ptr<Posed> posed_, plain_;
};

/// Appends a field, (points, 3) [N] as files hold it, to the fields of its sensor. Returns the sum:
/// the normal force that presses on the body, and the sum of the shear's lengths [N].
std::array<double, 2> add_field(const ViewSensor& sensor, int pressure_sign,
                                std::span<const double> force, ViewField& field);

}  // namespace tangere
