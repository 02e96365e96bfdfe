// SPDX-License-Identifier: Apache-2.0
// tangere skin: coefficients of a layer of rubber that is bonded to a stiff back, for points that
// each stand for an area of it (engine/scene/skin_material.hpp).
#include "engine/scene/skin_material.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "engine/base/error.hpp"

namespace tangere::apps {
namespace {

/// Contact sizes χ for which the formula was compared with finite elements.
constexpr double kLeastSize = 0.3, kMostSize = 1;

struct SkinArguments {
  std::optional<double> modulus, thickness, pitch, contact_pitch, radius, press, time, depth,
      friction;
};

double required(const std::optional<double>& x, const char* option, const char* what) {
  if (!x) throw InputError(fmt::format("{} is missing; expected {}", option, what));
  return *x;
}

/// Returns c = K t/E of the contact that is given, or the usual one.
double ratio_of(const SkinArguments& a, double thickness) {
  if (a.radius.has_value() != a.press.has_value())
    throw InputError(fmt::format("{} without {}; expected both: they say how large a contact is",
                                 a.radius ? "--radius" : "--press",
                                 a.radius ? "--press" : "--radius"));
  if (!a.radius) return kUsualStiffnessRatio;
  const double size = std::sqrt(*a.radius * *a.press) / thickness;
  if (size < kLeastSize || size > kMostSize)
    throw InputError(fmt::format(
        "--radius {} and --press {} make a contact of {:.3g} times the thickness; expected {} to "
        "{}, for which the stiffness is known",
        *a.radius, *a.press, size, kLeastSize, kMostSize));
  return stiffness_ratio(size);
}

/// The coefficients of points that stand for an area [m²].
Json shared(const ContactCoefficients& per_area, double area, double friction) {
  return {{"kn", per_area.kn * area},
          {"kt", per_area.kt * area},
          {"mu", friction},
          {"damping", per_area.damping * area},
          {"ks", per_area.ks * area}};
}

std::string attributes(const Json& c) {
  std::string text;
  for (const auto& [name, value] : c.items())
    text += fmt::format("{}{}=\"{:.4g}\"", text.empty() ? "" : " ", name, value.get<double>());
  return text;
}

int skin(const SkinArguments& a, const Console& console) {
  const double E = required(a.modulus, "--modulus", "Young's modulus of the skin [Pa]"),
               t = required(a.thickness, "--thickness", "the skin's thickness [m]"),
               pitch = required(a.pitch, "--pitch", "the distance between neighbouring points [m]"),
               contact_pitch = a.contact_pitch.value_or(pitch), friction = a.friction.value_or(0.6),
               ratio = ratio_of(a, t), stiffness = ratio * E / t;
  const ContactCoefficients per_area =
      skin_springs(stiffness, a.time.value_or(SkinMaterial{}.relaxation),
                   a.depth.value_or(kUsualDampingDepth * t));
  const Json tactile = shared(per_area, pitch * pitch, friction),
             contact = shared(per_area, contact_pitch * contact_pitch, friction),
             surface = shared(per_area, 1, friction);
  console.print(fmt::format("<tactile {}/>\n<general_primitive_contact {}/>\n<surface_contact {}/>",
                            attributes(tactile), attributes(contact), attributes(surface)));
  constexpr double kPerSquareMillimetre = 1e-6;
  console.note(fmt::format(
      "per mm² of skin: kn {:.4g} N/m, ks {:.4g} N/m. kn by area is {:.3g} E/t; it is {:.3g} to "
      "{:.3g} E/t under balls with √(R d) from 1 to {} of the thickness. Under contacts much wider "
      "than the skin is thick ks is E/(3 t). Measure kn with a press test.",
      per_area.kn * kPerSquareMillimetre, per_area.ks * kPerSquareMillimetre, ratio,
      stiffness_ratio(kMostSize), stiffness_ratio(kLeastSize), kLeastSize));
  console.result({{"command", "skin"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"stiffness_ratio", ratio},
                  {"pitch", pitch},
                  {"contact_pitch", contact_pitch},
                  {"tactile", tactile},
                  {"contact", contact},
                  {"surface_contact", surface}});
  return kDone;
}

}  // namespace

Command add_skin(CLI::App& program) {
  const auto a = std::make_shared<SkinArguments>();
  const auto console = std::make_shared<Console>();
  CLI::App& app = add_command(program, "skin", "Choose the coefficients of a soft skin",
                              "tangere skin --modulus 2e5 --thickness 3e-3 --pitch 1e-3");
  add_positive_number(app, "--modulus", a->modulus, "Young's modulus of the skin [Pa]");
  add_positive_number(app, "--thickness", a->thickness, "Thickness of the skin [m]");
  add_positive_number(app, "--pitch", a->pitch, "Distance between neighbouring tactile points [m]");
  add_positive_number(app, "--contact-pitch", a->contact_pitch,
                      "Distance between contact points of the body [m] [default: as --pitch]");
  add_positive_number(app, "--radius", a->radius,
                      "Radius of a ball that presses [m]; with --press, kn is that of its contact");
  add_positive_number(app, "--press", a->press, "How far the ball is pressed in [m]");
  add_positive_number(app, "--time", a->time, "Time of relaxation [s] [default: 0.005]");
  add_positive_number(
      app, "--depth", a->depth,
      "Depth at which the normal damping relaxes in that time [m] [default: thickness / 10]");
  add_positive_number(app, "--friction", a->friction, "Friction coefficient [default: 0.6]");
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return skin(*a, *console); }};
}

}  // namespace tangere::apps
