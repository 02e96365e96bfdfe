// SPDX-License-Identifier: Apache-2.0
// MuJoCo takes a file once, from the folder of the file that the user names. So does this, and
// rings cannot be.
#include "io/robot/mjcf_include.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "io/files/text_file.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestInclude = std::size_t{64} << 20;

bool same_file(const std::string& a, const std::string& b) {
  std::error_code not_both_there;
  return fs::equivalent(a, b, not_both_there) || a == b;
}

}  // namespace

RobotNode included_root(const RobotNode& include) {
  include.check({{"file"}});
  Robot& robot = include.robot();
  const std::string& main = robot.scene.path;
  const std::string path =
      (fs::path(main).parent_path() / include.text("file")).lexically_normal().string();
  bool known = same_file(path, main);
  for (const auto& other : robot.included) known |= same_file(path, other->context.file);
  if (known) include.fail(fmt::format("{} is there already; MuJoCo includes a file once", path));
  const auto file = std::make_shared<RobotFile>();
  robot.included.push_back(file);
  file->context.file = path;
  file->context.allow_unknown = include.context().allow_unknown;
  try {
    const std::string text = read_text_file(path, kLargestInclude, "a MJCF file");
    const RobotNode root(
        parse_xml(file->document, text, path, "the root <mujoco>", file->context.warnings),
        file->context, robot);
    if (root.name() != "mujoco" && root.name() != "mujocoinclude")
      root.fail("no part of a MJCF file; expected the root <mujoco> or <mujocoinclude>");
    root.check({{"model"}});
    return root;
  } catch (const IoError& e) {
    throw IoError(include.source().prefix() + "<include>: " + e.what());
  }
}

}  // namespace tangere
