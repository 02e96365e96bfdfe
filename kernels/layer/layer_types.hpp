// SPDX-License-Identifier: Apache-2.0
// Arguments of the kernels of a layer that is the contact. Points, shapes and motions are in pad
// axes about the pad's origin; o = (0, 0, outward) leads out of the skin.
#pragma once

#include <cstdint>

#include "kernels/contact/elastic_contact.hpp"
#include "kernels/contact/shapes/tile.hpp"

namespace tangere::kernels {

/// Which surface of a shape determines the depth at a point.
enum class DepthBy : std::uint8_t {
  underside,
  end,   ///< the shape goes on below the layer, or the depths of a table; of readings alone
  side,  ///< -c d(ξ)
  gap,   ///< -d(ξ), outside
};

template <class N>
struct LayerDepth {
  N depth;        ///< δ + τ δ̇ [m]
  Vec3<N> slant;  ///< force on the pad's body by a pressing force of 1 N without friction
  Vec3<N> place;  ///< where it acts [m]
};

/// What a layer that is the contact needs besides its compliance.
struct LayerLaw {
  double outward;     ///< 1 or -1: whether the pad's z points out of the skin
  double bulge;       ///< how far above the surface a body may be that the gel's bulge touches [m]
  double relaxation;  ///< τ [s]
  double fading;      ///< δ₀: depth at which relaxation is whole [m]
};

/// A body that presses a pad. `touch.law`: of the springs.
template <class N>
struct LayerBody {
  Touch<N> touch;
  Vec3<N> size;  ///< as in PairContact
};

/// What stays the same while it moves.
struct LayerShape {
  PrimitiveShape shape;
  const DistanceGrid* grid;
  ContactLaw law;
  double ramp;
  bool elastic;  ///< its springs have anchors
  bool secant;   ///< derivatives take friction by its secant
};

/// A point that a body touches.
template <class N>
struct LayerPoint {
  Vec3<N> xi;        ///< its place [m]
  Anchor<N> anchor;  ///< b in pad axes
  N known;           ///< δ [m]
  N by;              ///< DepthBy as a number
  LayerDepth<N> at;
  N load, friction_load;  ///< P and that of friction [N]; 0 where it does not press
  Vec3<N> friction;       ///< T'/N
  N normal;               ///< N [N]; 0: without friction
};
/// Eight of them. What is left of the last eight of a body repeats a point, without load.
using LayerEight = LayerPoint<LaneRow>;

/// Numbers of the sums of a cell: wrenches by load, (8) of which 6 are used, and slopes of depths
/// along 12 directions, (16).
inline constexpr int kCellWrench = 8, kCellSlopes = 16, kCellNumbers = kCellWrench + kCellSlopes;
/// Displacement, then change of twist.
inline constexpr int kLayerDirections = 12;

/// Candidates of a body, and the points of them that it touches.
struct LayerSearch {
  const LayerShape* shape;
  const LayerBody<double>* body;
  LayerLaw law;
  Frame<double> pad;      ///< in its link
  const double* places;   ///< (3, stride) link axes [m]
  const double* anchors;  ///< (kAnchorNumbers, stride) b in link axes; null: zeros
  int stride;             ///< a multiple of eight
  int count;
  LayerEight* points;  ///< room for `count` and eight more
  int* candidate;      ///< (the same) numbers of the touched points among the candidates
};

/// Points of one body with loads.
struct LayerPoints {
  const LayerShape* shape;
  const LayerBody<double>* body;
  LayerLaw law;
  LayerEight* points;
  int eights;
};

/// Slopes of the wrench of one body's points.
struct LayerSlopeSums {
  LayerPoints of;
  double stiffness;  ///< of a point on the layer, ∂P/∂δ at a fixed yield of its cell [N/m]
  const int* cell;   ///< (8 eights) that a point is in; -1: it does not press
  double* cells;     ///< (cells, kCellNumbers) added to
  double* rows;      ///< (6, kLayerDirections) added to: of w where no cell yields
};

/// The linear system of a layer.
struct LayerSystem {
  const double* factor;  ///< (n, n) U with M = Uᵀ U; the rest of it is not read
  int n;                 ///< pressing cells
  const int* cell;       ///< (n) their numbers, `step` apart
  const int* count;      ///< (n) points that press each, `step` apart
  int step;
  double whole;         ///< side² C(0) [m]
  const double* cells;  ///< (cells, kCellNumbers)
  double* work;         ///< (n, kCellWrench)
  double* rows;         ///< (6, kLayerDirections) added to: what yielding cells change
};

/// A product with the compliance C of a layer.
struct LayerProduct {
  const double* table;  ///< C, (cells, cells)
  int cells;
  const int* from;  ///< (n) cells where x is not zero
  const double* x;  ///< (n)
  int n;
  const int* to;  ///< (m) cells where C x is computed
  int m;
  double* out;  ///< (cells) of which those of `to` are set
};

}  // namespace tangere::kernels
