// SPDX-License-Identifier: Apache-2.0
// Finds the tables that were built and that the processor can run.
#include "kernels/table/kernel_table.hpp"

#include <array>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

#include "kernels/numbers/one_lane.hpp"
#include "kernels/table/processor.hpp"

#include "kernels/table/isa.hpp"

namespace tangere::kernels {

// Each fills the functions of one part. Parts are compiled elsewhere, with the flags of their
// instruction set (kernels/CMakeLists.txt), so that a change recompiles the parts that use it. N:
// numbers of L lanes.
template <class N, int L>
void add_step_kernels(StageKernels<L>& k);
template <class N, int L>
void add_adjoint_kernels(StageKernels<L>& k);
template <class N, int L>
void add_shear_row_kernels(StageKernels<L>& k);
template <class Arch>
void add_group_kernels(KernelTable& k);
template <class Arch, class Real>
void add_tactile_kernels(KernelTable& k);
template <class Arch>
void add_reading_pullback_kernels(KernelTable& k);
template <class Arch>
void add_shear_kernels(KernelTable& k);
template <class Arch>
void add_block_kernels(KernelTable& k);
template <class Arch>
void add_layer_kernels(KernelTable& k);

namespace {

/// Fills the table of the instruction set Arch, an xsimd tag or ScalarArch. Its code is compiled
/// for that set as well, so only a processor that runs the set may run it.
template <class Arch>
void fill_table(KernelTable& k) {
  add_step_kernels<Lanes<Arch>, kGroup>(k.group);
  add_step_kernels<OneLane<Arch>, 1>(k.single);
  add_adjoint_kernels<Lanes<Arch>, kGroup>(k.group);
  add_adjoint_kernels<OneLane<Arch>, 1>(k.single);
  add_shear_row_kernels<Lanes<Arch>, kGroup>(k.group);
  add_shear_row_kernels<OneLane<Arch>, 1>(k.single);
  add_group_kernels<Arch>(k);
  add_tactile_kernels<Arch, double>(k);
  add_tactile_kernels<Arch, float>(k);
  add_reading_pullback_kernels<Arch>(k);
  add_shear_kernels<Arch>(k);
  add_block_kernels<Arch>(k);
  add_layer_kernels<Arch>(k);
}

struct BuiltSet {
  const char* name;
  void (*fill)(KernelTable& k);
};

/// The instruction sets that were built. Best first.
constexpr BuiltSet kBuilt[] = {
#if TANGERE_AVX512
    {"avx512", &fill_table<xsimd::avx512bw>},
#endif
#if TANGERE_AVX2
    {"avx2", &fill_table<xsimd::avx2>},
#endif
#if TANGERE_SSE2
    {"sse2", &fill_table<xsimd::sse2>},
#endif
#if TANGERE_SCALAR
    {"scalar", &fill_table<ScalarArch>},
#endif
};

struct Registry {
  std::array<KernelTable, std::size(kBuilt)> filled{};
  std::array<const KernelTable*, std::size(kBuilt)> tables{};
  std::size_t count = 0;
  const KernelTable* active = nullptr;
  std::string error;

  Registry() {
    std::string names, all_names;
    for (const BuiltSet& built : kBuilt) {
      all_names += (all_names.empty() ? "" : ", ") + std::string(built.name);
      filled[count].name = built.name;
      if (!processor_runs(built.name)) continue;
      built.fill(filled[count]);
      tables[count] = &filled[count];
      ++count;
      names += (names.empty() ? "" : ", ") + std::string(built.name);
    }
    if (count == 0) {
      active = &filled[0];  // without functions
      error = "this processor runs none of the instruction sets that this program was built for: " +
              all_names +
              "; expected a program that was built on this machine, or with -DTANGERE_ISAS=all";
      return;
    }
    active = tables[0];
    const char* requested = std::getenv("TANGERE_ISA");
    if (requested == nullptr || *requested == '\0') return;
    for (std::size_t i = 0; i < count; ++i) {
      if (std::strcmp(requested, tables[i]->name) == 0) {
        active = tables[i];
        return;
      }
    }
    error =
        "TANGERE_ISA=" + std::string(requested) +
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
int active_register_width() {
  const std::string_view name = active_isa_name();
  return name == "avx512" ? 8 : name == "avx2" ? 4 : name == "sse2" ? 2 : 1;
}
const char* isa_error() { return registry().error.c_str(); }
void use_kernels(const KernelTable& table) { registry().active = &table; }

}  // namespace tangere::kernels
