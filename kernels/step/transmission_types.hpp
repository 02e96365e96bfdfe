// SPDX-License-Identifier: Apache-2.0
// Transmissions of a compiled scene: what drives dofs through a length or a wrench
// (transmissions.hpp).
#pragma once

#include <cstdint>

#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

enum class PieceKind : std::uint8_t {
  straight,  ///< from a point to a point
  sphere,    ///< the same, around a sphere
  cylinder,  ///< the same, around a cylinder without ends
  offset,    ///< force · (point - centre), in the axes of a link
  wrench     ///< a force at a point and a torque, in the axes of a link; it has no length
};

/// One term of a transmission's length. Links: -1: the world.
struct TransmissionPiece {
  PieceKind kind;
  int first, second, round;  ///< links of the points and of the surface; offset: round is its link
  Vec3<double> first_point, second_point;  ///< in their links [m]
  Vec3<double> centre, axis;               ///< of the surface, in its link; axis: unit
  Vec3<double> side;  ///< from the centre to the side on which the path lies, in its link [m]
  bool has_side;      ///< false: the path takes the shorter way round
  double radius;      ///< of the surface [m]
  double share;       ///< by which its length counts
  Vec3<double> force, torque;  ///< of a wrench, in `first`; force of an offset, in `round`
  /// Bit i: dof i of the transmission moves `first`, `second`, `round`.
  std::uint64_t moves_first, moves_second, moves_round;
};
/// Dofs of a transmission at most.
inline constexpr int kMostTransmissionDofs = 64;

/// A dof that a transmission drives. All dofs of a joint stand side by side, and joints ascend.
struct TransmissionDof {
  int link, component, v;
};

/// A joint without mass, of one dof, whose coordinate is a length of the other dofs and whose rate
/// is that of the length, or the power of a wrench of size 1.
struct Transmission {
  int v, q, link;
  bool has_length;  ///< false: its coordinate stays 0
  int first_piece, pieces;
  int first_dof, dofs;
};

}  // namespace tangere::kernels
