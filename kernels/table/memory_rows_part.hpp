// SPDX-License-Identifier: Apache-2.0
// What friction remembers, for all lanes of a group at once: a part of the table as those of
// kernels/table/parts.hpp.
#pragma once

#include "kernels/step/arguments.hpp"

namespace tangere::kernels {

/// In numbers N of L lanes. StageKernels documents each function.
template <class N, int L>
struct MemoryRowsPart {
  static void touches_at(const ModelView&, const LinkPose<Row<L>>* links, LinkPose<Row<L>>* out);
  static void recall_ground(const ModelView&, const Stage<L>&, const LinkPose<Row<L>>* touches,
                            const Row<L>* s);
  static void advance_ground(const ModelView&, const Stage<L>&, const LinkPose<Row<L>>* touches,
                             Row<L>* kept);
};

}  // namespace tangere::kernels
