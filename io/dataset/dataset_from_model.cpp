// SPDX-License-Identifier: Apache-2.0
// What a data set adds to the facts of a run: how its episodes are played and stored.
#include "io/dataset/dataset_from_model.hpp"

#include "io/scene/scene_tables.hpp"
#include "io/trajectory/layout_from_model.hpp"

namespace tangere {

DatasetLayout dataset_layout_from(const Model& model, const Stepper& stepper,
                                  const DatasetDescription& run) {
  const Scene& scene = model.scene();
  DatasetLayout layout;
  static_cast<RunFacts&>(layout) = run_facts(model, stepper, run, run.seed);
  layout.episodes = run.episodes;
  layout.steps = run.steps;
  layout.every = run.every;
  layout.single = run.single;
  for (std::size_t i = 0; i < model.sensors().size(); ++i)
    layout.sensors.push_back(sensor_layout(model.sensors()[i], scene.sensors[i], run.every));
  layout.played_by = run.played_by;
  layout.set_name = run.set_name;
  layout.controls = run.controls;
  layout.command = run.command;
  layout.shards = run.shards;
  layout.compression = run.compression;
  layout.gradients_of = run.gradients_of;
  layout.gradients = run.gradients;
  layout.sparse = run.sparse;
  layout.tables = tables_of(scene);
  layout.record = run.record;
  layout.record_times = run.record_times;
  layout.bodies = run.bodies;
  layout.fields = run.fields ? *run.fields : whole_fields(model.scene());
  return layout;
}

}  // namespace tangere
