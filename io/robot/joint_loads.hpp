// SPDX-License-Identifier: Apache-2.0
// Forces that limits and loops of an imported robot should hold: their stiffness follows from them.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "engine/model/model.hpp"
#include "io/robot/robot.hpp"

namespace tangere {

/// The load of a joint is the largest of the weight of what hangs on it at its distance, the file's
/// effort, and the forces of its motors and of motors on tendons along it. Of a joint without mass
/// it includes those of the joints that it follows.
class JointLoads {
 public:
  /// What should hold a load. A limit holds of a position motor without a range of its force what
  /// presses against it where a target is beyond it. A loop holds its force at any place of the
  /// joint.
  enum class Holder { limit, loop };

  JointLoads(const Robot& robot, Holder holder);

  /// Of the joint of a link of the scene [N], [N m].
  [[nodiscard]] double load(std::size_t link);
  /// The force at a point of the world on a link with which the joints on the way to it can load
  /// a loop [N].
  [[nodiscard]] double load_at(std::size_t link, const Vector3& point);

  /// Where a point of a link's body is in the world with all joints at 0.
  [[nodiscard]] Vector3 place(std::size_t link, const Vector3& in_body) const;
  /// How far a point of the world is from a joint [m].
  [[nodiscard]] double distance(std::size_t joint, const Vector3& point) const;

 private:
  using Range = std::array<double, 2>;
  /// Force of a joint per force of the tendon of a link, at most [m], or without a unit.
  struct Arm {
    std::size_t joint;
    double length;
  };
  struct Tendon {
    std::size_t link;  ///< whose joint has no mass
    std::vector<Arm> arms;
  };

  [[nodiscard]] double whole_weight() const;
  [[nodiscard]] double weight(std::size_t link) const;
  [[nodiscard]] std::size_t link_of_joint(const std::string& name) const;
  [[nodiscard]] int link_of_body(const std::string& name) const;
  /// Largest arm of a force at a point, or for a slide its share, on a joint above it.
  [[nodiscard]] double arm(std::size_t joint, const Vector3& point) const;
  void list_tendons();
  [[nodiscard]] std::vector<Arm> path_arms(const TransmissionDescription& path) const;
  [[nodiscard]] std::vector<Arm> wrench_arms(const TransmissionDescription& wrench) const;
  [[nodiscard]] const Tendon* tendon_of(std::size_t link) const;
  /// Where a joint of one dof may be by its limits, or those of the joints of its tendon.
  [[nodiscard]] Range places(std::size_t link) const;
  [[nodiscard]] double position_force(const MotorDescription& motor, std::size_t link) const;
  /// The largest force of the motors of a joint.
  [[nodiscard]] double motors(std::size_t link) const;

  const Robot& robot_;
  const Scene& scene_;
  Holder holder_;
  Model model_;
  std::vector<Pose> at_;  ///< of links in the world with all joints at 0
  std::vector<Tendon> tendons_;
  std::vector<std::optional<double>> known_;  ///< loads
};

}  // namespace tangere
