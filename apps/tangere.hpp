// SPDX-License-Identifier: Apache-2.0
// What users of the libraries include: <tangere/tangere.hpp>. The install tree has the headers that
// are named here and those that they include.
#pragma once

// Scenes, models, steps and readings.
#include "engine/scene/surface_contact.hpp"
#include "engine/scene/variable_numbers.hpp"
#include "engine/sense/energy_balance.hpp"
#include "engine/sense/flow_map.hpp"
#include "engine/sense/loop_readings.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "engine/step/stepper.hpp"
#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/isa.hpp"

// Tasks and policies.
#include "apps/program.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/run/policy.hpp"
#include "tasks/run/vector_task.hpp"

// Gradients and identification.
#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "tasks/calibration/calibration.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/identification.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/gradients/task_tape.hpp"

// Runs, data sets and their files.
#include "io/dataset/dataset_from_model.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/trajectory/trajectory_file.hpp"
#include "tasks/effects/ablation.hpp"
#include "tasks/run/episodes.hpp"
#include "tasks/run/rollout.hpp"
