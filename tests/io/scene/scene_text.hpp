// SPDX-License-Identifier: Apache-2.0
// A small complete scene as text, for tests that change one place at a time.
#pragma once

#include <stdexcept>
#include <string>

namespace tangere::testing {

// One element a line, so that messages can be checked for theirs.
inline const std::string kScene =
    R"(<tangere model="small">
<option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3" integrator="BDF2"/>
<solver_option tol="1e-9" max_iter="20"/>
<ground pos="0 0 0" normal="0 0 1"/>
<default><tactile kn="1" kt="0.01" mu="2"/></default>
<robot>
<link name="pad">
<joint name="pad_joint" type="translational" pos="0 0 0.06" damping="1"/>
<body name="pad" type="cuboid" size="0.05 0.05 0.01" density="1000" )"
    R"(general_contact_resolution="4 4 2"/>
</link>
<link name="ball">
<joint name="ball_joint" type="free3d" pos="0 0 0.02"/>
<body name="ball" type="sphere" radius="0.02" density="100"/>
</link>
</robot>
<actuator>
<motor joint="pad_joint" ctrl="force" ctrl_range="-1 1"/>
</actuator>
<contact>
<ground_contact body="ball" kn="5e3" kt="1" mu="0.8" damping="0.03"/>
<general_primitive_contact general_body="pad" primitive_body="ball" kn="5" kt="1" mu="1" )"
    R"(damping="1"/>
</contact>
<sensor>
<tactile name="skin" body="pad" type="rect_array" rect_pos0="-0.02 0.02 -0.005" )"
    R"(rect_pos1="0.02 -0.02 -0.005" axis0="0 -1 0" axis1="1 0 0" resolution="5 7" )"
    R"(damping="0.003"/>
</sensor>
<initial>
<joint name="ball_joint" q="0.001 0 0 1 0 0 0" v="0.1 0 0 0 2 0"/>
</initial>
<control>
<piecewise end="1">
<at time="0" value="0 0 0.2"/>
<at time="0.5" value="0.1 0 0.2"/>
</piecewise>
</control>
<randomize>
<joint name="ball_joint" q="0" uniform="-0.003 0.003"/>
<tactile name="skin" field="kt" log_uniform="0.005 0.02"/>
</randomize>
</tangere>
)";

/// The scene with one piece of text replaced; the piece must be there.
inline std::string with(const std::string& what, const std::string& by, std::string text = kScene) {
  const std::size_t at = text.find(what);
  if (at == std::string::npos) throw std::logic_error("not in the scene: " + what);
  return text.replace(at, what.size(), by);
}

}  // namespace tangere::testing
