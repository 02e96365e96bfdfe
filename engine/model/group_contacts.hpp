// SPDX-License-Identifier: Apache-2.0
// Puts contacts of the same links side by side. Folding leaves many shapes on one link, which all
// move alike. A step of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Computes a ball around points (n, 3): its centre is the middle of their box, its radius reaches
/// the farthest of them.
void bound(const double* points, int n, kernels::Vec3<double>& middle, double& extent);

/// Finds the contacts that share their links. Fills link_pairs, grounded and the orders.
void group_contacts(CompiledModel& m);

/// Puts balls around the contact points and the shapes of the links that share contacts. Call it
/// when it is known which sizes vary.
void bound_links(CompiledModel& m);

/// Returns how far above its points a pair's layer may touch [m]; 0 without a layer.
double bulge_of(const CompiledModel& m, const kernels::PairContact& pair);

/// Numbers the pairs of links that pads with layers touch.
void number_layers(CompiledModel& m);

/// Scenes with fewer pairs of links consider all of them in every step.
inline constexpr std::size_t kManyLinkPairs = 128;
/// Puts a ball around all contact points and all shapes of every link, in scenes of many link
/// pairs. Call after bound_links().
void find_link_balls(CompiledModel& m);

}  // namespace tangere
