// SPDX-License-Identifier: Apache-2.0
// Which contact points touch and which joint limits act in a state: the decisions of a step that a
// small change of its inputs may turn round.
#pragma once

#include <memory>
#include <vector>

#include "engine/step/batch.hpp"

namespace tangere {

/// Of one environment.
struct ContactState {
  std::vector<int> touching;  ///< (contacts of the model) points whose depth is positive
  /// (nv) -1 below its lower limit, 1 above its upper limit, else 0; 0 for ball joints.
  std::vector<int> beyond;
  friend bool operator==(const ContactState&, const ContactState&) = default;
};

/// Owns the scratch of one thread.
class ContactStateReader {
 public:
  explicit ContactStateReader(const Model& model);
  ~ContactStateReader();
  ContactStateReader(ContactStateReader&&) noexcept;
  ContactStateReader& operator=(ContactStateReader&&) noexcept;

  /// Reads the environments of a block, in their order.
  [[nodiscard]] std::vector<ContactState> read(const Batch& batch, int block);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
