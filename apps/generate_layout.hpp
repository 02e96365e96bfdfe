// SPDX-License-Identifier: Apache-2.0
// Metadata of a data set's files, and the rows that are computed for them.
#pragma once

#include "apps/command.hpp"
#include "apps/generate_options.hpp"
#include "engine/step/stepper.hpp"
#include "io/dataset/dataset_layout.hpp"
#include "tasks/gradients/episode_gradients.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere::apps {

/// `task`: null for a scene alone.
DatasetLayout make_layout(const GenerateOptions& options, const Model& model,
                          const Stepper& stepper, const EpisodeOptions& run,
                          const ProgramInfo& info, const GradientPlan& gradients,
                          const Task* task = nullptr, const PlayedBy& played_by = {});

}  // namespace tangere::apps
