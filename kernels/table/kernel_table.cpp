// SPDX-License-Identifier: Apache-2.0
// Finds the tables that were built and that the processor can run.
#include "kernels/table/kernel_table.hpp"

#include <array>
#include <cstdlib>
#include <cstring>
#include <string>

#include "kernels/numbers/one_lane.hpp"
#include "kernels/table/parts.hpp"
#include "kernels/table/processor.hpp"

#include "kernels/table/isa.hpp"

namespace tangere::kernels {
namespace {

template <class N, int L>
constexpr StageKernels<L> stage_kernels() {
  using Step = StepPart<N, L>;
  using Adjoint = AdjointPart<N, L>;
  using Memory = ShearRowsPart<N, L>;
  return {Adjoint::scratch_bytes,
          Step::kinematics,
          Step::choose_faces,
          Step::choose_faces_at,
          Step::poses_at,
          Step::near_pairs,
          Step::residual,
          Step::evaluate,
          Step::contact_wrenches,
          Step::set_weights,
          Step::set_floor,
          Step::scaled_residual,
          Step::weighted_norm,
          Step::factor,
          Step::solve,
          Step::solve_watched,
          Step::solve_transposed,
          Adjoint::adjoint_rhs,
          Adjoint::adjoint_products,
          Adjoint::parameter_products,
          Adjoint::pull_back_poses,
          Memory::touches_at,
          Memory::recall_ground,
          Memory::advance_ground};
}

/// The functions of this table are compiled elsewhere, with the flags of Arch
/// (kernels/CMakeLists.txt).
template <class Arch>
constexpr KernelTable table_of(const char* name) {
  using Group = GroupPart<Arch>;
  using Tactile = TactilePart<Arch, double>;
  using MixedTactile = TactilePart<Arch, float>;
  using Pullback = ReadingPullbackPart<Arch>;
  using Memory = ShearPart<Arch>;
  return {name,
          stage_kernels<Lanes<Arch>, kGroup>(),
          stage_kernels<OneLane<Arch>, 1>(),
          Group::find_candidates,
          Group::transpose_list,
          Group::link_poses,
          Group::pad_touch,
          Tactile::tactile,
          MixedTactile::tactile,
          Tactile::tactile_block,
          MixedTactile::tactile_block,
          Pullback::pull_back_links,
          Pullback::pullback_bytes,
          Pullback::pull_back_field,
          Pullback::field_tangent,
          Memory::recall,
          Memory::advance,
          Memory::pull_back_memory};
}

/// The tables that were built. Best first.
constexpr KernelTable kBuilt[] = {
#if TANGERE_AVX512
    table_of<xsimd::avx512bw>("avx512"),
#endif
#if TANGERE_AVX2
    table_of<xsimd::avx2>("avx2"),
#endif
#if TANGERE_SSE2
    table_of<xsimd::sse2>("sse2"),
#endif
#if TANGERE_SCALAR
    table_of<ScalarArch>("scalar"),
#endif
};

struct Registry {
  std::array<const KernelTable*, std::size(kBuilt)> tables{};
  std::size_t count = 0;
  const KernelTable* active = nullptr;
  std::string error;

  Registry() {
    std::string names, all_names;
    for (const KernelTable& built : kBuilt) {
      all_names += (all_names.empty() ? "" : ", ") + std::string(built.name);
      if (!processor_runs(built.name)) continue;
      tables[count++] = &built;
      names += (names.empty() ? "" : ", ") + std::string(built.name);
    }
    if (count == 0) {
      active = &kBuilt[0];
      error = "this processor runs none of the instruction sets that this program was built for: " +
              all_names +
              "; expected a program that was built on this machine, or with -DTANGERE_ISAS=all";
      return;
    }
    active = tables[0];
    const char* wanted = std::getenv("TANGERE_ISA");
    if (wanted == nullptr || *wanted == '\0') return;
    for (std::size_t i = 0; i < count; ++i) {
      if (std::strcmp(wanted, tables[i]->name) == 0) {
        active = tables[i];
        return;
      }
    }
    error =
        "TANGERE_ISA=" + std::string(wanted) +
        ": an instruction set that this machine does not run or this program was built without; "
        "expected one of " +
        names;
  }
};

Registry& registry() {
  static Registry r;
  return r;
}

}  // namespace

std::span<const KernelTable* const> available_kernels() {
  return {registry().tables.data(), registry().count};
}
const KernelTable& active_kernels() { return *registry().active; }
const char* active_isa_name() { return active_kernels().name; }
const char* isa_error() { return registry().error.c_str(); }
void use_kernels(const KernelTable& table) { registry().active = &table; }

}  // namespace tangere::kernels
