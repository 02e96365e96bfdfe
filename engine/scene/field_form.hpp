// SPDX-License-Identifier: Apache-2.0
// Quantities of a sensor: its whole field, pressure, shear, flow, sum, displacements of markers and
// of the surface, channels of its hardware, or pictures of its gel; and those of a camera. Only
// requested quantities are
// computed and stored.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/scene/output_times.hpp"
#include "engine/scene/scene.hpp"

namespace tangere {

enum class FieldForm {
  field,       ///< (points, 3) [N]: f·axis0, f·axis1, -f·(axis0 × axis1)
  pressure,    ///< (points, 1) [N]: the third of these, without friction (docs/outputs.md)
  shear,       ///< (points, 2) [N]: the first two
  sum,         ///< (6): force on the body [N], then where it presses [m], body axes
  ideal,       ///< the field without the sensor's imperfections
  markers,     ///< (points, 2) [m]: where the ideal field pushes them, along axis0 and axis1
  surface,     ///< (points, 3) [m]: how a layer's surface moves, the third number out of the layer
  flow,        ///< (points, 2): the shear over its largest length on this sensor; 0 without shear
  channels,    ///< (channels) what its hardware returns, in the map's unit (docs/channels.md)
  height,      ///< (height, width, 1) [m]: a gel's surface in a picture, towards the camera
  rgb,         ///< (height, width, 3), 0 to 255: a picture of a gel (docs/pictures.md)
  rgb_marker,  ///< the same with printed markers
  view_rgb,    ///< (height, width, 3), 0 to 255: what a camera of the scene sees
  view_depth,  ///< (height, width, 1) [m]: along the camera's axis
  view_ids,    ///< (height, width, 1): number of the body; -1 nothing, one after the last: ground
};

/// Force x y z on the body [N], then its centre x y z [m]: the mean of the points' places, each
/// weighted by the third number of its field where that presses. Body axes; the centre is 0 where
/// nothing presses.
using FieldSum = std::array<double, 6>;

/// The words of files and options: "field", "pressure", "shear", "sum", "ideal", "markers",
/// "surface", "flow", "channels", "height", "rgb", "rgb_marker"; of a camera "rgb", "depth", "ids".
const char* to_string(FieldForm form);

/// Numbers of a point, or of a pixel; 0 for a sum and for channels.
int components_of(FieldForm form);
/// Numbers of a whole reading that is no picture and has no channels.
std::size_t numbers_of(int points, FieldForm form);

/// One reading of one sensor or camera.
struct FieldOutput {
  int sensor = 0;  ///< of a form of cameras: the camera
  FieldForm form = FieldForm::field;
  OutputTimes times = {};  ///< none: as often as the run reads this sensor
  friend bool operator==(const FieldOutput&, const FieldOutput&) = default;
};

/// Whether a reading is that of an ideal sensor, whatever the sensor's imperfections: the ideal
/// field, how it moves markers and the surface, channels, which have flaws of their own, and
/// pictures.
bool is_ideal(FieldForm form);
/// Whether a reading is that of a camera, not of a sensor.
inline bool is_view(FieldForm form) { return form >= FieldForm::view_rgb; }
/// Whether a reading is a picture: its shape is that of <picture> or <camera>.
inline bool is_picture(FieldForm form) { return form >= FieldForm::height; }
/// Whether a reading is a picture in colours, which files keep as bytes.
inline bool is_colour(FieldForm form) {
  return form == FieldForm::rgb || form == FieldForm::rgb_marker || form == FieldForm::view_rgb;
}
/// Bytes of a number whose type does not follow the precision of a run: 1 of colours (uint8), 2 of
/// numbers of bodies (int16), else 0.
inline std::size_t own_bytes(FieldForm form) {
  return is_colour(form) ? 1 : form == FieldForm::view_ids ? 2 : 0;
}
/// Whether a reading has displacements [m].
inline bool is_displacement(FieldForm form) {
  return form == FieldForm::markers || form == FieldForm::surface;
}

/// Returns the output from which a reading is computed: for a flow the shear, else itself.
inline FieldOutput undivided(FieldOutput of) {
  if (of.form == FieldForm::flow) of.form = FieldForm::shear;
  return of;
}

/// All of sensors, in the order of the enumeration.
std::span<const FieldForm> field_forms();
/// All of cameras.
std::span<const FieldForm> view_forms();

/// Returns "pad" for a field, else "pad.pressure", "pad.shear", "pad.sum", "pad.ideal",
/// "pad.markers", "pad.surface", "pad.flow", "pad.channels", "pad.height", "pad.rgb" or
/// "pad.rgb_marker".
std::string output_name(const std::string& sensor, FieldForm form);
/// Returns the names of a scene's sensors, in file order.
std::vector<std::string> sensor_names(const Scene& scene);
/// Returns the name of the sensor or camera of an output.
const std::string& source_name(const Scene& scene, const FieldOutput& output);
/// Whether a name is that of an output of no sensor: q, v, variables (positions of end effectors),
/// bodies (poses and twists), memory (the shear state) or transmissions (their forces).
bool is_plain_output(const std::string& name);
/// Returns the reading of this name; none where no sensor has it.
std::optional<FieldOutput> find_output(std::span<const std::string> sensors,
                                       const std::string& name);
/// The same of a scene's sensors and cameras.
std::optional<FieldOutput> find_output(const Scene& scene, const std::string& name);
/// Returns the name of the motion of one body: "bodies.box".
std::string body_output(const std::string& body);
/// Returns the index of the body whose motion has this name, "bodies.box"; none where there is no
/// such body.
std::optional<int> find_body_output(const Scene& scene, const std::string& name);
/// Whether a scene has an output of this name, with or without times: "q/final", "bodies.box".
/// Throws InputError as split_times() does.
bool has_output(const Scene& scene, const std::string& word);
/// Returns why a scene lacks a reading, as in "sensor 'pad' has no <markers>"; "" where it has it.
std::string reason_against(const Scene& scene, const FieldOutput& output);
/// Throws InputError for a sensor or camera that is not there and for an output that is listed
/// twice.
void check_outputs(const Scene& scene, std::span<const FieldOutput> outputs);
/// Returns the field of every sensor: the outputs of a scene without <outputs>.
std::vector<FieldOutput> whole_fields(const Scene& scene);
/// Returns the outputs of sensors and cameras of the scene's <outputs>, with their times; without
/// it, the field of every sensor.
std::vector<FieldOutput> requested_fields(const Scene& scene);
/// Returns all names of outputs, the plain ones included.
std::vector<std::string> output_names(std::span<const std::string> sensors);
/// The same with those of cameras and the names of single bodies.
std::vector<std::string> output_names(const Scene& scene);

}  // namespace tangere
