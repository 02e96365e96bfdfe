// SPDX-License-Identifier: Apache-2.0
// The names of elements, and which elements each part of a file holds.
#include <algorithm>
#include <bit>

#include "engine/scene/schema.hpp"

namespace tangere {
namespace {

// clang-format off
constexpr const char* kElementNames[] = {
    "option", "solver_option", "ground", "robot", "link", "joint", "body", "visual", "collision",
    "motor", "ground_contact", "general_primitive_contact", "tactile", "imperfections", "markers",
    "endeffector", "joint", "constant", "piecewise", "at", "csv", "random", "outputs", "joint",
    "motor", "ground_contact", "general_primitive_contact", "tactile", "body", "surface_contact",
    "surface_contact", "layer", "picture", "connect", "weld", "connect", "weld", "camera",
    "channels", "path", "wrench", "point", "wrap", "pulley", "camera",
};
// clang-format on
static_assert(std::size(kElementNames) == kElements);

constexpr Holder kHolders[] = {
    {"tangere", kOption | kSolver | kGround | kOutputs},
    {"default", kJoint | kBody | kTouching | kSurfaceContact | kMotor | kEndEffector, true},
    {"robot", kLink, true},
    {"actuator", kMotor, true},
    {"contact", kContacts | kSurfaceContact, true},
    {"loop", kLoops, true},
    {"transmission", kPath | kWrench, true},
    {"sensor", kTactile | kCamera, true},
    {"variable", kEndEffector, true},
    {"initial", kInitialJoint, true},
    {"control", kConstant | kPiecewise | kCsv | kRandom, true},
    {"randomize", kVarying, true},
    {"link", kJoint | kBody | kLink},
    {"body", kVisual | kCollision},
    {"tactile", kImperfections | kMarkers | kLayer | kGelPicture | kChannels},
    {"piecewise", kAt},
    {"path", kPoint | kWrap | kPulley},
};

}  // namespace

std::span<const Holder> holders() { return kHolders; }

std::uint64_t elements_inside(std::string_view holder) {
  const auto found =
      std::ranges::find_if(kHolders, [&](const Holder& h) { return holder == h.name; });
  return found == std::end(kHolders) ? 0 : found->elements;
}

const char* to_string(Element element) {
  return kElementNames[std::countr_zero(static_cast<std::uint64_t>(element))];
}

}  // namespace tangere
