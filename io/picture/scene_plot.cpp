// SPDX-License-Identifier: Apache-2.0
// Faces are painted from the farthest to the nearest; what explains them is painted on top. Lengths
// on the page are in SVG units.
#include "io/picture/scene_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/model/model.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/batch.hpp"
#include "io/picture/body_faces.hpp"
#include "io/picture/projection.hpp"
#include "io/picture/svg.hpp"

namespace tangere {
namespace {

constexpr double kWidth = 720, kHeight = 520;
constexpr double kArrow = 52;           // length of an axis
constexpr std::size_t kMostDots = 400;  // of a sensor
constexpr const char *kFirst = "#c8553d", *kSecond = "#3f8a3a", *kThird = "#1e4fae",
                     *kJoint = "#b5791b", *kSkin = "#12566f";

class Picture {
 public:
  Picture(const Scene& scene, const SceneCamera& camera)
      : scene_(scene), model_(scene), eye_(camera, kWidth, kHeight) {
    Batch batch(model_, 1);
    Readout readout(model_);
    std::vector<double> pose(7 * scene.links.size()), twist(6 * scene.links.size());
    readout.bodies(batch, 0, pose, twist);
    for (std::size_t b = 0; b < scene.links.size(); ++b) {
      const double* p = &pose[7 * b];
      bodies_.push_back({{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}});
    }
    ends_.resize(3 * scene.end_effectors.size());
    if (!ends_.empty()) readout.end_effectors(batch, 0, ends_);
    find_extent();
  }

  std::string draw() {
    std::string out = svg::begin(kWidth, kHeight);
    const auto counted = [](std::size_t n, const char* what) {
      return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s");
    };
    const std::vector<std::string> captions = {
        "at its start: " +
        (scene_.links.size() == 1 ? std::string("1 body")
                                  : fmt::format("{} bodies", scene_.links.size())) +
        ", " + counted(std::size_t(model_.nv()), "dof") + ", " +
        counted(scene_.sensors.size(), "sensor")};
    out += svg::heading(scene_.name.empty() ? "scene" : scene_.name, captions);
    out += ground() + faces();
    for (std::size_t k = 0; k < scene_.links.size(); ++k) out += joint(k);
    for (std::size_t k = 0; k < scene_.sensors.size(); ++k) out += sensor(k);
    for (std::size_t k = 0; k < scene_.end_effectors.size(); ++k) out += end_effector(k);
    out += world() + legend();
    return out + "</svg>\n";
  }

 private:
  /// Bodies without bounds are left out.
  void find_extent() {
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Shape& shape = scene_.links[b].body.shape;
      if (std::holds_alternative<PlaneShape>(shape)) continue;
      for (const Face& face : faces_of(shape, 0))
        for (const Vector3& corner : face) eye_.take(outer_point(bodies_[b], corner));
      eye_.take(bodies_[b].position);
    }
    for (std::size_t k = 0; k < ends_.size(); k += 3)
      eye_.take({ends_[k], ends_[k + 1], ends_[k + 2]});
    eye_.fit();
  }

  /// Two directions along a plane.
  static std::array<Vector3, 2> along_plane(const Vector3& normal) {
    const Vector3 other = std::abs(normal[2]) < 0.9 ? Vector3{0, 0, 1} : Vector3{1, 0, 0};
    const Vector3 first = unit(cross(other, normal));
    return {first, cross(normal, first)};
  }

  /// A grid below the middle of the bodies.
  std::string ground() {
    if (!scene_.ground) return "";
    const Vector3& n = scene_.ground->normal;
    Vector3 middle{};
    for (const Pose& b : bodies_) middle = middle + (1.0 / double(bodies_.size())) * b.position;
    middle = middle - dot(n, middle - scene_.ground->position) * n;
    const auto [a, b] = along_plane(n);
    const double step = svg::round_down(eye_.metres(60));
    std::string out;
    for (int k = -4; k <= 4; ++k)
      for (const auto& [u, w] : {std::pair{a, b}, std::pair{b, a}}) {
        const Vector3 from = middle + (k * step) * u - (4 * step) * w;
        out += fmt::format("<path d=\"{}\" stroke=\"#d4d4d4\"/>\n",
                           svg::path_of({eye_(from), eye_(from + (8 * step) * w)}, false));
      }
    return out;
  }

  std::string faces() {
    struct Painted {
      double nearness;
      std::string text;
    };
    std::vector<Painted> all;
    const Vector3 light = unit({0.35, -0.6, 0.75});
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const BodyDescription& body = scene_.links[b].body;
      for (const Face& face : faces_of(body.shape, eye_.metres(90))) {
        std::vector<svg::Place> places;
        Vector3 middle{};
        std::vector<Vector3> at;
        for (const Vector3& corner : face) {
          at.push_back(outer_point(bodies_[b], corner));
          middle = middle + (1.0 / double(face.size())) * at.back();
          places.push_back(eye_(at.back()));
        }
        const Vector3 out = cross(at[1] - at[0], at[2] - at[0]);
        if (!(eye_.nearness(unit(out)) > 1e-6)) continue;  // back face, or edge on
        const double bright = 0.72 + 0.28 * dot(light, unit(out));
        const auto tone = [&](int c) {
          return std::clamp(static_cast<int>(255 * bright * body.rgba[std::size_t(c)]), 0, 255);
        };
        const std::string fill = fmt::format("#{:02x}{:02x}{:02x}", tone(0), tone(1), tone(2));
        all.push_back({eye_.nearness(middle),
                       fmt::format("<path d=\"{}\" fill=\"{}\" stroke=\"{}\" stroke-width=\"0.4\" "
                                   "fill-opacity=\"0.9\"/>\n",
                                   svg::path_of(places, true), fill, fill)});
      }
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Painted& a, const Painted& b) { return a.nearness < b.nearness; });
    std::string out;
    for (const Painted& p : all) out += p.text;
    return out;
  }

  /// Writes a label where it hides no other one.
  std::string label(svg::Place at, const std::string& name, const char* colour) {
    const double width = 6.3 * double(name.size());
    at.x = std::clamp(at.x, 6.0, std::max(kWidth - 6 - width, 6.0));
    const auto taken = [&](const svg::Place& p) {
      return std::any_of(labels_.begin(), labels_.end(), [&](const std::array<double, 3>& l) {
        return std::abs(l[1] - p.y) < 12 && l[0] < p.x + width && p.x < l[0] + l[2];
      });
    };
    for (int tries = 0; tries < 40 && taken(at); ++tries) at.y += 12;
    labels_.push_back({at.x, at.y, width});
    // Its white edge is a text of its own: not every program supports paint-order.
    return svg::text(at.x, at.y, name,
                     "font-size=\"11\" fill=\"#fff\" stroke=\"#fff\" stroke-width=\"3\"") +
           svg::text(at.x, at.y, name, fmt::format("font-size=\"11\" fill=\"{}\"", colour).c_str());
  }

  std::string straight(const Vector3& from, const Vector3& way, const char* colour) {
    return svg::arrow({eye_(from), eye_(from + way)}, colour);
  }
  /// A way there and back.
  std::string slide(const Vector3& at, const Vector3& axis) {
    const double half = eye_.metres(0.5 * kArrow);
    return straight(at, half * axis, kJoint) + straight(at, (-half) * axis, kJoint);
  }
  /// The axis, and most of a circle around it.
  std::string turn(const Vector3& at, const Vector3& axis) {
    const double radius = eye_.metres(0.34 * kArrow), half = eye_.metres(0.5 * kArrow);
    const auto [a, b] = along_plane(axis);
    std::vector<svg::Place> way;
    for (int k = 0; k <= 28; ++k) {
      const double angle = 1.6 * M_PI * k / 28;
      way.push_back(eye_(at + radius * (std::cos(angle) * a + std::sin(angle) * b)));
    }
    return fmt::format(
               "<path d=\"{}\" stroke=\"{}\" stroke-dasharray=\"5 3\" stroke-width=\"1.2\"/>\n",
               svg::path_of({eye_(at - half * axis), eye_(at + half * axis)}, false), kJoint) +
           svg::arrow(way, kJoint);
  }

  /// How a joint moves, at the moved joint's frame.
  std::string joint(std::size_t link) {
    const JointDescription& d = scene_.links[link].joint;
    if (d.type == JointType::fixed) return "";
    // The frame that moves with the joint, in its body's.
    const Pose& in_joint = scene_.links[link].body.pose;
    const Pose back = pose_at_end({&in_joint, 1}, Pose{});
    const auto axis = [&](const Vector3& a) {
      return outer_direction(bodies_[link], outer_direction(back, a));
    };
    const Vector3 at = outer_point(bodies_[link], back.position);
    const Vector3 x = axis({1, 0, 0}), y = axis({0, 1, 0}), z = axis({0, 0, 1});
    std::string out;
    switch (d.type) {
      case JointType::fixed: break;
      case JointType::revolute: out = turn(at, axis(d.axis0)); break;
      case JointType::prismatic: out = slide(at, axis(d.axis0)); break;
      case JointType::planar: out = slide(at, axis(d.axis0)) + slide(at, axis(d.axis1)); break;
      case JointType::translational: out = slide(at, x) + slide(at, y) + slide(at, z); break;
      case JointType::free2d: out = slide(at, x) + slide(at, y) + turn(at, z); break;
      case JointType::spherical: out = turn(at, x) + turn(at, y) + turn(at, z); break;
      case JointType::free:
        out = slide(at, x) + slide(at, y) + slide(at, z) + turn(at, x) + turn(at, y) + turn(at, z);
        break;
    }
    const svg::Place where = eye_(at);
    return out + label({where.x + 8, where.y - 8}, d.name, kJoint);
  }

  /// Points on back faces are paler.
  std::string sensor(std::size_t which) {
    const TactileDescription& d = scene_.sensors[which];
    const auto names = model_.body_names();
    const auto body = std::size_t(std::find(names.begin(), names.end(), d.body) - names.begin());
    const std::vector<TactilePoint> points = tactile_points(d);
    const double side = model_.sensors()[which].pressure_sign;
    std::string out;
    const std::size_t every = (points.size() + kMostDots - 1) / kMostDots;
    for (std::size_t k = 0; k < points.size(); k += every) {
      const TactilePoint& p = points[k];
      const svg::Place at = eye_(outer_point(bodies_[body], p.position));
      const bool towards =
          side * eye_.nearness(outer_direction(bodies_[body], cross(p.axis0, p.axis1))) > 0;
      out += fmt::format(
          "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.4\" fill=\"{}\" "
          "fill-opacity=\"{}\"/>\n",
          at.x, at.y, kSkin, towards ? 1 : 0.3);
    }
    const bool array = d.points.empty();
    const TactilePoint& p = points[array ? 0 : points.size() / 2];
    const Vector3 at = outer_point(bodies_[body], p.position);
    const double length = eye_.metres(0.7 * kArrow);
    const std::array<Vector3, 3> axes = {p.axis0, p.axis1, cross(p.axis0, p.axis1)};
    const std::array<const char*, 3> colours = {kFirst, kSecond, kThird};
    for (std::size_t k = 0; k < 3; ++k)
      out += straight(at, length * outer_direction(bodies_[body], axes[k]), colours[k]);
    const svg::Place where = eye_(at);
    return out + label({where.x + 8, where.y + 16}, d.name, kSkin);
  }

  std::string end_effector(std::size_t which) {
    const svg::Place at = eye_({ends_[3 * which], ends_[3 * which + 1], ends_[3 * which + 2]});
    return fmt::format(
               "<path d=\"M{0:.1f} {1:.1f}h8m-4 -4v8\" stroke=\"#a02\" "
               "stroke-width=\"1.6\"/>\n",
               at.x - 4, at.y) +
           label({at.x + 6, at.y - 2}, scene_.end_effectors[which].name, "#a02");
  }

  /// The world's axes in a corner.
  std::string world() {
    const svg::Place corner = {40, kHeight - 36};
    const std::array<const char*, 3> names = {"x", "y", "z"};
    std::string out;
    for (std::size_t k = 0; k < 3; ++k) {
      Vector3 axis{};
      axis[k] = 1;
      const svg::Place d = eye_.along(axis);
      out += svg::arrow({corner, {corner.x + 26 * d.x, corner.y + 26 * d.y}}, "#555");
      out += svg::text(corner.x + 38 * d.x - 3, corner.y + 38 * d.y + 4, names[k],
                       "font-size=\"11\" fill=\"#555\"");
    }
    return out;
  }

  std::string legend() {
    std::string out;
    double x = 110;
    const auto entry = [&](const char* colour, const std::string& words) {
      out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", x,
                         kHeight - 20, colour);
      out += svg::text(x + 8, kHeight - 16, words, "font-size=\"11\"");
      x += 26 + 6.0 * double(words.size());
    };
    entry(kJoint, "how joints move");
    if (scene_.sensors.empty()) return out;
    entry(kSkin, "points of sensors");
    entry(kFirst, "axis0");
    entry(kSecond, "axis1");
    entry(kThird, "axis0 × axis1");
    return out;
  }

  const Scene& scene_;
  Model model_;
  svg::Projection eye_;
  std::vector<Pose> bodies_;                   ///< body frames in the world
  std::vector<double> ends_;                   ///< (end effectors, 3) [m]
  std::vector<std::array<double, 3>> labels_;  ///< x, y and width of each
};

}  // namespace

std::string render_scene_svg(const Scene& scene, const SceneCamera& camera) {
  Scene own = scene;
  own.randomizations.clear();  // its own numbers, not drawn ones
  return Picture(own, camera).draw();
}

}  // namespace tangere
