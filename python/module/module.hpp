// SPDX-License-Identifier: Apache-2.0
// The parts of the module.
#pragma once

#include <nanobind/nanobind.h>

namespace tangere::python {

// One function for each file of this folder: it adds its classes to the module.
void add_scenes(nanobind::module_& m);
void add_scene_schema(nanobind::module_& m);
void add_robots(nanobind::module_& m);
void add_batches(nanobind::module_& m);
void add_tasks(nanobind::module_& m);
void add_environments(nanobind::module_& m);
void add_episode_writer(nanobind::module_& m);
void add_tapes(nanobind::module_& m);
void add_scene_tapes(nanobind::module_& m);
void add_views(nanobind::module_& m);
void add_data_files(nanobind::module_& m);

}  // namespace tangere::python
