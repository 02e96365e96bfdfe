// SPDX-License-Identifier: Apache-2.0
// Models in models and copies: which names and places they have. Copy i of a <replicate> has the
// rotation R(i euler), and copy i + 1 the place p + R(i euler) offset, with p of copy i.
#include <fmt/format.h>

#include <algorithm>

#include "engine/scene/outer_pose.hpp"
#include "io/robot/mjcf_file.hpp"
#include "io/scene/included_file.hpp"

namespace tangere {
namespace {

constexpr int kMostScopes = 10000;  // copies and attached models of a file

/// A part of names, which may be empty.
std::string affix(const RobotNode& node, const char* attribute) {
  const char* const text = node.element().Attribute(attribute);
  return text == nullptr ? "" : text;
}

const MjcfScope& add_scope(MjcfWhole& whole, const RobotNode& node, MjcfScope scope) {
  if (whole.scopes.size() >= kMostScopes)
    node.fail(fmt::format("more than {} copies and attached models", kMostScopes));
  return whole.scopes.emplace_back(std::move(scope));
}

MjcfFile& model_named(const MjcfFile& file, const RobotNode& attach) {
  const std::string name = attach.text("model");
  const auto found = file.models.find(name);
  if (found != file.models.end()) return *found->second;
  std::vector<std::string> all;
  for (const auto& [known, model] : file.models) all.push_back(known);
  attach.fail(fmt::format("model=\"{}\": no <model> has this name{}", name, suggestion(name, all)));
}

}  // namespace

std::string MjcfScope::full_name(std::string name) const {
  for (const MjcfScope* s = this; s != nullptr; s = s->outer) name = s->prefix + name + s->suffix;
  return name;
}

std::string MjcfWhole::keep_name(MjcfNames& kind, const RobotNode& node, const MjcfScope& scope) {
  std::string name = node.text("name");
  const std::string full = scope.full_name(name);
  const auto [first, is_new] = kind.places.try_emplace(full, place_in(robot, node.source()));
  if (!is_new)
    node.fail(
        fmt::format("{} name '{}' is used twice, first in {}", kind.what, full, first->second));
  for (const MjcfScope* s = &scope; s != nullptr; s = s->outer) {
    kind.copies[{s->model, name}].push_back({full, s});
    name = s->prefix + name + s->suffix;
  }
  for (std::size_t k = 0; k < scope.copies.size(); k += 2)
    ranks.try_emplace(scope.copies[k], static_cast<int>(ranks.size()));
  names.keep(full);
  return full;
}

std::vector<int> MjcfWhole::order(const MjcfScope& scope) const {
  std::vector<int> out = scope.copies;
  for (std::size_t k = 0; k < out.size(); k += 2)
    if (const auto rank = ranks.find(out[k]); rank != ranks.end()) out[k] = rank->second;
  return out;
}

std::vector<MjcfReplica> replicas(MjcfWhole& whole, const RobotNode& node, const MjcfScope& scope) {
  node.check({{"count"},
              {"sep"},
              {"offset"},
              {"euler"},
              {"childclass"},
              {"prefix", Fate::idle, "MuJoCo does not read it"}});
  const int count = node.integer("count", 0, kMostScopes);
  const std::string separator = affix(node, "sep");
  const Vector3 offset = node.vector("offset", Vector3{0, 0, 0}),
                euler = node.vector("euler", Vector3{0, 0, 0});
  const std::size_t digits = fmt::format("{}", count).size();
  const auto group = static_cast<int>(whole.scopes.size());
  std::vector<MjcfReplica> out;
  Pose pose;
  for (int i = 0; i < count; ++i) {
    MjcfScope copy = scope;
    copy.suffix = fmt::format("{}{:0{}}{}", separator, i, digits, scope.suffix);
    copy.copies.insert(copy.copies.end(), {group, i});
    pose.orientation = scope.file->euler({i * euler[0], i * euler[1], i * euler[2]});
    out.push_back({pose, &add_scope(whole, node, std::move(copy))});
    pose.position = outer_point(pose, offset);
  }
  return out;
}

void read_mjcf_model(MjcfFile& file, const RobotNode& asset) {
  asset.check({{"name"}, {"file"}, {"content_type", Fate::idle, "MJCF is the only one"}});
  const std::string path = path_beside(asset, asset.text("file"));
  for (const MjcfFile* up = &file; up != nullptr; up = up->outer)
    if (same_file(path, up->root.context().file))
      asset.fail(fmt::format("{} is part of itself; expected another file", path));
  const RobotNode root = read_mjcf_root(asset, path, nullptr);
  const std::string name = asset.text("name", root.text("model", ""));
  auto& model = file.models[name];
  if (model) asset.fail(fmt::format("model name '{}' is used twice", name));
  model = std::make_unique<MjcfFile>(root, file.whole, &file);
  read_mjcf_settings(*model);
}

const MjcfScope& attached_scope(MjcfWhole& whole, const RobotNode& node, const MjcfScope& outer) {
  node.check({{"model"}, {"body"}, {"frame"}, {"prefix"}});
  if (node.has("body") && node.has("frame")) node.fail("both 'body' and 'frame'; expected one");
  if (!node.has("body") && !node.has("frame") && !node.has("model"))
    node.fail("none of 'model', 'body' and 'frame'; expected one");
  MjcfScope scope{node.has("model") ? &model_named(*outer.file, node) : outer.file};
  scope.model = static_cast<int>(whole.models.size());
  if (!node.given("prefix")) node.fail("attribute 'prefix' is missing; \"\" is none");
  scope.prefix = affix(node, "prefix");
  scope.outer = &outer;
  scope.copies = outer.copies;
  scope.copies.insert(scope.copies.end(), {static_cast<int>(whole.scopes.size()), 0});
  whole.models.push_back(&add_scope(whole, node, std::move(scope)));
  return *whole.models.back();
}

}  // namespace tangere
