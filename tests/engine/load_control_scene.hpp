// SPDX-License-Identifier: Apache-2.0
// The scene of the tests of <layer load="contact">, and the loads of its contacts by the kernels of
// a step.
#pragma once

#include <array>
#include <string>

#include "engine/model/compiled_layer.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/shear_anchors.hpp"
#include "engine/step/shear_lane.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/engine/runs.hpp"

namespace tangere::testing {

/// Attributes of the parts of gel_on_a_hinge().
struct LoadScene {
  std::string body = R"(type="sphere" radius="0.02")";
  std::string contact =
      R"(<surface_contact body1="table" body2="ball" kn="4e7" kt="2e4" mu="0.5" damping="1e8"/>)";
  std::string skin = R"(mu="0.7" ks="0" kt="4e5")", layer = R"(load="contact")";
  std::string more{};  ///< links
  std::string hinge = R"(type="revolute" axis="0 1 0" damping="0.01" stiffness="20")";
  std::string start = "0.002 0.001 0.0194";  ///< of the ball [m]
  int n = 22;
};

/// A gel of n × n points 0.6 mm apart on a table that turns a little. A body lies on it.
inline std::string gel_on_a_hinge(const LoadScene& s = {}) {
  const std::string half = std::to_string(0.3e-3 * (s.n - 1)), count = std::to_string(s.n);
  return R"(<tangere model="table">
<option unit="m-kg" gravity="0. 0. -10" timestep="1e-3" integrator="BDF1"/>
<solver_option tol="1e-12"/>
<robot>
<link name="table">
<joint name="table" pos="0 0 0" )" +
         s.hinge + R"(/>
<body name="table" type="cuboid" size="0.04 0.04 0.02" pos="0 0 -0.01" density="1000"/>
</link>
</robot>
<robot>
<link name="ball">
<joint name="ball" type="free3d" pos=")" +
         s.start + R"("/>
<body name="ball" )" +
         s.body + R"( density="3000"/>
</link>
</robot>)" +
         s.more + "<contact>" + s.contact + R"(</contact>
<sensor>
<tactile name="skin" body="table" type="rect_array" rect_pos0="-)" +
         half + " -" + half + R"( 0.01" rect_pos1=")" + half + " " + half +
         R"( 0.01" axis0="1 0 0" axis1="0 1 0" modulus="4e4" thickness="4e-3" resolution=")" +
         count + " " + count + "\" " + s.skin + R"(><layer cell="1.2e-3" margin="3e-3" )" +
         s.layer + R"(/></tactile>
</sensor>
</tangere>
)";
}

inline Scene parsed(const std::string& text) { return parse_scene(text, "gel.xml").scene; }

/// F, F x and F y of the contacts of a sensor, at the state of an environment, by the kernels.
inline std::array<double, 3> loads_by_kernels(const Batch& batch, int environment = 0,
                                              std::size_t number = 0) {
  const CompiledModel& m = compiled(batch.model());
  const CompiledSensor& sensor = m.sensors[number];
  const kernels::KernelTable& table = kernels::active_kernels();
  const double* const column = batch.block(environment / 16) + environment % 16;
  SingleWorkspace w(m);
  for (int i = 0; i < m.nq; ++i) w.q0[i][0] = w.stage.centre[i][0] = column[(m.layout.q + i) * 16];
  for (int i = 0; i < m.nv; ++i) {
    w.v0[i][0] = w.stage.r[i][0] = column[(m.layout.v + i) * 16];
    w.stage.x[i][0] = w.stage.s[i][0] = w.stage.tau[i][0] = w.stage.target[i][0] = 0;
  }
  w.stage.block = column;
  w.stage.group = 0;
  w.stage.c0_over_h[0] = 0;
  w.stage.inverse_h[0] = 1;
  w.shear.now[0] = batch.shear_state(environment);
  start_solve(m, table, w, 1U);
  begin_shear(m, table, w);
  const auto& kernel = table.stage<1>();
  kernel.kinematics(m.view, w.stage);
  clear_candidates(m, w);
  find_candidates(m, table, w, 1U);
  set_list_anchors(m, table, w, 1U);
  kernel.residual(m.view, w.stage, 0);
  AlignedVector<kernels::Row<1>> rows(6 * (m.link_pairs.size() + m.grounded.size()));
  kernel.contact_wrenches(m.view, w.stage, rows.data());
  AlignedVector<kernels::LinkPose<kernels::Row<1>>> poses(m.links.size());
  kernel.poses_at(m.view, w.stage, w.q0, w.v0, w.zero, poses.data());
  std::array<double, 3> sum{};
  for (std::size_t g = 0; g < m.link_pairs.size(); ++g) {
    const kernels::LinkPair& links = m.link_pairs[g];
    const bool first = links.link1 == sensor.link;
    if (!first && links.link2 != sensor.link) continue;
    const auto row = [&](std::size_t i) { return rows[6 * g + i][0]; };
    kernels::Vec6<double> wrench = {{row(0), row(1), row(2)}, {row(3), row(4), row(5)}};
    if (!first)
      wrench = wrench_to_child(relative(pose_of<1>(poses, links.link1, 0).world,
                                        pose_of<1>(poses, links.link2, 0).world),
                               -wrench);
    const kernels::Vec6<double> at = wrench_to_child(sensor.pad, wrench);
    const double o = sensor.layer->outward;
    sum[0] -= o * at.l.z, sum[1] += o * at.a.y, sum[2] -= o * at.a.x;
  }
  return sum;
}

/// The same of a field of the sensor, (n, n, 3), with points `pitch` apart.
inline std::array<double, 3> loads_in_field(const Model& model, const std::vector<double>& field,
                                            double pitch = 0.6e-3, std::size_t number = 0) {
  const CompiledSensor& sensor = compiled(model).sensors[number];
  std::array<double, 3> sum{};
  for (int i = 0; i < sensor.rows; ++i)
    for (int j = 0; j < sensor.cols; ++j) {
      const double f =
          model.sensors()[number].pressure_sign * field[std::size_t(3 * (i * sensor.cols + j) + 2)];
      sum[0] += f;
      sum[1] += f * pitch * (i - 0.5 * (sensor.rows - 1));
      sum[2] += f * pitch * (j - 0.5 * (sensor.cols - 1));
    }
  return sum;
}

inline std::vector<double> field_at(const Batch& batch, int environment = 0, int sensor = 0) {
  std::vector<double> field(std::size_t(3 * batch.model().sensors()[std::size_t(sensor)].points));
  Readout(batch.model()).tactile(batch, environment, sensor, field);
  return field;
}

}  // namespace tangere::testing
