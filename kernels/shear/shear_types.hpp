// SPDX-License-Identifier: Apache-2.0
// Arguments of the shear-state kernels, all of one environment.
#pragma once

#include "kernels/contact/elastic_contact.hpp"
#include "kernels/step/model_view.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// A contact with shear springs at one state.
struct ShearSpringTouch {
  const ShearSpringContact* of;
  Vec3<double> size;    ///< of the touched shape, as in PairContact
  Vec3<double> faces;   ///< kernels/step/faces.hpp
  double radius;        ///< as in GroundContact
  Frame<double> shape;  ///< in body 1
  Vec6<double> twist;   ///< W, body 1's axes and origin
  Coefficients<double> law;
};

/// Points of body 1 that may touch. Rows are padded to multiples of eight.
struct ShearSpringPoints {
  const double* places;  ///< (3, stride) body 1's axes; padding is far away
  double* anchors;       ///< (kAnchorNumbers, stride)
  /// (kPointCoefficients, stride) factors of coefficients (factor_index()); null: all 1.
  const double* factors;
  int count, stride;
  const double* weights = nullptr;  ///< (stride) as PairContact::weights; null: none has any
};

/// Cotangents of one contact of one environment, body 1's axes and origin.
struct ShearCotangentSums {
  TouchCotangent<double> end;  ///< of motion and coefficients at the end of a step
  Vec6<double> start;          ///< of (θ; ρ) of body 2 where the step began
};

/// What reaches the points at the end of a step.
struct ShearPullback {
  const ShearSpringTouch *start, *end;
  ShearSpringPoints points;
  const double* s_start;  ///< (3, stride) s where the step began
  const double* s_bar;    ///< (3, stride) of s' at its end; or null: zeros
  const double* f_bar;    ///< (3, stride) of forces, body 1's axes; or null: those of `slip`
  /// The slip Y along λ (kernels/reverse/adjoint.hpp), with power -Yᵀw of the forces. Then no
  /// derivatives by the final motion are added, because the matrix of the step contains them.
  const Vec6<double>* slip;
  double* s_out;  ///< (3, stride) added to: of s where the step began
  ShearCotangentSums* out;
  // Of sensors with shear_interval > 0; else null.
  const double* anchor_bar = nullptr;  ///< (6, stride) of b and a that follow at the end
  const double* kept = nullptr;  ///< (stride) 1: its anchor was kept, not found at `start`; else 0
  double* anchor_out = nullptr;  ///< (6, stride) of b and a of kept anchors, at points that touch
  /// (kPointNumbers, stride) added to: of every point's own place, body 1's axes, and coefficients;
  /// or null.
  double* own = nullptr;
};

}  // namespace tangere::kernels
