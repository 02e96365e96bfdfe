// SPDX-License-Identifier: Apache-2.0
// Allocates lists where a group is stepped for the first time.
#include "engine/step/candidate_store.hpp"

#include <array>

#include "engine/base/as_size.hpp"
#include "engine/step/candidate_lists.hpp"
#include "engine/step/detection.hpp"

namespace tangere {

struct CandidateStore::Group {
  std::unique_ptr<CandidateLists<kernels::kGroup>> group_lists;
  std::array<std::unique_ptr<CandidateLists<1>>, kernels::kGroup> lane_lists;
  bool whole = true;
};

CandidateStore::CandidateStore(std::size_t groups) : groups_(groups) {}
CandidateStore::~CandidateStore() = default;
CandidateStore::CandidateStore(const CandidateStore& of) : groups_(of.groups_.size()) {}
CandidateStore::CandidateStore(CandidateStore&&) noexcept = default;
CandidateStore& CandidateStore::operator=(const CandidateStore& of) {
  return *this = CandidateStore(of);
}
CandidateStore& CandidateStore::operator=(CandidateStore&&) noexcept = default;

template <int L>
CandidateLists<L>& CandidateStore::lists(std::size_t group, int lane, const CompiledModel& model,
                                         bool whole) {
  Group& g = groups_[group];
  if (g.whole != whole) g = {};
  g.whole = whole;
  const auto made = [&](auto& of) -> CandidateLists<L>& {
    if (!of) of = std::make_unique<CandidateLists<L>>(model);
    return *of;
  };
  if constexpr (L == 1) {
    return made(g.lane_lists[as_size(lane)]);
  } else {
    return made(g.group_lists);
  }
}

std::size_t CandidateStore::group_bytes(const CompiledModel& model) {
  constexpr int kMostOfLinks = 192;  // in the scenes of the tasks lists of two links hold 40 to 180
  return keeps_lists(model) ? CandidateLists<kernels::kGroup>::bytes(model, kMostOfLinks) : 0;
}

template CandidateLists<1>& CandidateStore::lists(std::size_t, int, const CompiledModel&, bool);
template CandidateLists<kernels::kGroup>& CandidateStore::lists(std::size_t, int,
                                                                const CompiledModel&, bool);

}  // namespace tangere
