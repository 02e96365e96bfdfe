// SPDX-License-Identifier: Apache-2.0
// A path becomes pieces between points that follow each other; a surface between two points makes
// one piece of their way.
#include "engine/model/compile_transmissions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "engine/model/transmission_state.hpp"
#include "engine/scene/frames.hpp"

namespace tangere {

using kernels::PieceKind;
using kernels::TransmissionPiece;
using kernels::Vec3;

namespace {

/// A point or a surface of a path, in its link.
struct Placed {
  int link = -1;
  Vec3<double> at{0, 0, 0}, axis{0, 0, 1}, side{0, 0, 0};
};

class Transmissions {
 public:
  Transmissions(CompiledModel& m, const NameIndex& joints, const NameIndex& bodies)
      : m_(m), joints_(joints), bodies_(bodies) {}

  void add(const TransmissionDescription& d) {
    d_ = &d;
    const auto joint = std::size_t(joints_.find("joint", d.joint, d.source));
    check_joint(joint);
    kernels::Transmission t{};
    t.v = m_.joints[joint].v;
    t.q = m_.joints[joint].q;
    t.link = m_.joints[joint].link;
    t.has_length = d.kind == TransmissionDescription::Kind::path || d.reference;
    t.first_piece = static_cast<int>(m_.transmission_pieces.size());
    d.kind == TransmissionDescription::Kind::path ? add_path() : add_wrench();
    t.pieces = static_cast<int>(m_.transmission_pieces.size()) - t.first_piece;
    t.first_dof = static_cast<int>(m_.transmission_dofs.size());
    add_dofs(t);
    m_.transmissions.push_back(t);
  }

 private:
  [[noreturn]] void fail(const Source& source, const std::string& text) const {
    throw InputError(source.prefix() + "transmission '" + d_->joint + "' " + text);
  }

  void check_joint(std::size_t joint) {
    const LinkDescription& link = m_.scene.links[joint];
    if (dof_count(link.joint.type) != 1)
      fail(d_->source, fmt::format("has a joint of {} degrees of freedom; expected a revolute or "
                                   "prismatic joint",
                                   dof_count(link.joint.type)));
    if (!link.joint.follows.empty())
      fail(d_->source, "has a joint that follows others; expected one that follows none");
    const bool carries = std::ranges::any_of(
        m_.scene.links, [&](const LinkDescription& l) { return l.parent == int(joint); });
    if (link.parent >= 0 || carries || m_.bodies[joint].mass > 0)
      fail(d_->source,
           "has a joint that moves a body; expected a link of its own, on the world, "
           "whose body has no mass and carries nothing");
    if (!used_.insert(d_->joint).second)
      fail(d_->source, "is given twice; expected one for each joint");
    for (const LinkDescription& l : m_.scene.links)
      if (std::ranges::find(l.joint.follows, d_->joint) != l.joint.follows.end())
        fail(d_->source, "is followed by joint '" + l.joint.name +
                             "'; expected joints that follow joints alone");
  }

  Placed place(const std::string& body, const Vector3& at, const Source& source) {
    Placed p;
    if (body.empty()) {
      p.at = vec3_of(at);
      if (m_.moved) p.at -= m_.origin;
      return p;
    }
    const auto k = std::size_t(bodies_.find("body", body, source));
    const CompiledBody& of = m_.bodies[k];
    if (is_transmission(m_.scene, m_.scene.links[k].joint))
      fail(source, "names body '" + body + "' of a transmission; expected a body that moves");
    p.link = of.link;
    p.at = of.frame.R * vec3_of(at) + of.frame.p;
    return p;
  }

  [[nodiscard]] Vec3<double> turned(const std::string& body, const Vector3& x) const {
    if (body.empty()) return vec3_of(x);
    return m_.bodies[std::size_t(bodies_.find("body", body, d_->source))].frame.R * vec3_of(x);
  }

  /// Adds the piece to the next point of a path.
  void add_piece(const PathPart* surface, const Placed& first, const Placed& second,
                 double divisor) {
    TransmissionPiece piece{};
    piece.kind = PieceKind::straight;
    piece.round = -1;
    piece.first = first.link;
    piece.second = second.link;
    piece.first_point = first.at;
    piece.second_point = second.at;
    piece.axis = {0, 0, 1};
    piece.share = 1 / divisor;
    if (surface != nullptr) {
      const bool ball = surface->kind == PathPart::Kind::sphere;
      piece.kind = ball ? PieceKind::sphere : PieceKind::cylinder;
      const Placed centre = place(surface->body, surface->position, d_->source);
      piece.round = centre.link;
      piece.centre = centre.at;
      piece.radius = surface->radius;
      const Vec3<double> axis = turned(surface->body, surface->axis);
      piece.axis = (1 / std::sqrt(dot(axis, axis))) * axis;
      piece.has_side = surface->side.has_value();
      if (surface->side) set_side(*surface, piece);
    }
    m_.transmission_pieces.push_back(piece);
  }

  void set_side(const PathPart& surface, TransmissionPiece& piece) {
    Vec3<double> side = place(surface.body, *surface.side, d_->source).at - piece.centre;
    if (piece.kind == PieceKind::cylinder) side -= dot(side, piece.axis) * piece.axis;
    if (!(std::sqrt(dot(side, side)) >= piece.radius))
      fail(d_->source, fmt::format("has a side {:.6g} m from the middle of a surface of radius "
                                   "{:.6g} m; expected one outside of it",
                                   std::sqrt(dot(side, side)), piece.radius));
    piece.side = side;
  }

  void add_path() {
    Placed before;
    bool begun = false;
    const PathPart* surface = nullptr;
    double divisor = 1;
    int pieces = 0;
    for (const PathPart& part : d_->path) {
      if (part.kind == PathPart::Kind::pulley) {
        if (surface != nullptr) fail(d_->source, "has a surface before a pulley; expected a point");
        begun = false;
        divisor = part.divisor;
      } else if (part.kind == PathPart::Kind::point) {
        const Placed point = place(part.body, part.position, d_->source);
        if (begun) add_piece(surface, before, point, divisor), ++pieces;
        before = point;
        begun = true;
        surface = nullptr;
      } else {
        if (!begun || surface != nullptr)
          fail(d_->source,
               "has a surface that follows no point; expected points before and after "
               "each surface");
        surface = &part;
      }
    }
    if (surface != nullptr || pieces == 0)
      fail(d_->source, "ends at no second point; expected points at both ends of its path");
  }

  void add_wrench() {
    TransmissionPiece piece{};
    const Placed point = place(d_->body, d_->position, d_->source);
    piece.kind = d_->reference ? PieceKind::offset : PieceKind::wrench;
    piece.first = point.link;
    piece.second = piece.round = -1;
    piece.first_point = point.at;
    piece.share = 1;
    if (d_->reference) {
      const Placed centre = place(*d_->reference, d_->reference_position, d_->source);
      piece.round = centre.link;
      piece.centre = centre.at;
    }
    piece.force = turned(d_->reference ? *d_->reference : d_->body, d_->force);
    piece.torque = turned(d_->body, d_->torque);
    m_.transmission_pieces.push_back(piece);
  }

  /// Lists the dofs that move a link of the transmission, and marks which of them move which.
  void add_dofs(kernels::Transmission& t) {
    std::set<int> links;
    const auto each = [&](int link, const auto& f) {
      for (; link >= 0; link = m_.links[std::size_t(link)].parent) f(link);
    };
    const auto pieces = [&](const auto& f) {
      for (int k = t.first_piece; k < t.first_piece + t.pieces; ++k)
        f(m_.transmission_pieces[std::size_t(k)]);
    };
    pieces([&](const TransmissionPiece& p) {
      for (const int link : {p.first, p.second, p.round})
        each(link, [&](int i) { links.insert(i); });
    });
    for (const int i : links) {
      const kernels::Link& link = m_.links[std::size_t(i)];
      for (int k = 0; k < kernels::dofs(link.kind); ++k)
        m_.transmission_dofs.push_back({i, k, link.v + k});
    }
    t.dofs = static_cast<int>(m_.transmission_dofs.size()) - t.first_dof;
    if (t.dofs == 0)
      fail(d_->source, "has no degree of freedom that moves it; expected a body that moves");
    if (t.dofs > kernels::kMostTransmissionDofs)
      fail(d_->source, fmt::format("is moved by {} degrees of freedom; expected at most {}", t.dofs,
                                   kernels::kMostTransmissionDofs));
    const auto mask = [&](int link) {
      std::uint64_t out = 0;
      each(link, [&](int i) {
        for (int k = 0; k < t.dofs; ++k)
          if (m_.transmission_dofs[std::size_t(t.first_dof + k)].link == i)
            out |= std::uint64_t{1} << k;
      });
      return out;
    };
    pieces([&](TransmissionPiece& p) {
      p.moves_first = mask(p.first);
      p.moves_second = mask(p.second);
      p.moves_round = mask(p.round);
    });
  }

  CompiledModel& m_;
  const NameIndex &joints_, &bodies_;
  const TransmissionDescription* d_ = nullptr;
  std::set<std::string> used_;
};

}  // namespace

void compile_transmissions(CompiledModel& m, const NameIndex& joints, const NameIndex& bodies) {
  Transmissions all(m, joints, bodies);
  for (const TransmissionDescription& d : m.scene.transmissions) all.add(d);
}

void place_initial_transmissions(CompiledModel& m) {
  if (m.transmissions.empty()) return;
  const std::vector<double> q = m.initial_q, v = m.initial_v;
  TransmissionState(m).place(m.initial_q.data(), m.initial_v.data(), 1, nullptr);
  constexpr double kRounding = 1e-6;  // of files that give both
  const auto differs = [](double given, double placed) {
    return std::abs(given - placed) > kRounding * (1 + std::abs(placed));
  };
  for (std::size_t k = 0; k < m.transmissions.size(); ++k) {
    const TransmissionDescription& d = m.scene.transmissions[k];
    const auto iq = std::size_t(m.transmissions[k].q), iv = std::size_t(m.transmissions[k].v);
    const auto given = std::ranges::find(m.scene.initial, d.joint, &InitialState::joint);
    if (given == m.scene.initial.end() ||
        !(differs(q[iq], m.initial_q[iq]) || differs(v[iv], m.initial_v[iv])))
      continue;
    throw InputError(given->source.prefix() +
                     fmt::format("transmission '{}' starts at {} with rate {}, but by what it "
                                 "drives at {} with {}; expected no start of its own",
                                 d.joint, q[iq], v[iv], m.initial_q[iq], m.initial_v[iv]));
  }
}

std::vector<std::vector<int>> driven_dofs(const CompiledModel& m) {
  std::vector<std::vector<int>> out;
  for (const kernels::Transmission& t : m.transmissions) {
    out.emplace_back();
    for (int k = t.first_dof; k < t.first_dof + t.dofs; ++k)
      out.back().push_back(m.transmission_dofs[std::size_t(k)].v);
  }
  return out;
}

}  // namespace tangere
