// SPDX-License-Identifier: Apache-2.0
// Finds the probes that this machine can run.
#include "tests/kernels/lane_probe.hpp"

#include <cstring>
#include <vector>

#include "kernels/table/kernel_table.hpp"

namespace tangere::testing {

// TANGERE_PROBES: PROBE(scalar) PROBE(avx2) and so on, for the instruction sets that were built.
#define PROBE(isa) extern const LaneProbe kProbe_##isa;
TANGERE_PROBES
#undef PROBE

std::span<const LaneProbe* const> lane_probes() {
  static const std::vector<const LaneProbe*> probes = [] {
    std::vector<const LaneProbe*> built;
#define PROBE(isa) &kProbe_##isa,
    for (const LaneProbe* p : {TANGERE_PROBES})
#undef PROBE
      for (const kernels::KernelTable* table : kernels::available_kernels())
        if (std::strcmp(p->name, table->name) == 0) built.push_back(p);
    return built;
  }();
  return probes;
}

}  // namespace tangere::testing
