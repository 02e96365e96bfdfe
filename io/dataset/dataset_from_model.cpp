// SPDX-License-Identifier: Apache-2.0
// Row j of a data set is the state after j K steps, so its fields are those after K steps, too.
#include "io/dataset/dataset_from_model.hpp"

#include "io/scene/scene_tables.hpp"

namespace tangere {

DatasetLayout dataset_layout_from(const Model& model, const Stepper& stepper,
                                  const DatasetLayout& requested) {
  const Scene& scene = model.scene();
  DatasetLayout layout = requested;
  static_cast<RunFacts&>(layout) = run_facts(model, stepper, requested, requested.seed);
  for (std::size_t i = 0; i < model.sensors().size(); ++i)
    layout.sensors.push_back(sensor_layout(model.sensors()[i], scene.sensors[i], requested.every));
  layout.cameras = camera_layouts(scene);
  layout.tables = tables_of(scene);
  layout.body_names.assign(model.body_names().begin(), model.body_names().end());
  return layout;
}

}  // namespace tangere
