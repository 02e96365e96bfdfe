// SPDX-License-Identifier: Apache-2.0
// tangere skin: coefficients of a layer of rubber that is bonded to a stiff back, for points that
// each stand for an area 𝒜 of it. With Young's modulus E, Poisson's ratio ν and thickness t,
//   k_n = E' 𝒜/t,  k_s = G 𝒜/t,  G = E/(2(1 + ν))
// where E' is E/(1 - ν²) under contacts narrower than t, and up to the confined modulus
// E(1 - ν)/((1 + ν)(1 - 2ν)) under those that are much wider. With a time of relaxation τ
//   k_t = k_s τ,  k_d = k_n τ/δ
// so that the damper of the clamped law, k_d |d|, is k_n τ at the depth δ.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "engine/base/error.hpp"

namespace tangere::apps {
namespace {

struct SkinArguments {
  std::optional<double> modulus, thickness, pitch, contact_pitch, poisson, time, depth, friction;
  bool wide = false;
};

/// A skin's coefficients per area, and what they follow from.
struct Skin {
  double shear;                              ///< G [Pa]
  double narrow, wide;                       ///< E' under narrow and wide contacts [Pa]
  double normal_stiffness, shear_stiffness;  ///< of an area [N/m per m²]
  double time, depth, friction;              ///< τ [s], δ [m], μ
};

Skin skin_of(const SkinArguments& a) {
  const auto required = [](const std::optional<double>& x, const char* option, const char* what) {
    if (!x) throw InputError(fmt::format("{} is missing; expected {}", option, what));
    return *x;
  };
  const double E = required(a.modulus, "--modulus", "Young's modulus of the skin [Pa]"),
               t = required(a.thickness, "--thickness", "the skin's thickness [m]"),
               nu = a.poisson.value_or(0.49);
  required(a.pitch, "--pitch", "the distance between neighbouring points [m]");
  if (nu >= 0.5)
    throw InputError(fmt::format(
        "--poisson {} has no confined modulus; expected a number below 0.5, such as 0.49", nu));
  Skin s{};
  s.shear = E / (2 * (1 + nu));
  s.narrow = E / (1 - nu * nu);
  s.wide = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu));
  s.normal_stiffness = (a.wide ? s.wide : s.narrow) / t;
  s.shear_stiffness = s.shear / t;
  s.time = a.time.value_or(5e-3);
  s.depth = a.depth.value_or(0.1 * t);
  s.friction = a.friction.value_or(0.6);
  return s;
}

/// Coefficients of points at a pitch.
Json coefficients(const Skin& s, double pitch) {
  const double area = pitch * pitch, kn = s.normal_stiffness * area, ks = s.shear_stiffness * area;
  return {{"kn", kn},
          {"kt", ks * s.time},
          {"mu", s.friction},
          {"damping", kn * s.time / s.depth},
          {"ks", ks}};
}

std::string attributes(const Json& c) {
  std::string text;
  for (const auto& [name, value] : c.items())
    text += fmt::format("{}{}=\"{:.4g}\"", text.empty() ? "" : " ", name, value.get<double>());
  return text;
}

int skin(const SkinArguments& a, const Console& console) {
  const Skin s = skin_of(a);
  const double pitch = *a.pitch, contact_pitch = a.contact_pitch.value_or(pitch);
  const Json tactile = coefficients(s, pitch), contact = coefficients(s, contact_pitch);
  constexpr double kPerSquareMillimetre = 1e-6;
  const Json surface = coefficients(s, 1);  // of an area
  console.print(fmt::format("<tactile {}/>\n<general_primitive_contact {}/>\n<surface_contact {}/>",
                            attributes(tactile), attributes(contact), attributes(surface)));
  console.note(fmt::format(
      "per mm² of skin: kn {:.4g} N/m, ks {:.4g} N/m. Young's modulus {:.4g} Pa acts as {:.4g} Pa "
      "under contacts narrower than the skin is thick and as up to {:.4g} Pa under wide ones; {} "
      "is "
      "taken. Press the skin to know kn.",
      s.normal_stiffness * kPerSquareMillimetre, s.shear_stiffness * kPerSquareMillimetre,
      *a.modulus, s.narrow, s.wide, a.wide ? "the latter" : "the former"));
  console.result({{"command", "skin"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"shear_modulus", s.shear},
                  {"narrow_modulus", s.narrow},
                  {"wide_modulus", s.wide},
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
  add_positive_number(app, "--poisson", a->poisson, "Poisson's ratio, below 0.5 [default: 0.49]");
  add_positive_number(app, "--time", a->time, "Time of relaxation [s] [default: 0.005]");
  add_positive_number(
      app, "--depth", a->depth,
      "Depth at which the normal damping relaxes in that time [m] [default: thickness / 10]");
  add_positive_number(app, "--friction", a->friction, "Friction coefficient [default: 0.6]");
  add_flag(app, "--wide", a->wide, "Contacts are much wider than the skin is thick");
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return skin(*a, *console); }};
}

}  // namespace tangere::apps
