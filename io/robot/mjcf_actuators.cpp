// SPDX-License-Identifier: Apache-2.0
// Actuators on hinges, slides and fixed tendons. With the gear G the length of the transmission is
// G (q + ref), where q is the scene's coordinate. The force f of the actuator acts on the joint as
// G f:
//   f = g c + b - kp G (q + ref) - kv G v
//   kp > 0    a position motor: P = kp G², D = kv G², target (g c + b)/(kp G) - ref
//   kp = 0    a force motor G (g c + b), and damping kv G² of the joint or, with a forcerange, D
//             of the motor
// motor: g = 1; position: g = kp; velocity: g = kv; all with b = 0. With dampratio Z instead of kv,
// D = 2 Z sqrt(P I), I = 1/(M⁻¹)jj where all joints are at rest, which is kv = 2 Z sqrt(kp m) with
// m = 1/(J M⁻¹ Jᵀ). The scene's control is the file's c.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "io/robot/effective_inertia.hpp"
#include "io/robot/mjcf_file.hpp"
#include "io/robot/mjcf_words.hpp"

namespace tangere {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();
using Range = std::array<double, 2>;

/// Force per control and per state: f = gain c + bias - kp G (q + ref) - kv G v.
struct Law {
  double gain = 1, bias = 0, kp = 0, kv = 0;
  double damping_ratio = 0;  ///< from which kv follows, if it is not 0
};

const char* joint_attribute(const RobotNode& node) {
  return node.has("jointinparent") ? "jointinparent" : "joint";
}

class Actuators {
 public:
  explicit Actuators(MjcfWhole& whole) : whole_(whole), scene_(whole.robot.scene) {}

  /// `drives`: the name in the scene of the joint that the actuator names; "" if there is none.
  void read(const RobotNode& node, const MjcfScope& scope, const std::string& drives) {
    whole_.motors.push_back(-1);
    if (std::find(kActuators.begin(), kActuators.end(), node.name()) == kActuators.end())
      return node.lost("<" + node.name() + ">: an actuator that scenes do not have");
    node.check(mjcf_words(node.name()));
    const int group = node.integer("group", 0, std::numeric_limits<int>::max(), 0);
    if (std::find(whole_.disabled_groups.begin(), whole_.disabled_groups.end(), group) !=
        whole_.disabled_groups.end())
      return node.changed("<" + node.name() +
                          "> of a group that <option actuatorgroupdisable> switches off: no motor");
    Law law;
    if (!read_law(node, law)) return;
    if (!drives_joint(node, drives)) return;
    const std::string& name = drives;
    const MjcfJoint& end = whole_.joints.at(name);
    LinkDescription& link = scene_.links[std::size_t(end.link)];
    if (link.joint.type != JointType::revolute && link.joint.type != JointType::prismatic)
      return node.lost("<" + node.name() + "> of a ball or a free joint");
    // That of a site is in its wrench.
    const double gear = node.has("gear") && !node.has("site") ? node.numbers("gear").at(0) : 1;
    if (node.has("gear") && gear == 0) node.fail("gear=\"0\"; expected another number");
    MotorDescription motor;
    motor.joint = name;
    motor.name = free_name(name, scope.full_name(node.text("name", name)));
    motor.source = node.source();
    motor.u_range = control_range(node, *scope.file, end);
    Range force = scaled(range(node, *scope.file, "forcerange", "forcelimited"), gear);
    if (end.actuator_range)
      force = {std::max(force[0], (*end.actuator_range)[0]),
               std::min(force[1], (*end.actuator_range)[1])};
    if (!(force[0] < force[1])) node.fail("its ranges leave no force");
    motor.low = force[0];
    motor.high = force[1];
    if (law.kp > 0) {
      set_position(law, gear, end.ref, motor);
      if (law.damping_ratio > 0 && whole_.tendons.contains(name))
        node.lost("<" + node.name() + "> dampratio on a tendon");
      else if (law.damping_ratio > 0)
        keep_ratio(node, law.damping_ratio, end.link);
    } else {
      set_force(node, law, gear, link.joint, motor);
    }
    whole_.motors.back() = static_cast<int>(scene_.motors.size());
    scene_.motors.push_back(motor);
  }

  /// Gives motors with a damping ratio their damping, and each joint at most one position motor,
  /// after all are read.
  void finish() {
    damp();
    std::map<std::string, std::vector<std::size_t>> position_motors;  // by joint
    for (std::size_t k = 0; k < scene_.motors.size(); ++k)
      if (scene_.motors[k].has_gains()) position_motors[scene_.motors[k].joint].push_back(k);
    std::vector<std::size_t> lost;
    for (const auto& [joint, motors] : position_motors) {
      const auto clips = [&](std::size_t k) { return is_clipped(scene_.motors[k]); };
      const auto has_target = [&](std::size_t k) {
        return scene_.motors[k].control == MotorControl::position;
      };
      const auto first = [&](const auto& is) {
        return std::find_if(motors.begin(), motors.end(), is);
      };
      auto chosen = first([&](std::size_t k) { return clips(k) && has_target(k); });
      if (chosen == motors.end()) chosen = first(has_target);
      if (chosen == motors.end()) chosen = first(clips);
      const std::size_t kept = chosen == motors.end() ? motors.front() : *chosen;
      for (const std::size_t k : motors) {
        if (k == kept) continue;
        if (!has_target(k))
          make_damper(scene_.motors[k]);
        else if (clips(k))
          lost.push_back(k);
        else
          make_spring(scene_.motors[k]);
      }
    }
    std::sort(lost.rbegin(), lost.rend());
    for (const std::size_t k : lost) leave_out(static_cast<int>(k));
  }

 private:
  struct Ratio {
    std::size_t motor;
    int dof;
    double value;
  };

  void damp() const {
    if (ratios_.empty()) return;
    std::vector<int> dofs;
    for (const Ratio& ratio : ratios_) dofs.push_back(ratio.dof);
    const std::vector<double> inertias = effective_inertias(scene_, dofs, whole_.tendons);
    for (std::size_t k = 0; k < ratios_.size(); ++k) {
      MotorDescription& motor = scene_.motors[ratios_[k].motor];
      motor.D = 2 * ratios_[k].value * std::sqrt(motor.P * inertias[k]);
    }
  }

  static bool is_clipped(const MotorDescription& motor) {
    return motor.low > -kNone || motor.high < kNone;
  }

  /// The name of a motor's controls: none for the first motor of a joint, whose name they have.
  [[nodiscard]] std::string free_name(const std::string& joint, std::string requested) const {
    const auto drives = [&](const MotorDescription& m) { return m.joint == joint; };
    if (std::none_of(scene_.motors.begin(), scene_.motors.end(), drives)) return "";
    const auto taken = [&](const std::string& name) {
      return whole_.joints.contains(name) ||
             std::any_of(scene_.motors.begin(), scene_.motors.end(),
                         [&](const MotorDescription& m) { return m.name == name; });
    };
    std::string name = requested;
    for (int k = 2; taken(name); ++k) name = fmt::format("{}_{}", requested, k);
    return name;
  }

  /// Turns a position motor whose force is not clipped into a force motor beside a spring and
  /// damping: P (t - q) - D v = P t - P q - D v.
  void make_spring(MotorDescription& motor) {
    JointDescription& joint = scene_.links[std::size_t(whole_.joints.at(motor.joint).link)].joint;
    const double rest = joint.rest.empty() ? 0 : joint.rest[0];
    if (rest != 0) joint.rest = {joint.stiffness * rest / (joint.stiffness + motor.P)};
    joint.stiffness += motor.P;
    joint.damping += motor.D;
    motor.control = MotorControl::force;
    motor.scale = motor.P * motor.scale.value_or(1);
    motor.offset *= motor.P;
    motor.P = motor.D = 0;
    whole_.robot.changed.add(motor.source,
                             "a second actuator with a target, of joint '" + motor.joint +
                                 "': a force motor, and stiffness and damping of the joint");
  }

  /// Gives the joint the damping of a force motor with D beside another motor with gains.
  void make_damper(MotorDescription& motor) {
    for (LinkDescription& link : scene_.links)
      if (link.joint.name == motor.joint) link.joint.damping += std::exchange(motor.D, 0.0);
    whole_.robot.lost.add(
        motor.source, "that the damping of a velocity servo is clipped, of joint '" + motor.joint +
                          "': another of its motors has gains");
  }

  void leave_out(int motor) {
    const auto at = scene_.motors.begin() + motor;
    whole_.robot.lost.add(
        at->source, "a second actuator with a target and a forcerange, of joint '" + at->joint +
                        "': a joint has one position motor");
    scene_.motors.erase(at);
    for (int& k : whole_.motors) k = k == motor ? -1 : k > motor ? k - 1 : k;
  }

  /// Keeps the damping ratio of the motor that is added next.
  void keep_ratio(const RobotNode& node, double value, int link) {
    int dof = 0;
    for (int k = 0; k < link; ++k) dof += dof_count(scene_.links[std::size_t(k)].joint.type);
    ratios_.push_back({scene_.motors.size(), dof, value});
    node.changed(fmt::format(
        "<{}> dampratio: its damping is a number, by the rule of MuJoCo 4.0.0: kv = 2 dampratio "
        "sqrt(kp m) with m = 1/(J M^-1 J^T) at the reference pose; some older versions have "
        "another m",
        node.name()));
  }

  static Range scaled(const Range& x, double by) {
    return by > 0 ? Range{by * x[0], by * x[1]} : Range{by * x[1], by * x[0]};
  }

  static Range range(const RobotNode& node, const MjcfFile& file, const char* name,
                     const char* limited) {
    const int word = node.choice(limited, {"auto", "true", "false"}, 0);
    const bool on = word == 1 || (word == 0 && file.auto_limits);
    if (!node.has(name) || !on) return {-kNone, kNone};
    const std::vector<double> x = node.numbers(name, 2);
    if (!(x[0] < x[1]))
      node.fail(fmt::format("{}=\"{} {}\": expected low, then high", name, x[0], x[1]));
    return {x[0], x[1]};
  }

  /// The range of the control: ctrlrange, or a part of the joint's range about its middle.
  static Range control_range(const RobotNode& node, const MjcfFile& file, const MjcfJoint& end) {
    const double part = node.has("inheritrange") ? node.not_negative("inheritrange") : 0;
    if (part == 0 || node.has("ctrlrange")) return range(node, file, "ctrlrange", "ctrllimited");
    if (!end.range) node.fail("inheritrange of a joint without a range; expected one");
    const auto& [low, high] = *end.range;
    const double middle = 0.5 * (low + high), half = 0.5 * part * (high - low);
    return {middle - half, middle + half};
  }

  /// Whether the actuator drives a joint. Lists what else it drives.
  bool drives_joint(const RobotNode& node, const std::string& joint) const {
    if (node.has("site")) return !joint.empty();  // else it is listed
    for (const char* other : {"body", "cranksite", "slidersite", "refsite"})
      if (node.has(other)) {
        node.lost(fmt::format("<{}> on a {}: scenes drive joints and tendons", node.name(), other));
        return false;
      }
    if (!joint.empty()) return true;
    if (node.has("tendon")) {
      node.lost("<" + node.name() + "> on a tendon that is not read");
      return false;
    }
    const char* const attribute = joint_attribute(node);
    const std::string name = node.text(attribute);
    std::vector<std::string> names;
    for (const auto& [known, end] : whole_.joints) names.push_back(known);
    node.fail(fmt::format("{}=\"{}\": no joint has this name{}", attribute, name,
                          suggestion(name, names)));
  }

  static bool read_law(const RobotNode& node, Law& law) {
    if (node.name() == "position") {
      law.kp = law.gain = node.positive("kp", 1.0);
      if (node.given("kv") && node.given("dampratio"))
        node.fail("both 'kv' and 'dampratio'; expected one");
      if (!node.given("dampratio")) law.kv = node.not_negative("kv", 0.0);
      if (!node.given("kv")) law.damping_ratio = node.not_negative("dampratio", 0.0);
    } else if (node.name() == "velocity") {
      law.kv = law.gain = node.positive("kv", 1.0);
    } else if (node.name() == "general") {
      return read_general(node, law);
    }
    return true;
  }

  static bool read_general(const RobotNode& node, Law& law) {
    const auto is = [&](const char* attribute, const char* usual) {
      return node.text(attribute, usual) == usual;
    };
    const std::string bias_type = node.text("biastype", "none");
    if (!is("dyntype", "none") || !is("gaintype", "fixed") ||
        (bias_type != "none" && bias_type != "affine")) {
      node.lost("<general> with a state, or with a gain or bias that is no plain spring");
      return false;
    }
    const std::vector<double> gain =
        node.has("gainprm") ? node.numbers("gainprm") : std::vector<double>{1};
    std::vector<double> bias =
        node.has("biasprm") ? node.numbers("biasprm") : std::vector<double>{};
    bias.resize(std::max<std::size_t>(bias.size(), 3));
    if (bias_type == "none") bias = {0, 0, 0};
    law.gain = gain.empty() ? 1 : gain[0];
    law.bias = bias[0];
    law.kp = 0 - bias[1];
    law.kv = 0 - bias[2];
    if (law.kp == law.gain && law.kp > 0 && law.kv < 0) {
      law.damping_ratio = 0 - law.kv;  // MuJoCo takes a positive one for a damping ratio
      law.kv = 0;
    }
    if (law.kp < 0 || law.kv < 0) {
      node.lost("<general> with a bias that drives its joint: negative stiffness or damping");
      return false;
    }
    if (law.gain == 0) {
      node.lost("<general> with gain 0: a force without a control");
      return false;
    }
    return true;
  }

  static void set_position(const Law& law, double gear, double ref, MotorDescription& motor) {
    motor.control = MotorControl::position;
    motor.P = law.kp * gear * gear;
    motor.D = law.kv * gear * gear;
    const double scale = law.gain / (law.kp * gear);
    if (scale != 1) motor.scale = scale;
    motor.offset = law.bias / (law.kp * gear) - ref;
  }

  /// Where the file's control is from -1 to 1 and is the only bound, it needs no scale.
  void set_force(const RobotNode& node, const Law& law, double gear, JointDescription& joint,
                 MotorDescription& motor) const {
    motor.control = MotorControl::force;
    const double slope = gear * law.gain;
    if (law.bias == 0 && motor.u_range == Range{-1, 1} && !is_clipped(motor)) {
      motor.low = -slope;
      motor.high = slope;
      motor.u_range = {-kNone, kNone};
    } else {
      motor.scale = slope;
      motor.offset = gear * law.bias;
    }
    if (law.kv == 0) return;
    if (is_clipped(motor)) {
      motor.scale = slope;
      motor.offset = gear * law.bias;
      motor.D = law.kv * gear * gear;
      return;
    }
    joint.damping += law.kv * gear * gear;
    node.changed(fmt::format("<{}>: a motor for the control, and damping of joint '{}'",
                             node.name(), motor.joint));
  }

  MjcfWhole& whole_;
  Scene& scene_;
  std::vector<Ratio> ratios_;
};

/// An actuator of a model, or one that drives a copy.
struct Drive {
  RobotNode node;
  const MjcfScope* scope;  ///< of the copy, or of the model
  std::string joint;       ///< in the scene; "": none is found
};

/// Adds the actuators of a section, one for each copy of its joint.
void add_drives(MjcfWhole& whole, const MjcfScope& model, const RobotNode& section,
                std::vector<Drive>& out) {
  static const Words known = [] {
    Words words;
    for (const std::string& name : kActuators) words.push_back({name.c_str()});
    for (const char* other : kOtherActuators) words.push_back({other});
    return words;
  }();
  for (const RobotNode& part : section.parts(known)) {
    const RobotNode node = model.file->with_class(part, "main");
    if (node.has("tendon")) {
      const auto tendon = whole.tendon_names.find({model.model, node.text("tendon")});
      out.push_back({node, &model, tendon == whole.tendon_names.end() ? "" : tendon->second});
      continue;
    }
    if (node.has("site")) {
      const bool reads =
          std::find(kActuators.begin(), kActuators.end(), node.name()) != kActuators.end();
      out.push_back({node, &model, reads ? add_mjcf_wrench(whole, model, node) : ""});
      continue;
    }
    const char* const attribute = joint_attribute(node);
    const auto copies = node.has(attribute)
                            ? whole.joint_names.copies.find({model.model, node.text(attribute)})
                            : whole.joint_names.copies.end();
    if (copies != whole.joint_names.copies.end())
      for (const MjcfCopy& copy : copies->second) out.push_back({node, copy.scope, copy.name});
    else if (model.outer != nullptr && model.outer->file == model.file)
      continue;  // not in the part of the file that is attached again
    else if (model.outer != nullptr && node.has(attribute))
      node.idle("<" + node.name() + "> of a part of a model that is not attached");
    else
      out.push_back({node, &model, ""});
  }
}

}  // namespace

/// Copies follow the others, and the actuators of a model those of the model that attaches it, as
/// in MuJoCo: keyframes have controls in this order.
void read_mjcf_actuators(MjcfWhole& whole) {
  std::vector<Drive> drives;
  for (const MjcfScope* model : whole.models)
    for (const RobotNode& section : model->file->sections)
      if (section.name() == "actuator") add_drives(whole, *model, section, drives);
  std::stable_sort(drives.begin(), drives.end(), [&](const Drive& a, const Drive& b) {
    return whole.order(*a.scope) < whole.order(*b.scope);
  });
  Actuators actuators(whole);
  for (const Drive& drive : drives) actuators.read(drive.node, *drive.scope, drive.joint);
  actuators.finish();
}

}  // namespace tangere
