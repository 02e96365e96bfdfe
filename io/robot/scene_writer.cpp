// SPDX-License-Identifier: Apache-2.0
// Attributes that have their default are left out, so that what is there can be read.
#include "io/robot/scene_writer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "engine/scene/schema.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {
namespace {

std::string vector_text(const Vector3& v) {
  return fmt::format("{} {} {}", number_text(v[0]), number_text(v[1]), number_text(v[2]));
}

std::string numbers_text(const std::vector<double>& numbers) {
  std::string text;
  for (const double x : numbers) text += (text.empty() ? "" : " ") + number_text(x);
  return text;
}

/// ` name="value"` of all members of T that an element keeps, but for those with their default.
template <class T>
std::string members_text(Element element, const T& of, std::string_view type = {}) {
  std::string text;
  for_each_member<T>(element, [&](const Attribute& row, auto member) {
    std::string value;
    if constexpr (requires { (of.*member).size(); })
      value = numbers_text({(of.*member).begin(), (of.*member).end()});
    else
      value = number_text(of.*member);
    if (row.serves(type) && (row.default_text == nullptr || value != row.default_text))
      text += fmt::format(" {}=\"{}\"", row.name, value);
  });
  return text;
}

/// Names between blanks, or between commas where one has a blank.
std::string leaders_text(const std::vector<std::string>& names) {
  const auto has_blank = [](const std::string& name) {
    return name.find_first_of(" \t") != std::string::npos;
  };
  if (!std::any_of(names.begin(), names.end(), has_blank))
    return fmt::format("{}", fmt::join(names, " "));
  return fmt::format("{}{}", fmt::join(names, ", "), names.size() == 1 ? "," : "");
}

class Writer {
 public:
  Writer(const Robot& robot, const std::string& folder)
      : robot_(robot), scene_(robot.scene), folder_(folder), children_(scene_.links.size()) {
    for (std::size_t i = 0; i < scene_.links.size(); ++i)
      if (scene_.links[i].parent >= 0) children_[std::size_t(scene_.links[i].parent)].push_back(i);
  }

  std::string text(const SceneSections& sections) {
    out_ = fmt::format("<!-- {}-->\n<tangere model=\"{}\">\n", comment_text(sections.head),
                       attribute_text(scene_.name));
    out_ += fmt::format(
        "  <option unit=\"m-kg\" gravity=\"{}\" timestep=\"{}\" integrator=\"{}\"/>\n",
        vector_text(scene_.gravity), number_text(scene_.timestep), to_string(scene_.integrator));
    if (scene_.ground) write_ground(*scene_.ground);
    section("default", sections.defaults);
    for (std::size_t i = 0; i < scene_.links.size(); ++i) {
      if (scene_.links[i].parent >= 0) continue;
      out_ += "  <robot>\n";
      write_link(i, 4);
      out_ += "  </robot>\n";
    }
    if (!scene_.motors.empty()) write_motors();
    section("contact", sections.contacts);
    write_loops();
    write_transmissions();
    section("sensor", sections.sensors);
    section("variable", sections.places);
    write_start();
    return out_ + "</tangere>\n";
  }

 private:
  void section(const char* name, const std::string& inside) {
    if (!inside.empty()) out_ += fmt::format("  <{0}>\n{1}  </{0}>\n", name, inside);
  }

  void write_ground(const GroundDescription& ground) {
    out_ += "  <ground" + members_text(kGround, ground);
    if (ground.normal != Vector3{0, 0, 1})
      out_ += fmt::format(" normal=\"{}\"", vector_text(ground.normal));
    out_ += "/>\n";
  }

  void write_link(std::size_t i, int indent) {
    const LinkDescription& link = scene_.links[i];
    const std::string space(std::size_t(indent), ' ');
    const auto origin = robot_.origins.find(link.name);
    out_ += fmt::format(
        "{}<link name=\"{}\">  <!-- {} -->\n", space, attribute_text(link.name),
        comment_text(origin == robot_.origins.end() ? std::string("<link>") : origin->second));
    write_joint(link.joint, space + "  ");
    write_body(link.body, space + "  ");
    for (const std::size_t child : children_[i]) write_link(child, indent + 2);
    out_ += space + "</link>\n";
  }

  void write_joint(const JointDescription& joint, const std::string& space) {
    out_ += fmt::format("{}<joint name=\"{}\" type=\"{}\"{}", space, attribute_text(joint.name),
                        to_string(joint.type), pose_text(joint.pose));
    if (joint.type == JointType::revolute || joint.type == JointType::prismatic)
      out_ += fmt::format(" axis=\"{}\"", vector_text(joint.axis0));
    JointEffects effects = joint;
    if (!joint.limits) effects.limit_stiffness = 0;
    out_ += members_text(kJoint, effects, to_string(joint.type));
    if (!joint.rest.empty() && joint.rest[0] != 0)
      out_ += fmt::format(" rest=\"{}\"", number_text(joint.rest[0]));
    if (joint.limits)
      out_ += fmt::format(" lim=\"{} {}\"", number_text((*joint.limits)[0]),
                          number_text((*joint.limits)[1]));
    if (!joint.follows.empty())
      out_ += fmt::format(" follows=\"{}\" ratio=\"{}\" offset=\"{}\"",
                          attribute_text(leaders_text(joint.follows)), numbers_text(joint.ratio),
                          number_text(joint.offset));
    if (!joint.powers.empty()) out_ += fmt::format(" powers=\"{}\"", numbers_text(joint.powers));
    out_ += "/>\n";
  }

  void write_body(const BodyDescription& body, const std::string& space) {
    out_ += fmt::format("{}<body name=\"{}\" type=\"{}\"{}", space, attribute_text(body.name),
                        shape_name(body.shape), pose_text(body.pose));
    write_size(body);
    const char* const type = shape_name(body.shape);
    const bool massless = body.density == 0 && attribute_of(kBody, "density").serves(type);
    out_ += massless ? " mass=\"0\"" : "";
    out_ += members_text(kBody, body, massless ? "" : type);
    out_ += "/>\n";
  }

  void write_size(const BodyDescription& body) {
    if (const auto* const mass = std::get_if<AbstractShape>(&body.shape)) return write_mass(*mass);
    if (std::holds_alternative<MeshShape>(body.shape)) return write_mesh(body.name);
    for (const NamedSize& size : named_sizes(body.shape))
      out_ += fmt::format(" {}=\"{}\"", size.name,
                          numbers_text({size.values.begin(), size.values.end()}));
  }
  void write_mesh(const std::string& body) {
    const MeshFile& file = robot_.meshes.at(body);
    out_ += " transform_type=\"OBJ_TO_JOINT\"";
    if (file.path.empty()) {
      out_ += fmt::format(" vertices=\"{}\"", numbers_text(file.vertices));
      if (!file.triangles.empty())
        out_ += fmt::format(" triangles=\"{}\"", fmt::join(file.triangles, " "));
    } else {
      out_ += fmt::format(" filename=\"{}\"", attribute_text(path_from_folder(file.path)));
    }
    if (file.hull) out_ += " hull=\"true\"";
    if (file.scale != Vector3{1, 1, 1})
      out_ += fmt::format(" scale=\"{}\"", vector_text(file.scale));
  }
  /// The path of a file from the folder of the scene.
  [[nodiscard]] std::string path_from_folder(const std::string& file) const {
    namespace fs = std::filesystem;
    std::error_code none;
    const fs::path path = fs::absolute(file, none).lexically_normal();
    const fs::path from = fs::absolute(folder_.empty() ? "." : folder_, none).lexically_normal();
    const fs::path relative = path.lexically_relative(from);
    return (relative.empty() ? path : relative).generic_string();
  }
  void write_mass(const AbstractShape& s) {
    const auto& [xx, xy, xz, yy, yz, zz] = s.inertia;
    out_ += fmt::format(" mass=\"{}\" inertia=\"", number_text(s.mass));
    if (xy == 0 && xz == 0 && yz == 0)
      out_ += vector_text({xx, yy, zz}) + "\"";
    else
      out_ += vector_text({xx, xy, xz}) + " " + vector_text({yy, yz, zz}) + "\"";
  }

  void write_motors() {
    out_ += "  <actuator>\n";
    for (const MotorDescription& m : scene_.motors) {
      const bool position = m.control == MotorControl::position;
      out_ += fmt::format("    <motor joint=\"{}\" ctrl=\"{}\"", attribute_text(m.joint),
                          position ? "position" : "force");
      if (!m.name.empty()) out_ += fmt::format(" name=\"{}\"", attribute_text(m.name));
      out_ += members_text(kMotor, m, position ? "position" : "force");
      write_range("ctrl_range", m.low, m.high);
      if (m.scale) out_ += fmt::format(" scale=\"{}\"", number_text(*m.scale));
      if (m.offset != 0) out_ += fmt::format(" offset=\"{}\"", number_text(m.offset));
      write_range("u_range", m.u_range[0], m.u_range[1]);
      out_ += m.source.line > 0
                  ? fmt::format("/>  <!-- {} -->\n", comment_text(place_in(robot_, m.source)))
                  : "/>\n";
    }
    out_ += "  </actuator>\n";
  }
  void write_range(const char* name, double low, double high) {
    if (std::isfinite(low) || std::isfinite(high))
      out_ +=
          fmt::format(" {}=\"{} {}\"", name, number_text(bounded(low)), number_text(bounded(high)));
  }

  void write_loops() {
    std::string text;
    for (const LoopDescription& loop : scene_.loops) {
      text += fmt::format("    <{} name=\"{}\" body1=\"{}\"", loop.weld ? "weld" : "connect",
                          attribute_text(loop.name), attribute_text(loop.body1));
      if (!loop.body2.empty()) text += fmt::format(" body2=\"{}\"", attribute_text(loop.body2));
      text += members_text(loop.weld ? kWeld : kConnect, loop);
      if (loop.position2) text += fmt::format(" pos2=\"{}\"", vector_text(*loop.position2));
      if (loop.orientation2) {
        const Quaternion& q = *loop.orientation2;
        text += fmt::format(" quat2=\"{}\"", numbers_text({q[0], q[1], q[2], q[3]}));
      }
      text += fmt::format("/>  <!-- {} -->\n", comment_text(place_in(robot_, loop.source)));
    }
    section("loop", text);
  }

  static std::string body_text(const char* name, const std::string& body) {
    return body.empty() ? "" : fmt::format(" {}=\"{}\"", name, attribute_text(body));
  }

  static std::string part_text(const PathPart& part) {
    if (part.kind == PathPart::Kind::pulley)
      return fmt::format("      <pulley divisor=\"{}\"/>\n", number_text(part.divisor));
    const bool point = part.kind == PathPart::Kind::point;
    std::string text = fmt::format("      <{}{} pos=\"{}\"", point ? "point" : "wrap",
                                   body_text("body", part.body), vector_text(part.position));
    if (!point) text += fmt::format(" radius=\"{}\"", number_text(part.radius));
    if (part.kind == PathPart::Kind::cylinder)
      text += fmt::format(" axis=\"{}\"", vector_text(part.axis));
    if (part.side) text += fmt::format(" side=\"{}\"", vector_text(*part.side));
    return text + "/>\n";
  }

  void write_transmissions() {
    std::string text;
    for (const TransmissionDescription& d : scene_.transmissions) {
      const bool path = d.kind == TransmissionDescription::Kind::path;
      text +=
          fmt::format("    <{} joint=\"{}\"", path ? "path" : "wrench", attribute_text(d.joint));
      const std::string origin = comment_text(place_in(robot_, d.source));
      if (path) {
        text += fmt::format(">  <!-- {} -->\n", origin);
        for (const PathPart& part : d.path) text += part_text(part);
        text += "    </path>\n";
        continue;
      }
      text +=
          body_text("body", d.body) +
          fmt::format(" pos=\"{}\" force=\"{}\"", vector_text(d.position), vector_text(d.force));
      if (d.torque != Vector3{0, 0, 0})
        text += fmt::format(" torque=\"{}\"", vector_text(d.torque));
      if (d.reference)
        text += body_text("reference", d.reference->empty() ? "world" : *d.reference) +
                fmt::format(" pos2=\"{}\"", vector_text(d.reference_position));
      text += fmt::format("/>  <!-- {} -->\n", origin);
    }
    section("transmission", text);
  }

  /// The start and the controls of a keyframe.
  void write_start() {
    std::string states;
    for (const InitialState& s : scene_.initial) {
      states += fmt::format("    <joint name=\"{}\"", attribute_text(s.joint));
      if (!s.q.empty()) states += fmt::format(" q=\"{}\"", numbers_text(s.q));
      if (!s.v.empty()) states += fmt::format(" v=\"{}\"", numbers_text(s.v));
      states += "/>\n";
    }
    section("initial", states);
    if (robot_.controls && !robot_.controls->empty())
      section("control",
              fmt::format("    <constant value=\"{}\"/>\n", numbers_text(*robot_.controls)));
  }

  /// A range that is open on one side only: this far beyond any force, the bound is never met.
  static double bounded(double x) { return std::isfinite(x) ? x : std::copysign(1e30, x); }

  const Robot& robot_;
  const Scene& scene_;
  std::string folder_, out_;
  std::vector<std::vector<std::size_t>> children_;
};

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, what.size(), by);
  return text;
}

}  // namespace

std::string number_text(double x) { return x == 0 ? "0" : fmt::format("{}", x); }

std::string pose_text(const Pose& pose) {
  Pose written = pose;
  if (pose.orientation == Quaternion{-1, 0, 0, 0}) written.orientation = {1, 0, 0, 0};
  return members_text(kBody, written);
}

std::string attribute_text(const std::string& text) {
  return replaced(replaced(replaced(replaced(text, "&", "&amp;"), "<", "&lt;"), ">", "&gt;"), "\"",
                  "&quot;");
}

std::string comment_text(const std::string& text) { return replaced(text, "--", "- -"); }

std::string write_scene(const Robot& robot, const SceneSections& sections,
                        const std::string& folder) {
  return Writer(robot, folder).text(sections);
}

}  // namespace tangere
