// SPDX-License-Identifier: Apache-2.0
// Finds the probes that this machine can run.
#include "tests/kernels/lane_probe.hpp"

#include <vector>

#include "kernels/table/processor.hpp"

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
      if (kernels::processor_runs(p->name)) built.push_back(p);
    return built;
  }();
  return probes;
}

}  // namespace tangere::testing
