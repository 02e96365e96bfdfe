// SPDX-License-Identifier: Apache-2.0
// The scene of the tests of feedback="true".
#pragma once

#include <string>

namespace tangere::testing {

/// A ball of 0.1005 kg that slides onto a skin of 21 × 21 points on a table, 24 mm wide.
inline const std::string kTable = R"(<tangere model="table">
<option unit="m-kg" gravity="0. 0. -10" timestep="1e-3" integrator="BDF1"/>
<solver_option tol="1e-12"/>
<robot>
<link name="table">
<joint name="table" type="fixed" pos="0 0 0" quat="1 0 0 0"/>
<body name="table" type="cuboid" size="0.04 0.04 0.02" pos="0 0 -0.01" quat="1 0 0 0" )"
                                  R"(density="1000"/>
</link>
</robot>
<robot>
<link name="ball">
<joint name="ball" type="free3d-exp" pos="0 0 0.0199" quat="1 0 0 0"/>
<body name="ball" type="sphere" radius="0.02" density="3000" pos="0 0 0" quat="1 0 0 0"/>
</link>
</robot>
<sensor>
<tactile name="skin" body="table" type="rect_array" rect_pos0="-0.012 -0.012 0.01"
 rect_pos1="0.012 0.012 0.01" axis0="1 0 0" axis1="0 1 0" resolution="21 21" kn="400" kt="0.2"
 mu="0.7" damping="20" feedback="true"/>
</sensor>
<initial><joint name="ball" v="0.05 -0.02 0 0 0 3"/></initial>
</tangere>
)";

}  // namespace tangere::testing
