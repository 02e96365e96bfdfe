// SPDX-License-Identifier: Apache-2.0
// Imported robots move as MuJoCo moves them: masses, poses, bias forces and accelerations at random
// states (tests/data/robots/make_reference.py).
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>

#include "engine/model/compile.hpp"
#include "engine/scene/mass_properties.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/motor_force.hpp"
#include "io/robot/robot_import.hpp"
#include "io/robot/rotations.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/engine/dense_dynamics.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using Dense = testing::DenseDynamics<double>;
using Vector = Eigen::VectorXd;
using Doubles = std::vector<double>;
const std::string kRobots = TANGERE_TEST_DATA "/robots/";
constexpr double kClose = 1e-9;

struct ReferenceState {
  std::map<std::string, Doubles> q, v, u, bias, acceleration;  // by joint
  std::map<std::string, Doubles> pose, site;                   // by body, by site
};
struct RobotReference {
  std::map<std::string, double> mass;
  std::vector<ReferenceState> states;
};

RobotReference read_reference(const std::string& path) {
  RobotReference out;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string kind, name;
    words >> kind >> name;
    if (kind.empty() || kind == "#") continue;
    Doubles numbers;
    for (double x = 0; words >> x;) numbers.push_back(x);
    if (kind == "mass") {
      out.mass[name] = numbers.at(0);
    } else if (kind == "state") {
      out.states.emplace_back();
    } else {
      ReferenceState& s = out.states.at(out.states.size() - 1);
      (kind == "q"              ? s.q
       : kind == "v"            ? s.v
       : kind == "u"            ? s.u
       : kind == "bias"         ? s.bias
       : kind == "acceleration" ? s.acceleration
       : kind == "pose"         ? s.pose
                                : s.site)[name] = numbers;
    }
  }
  return out;
}

/// Puts the numbers of each joint where the scene has them.
Vector in_order(const Scene& scene, const std::map<std::string, Doubles>& by_joint,
                int (*count)(JointType)) {
  Doubles all;
  for (const LinkDescription& link : scene.links) {
    const int n = count(link.joint.type);
    if (n == 0) continue;
    const auto numbers = by_joint.find(link.joint.name);
    if (numbers == by_joint.end() || static_cast<int>(numbers->second.size()) != n) {
      ADD_FAILURE() << "the reference has no " << n << " numbers of joint " << link.joint.name;
      return Vector::Zero(1000);
    }
    all.insert(all.end(), numbers->second.begin(), numbers->second.end());
  }
  return Eigen::Map<const Vector>(all.data(), static_cast<int>(all.size()));
}

void expect_close(const Vector& ours, const Vector& theirs, const char* what) {
  ASSERT_EQ(ours.size(), theirs.size());
  const double scale = std::max(1.0, theirs.cwiseAbs().maxCoeff());
  for (int i = 0; i < ours.size(); ++i)
    EXPECT_NEAR(ours[i], theirs[i], kClose * scale) << what << " " << i;
}

/// Accelerations by the kernels: the residual of a stage is linear in them.
Vector kernel_acceleration(const Scene& scene, const Vector& q, const Vector& v,
                           const std::vector<double>& u) {
  const auto m = compile(scene);
  testing::StageBuffers<double> b(*m);
  for (int i = 0; i < m->nq; ++i) b.centre[std::size_t(i)] = q[i];
  for (int i = 0; i < m->nv; ++i) b.r[std::size_t(i)] = v[i];
  for (std::size_t k = 0; k < m->motors.size(); ++k) {
    const CompiledMotor& motor = m->motors[k];
    const auto dof = std::size_t(motor.dof);
    if (motor.control == MotorControl::position)
      b.target[dof] = motor_input(motor, u[k]);
    else
      b.tau[dof] += force_at_start(*m, motor, nullptr, &u[k]);
  }
  const auto residual = [&](const Vector& a) {
    for (int i = 0; i < m->nv; ++i) b.s[std::size_t(i)] = a[i];
    b.residual(0, 1);
    return Vector(Eigen::Map<const Vector>(b.g.data(), m->nv));
  };
  const Vector rest = residual(Vector::Zero(m->nv));
  Eigen::MatrixXd mass(m->nv, m->nv);
  for (int k = 0; k < m->nv; ++k)
    mass.col(k) = (residual(1e3 * Vector::Unit(m->nv, k)) - rest) / 1e3;
  Vector a = mass.ldlt().solve(-rest);
  return a - mass.ldlt().solve(residual(a));
}

/// The scene starts as the reference's state does, and its motors get the same controls.
void expect_start(const Scene& scene, const Batch& batch, const Vector& q, const Vector& v,
                  const std::vector<double>& u) {
  const auto vector = [](const std::vector<double>& x) {
    return Vector(Eigen::Map<const Vector>(x.data(), static_cast<int>(x.size())));
  };
  std::vector<double> start_q(std::size_t(q.size())), start_v(std::size_t(v.size()));
  batch.get_q(0, start_q);
  batch.get_v(0, start_v);
  expect_close(vector(start_q), q, "start");
  expect_close(vector(start_v), v, "rates at the start");
  expect_close(vector(std::get<ConstantControl>(scene.control.value()).values), vector(u),
               "controls");
}

void compare(const std::string& robot, const std::string& name, const RobotOptions& options = {}) {
  const ImportedScene imported = import_robot(kRobots + robot, kRobots + "scene.xml", options);
  EXPECT_EQ(imported.lost, std::vector<std::string>());
  Scene scene = parse_scene(imported.text, kRobots + "scene.xml").scene;
  for (LinkDescription& link : scene.links) link.joint.limits.reset();
  const RobotReference reference = read_reference(kRobots + name);
  ASSERT_EQ(reference.states.size(), options.keyframe.empty() ? 5U : 6U);
  const Model model(scene);
  std::map<std::string, int> index;
  for (std::size_t i = 0; i < scene.links.size(); ++i)
    index[scene.links[i].name] = static_cast<int>(i);
  std::map<std::string, double> mass;
  for (std::size_t i = 0; i < scene.links.size(); ++i) {
    auto at = static_cast<int>(i);
    while (at >= 0 && !reference.mass.contains(scene.links[std::size_t(at)].name))
      at = scene.links[std::size_t(at)].parent;
    if (at >= 0) mass[scene.links[std::size_t(at)].name] += model.mass(static_cast<int>(i));
  }
  for (const auto& [body, kg] : reference.mass) EXPECT_NEAR(mass[body], kg, kClose * kg) << body;

  // The dense equations know no meshes: here these are given by mass and inertia.
  Scene plain = scene;
  for (LinkDescription& link : plain.links) {
    if (!std::holds_alternative<MeshShape>(link.body.shape)) continue;
    const MassProperties p = mass_properties(link.body.shape, link.body.density);
    const auto& I = p.inertia.m;
    link.body.shape =
        AbstractShape{p.mass, {I[0][0], I[0][1], I[0][2], I[1][1], I[1][2], I[2][2]}, {}};
    link.body.pose.position = outer_point(link.body.pose, {p.centre.x, p.centre.y, p.centre.z});
  }
  const Dense dense(plain);
  Batch batch(model, 1, 1);
  Readout readout(model);
  for (const ReferenceState& state : reference.states) {
    const Vector q = in_order(scene, state.q, position_count);
    const Vector v = in_order(scene, state.v, dof_count);
    ASSERT_EQ(q.size(), model.nq());
    std::vector<double> u;
    std::map<std::string, std::size_t> used;  // motors of a joint
    for (const MotorDescription& motor : scene.motors)
      u.push_back(state.u.at(motor.joint).at(used[motor.joint]++));
    if (!options.keyframe.empty() && &state == &reference.states.back())
      expect_start(scene, Batch(model, 1, 1), q, v, u);
    expect_close(dense.terms(q, v, u).bias, in_order(scene, state.bias, dof_count), "bias");
    const Vector theirs = in_order(scene, state.acceleration, dof_count);
    expect_close(dense.acceleration(q, v, u), theirs, "acceleration");
    expect_close(kernel_acceleration(scene, q, v, u), theirs, "acceleration by kernels");
    batch.set_state(0, {q.data(), std::size_t(q.size())}, {v.data(), std::size_t(v.size())});
    Doubles poses(7 * scene.links.size()), twists(6 * scene.links.size());
    readout.bodies(batch, 0, poses, twists);
    for (const auto& [body, pose] : state.pose) {
      const auto i = std::size_t(index.at(body));
      const double* const p = &poses[7 * i];
      const Pose at = compose({{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}},
                              inverse(scene.links[i].body.pose));
      const Quaternion& turn = at.orientation;
      const double sign =
          turn[0] * pose[3] + turn[1] * pose[4] + turn[2] * pose[5] + turn[3] * pose[6] < 0 ? -1
                                                                                            : 1;
      for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(at.position[k], pose[k], kClose) << body;
      for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(sign * turn[k], pose[3 + k], kClose) << body;
    }
    Doubles ends(3 * scene.end_effectors.size());
    readout.end_effectors(batch, 0, ends, {});
    for (std::size_t e = 0; e < scene.end_effectors.size(); ++e)
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(ends[3 * e + k], state.site.at(scene.end_effectors[e].name).at(k), kClose)
            << scene.end_effectors[e].name;
  }
}

TEST(RobotPhysics, UrdfMovesAsInMujoco) { compare("hand.urdf", "hand_reference.txt"); }
TEST(RobotPhysics, MassesOfMeshesAreThoseOfMujoco) {
  compare("meshes.xml", "meshes_reference.txt");
}
TEST(RobotPhysics, MjcfMovesAsInMujoco) {
  RobotOptions options;
  options.end_effectors = {"marker", "edge"};
  options.keyframe = "ready";
  compare("machine.xml", "machine_reference.txt", options);
}
TEST(RobotPhysics, OtherKindsOfMjcfMoveAsInMujoco) {
  RobotOptions options;
  options.keyframe = "thrown";
  compare("kinds.xml", "kinds_reference.txt", options);
}
TEST(RobotPhysics, ActuatorsAndLiftedBodiesAreThoseOfMujoco) {
  RobotOptions options;
  options.keyframe = "on";
  compare("servos.xml", "servos_reference.txt", options);
}
TEST(RobotPhysics, CopiesAndAttachedModelsMoveAsInMujoco) {
  RobotOptions options;
  options.keyframe = "set";
  options.end_effectors = {"mark-0", "mark-2"};
  compare("models.xml", "models_reference.txt", options);
}

}  // namespace
}  // namespace tangere
