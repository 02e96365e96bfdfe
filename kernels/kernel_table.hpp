// SPDX-License-Identifier: Apache-2.0
// The kernels of one instruction set as values: listed, chosen at start, forced with TANGERE_ISA.
#pragma once

#include <span>

#include "kernels/model_view.hpp"
#include "kernels/tactile_types.hpp"

namespace tangere::kernels {

/// Everything a group of eight environments needs to evaluate and solve a stage; rows of eight lanes, sized by
/// make_workspace_sizes(). Link and contact scratch is opaque bytes: its layout belongs to the kernels.
struct GroupStage {
  LaneRow *centre, *x, *r, *s, *tau;                       // inputs
  LaneRow c0_over_h, inverse_h;
  const double* block;
  int group;
  struct List {
    LaneRow* points;     ///< (capacity, 3)
    int count;
    LaneRow* reference;  ///< (12)
    double margin;
  };
  List* lists;           ///< (n_pairs)
  std::byte* scratch;    ///< scratch_bytes(model)
  int* dofs;             ///< (2 nv)
  LaneRow *v, *g, *force_scale, *mass_diagonal, *G_q, *C, *A, *LU, *work, *excess;
};

/// World pose and body twist of a link.
template <class N>
struct LinkPose {
  Frame<N> world;
  Vec6<N> V;
};

/// State of eight environments as rows.
struct GroupState {
  const LaneRow *q, *v;
  const LaneRow* zero;  ///< (nv) zeros
  LaneRow* rates;       ///< (nv) scratch
};

struct KernelTable {
  const char* name;  ///< "avx512", "avx2", "sse2", "scalar"
  std::size_t (*scratch_bytes)(const ModelView&);
  /// Poses at x alone: writes shape_in_1 of every pair, (n_pairs, 12) rows: R row-major, then p.
  void (*pair_poses)(const ModelView&, const GroupStage&, LaneRow* out);
  /// g, v, force_scale, mass_diagonal, G_q, C, A, excess at x.
  void (*evaluate)(const ModelView&, const GroupStage&);
  /// LU of A in the lanes where accept > 0.
  void (*factor)(const ModelView&, const GroupStage&, const LaneRow& accept);
  /// out = A⁻¹ b by the factor as it is.
  void (*solve)(const ModelView&, const GroupStage&, const LaneRow* b, LaneRow* out);
  /// The same, refined once; sound[l] = 1 where the result can be trusted.
  void (*solve_watched)(const ModelView&, const GroupStage&, const LaneRow* b, LaneRow* out, LaneRow* sound);
  /// Poses and twists of every link, (n_links).
  void (*link_poses)(const ModelView&, const GroupState&, LinkPose<LaneRow>* out);
  /// Pose and twist of a shape against a pad, both given in their links (nullptr: the world). Parameters are left alone.
  void (*pad_touch)(const LinkPose<LaneRow>* sensor, const Frame<double>& pad, const LinkPose<LaneRow>* body,
                    const Frame<double>& shape, Touch<LaneRow>* out);
  /// Field of one environment; how many tiles are touched.
  int (*tactile)(const TactileArgs<double>&);
  int (*tactile_mixed)(const TactileArgs<float>&);
  /// Fields of eight and of sixteen environments.
  void (*tactile_block)(const TactileBlockArgs<double>&);
  void (*tactile_block_mixed)(const TactileBlockArgs<float>&);
};

/// Tables this machine can run, best first; never empty.
std::span<const KernelTable* const> available_kernels();

/// The table in use: the best one, or the one named by the environment variable TANGERE_ISA when the program started.
/// Throws nothing; an unknown or unsupported name is reported by forced_isa_error().
const KernelTable& active_kernels();

/// "" or why TANGERE_ISA cannot be honoured, with the names that can. Programs check it at start.
const char* forced_isa_error();

/// Runs on `table` from now on (tests visit every one).
void use_kernels(const KernelTable& table);

}  // namespace tangere::kernels
