// SPDX-License-Identifier: Apache-2.0
// Applies the imperfections of a sensor to an ideal field, with tangent and pullback
// (equations in engine/scene/sensor_imperfections.hpp).
#pragma once

#include <span>

#include "engine/model/compiled_model.hpp"
#include "engine/scene/field_form.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

/// Key of the random numbers of a reading.
struct ReadingKey {
  std::uint64_t seed;
  std::int64_t episode, step;
};
ReadingKey key_of(const Batch& batch, int environment);

/// Components of a field: `count` from `first` on.
struct FieldPart {
  int first = 0, count = 3;
};
/// Returns those that a form is computed from.
inline FieldPart part_of(FieldForm form) {
  if (form == FieldForm::sum) return {0, 3};
  return {form == FieldForm::pressure ? 2 : 0, components_of(form)};
}

/// Owns the scratch of one thread. Allocates only when made, and only for a model with a sensor
/// that is imperfect. Functions of a sensor that is not change nothing.
class ImperfectField {
 public:
  explicit ImperfectField(const Model& model);

  /// Turns the ideal field of a sensor, (points, part.count) [N], after delay and low-pass, into
  /// its reading.
  void apply(const CompiledSensor& sensor, const ReadingKey& key, FieldPart part,
             std::span<double> field);

  /// Turn a change of the ideal field after delay and low-pass, (points, 3), into that of the
  /// reading, and the cotangent of the reading, (points, part.count), into that of this field. Dead
  /// and saturated numbers have no derivative; rounding passes derivatives straight through.
  /// `ideal`: the field, used only where the sensor saturates.
  void push_forward(const CompiledSensor& sensor, const ReadingKey& key,
                    std::span<const double> ideal, std::span<double> change);
  void pull_back(const CompiledSensor& sensor, const ReadingKey& key, FieldPart part,
                 std::span<const double> ideal, std::span<double> cotangent);

 private:
  void spread(const CompiledSensor& sensor, int components, bool back, std::span<double> field);
  void share(const CompiledSensor& sensor, int components, std::span<double> field);
  void scale_by_slope(const CompiledSensor& sensor, const ReadingKey& key, FieldPart part,
                      std::span<const double> ideal, std::span<double> change);
  std::vector<double> before_, shared_;  // fields before crosstalk; ideal ones after it
};

/// Throws InputError for a sensor with lag: its reading depends on more than one state.
void check_has_no_lag(const Model& model, int sensor);

/// Computes the ideal field of a sensor, (points, 3), after PadReader::find_touches(). `arguments`:
/// those of the reader for one lane of a group.
void read_ideal(PadReader& reader, const CompiledSensor& sensor,
                kernels::TactileArgs<double> arguments, std::span<double> field);

/// Leaves friction out of the kernels' arguments. `touches`: what they then point to.
inline void without_friction(kernels::TactileArgs<double>& arguments,
                             std::vector<kernels::Touch<double>>& touches) {
  touches.assign(arguments.touches, arguments.touches + arguments.n_touches);
  for (kernels::Touch<double>& t : touches) t.law.kt = t.law.mu = 0;
  arguments.touches = touches.data();
}

}  // namespace tangere
