// SPDX-License-Identifier: Apache-2.0
// One visit per block and sensor selects the kind of frame; the code below it does not check again.
#include "tasks/run/benchmark_fields.hpp"

#include <algorithm>
#include <type_traits>

#include "engine/base/as_size.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {
namespace {

using kernels::kBlock;
constexpr int kTileSide = 8;

template <class Frame>
std::vector<std::vector<Frame>> make(const Model& model, int environments) {
  std::vector<std::vector<Frame>> frames(model.sensors().size());
  for (std::size_t s = 0; s < frames.size(); ++s) {
    frames[s].reserve(as_size(environments));
    for (int e = 0; e < environments; ++e) frames[s].emplace_back(model, static_cast<int>(s));
  }
  return frames;
}

template <class T>
std::uint64_t chain_field(std::uint64_t checksum, const DenseFrame<T>& frame) {
  return chain_bits(checksum, frame.values());
}
template <class T>
std::uint64_t chain_field(std::uint64_t checksum, const CompactFrame<T>& frame) {
  std::vector<T> dense(frame.dense_size());
  frame.expand(dense);
  return chain_bits(checksum, std::span<const T>(dense));
}

template <class T>
double bytes_of(const SensorInfo& sensor, FrameKind kind) {
  if (kind == FrameKind::dense) return 3.0 * sensor.points * sizeof(T);
  const double tiles = double((sensor.rows + kTileSide - 1) / kTileSide) *
                       ((sensor.cols + kTileSide - 1) / kTileSide);
  return kind == FrameKind::none ? 0
                                 : tiles * (3.0 * kTileSide * kTileSide * sizeof(T) + sizeof(int));
}

}  // namespace

BenchmarkFields::BenchmarkFields(const Model& model, int environments, FrameKind kind,
                                 Precision precision) {
  const bool wide = precision == Precision::f64;
  if (kind == FrameKind::dense && wide) frames_ = make<DenseFrame<double>>(model, environments);
  if (kind == FrameKind::dense && !wide) frames_ = make<DenseFrame<float>>(model, environments);
  if (kind == FrameKind::compact && wide) frames_ = make<CompactFrame<double>>(model, environments);
  if (kind == FrameKind::compact && !wide) frames_ = make<CompactFrame<float>>(model, environments);
}

void BenchmarkFields::read(Readout& readout, const Batch& batch, int block, int sensor) {
  std::visit(
      [&](auto& store) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(store)>, std::monostate>) {
          auto& frames = store[as_size(sensor)];
          const std::size_t first = as_size(block * kBlock);
          readout.read_block(
              batch, block,
              std::span(frames).subspan(first, std::min(frames.size() - first, as_size(kBlock))));
        }
      },
      frames_);
}

std::uint64_t BenchmarkFields::chain(std::uint64_t checksum, int environment, int sensor) const {
  return std::visit(
      [&](const auto& store) {
        if constexpr (std::is_same_v<std::decay_t<decltype(store)>, std::monostate>) {
          return checksum;
        } else {
          return chain_field(checksum, store[as_size(sensor)][as_size(environment)]);
        }
      },
      frames_);
}

double field_bytes(const Model& model, FrameKind kind, Precision precision) {
  double bytes = 0;
  for (const SensorInfo& sensor : model.sensors())
    bytes += precision == Precision::f64 ? bytes_of<double>(sensor, kind)
                                         : bytes_of<float>(sensor, kind);
  return bytes;
}

}  // namespace tangere
