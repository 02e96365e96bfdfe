// SPDX-License-Identifier: Apache-2.0
// Checks of arguments, then the parts of the implementation.
#include "engine/sense/readout.hpp"

#include <algorithm>
#include <array>

#include "engine/sense/readout_checks.hpp"
#include "engine/sense/readout_impl.hpp"

namespace tangere {

using kernels::kBlock;

Readout::Readout(const Model& model, Precision precision)
    : impl_(std::make_unique<Impl>(model, precision)) {}
Readout::~Readout() = default;
Readout::Readout(Readout&&) noexcept = default;
Readout& Readout::operator=(Readout&&) noexcept = default;
Precision Readout::precision() const { return impl_->precision; }
std::int64_t Readout::loads_not_carried() const { return impl_->layered.loads_not_carried(); }

void Readout::bodies(const Batch& batch, int environment, std::span<double> pose,
                     std::span<double> twist, std::span<const int> chosen) {
  check_environment(impl_->model, batch, environment);
  read_bodies(compiled(impl_->model), impl_->reader, batch, environment, pose, twist, chosen);
}
void Readout::end_effectors(const Batch& batch, int environment, std::span<double> position,
                            std::span<double> velocity) {
  check_environment(impl_->model, batch, environment);
  tangere::read_end_effectors(compiled(impl_->model), impl_->reader, batch, environment, position,
                              velocity);
}
void Readout::read_end_effectors(const Batch& batch, int block,
                                 std::span<const std::span<double>> positions) {
  check_block(impl_->model, batch, block, "positions of end effectors", positions,
              3 * impl_->model.end_effectors().size());
  tangere::read_end_effectors(compiled(impl_->model), impl_->reader, batch, block, positions);
}
void Readout::end_effector_jacobian(const Batch& batch, int environment,
                                    std::span<double> jacobian) {
  check_environment(impl_->model, batch, environment);
  read_end_effector_jacobian(compiled(impl_->model), impl_->reader, batch, environment, jacobian);
}

void Readout::tactile(const Batch& batch, int environment, int sensor, std::span<double> force) {
  impl_->tactile(batch, environment, sensor, force);
}
void Readout::tactile(const Batch& batch, int environment, int sensor, std::span<float> force) {
  impl_->tactile(batch, environment, sensor, force);
}

template <class T>
void Readout::read(const Batch& batch, int environment, DenseFrame<T>& frame) {
  check_frame(impl_->model, batch, environment, frame.model());
  impl_->place(batch, environment, frame.sensor_);
  impl_->refresh(batch, environment, frame);
}

template <class T>
void Readout::read(const Batch& batch, int environment, CompactFrame<T>& frame) {
  check_frame(impl_->model, batch, environment, frame.model());
  impl_->place(batch, environment, frame.sensor_);
  impl_->compact(batch, environment, frame);
}

void Readout::read_block(const Batch& batch, int block, FieldOutput output,
                         std::span<const std::span<double>> readings) {
  impl_->block_spans(batch, block, output, readings);
}
void Readout::read_block(const Batch& batch, int block, FieldOutput output,
                         std::span<const std::span<float>> readings) {
  impl_->block_spans(batch, block, output, readings);
}

void Readout::read_block(const Batch& batch, int block, FieldOutput output,
                         std::span<const std::span<std::uint8_t>> pictures) {
  Impl& m = *impl_;
  if (!is_colour(output.form))
    throw InputError(std::string("bytes of the reading '") + to_string(output.form) +
                     "'; expected rgb or rgb_marker");
  if (is_view(output.form)) return m.view_block(batch, block, output, pictures);
  checked_index("sensor", output.sensor, std::ssize(m.model.sensors()));
  m.check_has(output);
  check_block(m.model, batch, block, "picture", pictures,
              numbers_of(m.model.sensors()[std::size_t(output.sensor)], output.form));
  m.place_block(batch, block, output.sensor);
  for (int e = 0; e < Impl::environments_of(batch, block); ++e)
    m.write_picture(batch, kBlock * block + e, output, pictures[std::size_t(e)].data());
}

void Readout::read_block(const Batch& batch, int block, FieldOutput output,
                         std::span<const std::span<std::int16_t>> numbers) {
  if (output.form != FieldForm::view_ids)
    throw InputError(std::string("whole numbers of the reading '") + to_string(output.form) +
                     "'; expected ids of a camera");
  impl_->view_block(batch, block, output, numbers);
}

template <class T>
void Readout::read_block(const Batch& batch, int block, std::span<DenseFrame<T>> frames) {
  check_frames(impl_->model, batch, block, std::span<const DenseFrame<T>>(frames));
  if (frames.empty()) return;
  std::array<T*, kBlock> dense{};
  const bool whole = impl_->together(batch, block, frames[0].sensor_);
  for (std::size_t e = 0; e < std::min(frames.size(), std::size_t(kBlock)); ++e) {
    dense[e] = frames[e].values_.data();
    if (whole)
      // A later reading of one of them alone must find all tiles in its list.
      frames[e].mark_all();
  }
  impl_->block<T>(batch, block, {frames[0].sensor_, frames[0].form_}, dense, [&](int e) {
    impl_->refresh(batch, kBlock * block + e, frames[std::size_t(e)]);
  });
}

template <class T>
void Readout::read_block(const Batch& batch, int block, std::span<CompactFrame<T>> frames) {
  check_frames(impl_->model, batch, block, std::span<const CompactFrame<T>>(frames));
  if (frames.empty()) return;
  impl_->place_block(batch, block, frames[0].sensor_);
  const int environments = Impl::environments_of(batch, block);
  for (int e = 0; e < environments; ++e)
    impl_->compact(batch, kBlock * block + e, frames[std::size_t(e)]);
}

template void Readout::read(const Batch&, int, DenseFrame<float>&);
template void Readout::read(const Batch&, int, DenseFrame<double>&);
template void Readout::read(const Batch&, int, CompactFrame<float>&);
template void Readout::read(const Batch&, int, CompactFrame<double>&);
template void Readout::read_block(const Batch&, int, std::span<DenseFrame<float>>);
template void Readout::read_block(const Batch&, int, std::span<DenseFrame<double>>);
template void Readout::read_block(const Batch&, int, std::span<CompactFrame<float>>);
template void Readout::read_block(const Batch&, int, std::span<CompactFrame<double>>);

}  // namespace tangere
