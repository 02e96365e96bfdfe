// SPDX-License-Identifier: Apache-2.0
// The schema of scenes: one row for each attribute of a scene file. The reader, the writer, the
// parameters, the checks of values and the tables of docs/scenes.md follow from it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "engine/scene/effect_kind.hpp"
#include "engine/scene/scene.hpp"
#include "engine/scene/units.hpp"

namespace tangere {

/// Elements of a scene file as bits: a row may serve several.
enum Element : std::uint64_t {
  kOption = 1ULL << 0,
  kSolver = 1ULL << 1,
  kGround = 1ULL << 2,
  kRobot = 1ULL << 3,
  kLink = 1ULL << 4,
  kJoint = 1ULL << 5,
  kBody = 1ULL << 6,
  kVisual = 1ULL << 7,
  kCollision = 1ULL << 8,
  kMotor = 1ULL << 9,
  kGroundContact = 1ULL << 10,
  kPairContact = 1ULL << 11,
  kTactile = 1ULL << 12,
  kImperfections = 1ULL << 13,
  kMarkers = 1ULL << 14,
  kEndEffector = 1ULL << 15,
  kInitialJoint = 1ULL << 16,
  kConstant = 1ULL << 17,
  kPiecewise = 1ULL << 18,
  kAt = 1ULL << 19,
  kCsv = 1ULL << 20,
  kRandom = 1ULL << 21,
  kOutputs = 1ULL << 22,
  kVaryJoint = 1ULL << 23,  ///< in <randomize>, like those below
  kVaryMotor = 1ULL << 24,
  kVaryGround = 1ULL << 25,
  kVaryPair = 1ULL << 26,
  kVaryTactile = 1ULL << 27,
  kVaryBody = 1ULL << 28,
  kSurfaceContact = 1ULL << 29,
  kVarySurface = 1ULL << 30,  ///< in <randomize>
  kLayer = 1ULL << 31,
  kGelPicture = 1ULL << 32,
  kConnect = 1ULL << 33,
  kWeld = 1ULL << 34,
  kVaryConnect = 1ULL << 35,  ///< in <randomize>, like the next
  kVaryWeld = 1ULL << 36,
  kCamera = 1ULL << 37,
  kChannels = 1ULL << 38,
  kPath = 1ULL << 39,  ///< in <transmission>, like the next
  kWrench = 1ULL << 40,
  kPoint = 1ULL << 41,  ///< in <path>, like those below
  kWrap = 1ULL << 42,
  kPulley = 1ULL << 43,
  kVaryCamera = 1ULL << 44,  ///< in <randomize>
};
inline constexpr int kElements = 45;
inline constexpr std::uint64_t kContacts = kGroundContact | kPairContact,
                               kTouching = kContacts | kTactile, kLoops = kConnect | kWeld,
                               kVarying = kVaryJoint | kVaryMotor | kVaryGround | kVaryPair |
                                          kVaryTactile | kVaryBody | kVarySurface | kVaryConnect |
                                          kVaryWeld | kVaryCamera;

/// Elements of which also a number of a vector may vary, by its index.
inline constexpr std::uint64_t kVaryIndexed = kVaryJoint | kVaryBody | kVaryCamera;

/// The name in scene files.
const char* to_string(Element element);

/// A part of a scene file that holds elements: the root, a section, or an element.
struct Holder {
  const char* name;
  std::uint64_t elements;  ///< Element bits of what it holds
  bool section = false;    ///< stands in the root and has no attributes
};
/// All of them: the root <tangere>, then the sections, then elements that hold others.
std::span<const Holder> holders();
/// Returns the Element bits of what the holder of this name holds; 0 if there is none.
std::uint64_t elements_inside(std::string_view holder);

/// Which values an attribute may have. Numbers are finite.
enum class Bound : std::uint8_t { any, not_negative, positive, share, range, integer };

/// Properties of rows.
enum : std::uint8_t {
  kInDefault = 1,  ///< may stand in <default>
  kPicture = 2,    ///< for viewers only: accepted and not read
  kIgnored = 4,    ///< published scenes have it on elements that do not use it: a warning
  kVaries = 8,     ///< <randomize> may let it differ between environments
  kGradient = 16,  ///< has a derivative
  kIndexed = 32,   ///< the parameter has components
};

/// The member of a scene's structs that keeps a value; none: the reader places it.
using Member = std::variant<
    std::monostate, double Scene::*, double SolverOptions::*,
    std::optional<double> SolverOptions::*, int SolverOptions::*, Vector3 GroundDescription::*,
    Vector3 Pose::*, Quaternion Pose::*, double JointEffects::*, double BodyDescription::*,
    std::array<double, 4> BodyDescription::*, double AbstractShape::*, double MotorDescription::*,
    double ContactCoefficients::*, double LoopDescription::*, Vector3 LoopDescription::*,
    int TactileDescription::*, double SensorImperfections::*, NormalAndShear SensorImperfections::*,
    double MarkersDescription::*, double SkinMaterial::*, double LayerDescription::*,
    std::optional<double> LayerDescription::*, int PictureDescription::*,
    double PictureDescription::*, double ChannelsDescription::*, int CameraDescription::*,
    double CameraDescription::*, Vector3 CameraDescription::*, Vector3 EndEffectorDescription::*,
    double EndEffectorDescription::*, std::array<double, 4> EndEffectorDescription::*,
    double PiecewiseControl::*, double RandomControl::*>;

/// An attribute of one or several elements.
struct Attribute {
  std::uint64_t elements = 0;  ///< Element bits
  const char* name = "";
  /// The value where a file gives none, as in a file; "": there is none; nullptr: must be given.
  const char* default_text = "";
  Unit unit = Unit::one;        ///< of dofs that slide, and of laws other than linear
  const char* text = "";        ///< one line of documentation
  Unit other_unit = Unit::one;  ///< of dofs that turn, and of law linear; one: the same
  Bound bound = Bound::any;
  double least = 0, most = 0;   ///< of bound range and integer
  const char* words = nullptr;  ///< the values that it may have, between blanks; nullptr: no words
  const char* types = nullptr;  ///< of the element that use it, between blanks; nullptr: all
  Member member{};
  std::uint8_t flags = 0;
  std::optional<NumberField> field{};  ///< of the parameter that it is
  std::optional<EffectKind> effect{};  ///< for which it calls where it is not zero

  [[nodiscard]] bool has(int flag) const { return (flags & flag) != 0; }
  [[nodiscard]] Unit unit_of(bool turns_or_linear) const {
    return turns_or_linear && other_unit != Unit::one ? other_unit : unit;
  }
  /// Whether elements of a type use it.
  [[nodiscard]] bool serves(std::string_view type) const;
  /// Returns an error text for a value: `kn="-1"; expected zero or more`; "" if it is valid.
  [[nodiscard]] std::string fault(double value) const;
};

std::span<const Attribute> schema();
/// Splits a list of words between blanks.
std::vector<std::string> words_of(const char* between_blanks);
/// Returns the attribute of an element. Throws std::logic_error where the schema has none.
const Attribute& attribute_of(Element element, std::string_view name);

/// The kind of pair contacts for an effect of contacts or sensors.
constexpr EffectKind pair_kind(EffectKind kind) {
  constexpr int kFirst = static_cast<int>(EffectKind::pair_contact), kParts = 4;
  return static_cast<EffectKind>(kFirst + (static_cast<int>(kind) - kFirst) % kParts);
}
/// Returns the coefficients of joints, contacts or sensors that enable an effect.
std::vector<NumberField> coefficients_of(EffectKind kind);

/// Calls f(row, member) for all attributes of an element whose values are members of T.
template <class T, class F>
void for_each_member(Element element, const F& f) {
  for (const Attribute& row : schema()) {
    if ((row.elements & element) == 0) continue;
    std::visit(
        [&](auto member) {
          if constexpr (requires(T & to) { to.*member; }) f(row, member);
        },
        row.member);
  }
}

/// Returns an error text for the values of an element in T; "" if they are valid. For an attribute
/// without default, zero means that it is not given.
template <class T>
std::string value_fault(Element element, const T& of) {
  std::string fault;
  const auto check = [&](const Attribute& row, double value) {
    const bool not_given = value == 0 && row.default_text != nullptr && *row.default_text == '\0';
    if (fault.empty() && !not_given) fault = row.fault(value);
  };
  for_each_member<T>(element, [&](const Attribute& row, auto member) {
    using Value = std::remove_cvref_t<decltype(of.*member)>;
    if constexpr (std::is_arithmetic_v<Value>) {
      check(row, of.*member);
    } else if constexpr (std::is_same_v<Value, NormalAndShear>) {
      check(row, (of.*member).normal), check(row, (of.*member).shear);
    } else if constexpr (std::is_same_v<Value, std::optional<double>>) {
      if (of.*member) check(row, *(of.*member));
    } else {
      for (const double x : of.*member) check(row, x);
    }
  });
  return fault;
}

}  // namespace tangere
