// SPDX-License-Identifier: Apache-2.0
// The public face of a compiled scene.
#include "engine/model/model.hpp"

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "engine/base/error.hpp"
#include "engine/model/compile.hpp"
#include "kernels/table/isa.hpp"

namespace tangere {
namespace {

// Bounds of the tolerance that follows the step. Below the first, evaluations chase rounding.
constexpr double kTightTolerance = 1e-9, kLooseTolerance = 1e-4;

}  // namespace

const CompiledModel& compiled(const Model& model) { return *model.compiled_; }

Model::Model(const Scene& scene) : compiled_(compile(scene)) {
  if (*kernels::isa_error() != '\0') throw InputError(kernels::isa_error());
}

const Scene& Model::scene() const { return compiled_->scene; }
int Model::nq() const { return compiled_->nq; }
int Model::nv() const { return compiled_->nv; }
int Model::nu() const { return compiled_->nu; }
int Model::nb() const { return static_cast<int>(compiled_->bodies.size()); }
int Model::moving_bodies() const {
  return static_cast<int>(std::ranges::count_if(
      compiled_->bodies, [](const CompiledBody& body) { return body.link >= 0; }));
}
double Model::mass(int body) const { return compiled_->bodies[std::size_t(body)].mass; }
double Model::timestep() const { return compiled_->scene.timestep; }
Integrator Model::integrator() const {
  return keeping_accuracy(compiled_->scene.integrator, solver().accuracy.value_or(0));
}
const SolverOptions& Model::solver() const { return compiled_->scene.solver; }
double Model::following_tolerance(Integrator integrator, double timestep) const {
  const double share = timestep / compiled_->fall_time;
  if (!(share > 0)) return kTightTolerance;  // there is no gravity, so nothing to compare h with
  const double tolerance =
      integrator.scheme().order > 1 ? 2.5e-3 * share * share * share : 1e-2 * share * share;
  return std::clamp(tolerance, kTightTolerance, kLooseTolerance);
}
std::span<const double> Model::initial_q() const { return compiled_->initial_q; }
bool Model::has_shear_state() const { return compiled_->has_shear_state(); }
bool Model::has_followers() const {
  return compiled_->has_followers() || !compiled_->transmissions.empty();
}
bool Model::has_transmissions() const { return !compiled_->transmissions.empty(); }
bool Model::has_loops() const { return !compiled_->loops.empty(); }
std::span<const SensorInfo> Model::sensors() const { return compiled_->sensor_info; }
std::span<const EndEffectorInfo> Model::end_effectors() const {
  return compiled_->end_effector_info;
}
std::span<const ContactInfo> Model::contacts() const { return compiled_->contact_info; }
std::span<const MeshInfo> Model::meshes() const { return compiled_->mesh_info; }
std::span<const EffectInfo> Model::effects() const { return compiled_->effects; }
std::span<const StageInfo> Model::stages() const { return compiled_->stages; }
std::span<const std::string> Model::q_names() const { return compiled_->q_names; }
std::span<const std::string> Model::v_names() const { return compiled_->v_names; }
std::span<const std::string> Model::u_names() const { return compiled_->u_names; }
std::span<const std::string> Model::q_units() const { return compiled_->q_units; }
std::span<const std::string> Model::v_units() const { return compiled_->v_units; }
std::span<const std::string> Model::u_units() const { return compiled_->u_units; }
std::span<const std::string> Model::body_names() const { return compiled_->body_names; }

std::size_t Model::state_bytes_per_environment() const {
  // Rows of the block, then status, iterations, residual, the history flag and the steps so far,
  // and the largest shear state.
  return sizeof(double) * compiled_->layout.rows + sizeof(std::int8_t) + sizeof(std::int32_t) +
         sizeof(double) + 1 + sizeof(std::int64_t) +
         kShearEntryBytes * std::size_t(compiled_->taped_points);
}

std::size_t numbers_of(const Model& model, const FieldOutput& output) {
  const std::size_t k = as_size(output.sensor);
  if (!is_view(output.form)) return numbers_of(model.sensors()[k], output.form);
  const CameraDescription& camera = model.scene().cameras[k];
  return numbers_of(camera.rows * camera.cols, output.form);
}

std::vector<std::size_t> reading_shape(const Model& model, const FieldOutput& output) {
  const std::size_t k = as_size(output.sensor);
  if (!is_view(output.form)) return reading_shape(model.sensors()[k], output.form);
  const CameraDescription& camera = model.scene().cameras[k];
  return {as_size(camera.rows), as_size(camera.cols), as_size(components_of(output.form))};
}

}  // namespace tangere
