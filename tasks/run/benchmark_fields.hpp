// SPDX-License-Identifier: Apache-2.0
// Memory for the tactile fields of a benchmark: one frame per sensor and environment, reused for
// every reading.
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "engine/sense/readout.hpp"
#include "tasks/run/benchmark_run.hpp"

namespace tangere {

class BenchmarkFields {
 public:
  BenchmarkFields(const Model& model, int environments, FrameKind kind, Precision precision);

  /// Reads one sensor of all environments of a block. The precision of the readout must be that of
  /// the fields.
  void read(Readout& readout, const Batch& batch, int block, int sensor);
  /// Continues a checksum with the bits of the last reading of a field: every point, whatever the
  /// frames keep.
  [[nodiscard]] std::uint64_t chain(std::uint64_t checksum, int environment, int sensor) const;

 private:
  template <template <class> class Frame, class T>
  using Store = std::vector<std::vector<Frame<T>>>;  // (sensors, environments)
  std::variant<std::monostate, Store<DenseFrame, double>, Store<DenseFrame, float>,
               Store<CompactFrame, double>, Store<CompactFrame, float>>
      frames_;
};

/// Bytes that the fields of one environment take.
double field_bytes(const Model& model, FrameKind kind, Precision precision);

}  // namespace tangere
