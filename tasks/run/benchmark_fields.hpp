// SPDX-License-Identifier: Apache-2.0
// Buffers for the tactile fields and the pictures of cameras of a benchmark: one for each output
// and environment, reused for every reading.
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "engine/sense/readout.hpp"
#include "tasks/run/benchmark_options.hpp"

namespace tangere {

class BenchmarkFields {
 public:
  /// Throws InputError for compact frames of anything but whole fields and pictures of cameras.
  BenchmarkFields(const Model& model, int environments, const BenchmarkOptions& options,
                  FrameKind kind);

  [[nodiscard]] std::span<const FieldOutput> outputs() const { return outputs_; }
  /// Reads output `k` of all environments of a block. The precision of the readout must be that of
  /// the fields.
  void read(Readout& readout, const Batch& batch, int block, std::size_t k);
  /// Continues a checksum with the bits of the last reading: every point, whatever the frames keep.
  [[nodiscard]] std::uint64_t chain(std::uint64_t checksum, int environment, std::size_t k) const;

 private:
  template <template <class> class Frame, class T>
  using Store = std::vector<std::vector<Frame<T>>>;  // (outputs, environments); none for a sum
  /// (outputs, environments): pictures of a camera; none for other outputs.
  template <class T>
  using Pictures = std::vector<std::vector<std::vector<T>>>;
  void read_picture(Readout& readout, const Batch& batch, int block, std::size_t k);

  std::vector<FieldOutput> outputs_;
  std::vector<std::vector<FieldSum>> sums_;  // (outputs, environments); none for fields
  std::variant<std::monostate, Store<DenseFrame, double>, Store<DenseFrame, float>,
               Store<CompactFrame, double>, Store<CompactFrame, float>>
      frames_;
  Pictures<std::uint8_t> colours_;
  Pictures<std::int16_t> bodies_;
  Pictures<float> depths_;
};

/// Bytes that the fields of one environment take.
double field_bytes(const Model& model, const BenchmarkOptions& options, FrameKind kind);

}  // namespace tangere
