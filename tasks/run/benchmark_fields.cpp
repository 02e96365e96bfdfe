// SPDX-License-Identifier: Apache-2.0
// One visit per block and sensor selects the kind of frame; the code below it does not check again.
#include "tasks/run/benchmark_fields.hpp"

#include <algorithm>
#include <type_traits>

#include "engine/base/as_size.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/block_reader.hpp"
#include "tasks/run/checksum.hpp"

namespace tangere {
namespace {

using kernels::kBlock;
constexpr int kTileSide = 8;

template <class T>
DenseFrame<T> make_frame(const Model& model, FieldOutput of, const DenseFrame<T>*) {
  return {model, of.sensor, of.form};
}
template <class T>
CompactFrame<T> make_frame(const Model& model, FieldOutput of, const CompactFrame<T>*) {
  if (of.form != FieldForm::field)
    throw InputError("compact frames of a " + std::string(to_string(of.form)) +
                     "; expected whole fields, or dense frames");
  return {model, of.sensor};
}

template <class Frame>
std::vector<std::vector<Frame>> make(const Model& model, std::span<const FieldOutput> outputs,
                                     int environments) {
  std::vector<std::vector<Frame>> frames(outputs.size());
  for (std::size_t k = 0; k < frames.size(); ++k) {
    if (outputs[k].form == FieldForm::sum || is_view(outputs[k].form)) continue;
    frames[k].reserve(as_size(environments));
    for (int e = 0; e < environments; ++e)
      frames[k].push_back(make_frame(model, outputs[k], static_cast<const Frame*>(nullptr)));
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
double bytes_of(const SensorInfo& sensor, FieldForm form, FrameKind kind) {
  if (kind == FrameKind::none) return 0;
  if (form == FieldForm::sum) return sizeof(FieldSum);
  if (kind == FrameKind::dense) return static_cast<double>(numbers_of(sensor, form) * sizeof(T));
  const auto tiles_along = [](int points) { return (points + kTileSide - 1) / kTileSide; };
  return double(tiles_along(sensor.rows)) * tiles_along(sensor.cols) *
         (3.0 * kTileSide * kTileSide * sizeof(T) + sizeof(int));
}

template <class T>
std::uint64_t chain_picture(std::uint64_t checksum, const std::vector<T>& picture) {
  return chain_bits(checksum,
                    std::span<const float>(std::vector<float>(picture.begin(), picture.end())));
}

}  // namespace

BenchmarkFields::BenchmarkFields(const Model& model, int environments,
                                 const BenchmarkOptions& options, FrameKind kind)
    : outputs_(kind == FrameKind::none ? std::vector<FieldOutput>{}
                                       : fields_of(model, options.rollout.outputs)),
      sums_(outputs_.size()),
      colours_(outputs_.size()),
      bodies_(outputs_.size()),
      depths_(outputs_.size()) {
  const bool wide = options.precision == Precision::f64;
  const auto all = [&]<class Frame>() { frames_ = make<Frame>(model, outputs_, environments); };
  if (kind == FrameKind::dense && wide) all.template operator()<DenseFrame<double>>();
  if (kind == FrameKind::dense && !wide) all.template operator()<DenseFrame<float>>();
  if (kind == FrameKind::compact && wide) all.template operator()<CompactFrame<double>>();
  if (kind == FrameKind::compact && !wide) all.template operator()<CompactFrame<float>>();
  for (std::size_t k = 0; k < outputs_.size(); ++k)
    if (outputs_[k].form == FieldForm::sum) sums_[k].resize(as_size(environments));
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    if (!is_view(outputs_[k].form)) continue;
    const std::size_t own = own_bytes(outputs_[k].form), width = numbers_of(model, outputs_[k]),
                      count = as_size(environments);
    if (own == 1)
      colours_[k].assign(count, std::vector<std::uint8_t>(width));
    else if (own == 2)
      bodies_[k].assign(count, std::vector<std::int16_t>(width));
    else
      depths_[k].assign(count, std::vector<float>(width));
  }
}

void BenchmarkFields::read_picture(Readout& readout, const Batch& batch, int block, std::size_t k) {
  const auto into = [&]<class T>(std::vector<std::vector<T>>& pictures) {
    if (!pictures.empty())
      read_field<T>(readout, batch, block, outputs_[k],
                    [&](int e) { return std::span(pictures[as_size(e)]); });
  };
  into(colours_[k]);
  into(bodies_[k]);
  into(depths_[k]);
}

void BenchmarkFields::read(Readout& readout, const Batch& batch, int block, std::size_t k) {
  if (is_view(outputs_[k].form)) return read_picture(readout, batch, block, k);
  if (outputs_[k].form == FieldForm::sum) {
    read_field<double>(readout, batch, block, outputs_[k],
                       [&](int e) { return std::span(sums_[k][as_size(e)]); });
    return;
  }
  std::visit(
      [&](auto& store) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(store)>, std::monostate>) {
          auto& frames = store[k];
          const std::size_t first = as_size(block * kBlock);
          readout.read_block(
              batch, block,
              std::span(frames).subspan(first, std::min(frames.size() - first, as_size(kBlock))));
        }
      },
      frames_);
}

std::uint64_t BenchmarkFields::chain(std::uint64_t checksum, int environment, std::size_t k) const {
  if (outputs_[k].form == FieldForm::sum)
    return chain_bits(checksum, std::span<const double>(sums_[k][as_size(environment)]));
  if (!colours_[k].empty()) return chain_picture(checksum, colours_[k][as_size(environment)]);
  if (!bodies_[k].empty()) return chain_picture(checksum, bodies_[k][as_size(environment)]);
  if (!depths_[k].empty()) return chain_picture(checksum, depths_[k][as_size(environment)]);
  return std::visit(
      [&](const auto& store) {
        if constexpr (std::is_same_v<std::decay_t<decltype(store)>, std::monostate>) {
          return checksum;
        } else {
          return chain_field(checksum, store[k][as_size(environment)]);
        }
      },
      frames_);
}

double field_bytes(const Model& model, const BenchmarkOptions& options, FrameKind kind) {
  double bytes = 0;
  for (const FieldOutput of : fields_of(model, options.rollout.outputs)) {
    if (is_view(of.form) && kind != FrameKind::none)
      bytes += static_cast<double>(numbers_of(model, of) *
                                   (own_bytes(of.form) > 0 ? own_bytes(of.form) : sizeof(float)));
    if (is_view(of.form)) continue;
    const SensorInfo& sensor = model.sensors()[as_size(of.sensor)];
    bytes += options.precision == Precision::f64 ? bytes_of<double>(sensor, of.form, kind)
                                                 : bytes_of<float>(sensor, of.form, kind);
  }
  return bytes;
}

}  // namespace tangere
