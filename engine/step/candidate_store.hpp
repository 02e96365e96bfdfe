// SPDX-License-Identifier: Apache-2.0
// Contact candidates that the groups of a batch keep from one step to the next. They are no state:
// without them a step has the same bits and takes longer.
#pragma once

#include <memory>
#include <vector>

namespace tangere {

struct CompiledModel;
template <int L>
class CandidateLists;

/// Groups may be used from different threads. A copy is empty.
class CandidateStore {
 public:
  explicit CandidateStore(std::size_t groups);
  ~CandidateStore();
  CandidateStore(const CandidateStore& of);
  CandidateStore(CandidateStore&&) noexcept;
  CandidateStore& operator=(const CandidateStore& of);
  CandidateStore& operator=(CandidateStore&&) noexcept;

  /// Returns the lists of a group, or of its only lane that is stepped. `whole`: whether `model` is
  /// that of the batch, or it without inert contacts.
  template <int L>
  CandidateLists<L>& lists(std::size_t group, const CompiledModel& model, bool whole);

 private:
  struct Group;
  std::vector<Group> groups_;
};

}  // namespace tangere
