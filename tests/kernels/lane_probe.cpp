// SPDX-License-Identifier: Apache-2.0
// Which probes this machine can run.
#include "tests/kernels/lane_probe.hpp"

#include <cstring>
#include <vector>

#include "kernels/table/kernel_table.hpp"

namespace tangere::testing {

extern const LaneProbe kProbe_scalar;
#if TANGERE_X86
extern const LaneProbe kProbe_sse2, kProbe_avx2, kProbe_avx512;
#endif

std::span<const LaneProbe* const> lane_probes() {
  static const std::vector<const LaneProbe*> probes = [] {
    std::vector<const LaneProbe*> built = {&kProbe_scalar};
#if TANGERE_X86
    for (const LaneProbe* p : {&kProbe_sse2, &kProbe_avx2, &kProbe_avx512})
      for (const kernels::KernelTable* table : kernels::available_kernels())
        if (std::strcmp(p->name, table->name) == 0) built.push_back(p);
#endif
    return built;
  }();
  return probes;
}

}  // namespace tangere::testing
