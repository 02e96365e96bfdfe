// SPDX-License-Identifier: Apache-2.0
// Row j of a data set is the state after j K steps, so its fields are those after K steps, too.
#include "io/dataset/dataset_from_model.hpp"

#include <algorithm>

#include "engine/scene/actuated_joints.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/scene/included_texts.hpp"
#include "io/scene/scene_tables.hpp"

namespace tangere {
namespace {

/// Whether an episode of a scene has pictures in colours of it. What a task observes is not known.
bool is_recorded(const DatasetLayout& layout, const GainedPicture& picture) {
  if (layout.task) return true;
  const std::vector<EpisodeChannel> channels = layout.channels();
  return std::any_of(channels.begin(), channels.end(), [&](const EpisodeChannel& channel) {
    const FieldOutput of = channel.reading;
    return channel.kind == EpisodeChannel::Kind::reading && channel.requested &&
           is_colour(of.form) && is_view(of.form) == picture.is_camera &&
           of.sensor == picture.index;
  });
}

}  // namespace

DatasetLayout dataset_layout_from(const Model& model, const Stepper& stepper,
                                  const DatasetLayout& requested) {
  const Scene& scene = model.scene();
  DatasetLayout layout = requested;
  static_cast<RunFacts&>(layout) = run_facts(model, stepper, requested, requested.seed);
  for (std::size_t i = 0; i < model.sensors().size(); ++i)
    layout.sensors.push_back(sensor_layout(model.sensors()[i], scene.sensors[i], requested.every));
  layout.cameras = camera_layouts(scene);
  layout.tables = tables_of(scene);
  if (const IncludedTexts included = included_texts(scene.path, scene.text); !included.empty())
    layout.included = json_of(included);
  layout.body_names.assign(model.body_names().begin(), model.body_names().end());
  layout.actuated = actuated_joints(scene);
  for (const GainedPicture& picture : gained_pictures(model))
    if (is_recorded(layout, picture)) layout.gained.push_back(picture);
  return layout;
}

}  // namespace tangere
