// SPDX-License-Identifier: Apache-2.0
// Closed loops of MJCF: <connect> holds a point of a body at another, <weld> also its axes. Places
// that the file gives for one body are those of the other at the file's reference pose, where all
// of our coordinates are 0.
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "io/robot/mjcf_file.hpp"
#include "io/robot/mjcf_words.hpp"

namespace tangere {
namespace {

const char* const kSoft = "MuJoCo's own are softer";

Words loop_words(bool weld) {
  Words words = {{"name"},
                 {"class"},
                 {"active"},
                 {"body1"},
                 {"body2"},
                 {"anchor"},
                 {"site1"},
                 {"site2"},
                 {"solref", Fate::idle, kSoft},
                 {"solimp", Fate::idle, kSoft}};
  if (weld) words.insert(words.end(), {{"relpose"}, {"torquescale"}});
  return words;
}

class LoopReader {
 public:
  LoopReader(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node)
      : whole_(whole), scene_(whole.robot.scene), model_(model), node_(node) {}

  void read() {
    const bool weld = node_.name() == "weld";
    node_.check(loop_words(weld));
    if (!node_.flag("active", true)) return node_.idle("<" + node_.name() + "> that is not active");
    LoopDescription d;
    d.source = node_.source();
    d.weld = weld;
    std::optional<MjcfPlace> one, two;
    if (node_.has("site1") || node_.has("site2")) {
      one = site("site1"), two = site("site2");
    } else {
      one = body("body1");
      two = node_.has("body2") ? body("body2") : MjcfPlace{};
      if (one && two) weld ? place_weld(*one, *two) : place_point(*one, *two);
    }
    if (!one || !two) return;
    if (one->link < 0) std::swap(*one, *two);
    if (moving_link(one->link) == moving_link(two->link))
      return node_.idle("<" + node_.name() +
                        "> between bodies that do not move against each other");
    write(d, *one, *two);
  }

 private:
  /// The frame of a body, or nothing where it stands in several copies.
  std::optional<MjcfPlace> body(const char* attribute) {
    const std::string name = node_.text(attribute);
    if (name == "world") return MjcfPlace{};
    const auto found = whole_.body_names.copies.find({model_.model, name});
    if (found == whole_.body_names.copies.end())
      node_.fail(fmt::format("{}=\"{}\": no body has this name", attribute, name));
    if (found->second.size() != 1) {
      node_.lost("<" + node_.name() + "> of a body that stands in several copies");
      return std::nullopt;
    }
    const auto& [link, offset] = whole_.body_frames.at(found->second[0].name);
    return MjcfPlace{link, offset};
  }

  std::optional<MjcfPlace> site(const char* attribute) {
    const std::optional<MjcfPlace> place = mjcf_site(whole_, model_, node_, attribute);
    if (!place)
      node_.lost(
          fmt::format("<{}> {}: no site of a body that stands once", node_.name(), attribute));
    return place;
  }

  /// The frame of a link in the world, where all joints are at 0.
  [[nodiscard]] Pose at_rest(const MjcfPlace& place) const {
    Pose pose = place.pose;
    for (int i = place.link; i >= 0; i = scene_.links[std::size_t(i)].parent)
      pose = compose(scene_.links[std::size_t(i)].joint.pose, pose);
    return pose;
  }

  /// From the frames of two bodies to a point: `anchor` is in body 1.
  void place_point(MjcfPlace& one, MjcfPlace& two) const {
    const Pose anchor = {node_.vector("anchor"), {1, 0, 0, 0}};
    const Pose in_two = compose(inverse(at_rest(two)), compose(at_rest(one), anchor));
    one.pose = compose(one.pose, anchor);
    two.pose = compose(two.pose, in_two);
  }

  /// From the frames of two bodies to one frame: `anchor` is in body 2, `relpose` is body 2 in
  /// body 1, and a quaternion of zeros stands for the pose of the file.
  void place_weld(MjcfPlace& one, MjcfPlace& two) const {
    const Pose anchor = {node_.vector("anchor", Vector3{0, 0, 0}), {1, 0, 0, 0}};
    Pose second = compose(inverse(at_rest(one)), at_rest(two));
    if (node_.has("relpose")) {
      const std::vector<double> x = node_.numbers("relpose", 7);
      const double square = x[3] * x[3] + x[4] * x[4] + x[5] * x[5] + x[6] * x[6];
      if (square > 0) {
        const double scale = 1 / std::sqrt(square);
        second = {{x[0], x[1], x[2]}, {scale * x[3], scale * x[4], scale * x[5], scale * x[6]}};
      }
    }
    one.pose = compose(one.pose, compose(second, anchor));
    two.pose = compose(two.pose, anchor);
  }

  /// The link that a link moves with; -1: it stands in the world.
  [[nodiscard]] int moving_link(int link) const {
    while (link >= 0 && scene_.links[std::size_t(link)].joint.type == JointType::fixed)
      link = scene_.links[std::size_t(link)].parent;
    return link;
  }

  void write(LoopDescription& d, const MjcfPlace& one, const MjcfPlace& two) {
    const Pose first = in_body_frame(scene_, one), second = in_body_frame(scene_, two);
    d.body1 = scene_.links[std::size_t(one.link)].body.name;
    d.body2 = body_at(scene_, two);
    d.position1 = first.position;
    d.position2 = second.position;
    if (d.weld) d.orientation2 = compose(second, inverse(first)).orientation;
    d.stiffness = 1;  // chosen later
    if (d.weld) d.turning_stiffness = node_.not_negative("torquescale", 1.0);
    if (d.weld && d.turning_stiffness == 0) {
      d.weld = false;
      d.orientation2.reset();
    }
    d.name = whole_.names.free_name(node_.given("name")
                                        ? model_.full_name(node_.text("name"))
                                        : d.body1 + "_" + (d.body2.empty() ? "world" : d.body2));
    scene_.loops.push_back(d);
    node_.changed(fmt::format(
        "<{}>: springs that yield by 1 um under the largest load of their joints; MuJoCo's "
        "constraint is softer",
        node_.name()));
  }

  MjcfWhole& whole_;
  Scene& scene_;
  const MjcfScope& model_;
  const RobotNode& node_;
};

}  // namespace

void read_mjcf_loop(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node) {
  LoopReader(whole, model, node).read();
}

}  // namespace tangere
