// SPDX-License-Identifier: Apache-2.0
// The table of all attributes, in the order of docs/scenes.md.
#include "engine/scene/schema.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace tangere {
namespace {

using U = Unit;
using B = Bound;
using F = NumberField;
using E = EffectKind;
using C = ContactCoefficients;
using I = SensorImperfections;
using J = JointEffects;
using L = LoopDescription;

constexpr const char *kNone = "", *kNeeded = nullptr;
constexpr const char* kMoving = "revolute prismatic planar translational free2d spherical free3d";
constexpr const char *kSingle = "revolute prismatic", *kSkins = "rect_array hemisphere cylinder";
constexpr const char* kDry = "revolute prismatic planar translational free2d";
constexpr int kParameter = kVaries | kGradient;
constexpr int kMostPoints = 1 << 20;  // of a surface, and of a sensor
constexpr int kMostOnEdge = 1000;     // contact points along one edge or around one ring
constexpr int kMostSpread = 4096;     // contact points spread over a mesh

// Columns that not all rows have.
struct Between {
  Bound bound;
  double least, most;
};
struct Flags {
  int value;
};
struct Or {
  Unit value;
};
struct Types {
  const char* value;
};
struct Words {
  const char* value;
};
constexpr void set(Attribute& a, Bound bound) { a.bound = bound; }
constexpr void set(Attribute& a, Between x) {
  a.bound = x.bound, a.least = x.least, a.most = x.most;
}
constexpr void set(Attribute& a, Flags flags) { a.flags |= static_cast<std::uint8_t>(flags.value); }
constexpr void set(Attribute& a, Or unit) { a.other_unit = unit.value; }
constexpr void set(Attribute& a, Types types) { a.types = types.value; }
constexpr void set(Attribute& a, Words words) { a.words = words.value; }
constexpr void set(Attribute& a, NumberField field) { a.field = field; }
constexpr void set(Attribute& a, EffectKind effect) { a.effect = effect; }
template <class T, class Value>
constexpr void set(Attribute& a, Value T::*member) {
  a.member = member;
}

template <class... Columns>
constexpr Attribute row(std::uint64_t of, const char* name, const char* usual, Unit unit,
                        const char* text, Columns... columns) {
  Attribute a{of, name, usual, unit, text};
  (set(a, columns), ...);
  return a;
}
constexpr Attribute picture(std::uint64_t of, const char* name, int flags = 0) {
  return row(of, name, kNone, U::one, "", Flags{kPicture | flags});
}
constexpr Attribute ignored(std::uint64_t of, const char* name) {
  return row(of, name, kNone, U::one, "", Types{""}, Flags{kIgnored});
}
template <class... Columns>
constexpr Attribute shape(const char* types, const char* name, const char* usual, Unit unit,
                          const char* text, Columns... columns) {
  return row(kBody, name, usual, unit, text, Types{types}, columns...);
}
template <class... Columns>
constexpr Attribute layout(const char* types, const char* name, Unit unit, const char* text,
                           Columns... columns) {
  return row(kTactile, name, kNeeded, unit, text, Types{types}, columns...);
}
template <class Value, class... Columns>
constexpr Attribute imperfection(const char* name, Value I::*member, Unit unit, const char* text,
                                 Columns... columns) {
  return row(kImperfections, name, "0", unit, text, member, B::not_negative,
             E::sensor_imperfections, columns...);
}
template <class T, class... Columns>
constexpr Attribute coefficient(std::uint64_t of, const char* name, NumberField field,
                                double T::*member, Unit unit, EffectKind effect, const char* text,
                                Columns... columns) {
  return row(of, name, "0", unit, text, member, field, effect, B::not_negative,
             Flags{kInDefault | kVaries}, columns...);
}

constexpr Attribute kSchema[] = {
    row(kOption, "unit", "cm-g", U::one, "units of all numbers", Words{"cm-g m-kg"}),
    row(kOption, "gravity", "", U::m_per_s2,
        "acceleration of free fall; 0 0 -9.8 m/s² if left out"),
    row(kOption, "timestep", "0.02", U::s, "length of a step", &Scene::timestep, B::positive),
    row(kOption, "integrator", "BDF1", U::one, "BDF1, BDF2, SDIRK2 or SDIRK3"),

    row(kSolver, "tol", "", U::one, "on the scaled residual; follows scheme and step if left out",
        &SolverOptions::tolerance, B::positive),
    row(kSolver, "max_iter", "20", U::one, "Newton iterations before a step is split",
        &SolverOptions::max_iterations, Between{B::integer, 1, 100000}),
    row(kSolver, "accuracy", "", U::one, "steps are cut into parts that keep it: 0.01 is 1 percent",
        &SolverOptions::accuracy, B::share),
    row(kSolver, "energy", "bounded", U::one, "whether steps that create energy are taken again",
        Words{"bounded free"}),
    row(kSolver, "sleep", "", U::one, "share of its size that a resting body moves; 0.001 is usual",
        &SolverOptions::sleep, B::share, E::sleeping),
    ignored(kSolver, "max_ls"),

    row(kGround, "pos", "0 0 0", U::m, "a point of the ground", &GroundDescription::position),
    row(kGround, "normal", "0 0 1", U::one, "points out of the ground"),
    picture(kGround, "size"),
    picture(kGround, "texture"),
    picture(kGround, "rgba"),

    row(kRobot | kLink, "name", kNeeded, U::one, "its name"),
    row(kLink, "parent", "", U::one, "the link before it on which a link of <robot> hangs"),
    ignored(kLink, "design_params"),

    row(kJoint, "name", kNeeded, U::one, "its name"),
    row(kJoint, "type", kNeeded, U::one, "see below",
        Words{"fixed revolute prismatic planar free2d translational spherical spherical-euler "
              "spherical-exp free3d free3d-euler free3d-exp"}),
    row(kJoint, "pos", "0 0 0", U::m, "place in the parent joint's frame", &Pose::position, F::pos,
        Flags{kParameter | kIndexed}),
    row(kJoint, "quat", "1 0 0 0", U::one, "w x y z, made of length 1", &Pose::orientation),
    row(kJoint, "frame", "LOCAL", U::one, "WORLD: pos, quat and axes in the world, all at rest",
        Words{"LOCAL WORLD"}),
    row(kJoint, "axis", kNeeded, U::one, "joint's own frame", Types{"revolute prismatic"}),
    row(kJoint, "axis0", kNeeded, U::one, "joint's own frame", Types{"planar"}),
    row(kJoint, "axis1", kNeeded, U::one, "joint's own frame", Types{"planar"}),
    coefficient(kJoint, "damping", F::damping, &J::damping, U::N_s_per_m, E::joint_damping,
                "force -damping v", Or{U::N_m_s_per_rad}, Flags{kGradient}),
    coefficient(kJoint, "armature", F::armature, &J::armature, U::kg, E::armature,
                "inertia that moves with the dof", Or{U::kg_m2}, Flags{kGradient}, Types{kMoving}),
    coefficient(kJoint, "stiffness", F::stiffness, &J::stiffness, U::N_per_m, E::joint_springs,
                "force -stiffness (q - rest)", Or{U::N_m_per_rad}, Flags{kGradient},
                Types{kMoving}),
    row(kJoint, "rest", "0", U::m, "one number, or one a dof", Or{U::rad}, Types{kMoving}),
    row(kJoint, "lim", kNone, U::m, "low high of q", Or{U::rad}, Types{kMoving}),
    coefficient(kJoint, "lim_stiffness", F::lim_stiffness, &J::limit_stiffness, U::N_per_m,
                E::joint_limits, "force per distance outside lim", Or{U::N_m_per_rad},
                Flags{kGradient}, Types{kMoving}),
    coefficient(kJoint, "friction", F::friction, &J::friction, U::N, E::joint_friction,
                "bound of dry friction", Or{U::N_m}, Flags{kGradient}, Types{kDry}),
    row(kJoint, "friction_break", "0", U::m, "break-away; 0: 0.05 mm, 1 mrad", Or{U::rad},
        Types{kDry}, &J::friction_break, B::not_negative, Flags{kInDefault}),
    row(kJoint, "friction_time", "0.001", U::s, "its damping over its stiffness", Types{kDry},
        &J::friction_time, B::not_negative, Flags{kInDefault}),
    row(kJoint, "follows", kNone, U::one, "joints: q = sum of ratio q of each + offset",
        Types{kSingle}),
    row(kJoint, "ratio", "1", U::one, "a number for each, in units of both", Types{kSingle}),
    row(kJoint, "offset", "0", U::m, "of q, with follows", Or{U::rad}, Types{kSingle}),
    row(kJoint, "powers", kNone, U::one, "adds c2 q^2 + c3 q^3 + c4 q^4 of one", Types{kSingle}),
    ignored(kJoint | kBody, "mu"),
    ignored(kBody, "damping"),
    ignored(kJoint | kBody, "format"),
    ignored(kJoint | kBody, "contacts"),

    row(kBody, "name", "", U::one, "that of its link if left out"),
    row(kBody, "type", kNeeded, U::one, "see below"),
    row(kBody, "pos", "0 0 0", U::m, "place in the joint's frame", &Pose::position),
    row(kBody, "quat", "1 0 0 0", U::one, "w x y z, made of length 1", &Pose::orientation),
    row(kBody, "density", "1", U::kg_per_m3, "mass per volume",
        Types{"sphere cuboid cylinder capsule ellipsoid mesh"}, &BodyDescription::density,
        B::positive, F::density, Flags{kInDefault | kParameter}),
    row(kBody, "mass", kNone, U::kg, "0: massless; abstract: the mass", F::mass, B::not_negative,
        Flags{kGradient}),
    row(kBody, "gravity_share", "1", U::one,
        "of gravity that acts on it; one for what moves rigidly", &BodyDescription::gravity_share),
    row(kBody, "rgba", "0.7 0.7 0.7 1", U::one, "colour in pictures", &BodyDescription::rgba,
        Flags{kInDefault}),
    row(kBody, "specular", "0", U::one, "strength of the highlight of a camera's lamp",
        &BodyDescription::specular, Between{B::range, 0, 1}, Flags{kInDefault}),
    row(kBody, "shininess", "0.5", U::one, "of the highlight: 1 is small, 0 as wide as the body",
        &BodyDescription::shininess, Between{B::range, 0, 1}, Flags{kInDefault}),
    row(kBody, "emission", "0", U::one, "share of its colour that it emits",
        &BodyDescription::emission, Between{B::range, 0, 1}, Flags{kInDefault}),
    picture(kBody, "texture"),
    shape("sphere cylinder capsule", "radius", kNeeded, U::m, "of the round part", B::positive,
          F::radius, Flags{kParameter}),
    shape("cylinder capsule", "length", kNeeded, U::m, "along z; capsule: of the straight part",
          B::positive, F::length, Flags{kParameter}),
    shape("cuboid ellipsoid", "size", kNeeded, U::m, "full lengths along x y z", B::positive,
          F::size, Flags{kParameter | kIndexed}),
    shape("cuboid capsule ellipsoid mesh", "general_contact_resolution", kNone, U::one,
          "contact points", Between{B::integer, 1, kMostOnEdge}),
    shape("cylinder", "general_contact_angle_resolution", "8", U::one, "points on a ring",
          Between{B::integer, 3, kMostOnEdge}),
    shape("cylinder", "general_contact_radius_resolution", "3", U::one, "rings on a face",
          Between{B::integer, 1, kMostOnEdge}),
    shape("mesh", "filename", kNeeded, U::one, "OBJ, STL, PLY or DAE beside the scene"),
    shape("mesh", "vertices", kNone, U::m, "x y z of each, in place of a file"),
    shape("mesh", "triangles", kNone, U::one, "three vertices each, from 0"),
    shape("mesh", "transform_type", kNeeded, U::one, "frame",
          Words{"OBJ_TO_JOINT OBJ_TO_WORLD BODY_TO_JOINT"}),
    shape("mesh", "scale", "1 1 1", U::one, "negative factors mirror", F::scale,
          Flags{kInDefault | kParameter}),
    shape("mesh", "hull", "false", U::one, "true: the convex hull", Words{"true false"}),
    shape("mesh", "resolution", "64", U::one,
          "cells of its distance along the longest side; 0: none",
          Between{B::integer, 0, MeshShape::kMostCells}),
    shape("mesh", "error", kNone, U::m, "of the distance, in place of resolution", B::positive),
    shape("mesh", "count", kNone, U::one, "contact points spread over the area",
          Between{B::integer, 1, kMostSpread}),
    shape("mesh", "pitch", kNone, U::m, "in place of count: distance of contact points",
          B::positive),
    shape("abstract", "inertia", kNeeded, U::kg_m2, "xx yy zz, or xx xy xz yy yz zz"),
    shape("abstract", "contacts", kNone, U::one, "file of contact points, body frame"),
    shape("abstract", "mesh", kNone, U::one, "for pictures"),
    picture(kVisual, "mesh"),
    picture(kVisual, "pos"),
    picture(kVisual, "quat"),
    row(kCollision, "contacts", kNone, U::one, "file of contact points"),
    row(kCollision, "radius", kNeeded, U::m, "of a hemisphere, in place of a file", B::positive),
    row(kCollision, "count", kNeeded, U::one, "points of the hemisphere",
        Between{B::integer, 1, kMostPoints}),
    row(kCollision, "pos", "0 0 0", U::m, "place of the points in the body", &Pose::position),
    row(kCollision, "quat", "1 0 0 0", U::one, "w x y z", &Pose::orientation),

    row(kMotor, "joint", "", U::one, "a joint whose dofs all slide or all turn"),
    row(kMotor, "body", kNone, U::one, "in place of a joint: it pushes this body"),
    row(kMotor, "pos", "0 0 0", U::m, "of a force on the body, in its frame"),
    row(kMotor, "gear", kNone, U::one, "force, then torque [m] per force of the motor, body axes"),
    row(kMotor, "ctrl", kNeeded, U::one, "u: a force from -1 to 1, or a target",
        Words{"force position"}),
    row(kMotor, "name", "", U::one, "of its controls; that of its joint if left out"),
    row(kMotor, "ctrl_range", kNone, U::N, "least and largest force; ctrl force needs it",
        Or{U::N_m}, Flags{kInDefault}),
    row(kMotor, "P", kNeeded, U::N_per_m, "force P (u - q) - D v", Or{U::N_m_per_rad},
        Types{"position"}, &MotorDescription::P, B::not_negative, F::P,
        Flags{kInDefault | kParameter}),
    row(kMotor, "D", "0", U::N_s_per_m, "the same; of a force: scale u + offset - D v",
        Or{U::N_m_s_per_rad}, Types{"position force"}, &MotorDescription::D, B::not_negative, F::D,
        Flags{kInDefault | kParameter}),
    row(kMotor, "timing", "end", U::one, "start: the force is that of the step's start",
        Types{"position"}, Words{"end start"}, Flags{kInDefault}),
    row(kMotor, "scale", kNone, U::one, "force or target per u [N, N m, m, rad]"),
    row(kMotor, "offset", "0", U::one, "force or target at u = 0, in the unit of scale"),
    row(kMotor, "u_range", kNone, U::one, "to which u is clipped before; low high"),

    row(kGroundContact, "body", kNeeded, U::one, "its points touch the ground"),
    row(kPairContact, "general_body", kNeeded, U::one, "its points touch"),
    row(kPairContact, "primitive_body", kNeeded, U::one, "its distance is touched"),
    row(kTactile, "name", "", U::one, "that of its body if left out"),
    row(kTactile, "body", kNeeded, U::one, "it carries the sensor"),
    row(kTactile, "type", kNeeded, U::one, "a layout, see below",
        Words{"rect_array abstract hemisphere cylinder mesh"}),
    coefficient(kTouching, "kn", F::kn, &C::kn, U::N_per_m, E::pair_contact, "normal stiffness",
                Flags{kGradient}),
    coefficient(kTouching, "kt", F::kt, &C::kt, U::N_s_per_m, E::pair_friction,
                "tangential damping", Flags{kGradient}),
    coefficient(kTouching, "mu", F::mu, &C::mu, U::one, E::pair_friction, "friction coefficient",
                Flags{kGradient}),
    coefficient(kTouching, "damping", F::damping, &C::damping, U::N_s_per_m2, E::pair_damping,
                "normal damping; laws linear and published: N s/m", Flags{kGradient},
                Or{U::N_s_per_m}),
    coefficient(kTouching, "ks", F::ks, &C::ks, U::N_per_m, E::pair_memory, "tangential stiffness",
                Flags{kGradient}),
    row(kSurfaceContact, "body1", kNeeded, U::one, "its surface touches"),
    row(kSurfaceContact, "body2", kNeeded, U::one, "that of this body, or \"ground\""),
    coefficient(kSurfaceContact, "kn", F::kn, &C::kn, U::N_per_m3, E::pair_contact,
                "normal stiffness by area", Flags{kGradient}),
    coefficient(kSurfaceContact, "kt", F::kt, &C::kt, U::N_s_per_m3, E::pair_friction,
                "tangential damping by area", Flags{kGradient}),
    coefficient(kSurfaceContact, "mu", F::mu, &C::mu, U::one, E::pair_friction,
                "friction coefficient", Flags{kGradient}),
    coefficient(kSurfaceContact, "damping", F::damping, &C::damping, U::N_s_per_m4, E::pair_damping,
                "normal damping by area", Flags{kGradient}),
    coefficient(kSurfaceContact, "ks", F::ks, &C::ks, U::N_per_m3, E::pair_memory,
                "tangential stiffness by area", Flags{kGradient}),
    row(kSurfaceContact, "law", "clamped", U::one, "see contact.md", Words{"clamped paper"},
        Flags{kInDefault}),
    row(kSurfaceContact, "pitch", kNone, U::m,
        "distance of neighbouring points; follows sizes, kn and weight if left out", B::positive,
        Flags{kInDefault}),
    row(kGroundContact, "law", "linear", U::one, "see contact.md",
        Words{"clamped paper linear published"}, Flags{kInDefault}),
    row(kPairContact, "law", "clamped", U::one, "see contact.md",
        Words{"clamped paper linear published"}, Flags{kInDefault}),
    row(kTactile, "per", "point", U::one, "all but mu count per area", Types{kSkins},
        Words{"point area"}, Flags{kInDefault}),
    row(kTactile, "modulus", kNone, U::Pa, "gives kn, kt, ks, damping, see skin.md", Types{kSkins},
        &SkinMaterial::modulus, B::positive),
    row(kTactile, "thickness", kNone, U::m, "with modulus or pressure", F::thickness, Types{kSkins},
        &SkinMaterial::thickness, B::positive, Flags{kGradient}),
    row(kTactile, "relaxation", "0.005", U::s, "with modulus or pressure", Types{kSkins},
        &SkinMaterial::relaxation, B::not_negative),
    row(kTactile, "pressure_depth", kNone, U::m, "depths of a table of pressures, from 0",
        Types{"rect_array"}, B::not_negative),
    row(kTactile, "pressure", kNone, U::Pa, "at these depths, from 0, see table.md",
        Types{"rect_array"}, B::not_negative),
    row(kTactile, "law", "clamped", U::one, "see contact.md", Words{"clamped paper"},
        Flags{kInDefault}),
    row(kContacts, "ramp", kNone, U::m, "law linear: depth over which damping fades in",
        B::not_negative, Flags{kInDefault}),
    picture(kTouching, "render", kInDefault),
    picture(kContacts, "scale"),

    row(kTactile, "every", kNone, U::one, "read at every k-th step", &TactileDescription::every,
        Between{B::integer, 1, 1e9}, Flags{kInDefault}),
    row(kTactile, "memory", "step", U::one, "read: friction of ks advances when it is read",
        Words{"step read"}, Flags{kInDefault}),
    row(kTactile, "pressure_sign", kNone, U::one, "1 or -1; found from the geometry if left out"),
    row(kTactile, "feedback", "false", U::one, "true: its points push as well", Words{"false true"},
        E::feedback),
    row(kTactile, "feels", kNone, U::one, "bodies that it feels, between commas"),
    row(kTactile, "ignores", kNone, U::one, "bodies that it does not feel"),
    layout("rect_array", "rect_pos0", U::m, "a corner"),
    layout("rect_array", "rect_pos1", U::m, "the opposite corner"),
    layout("rect_array", "axis0", U::one, "along the rows of points"),
    layout("rect_array", "axis1", U::one, "along the columns"),
    layout("rect_array cylinder hemisphere", "resolution", U::one,
           "rows, cols; hemisphere: optional", Between{B::integer, 1, 4096}),
    layout("abstract", "spec", U::one, "file of points beside the scene"),
    row(kTactile, "points", kNone, U::one, "position, normal, axis0 of each, in place of a file",
        Types{"abstract"}),
    layout("hemisphere cylinder", "radius", U::m, "of the surface", B::positive),
    layout("hemisphere", "count", U::one, "number of points", Between{B::integer, 1, kMostPoints}),
    layout("cylinder", "length", U::m, "along z", B::positive),
    layout("mesh", "filename", U::one, "OBJ, STL, PLY or DAE beside the scene"),
    layout("mesh", "pitch", U::m, "longest edge of a triangle", B::positive),
    row(kTactile, "scale", "1 1 1", U::one, "of the file", Types{"mesh"}),
    row(kTactile, "pos", "0 0 0", U::m, "place in the body's frame", &Pose::position),
    row(kTactile, "quat", "1 0 0 0", U::one, "w x y z", &Pose::orientation),

    imperfection("hysteresis", &I::hysteresis, U::one, "share of the answer that is late",
                 Between{B::range, 0, 1}),
    imperfection("hysteresis_time", &I::hysteresis_time, U::s, "time constant with which it comes",
                 Between{B::range, 0, 1e3}),
    imperfection("low_pass", &I::low_pass, U::s, "time constant", Between{B::range, 0, 1e3}),
    imperfection("delay", &I::delay, U::s, "", Between{B::range, 0, 1e3}),
    imperfection("spread", &I::spread, U::m, "distance over which a force spreads",
                 Between{B::range, 0, 1e3}),
    imperfection("crosstalk", &I::crosstalk, U::one, "share of a point that each neighbour gets",
                 Between{B::range, 0, 0.25}),
    imperfection("gain", &I::gain, U::one, "deviation from point to point",
                 Between{B::range, 0, 1}),
    imperfection("sensor_gain", &I::sensor_gain, U::one, "deviation from episode to episode",
                 Between{B::range, 0, 1}),
    imperfection("bias", &I::bias, U::N, "deviation from point to point"),
    imperfection("noise", &I::noise, U::N, "deviation from step to step"),
    imperfection("dead", &I::dead, U::one, "probability that a point reads 0",
                 Between{B::range, 0, 1}),
    imperfection("saturation", &I::saturation, U::N, "largest reading; 0: none"),
    imperfection("quantisation", &I::quantisation, U::N,
                 "readings are multiples of it; 0: not rounded"),
    row(kMarkers, "stiffness", kNone, U::N_per_m, "of the gel under a point against shear",
        &MarkersDescription::stiffness, B::positive),
    row(kMarkers, "thickness", kNone, U::m, "of the gel", &MarkersDescription::thickness,
        B::positive),
    row(kMarkers, "spread", kNone, U::m, "distance over which the surface moves along",
        &MarkersDescription::spread, B::positive),
    row(kLayer, "poisson", "0.475", U::one, "Poisson's ratio, below 0.5", F::poisson,
        &LayerDescription::poisson, Between{B::range, 0, 0.4999}, Flags{kGradient}),
    row(kLayer, "cell", kNone, U::m, "side of a cell; a fifth of the thickness if left out",
        &LayerDescription::cell, B::positive),
    row(kLayer, "margin", kNone, U::m,
        "from the outermost cells to the skin's free sides; no sides if left out",
        &LayerDescription::margin, B::not_negative),
    row(kLayer, "feedback", "false", U::one, "true: the layer is the contact as well",
        Words{"false true"}, E::feedback),
    row(kLayer, "load", "depth", U::one, "what the sum of the field follows from",
        Words{"depth contact"}),
    row(kGelPicture, "gel", "", U::one, "file of the camera's gel; three lamps if left out"),
    row(kGelPicture, "rows", "240", U::one, "pixels from top to bottom", &PictureDescription::rows,
        Between{B::integer, 1, 2048}),
    row(kGelPicture, "cols", "320", U::one, "pixels from left to right", &PictureDescription::cols,
        Between{B::integer, 1, 2048}),
    row(kGelPicture, "size", "", U::m,
        "height and width; the points and half their distance around if left out", B::positive),
    row(kGelPicture, "mirror", "false", U::one, "true: left and right are exchanged",
        Words{"false true"}),
    row(kGelPicture, "noise", "0", U::one, "deviation of every number in a step, grey levels",
        &PictureDescription::noise, B::not_negative),
    row(kGelPicture, "gain", "0", U::one, "deviation of a factor per channel and episode",
        &PictureDescription::gain, B::not_negative),
    row(kGelPicture, "markers", "", U::one, "columns and rows of printed markers",
        Between{B::integer, 1, 1024}),
    row(kGelPicture, "marker_pitch", kNone, U::m,
        "between printed markers; spread over the picture if left out",
        &PictureDescription::marker_pitch, B::positive),
    row(kGelPicture, "marker_radius", kNone, U::m,
        "of printed markers; a tenth of their distance if left out",
        &PictureDescription::marker_radius, B::positive),

    row(kLoops, "name", "", U::one, "those of its bodies if left out"),
    row(kLoops, "body1", kNeeded, U::one, "a body that moves"),
    row(kLoops, "body2", "", U::one, "another; the world if left out"),
    row(kLoops, "pos1", "0 0 0", U::m, "the point, in the frame of body1", &L::position1),
    row(kLoops, "pos2", kNone, U::m, "in that of body2; where it starts if left out"),
    row(kWeld, "quat2", kNone, U::one, "of body1's axes in body2; as at the start if left out"),
    row(kLoops, "stiffness", kNeeded, U::N_per_m, "force by the gap", &L::stiffness, F::stiffness,
        B::positive, Flags{kParameter}),
    row(kLoops, "damping", "0", U::N_s_per_m, "force by the rate of the gap", &L::damping,
        F::damping, B::not_negative, Flags{kParameter}),
    row(kWeld, "turning_stiffness", kNeeded, U::N_m_per_rad, "torque by the turn",
        &L::turning_stiffness, F::turning_stiffness, B::positive, Flags{kParameter}),
    row(kWeld, "turning_damping", "0", U::N_m_s_per_rad, "torque by the rate of the turn",
        &L::turning_damping, F::turning_damping, B::not_negative, Flags{kParameter}),

    row(kPath | kWrench, "joint", kNeeded, U::one, "of one dof, on a link of its own without mass"),
    row(kPoint | kWrap, "body", "", U::one, "with which it moves; the world if left out"),
    row(kPoint | kWrap, "pos", "0 0 0", U::m, "of the point or the middle, in the body or world"),
    row(kWrap, "radius", kNeeded, U::m, "of the surface"),
    row(kWrap, "axis", kNone, U::one, "of a cylinder without ends; a sphere if left out"),
    row(kWrap, "side", kNone, U::m, "a point on the path's side; the shorter way if left out"),
    row(kPulley, "divisor", kNeeded, U::one, "of the lengths after it, up to the next pulley"),
    row(kWrench, "body", kNeeded, U::one, "on which it acts"),
    row(kWrench, "pos", "0 0 0", U::m, "where the force acts, in the frame of body"),
    row(kWrench, "force", "0 0 0", U::one, "per force of the joint, in the axes of body"),
    row(kWrench, "torque", "0 0 0", U::m, "per force of the joint, in the axes of body"),
    row(kWrench, "reference", kNone, U::one, "a body, or world, in whose axes the force is then"),
    row(kWrench, "pos2", "0 0 0", U::m, "a point of reference; q is force times the way from it"),

    row(kCamera, "name", kNeeded, U::one, "of its outputs"),
    row(kCamera, "body", "", U::one, "it moves with this body; it stands in the world if left out"),
    row(kCamera, "pos", kNeeded, U::m, "of the pinhole, in the body's frame or the world's",
        &CameraDescription::position, F::pos, Flags{kVaries | kIndexed}),
    row(kCamera, "look", kNeeded, U::m, "a point in the middle of the picture, same frame",
        &CameraDescription::target, F::look, Flags{kVaries | kIndexed}),
    row(kCamera, "up", "0 0 1", U::one, "points to the picture's upper edge, same frame",
        &CameraDescription::up),
    row(kCamera, "fov", "45", U::one, "degrees from the upper edge to the lower one",
        &CameraDescription::fov, Between{B::range, 1, 170}),
    row(kCamera, "rows", "128", U::one, "pixels from top to bottom", &CameraDescription::rows,
        Between{B::integer, 1, 2048}),
    row(kCamera, "cols", "128", U::one, "pixels from left to right", &CameraDescription::cols,
        Between{B::integer, 1, 2048}),
    row(kCamera, "far", "", U::m,
        "depth of the sky, behind which nothing is seen; 10 m if left out", &CameraDescription::far,
        Between{B::range, 1e-12, 1e9}),
    row(kCamera, "light", "0.35 -0.6 0.75", U::one, "points to a lamp far away, world axes",
        &CameraDescription::light, F::light, Flags{kVaries | kIndexed}),
    row(kCamera, "ambient", "0.35", U::one, "share of light from everywhere",
        &CameraDescription::ambient, Between{B::range, 0, 1}, F::ambient, Flags{kVaries}),
    row(kCamera, "brightness", "1", U::one, "factor of all light", &CameraDescription::brightness,
        Between{B::range, 0, 1e6}, F::brightness, Flags{kVaries}),
    row(kCamera, "noise", "0", U::one, "deviation of every number in a step, grey levels",
        &CameraDescription::noise, B::not_negative),
    row(kCamera, "gain", "0", U::one, "deviation of a factor per channel and episode",
        &CameraDescription::gain, B::not_negative),

    row(kChannels, "file", kNeeded, U::one, "file of the map from the field to channels"),
    row(kChannels, "noise", "0", U::one, "deviation from step to step, in the channels' unit",
        &ChannelsDescription::noise, B::not_negative),
    row(kChannels, "bias", "0", U::one, "deviation of a channel's offset, by episode",
        &ChannelsDescription::bias, B::not_negative),
    row(kChannels, "gain", "0", U::one, "deviation of a channel's gain about 1, by episode",
        &ChannelsDescription::gain, Between{B::range, 0, 1}),
    row(kChannels, "drift", "0", U::one, "deviation of the rate of a channel's offset, 1/s",
        &ChannelsDescription::drift, B::not_negative),
    row(kChannels, "saturation", "0", U::one, "largest channel; 0: none",
        &ChannelsDescription::saturation, B::not_negative),
    row(kChannels, "quantisation", "0", U::one, "channels are multiples of it; 0: not rounded",
        &ChannelsDescription::quantisation, B::not_negative),

    row(kEndEffector, "name", "", U::one, "endeffector and its place in the file if left out"),
    row(kEndEffector, "joint", kNeeded, U::one, "it moves with this joint"),
    row(kEndEffector, "pos", kNeeded, U::m, "in the joint's moving frame",
        &EndEffectorDescription::position),
    row(kEndEffector, "radius", "", U::m, "in pictures; 2 mm if left out",
        &EndEffectorDescription::radius, B::positive, Flags{kInDefault}),
    row(kEndEffector, "rgba", "1 0 0 1", U::one, "colour in pictures",
        &EndEffectorDescription::rgba, Flags{kInDefault}),

    row(kInitialJoint, "name", kNeeded, U::one, "the joint"),
    row(kInitialJoint, "q", kNone, U::m, "coordinates at the start", Or{U::rad}, F::q,
        Flags{kVaries | kIndexed}),
    row(kInitialJoint, "v", kNone, U::m_per_s, "velocities at the start", Or{U::rad_per_s}, F::v,
        Flags{kVaries | kIndexed}),

    row(kConstant | kAt, "value", kNeeded, U::one, "one number a control"),
    row(kPiecewise, "end", kNone, U::s, "length of the run", &PiecewiseControl::end, B::positive),
    row(kAt, "time", kNeeded, U::s, "from when the value holds", B::not_negative),
    row(kCsv, "file", kNeeded, U::one, "one row a step, beside the scene"),
    row(kRandom, "amplitude", "1", U::one, "largest |u|", &RandomControl::amplitude,
        B::not_negative),
    row(kRandom, "period", "0.1", U::s, "time between knots", &RandomControl::period, B::positive),
    row(kOutputs, "record", kNeeded, U::one, "names of outputs, between commas"),

    row(kVaryJoint | kVaryTactile | kVaryBody | kVaryConnect | kVaryWeld | kVaryCamera, "name",
        kNeeded, U::one, "whose number varies"),
    row(kVaryMotor, "joint", kNeeded, U::one, "of the motor"),
    row(kVaryGround, "body", kNeeded, U::one, "of the contact"),
    row(kVaryPair, "general_body", kNeeded, U::one, "of the contact"),
    row(kVaryPair, "primitive_body", kNeeded, U::one, "of the contact"),
    row(kVarySurface, "body1", kNeeded, U::one, "of the contact"),
    row(kVarySurface, "body2", kNeeded, U::one, "of the contact"),
    row(kVarying & ~kVaryIndexed, "field", kNeeded, U::one, "an attribute that varies"),
    row(kVaryIndexed, "field", kNone, U::one, "an attribute that varies, where no index says what"),
    row(kVaryJoint, "q", kNone, U::one, "index of the coordinate that varies"),
    row(kVaryJoint, "v", kNone, U::one, "index of the velocity that varies"),
    row(kVaryJoint, "pos", kNone, U::one, "index of the axis along which its place varies",
        Between{B::integer, 0, 2}),
    row(kVaryCamera, "pos", kNone, U::one, "index of the axis along which its place varies",
        Between{B::integer, 0, 2}),
    row(kVaryCamera, "look", kNone, U::one, "index of the axis along which the point varies",
        Between{B::integer, 0, 2}),
    row(kVaryCamera, "light", kNone, U::one, "index of the component that varies",
        Between{B::integer, 0, 2}),
    row(kVaryBody, "size", kNone, U::one, "index of the edge that varies",
        Between{B::integer, 0, 2}),
    row(kVarying, "uniform", kNone, U::one, "low high"),
    row(kVarying, "log_uniform", kNone, U::one, "low high, both positive"),
    row(kVarying, "normal", kNone, U::one, "mean deviation; only q, v, pos, look and light"),
    row(kVarying, "list", kNone, U::one, "values that are equally likely"),
    row(kVarying, "tie", kNone, U::one, "a word; numbers with the same are drawn together"),
};

}  // namespace

std::span<const Attribute> schema() { return kSchema; }

const Attribute& attribute_of(Element element, std::string_view name) {
  for (const Attribute& a : kSchema)
    if ((a.elements & element) != 0 && name == a.name) return a;
  throw std::logic_error(fmt::format("<{}> has no attribute {}", to_string(element), name));
}

std::vector<NumberField> coefficients_of(EffectKind kind) {
  std::vector<NumberField> fields;
  const EffectKind of = kind < E::pair_contact ? kind : pair_kind(kind);
  for (const Attribute& a : kSchema)
    if (a.field && a.effect == of && std::ranges::count(fields, *a.field) == 0)
      fields.push_back(*a.field);
  return fields;
}

std::vector<std::string> words_of(const char* between_blanks) {
  std::vector<std::string> words;
  std::istringstream stream(between_blanks);
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

bool Attribute::serves(std::string_view type) const {
  return types == nullptr || std::ranges::count(words_of(types), type) > 0;
}

std::string Attribute::fault(double x) const {
  const auto expected = [&](const std::string& what) {
    return fmt::format("{}=\"{}\"; expected {}", name, x, what);
  };
  if (!std::isfinite(x)) return expected("a finite number");
  switch (bound) {
    case Bound::any: break;
    case Bound::not_negative: return x >= 0 ? "" : expected("zero or more");
    case Bound::positive: return x > 0 ? "" : expected("a positive number");
    case Bound::share: return x > 0 && x < 1 ? "" : expected("a positive number below 1");
    case Bound::range:
      if (x < least || x > most)
        return expected(fmt::format("a number from {} to {}", least, most));
      break;
    case Bound::integer:
      if (x != std::floor(x) || x < least || x > most)
        return expected(fmt::format("an integer from {} to {}", least, most));
      break;
  }
  return "";
}

}  // namespace tangere
