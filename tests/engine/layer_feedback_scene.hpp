// SPDX-License-Identifier: Apache-2.0
// The scene of the tests of <layer feedback="true">, and what one environment's layers exert there.
#pragma once

#include <string>

#include "engine/step/layer_sums.hpp"
#include "engine/step/shear_anchors.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere::testing {

/// A gel of n × n points 1.2 mm apart and 4 mm thick, on which a body of 0.1 kg or so slides and
/// turns. `body`: attributes of its shape. `skin`, `layer`: more attributes of these.
inline std::string gel_table(const std::string& body = R"(type="sphere" radius="0.02")",
                             const std::string& skin = R"(mu="0.7")", int n = 21,
                             const std::string& layer = R"(margin="3e-3")") {
  const std::string half = std::to_string(0.6e-3 * (n - 1)), count = std::to_string(n);
  return R"(<tangere model="table">
<option unit="m-kg" gravity="0. 0. -10" timestep="1e-3" integrator="BDF1"/>
<solver_option tol="1e-12"/>
<robot>
<link name="table">
<joint name="table" type="fixed" pos="0 0 0" quat="1 0 0 0"/>
<body name="table" type="cuboid" size="0.04 0.04 0.02" pos="0 0 -0.01" density="1000"/>
</link>
</robot>
<robot>
<link name="ball">
<joint name="ball" type="free3d" pos="0 0 0.0195"/>
<body name="ball" )" +
         body + R"( density="3000"/>
</link>
</robot>
<sensor>
<tactile name="skin" body="table" type="rect_array" rect_pos0="-)" +
         half + " -" + half + R"( 0.01" rect_pos1=")" + half + " " + half +
         R"( 0.01" axis0="1 0 0" axis1="0 1 0" modulus="4e4" thickness="4e-3" resolution=")" +
         count + " " + count + "\" " + skin + R"(><layer feedback="true" )" + layer +
         R"(/></tactile>
</sensor>
<initial><joint name="ball" v="0.05 -0.02 0 0 0 3"/></initial>
</tangere>
)";
}

inline Model gel_model(const std::string& text) {
  return Model(parse_scene(text, "gel.xml").scene);
}

/// One environment's layers at a state without history.
class LayerProbe {
 public:
  explicit LayerProbe(const Model& model)
      : model_(model), m_(compiled(model_)), w_(m_), table_(kernels::active_kernels()) {}

  /// Places the links at (q, v), which are the start of the solve as well.
  void place(const std::vector<double>& q, const std::vector<double>& v) {
    for (int i = 0; i < m_.nq; ++i) w_.q0[i][0] = w_.stage.centre[i][0] = q[std::size_t(i)];
    for (int i = 0; i < m_.nv; ++i) {
      w_.v0[i][0] = w_.stage.r[i][0] = v[std::size_t(i)];
      w_.stage.x[i][0] = w_.stage.s[i][0] = w_.stage.tau[i][0] = w_.stage.target[i][0] = 0;
    }
    w_.stage.c0_over_h[0] = 0;
    w_.stage.inverse_h[0] = 1;
    start_solve(m_, table_, w_, 1U);
    begin_shear(m_, table_, w_);
    find();
  }
  /// Computes g, and A if `derivatives`, at the present x and rates.
  void evaluate(bool derivatives) {
    find();
    set_layer_sums(m_, table_, w_, 1U, derivatives);
    const auto& kernel = table_.stage<1>();
    (derivatives ? kernel.evaluate : kernel.residual)(m_.view, w_.stage, 0);
  }
  /// Returns the sum of the wrenches of layers on the first links of their pairs.
  std::array<double, 6> wrench() {
    set_layer_sums(m_, table_, w_, 1U, false);
    std::array<double, 6> out{};
    for (int pair = 0; pair < m_.layer_link_pairs; ++pair)
      for (std::size_t i = 0; i < out.size(); ++i)
        out[i] += w_.stage.layer_sums[std::size_t(kernels::kPairSumNumbers * pair) + i][0];
    return out;
  }
  /// Returns the energy that the layers store [J].
  double energy() {
    set_layer_sums(m_, table_, w_, 1U, false);
    double sum = 0;
    for_each_layer(m_, w_, [&](const kernels::LinkPair& links, int pad) {
      solve_layer(m_, table_, w_, links, pad, 0);
      sum += w_.layer_contact->energy();
    });
    return sum;
  }
  /// Sets the poses of the links at the start of the solve.
  void find_poses() {
    table_.stage<1>().poses_at(m_.view, w_.stage, w_.q0, w_.v0, w_.zero, w_.poses_before.data());
  }
  SingleWorkspace& work() { return w_; }
  const CompiledModel& compiled_model() const { return m_; }

 private:
  void find() {
    table_.stage<1>().kinematics(m_.view, w_.stage);
    clear_candidates(m_, w_);
    find_candidates(m_, table_, w_, 1U);
    set_list_anchors(m_, table_, w_, 1U);
  }

  Model model_;
  const CompiledModel& m_;
  SingleWorkspace w_;
  const kernels::KernelTable& table_;
};

}  // namespace tangere::testing
