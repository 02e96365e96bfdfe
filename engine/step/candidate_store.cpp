// SPDX-License-Identifier: Apache-2.0
// Allocates lists where a group is stepped for the first time.
#include "engine/step/candidate_store.hpp"

#include "engine/step/candidate_lists.hpp"

namespace tangere {

struct CandidateStore::Group {
  std::unique_ptr<CandidateLists<kernels::kGroup>> group_lists;
  std::unique_ptr<CandidateLists<1>> lane_lists;
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
CandidateLists<L>& CandidateStore::lists(std::size_t group, const CompiledModel& model,
                                         bool whole) {
  Group& g = groups_[group];
  if (g.whole != whole) g = {};
  g.whole = whole;
  const auto made = [&](auto& of) -> CandidateLists<L>& {
    if (!of) of = std::make_unique<CandidateLists<L>>(model);
    return *of;
  };
  if constexpr (L == 1) {
    return made(g.lane_lists);
  } else {
    return made(g.group_lists);
  }
}

template CandidateLists<1>& CandidateStore::lists(std::size_t, const CompiledModel&, bool);
template CandidateLists<kernels::kGroup>& CandidateStore::lists(std::size_t, const CompiledModel&,
                                                                bool);

}  // namespace tangere
