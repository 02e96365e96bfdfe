// SPDX-License-Identifier: Apache-2.0
// Contact of one pad's layer with the bodies of one link (docs/layer.md). With the loads of the
// points (engine/layer/gel_layer.hpp) and the forces f_s (kernels/layer/layer_force.hpp), which act
// at x_s, the wrench on the pad's link is
//   w = Σ (x_s × f_s; f_s)
// Its derivatives by motion are those of kernels/layer/layer_slopes.hpp; its change along any other
// direction follows from dual numbers.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/layer/gel_layer.hpp"
#include "engine/layer/layer_depth.hpp"
#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

/// Returns a body that presses a pad, from the pose and twist of its link in the pad's link.
template <class N>
kernels::LayerBody<N> layer_body(const LayerPad& pad, const kernels::Frame<double>& body,
                                 const kernels::Frame<N>& link2_in_1, const kernels::Vec6<N>& twist,
                                 const Coefficients<N>& law, const kernels::Vec3<N>& size) {
  const kernels::Frame<N> frame = kernels::broadcast<N>(pad.frame);
  const kernels::Frame<N> shape = relative(frame, compose(link2_in_1, kernels::broadcast<N>(body)));
  const kernels::Vec6<N> in_pad = motion_to_child(frame, twist);
  return {{shape.R, shape.p, in_pad.a, in_pad.l, law}, size};
}

/// Points of a pad that a body may touch.
struct LayerCandidates {
  const double* places;   ///< (3, stride) the pad's link's axes [m]
  const double* anchors;  ///< (kernels::kAnchorNumbers, stride) b in the link's axes; null: zeros
  const int* index;       ///< (count) numbers of the contact's points; null: 0 … count - 1
  int stride;             ///< a multiple of eight
  int count;
};

/// Owns the scratch of one thread.
class LayerContact {
 public:
  using D = kernels::Dual<double>;
  /// A point that a body touches, pad axes.
  struct Point {
    int index, body;           ///< in the field; in the order of add_body()
    int candidate;             ///< its number among those of add_body()
    kernels::Vec3<double> xi;  ///< [m]
    KnownDepth known;
    kernels::Anchor<double> anchor;  ///< b in pad axes
    LayerDepth<double> at;
    double load, friction_load;      ///< P, and that of friction [N]
    kernels::Vec3<double> friction;  ///< T'/N
    double normal;                   ///< N [N]
  };

  /// Begins a contact without bodies. The solver of a slot begins where it was last: contacts that
  /// change little from one call to the next have slots of their own. Results do not depend on it.
  void begin(const kernels::KernelTable& table, const LayerPad& pad, std::size_t slot = 0);
  /// Adds a body, and those of its candidates that it touches. Where two bodies are at a point, the
  /// deeper one counts.
  void add_body(const kernels::LayerShape& shape, const kernels::LayerBody<double>& body,
                const LayerCandidates& candidates);
  /// Solves the layer.
  void solve();
  /// Whether the layer's pressures were found.
  [[nodiscard]] bool solved() const { return layers_[at_].solved(); }

  /// Whether no body touches a point.
  [[nodiscard]] bool empty() const { return eights_ == 0; }
  /// Calls f with every Point.
  template <class F>
  void for_each_point(const F& f) const {
    for (int k = 0; k < kernels::kGroup * eights_; ++k)
      if (index_[std::size_t(k)] >= 0) f(point(k));
  }
  /// w, in the axes of the pad's link at its origin.
  [[nodiscard]] kernels::Vec6<double> wrench() const;
  /// Energy that the layer stores at depths without δ̇ [J].
  [[nodiscard]] double energy() const;

  /// Returns the change of w where the bodies change as their dual numbers say, and the material.
  /// `anchors`: of the points of for_each_point(), b in pad axes; empty: they stay.
  kernels::Vec6<double> change(std::span<const kernels::LayerBody<D>> bodies,
                               std::span<const kernels::Anchor<D>> anchors = {},
                               const LayerMaterial& material_dot = {});
  /// Cotangents of a body's coefficients, in the order of Coefficients, and of its size.
  struct BodyNumbers {
    std::array<double, kCoefficients> law{};
    std::array<double, kernels::kSizeNumbers> size{};
  };
  /// Computes the cotangents of the numbers of the bodies, in the order of add_body(), and of the
  /// material, from that of w: one system for all of them. Those of a material without slopes are
  /// zero.
  LayerMaterial pull_back(const kernels::Vec6<double>& wrench_bar, std::span<BodyNumbers> bodies);
  /// Adds w, and its derivatives by displacement and twist of the other link, to the sums.
  void add_to(kernels::PairSums<double>& sums, bool derivatives);
  /// Returns an anchor with b in pad axes instead of the axes of the pad's link.
  template <class N>
  [[nodiscard]] kernels::Anchor<N> in_pad(const kernels::Anchor<N>& anchor) const {
    const auto frame = kernels::broadcast<N>(pad_->frame);
    return {transposed_times(frame.R, anchor.b - frame.p), anchor.a, anchor.gap};
  }
  /// Returns the cotangent of the friction T of a point's spring from that of w, both in the axes
  /// of the pad's link.
  [[nodiscard]] kernels::Vec3<double> friction_bar(const Point& point,
                                                   const kernels::Vec6<double>& wrench_bar) const;

 private:
  struct Body {
    kernels::LayerShape shape;
    kernels::LayerBody<double> motion;
    int first = 0, count = 0;  ///< eights of points
  };
  /// Forces at a point whose bodies change.
  struct PointChange {
    LayerDepth<D> at;
    kernels::Vec3<D> friction;
  };

  [[nodiscard]] Point point(int k) const;
  [[nodiscard]] kernels::LayerPoints points_of(const Body& body);
  [[nodiscard]] double point_stiffness(const Body& body) const;
  void keep_deepest(int k);
  void set_loads(const Body& body);
  [[nodiscard]] PointChange changed(const Point& p, const kernels::LayerBody<D>& body,
                                    const kernels::Anchor<D>& anchor, double thickness_dot) const;
  [[nodiscard]] kernels::Vec3<D> changed_friction(const Point& p,
                                                  const kernels::LayerBody<D>& body) const;
  void pull_back_point(const Point& p, const kernels::Vec6<double>& bar, BodyNumbers& of,
                       double& thickness) const;
  [[nodiscard]] kernels::Vec6<double> change_in_pad(std::span<const kernels::LayerBody<D>> bodies,
                                                    std::span<const kernels::Anchor<D>> anchors,
                                                    const LayerMaterial& material_dot);

  const kernels::KernelTable* table_ = nullptr;
  const LayerPad* pad_ = nullptr;
  std::vector<Body> bodies_;
  int eights_ = 0;
  AlignedVector<kernels::LayerEight> points_;  // (eights)
  std::vector<int> index_, candidate_, cell_;  // (8 eights) cell: -1 where it does not press
  std::vector<int> slot_;                      // (points of the pad) number in index_, or -1
  std::vector<double> depth_;                  // (points of the pad)
  std::vector<double> depth_dot_, load_dot_;   // (points of the pad)
  std::vector<double> depth_bar_, load_bar_;   // (points of the pad)
  std::vector<PointChange> changes_;           // of for_each_point()
  AlignedVector<double> cells_;                // (cells, kernels::kCellNumbers)
  kernels::Vec6<double> wrench_{};             // pad axes
  std::vector<GelLayer> layers_;               // by slot
  std::size_t at_ = 0;                         // the present slot
};

}  // namespace tangere
