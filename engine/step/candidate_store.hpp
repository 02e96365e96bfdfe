// SPDX-License-Identifier: Apache-2.0
// Contact candidates that the groups of a batch keep from one step to the next. They are no state:
// without them a step has the same bits and takes longer.
#pragma once

#include <cstddef>
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

  /// Returns the lists of a group, or those of lane `lane` of it that is stepped alone. `whole`:
  /// whether `model` is that of the batch, or it without inert contacts.
  template <int L>
  CandidateLists<L>& lists(std::size_t group, int lane, const CompiledModel& model, bool whole);

  /// Estimates the memory of the lists of a group [bytes]: as if two links touched with 192 points,
  /// or with all if they have fewer. 0 where lists are not kept.
  static std::size_t group_bytes(const CompiledModel& model);

 private:
  struct Group;
  std::vector<Group> groups_;
};

}  // namespace tangere
