// SPDX-License-Identifier: Apache-2.0
// Contact of one pad's layer with the bodies of one link (docs/layer.md). With the loads of the
// points (engine/layer/gel_layer.hpp) and the forces f_s (engine/layer/layer_force.hpp), which act
// at x_s, the wrench on the pad's link is
//   w = Σ (x_s × f_s; f_s)
// Its derivatives by motion are those of engine/layer/layer_slopes.hpp; its change along any other
// direction follows from dual numbers.
#pragma once

#include <span>
#include <vector>

#include "engine/layer/gel_layer.hpp"
#include "engine/layer/layer_slopes.hpp"
#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere {

/// Returns a body that presses a pad, from the pose and twist of its link in the pad's link.
template <class N>
LayerBody<N> layer_body(const LayerPad& pad, const kernels::Frame<double>& body,
                        const kernels::Frame<N>& link2_in_1, const kernels::Vec6<N>& twist,
                        const Coefficients<N>& law, const kernels::Vec3<N>& size) {
  const kernels::Frame<N> frame = kernels::broadcast<N>(pad.frame);
  const kernels::Frame<N> shape = relative(frame, compose(link2_in_1, kernels::broadcast<N>(body)));
  const kernels::Vec6<N> in_pad = motion_to_child(frame, twist);
  return {{shape.R, shape.p, in_pad.a, in_pad.l, law}, size};
}

/// Owns the scratch of one thread.
class LayerContact {
 public:
  using D = kernels::Dual<double>;
  /// A point that a body touches.
  struct Point {
    int index, body;           ///< in the field; in the order of add_body()
    int candidate;             ///< as add_point() got it
    kernels::Vec3<double> xi;  ///< pad axes [m]
    KnownDepth known;
    kernels::Anchor<double> anchor;  ///< b in pad axes
    LayerForce<double> force;
  };

  /// Begins a contact without bodies. The solver of a slot begins where it was last: contacts that
  /// change little from one call to the next have slots of their own. Results do not depend on it.
  void begin(const LayerPad& pad, std::size_t slot = 0);
  void add_body(const LayerShape& shape, const LayerBody<double>& body);
  /// Adds a point of the last body at `place`, the pad's link's axes, if the body touches it. Where
  /// two bodies are at a point, the deeper one counts. `anchor`: b in the link's axes.
  void add_point(int candidate, int index, const kernels::Vec3<double>& place,
                 const kernels::Anchor<double>& anchor);
  /// Solves the layer.
  void solve();
  /// Whether the layer's pressures were found.
  [[nodiscard]] bool solved() const { return layer().solved(); }

  [[nodiscard]] const std::vector<Point>& points() const { return points_; }
  [[nodiscard]] const std::vector<LayerBody<double>>& bodies() const { return bodies_; }
  [[nodiscard]] double load(const Point& point) const;           ///< P_s [N]
  [[nodiscard]] double friction_load(const Point& point) const;  ///< that of friction [N]
  /// w, in the axes of the pad's link at its origin.
  [[nodiscard]] kernels::Vec6<double> wrench() const;
  /// Energy that the layer stores at depths without δ̇ [J].
  [[nodiscard]] double energy() const;

  /// Returns the change of w where the bodies change as their dual numbers say. `anchors`: of the
  /// points, b in pad axes; empty: they stay.
  kernels::Vec6<double> change(std::span<const LayerBody<D>> bodies,
                               std::span<const kernels::Anchor<D>> anchors = {});
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
  /// Returns bodies whose dual numbers do not change.
  [[nodiscard]] std::vector<LayerBody<D>> still_bodies() const;

 private:
  [[nodiscard]] GelLayer& layer() { return layers_[at_]; }
  [[nodiscard]] const GelLayer& layer() const { return layers_[at_]; }
  [[nodiscard]] double point_stiffness(const Point& p) const;
  [[nodiscard]] LayerSlopes slopes(const Point& p) const;
  [[nodiscard]] std::array<kernels::Vec6<double>, 12> columns_in_pad();
  template <class N, class F>
  void with_shape(int body, const kernels::Vec3<N>& size, const F& f) const;
  [[nodiscard]] LayerForce<D> force(const Point& p, const LayerBody<D>& body,
                                    const kernels::Anchor<D>& anchor) const;
  [[nodiscard]] kernels::Vec6<double> change_in_pad(std::span<const LayerBody<D>> bodies,
                                                    std::span<const kernels::Anchor<D>> anchors);

  const LayerPad* pad_ = nullptr;
  std::vector<LayerShape> shapes_;
  std::vector<LayerBody<double>> bodies_;
  kernels::Vec3<double> down_{};  // into the pad, axes of the last body's shape
  std::vector<Point> points_;
  std::vector<int> slot_;                     // (points) number in points_, or -1
  std::vector<double> depth_;                 // (points)
  std::vector<double> depth_dot_, load_dot_;  // (points)
  std::vector<LayerForce<D>> changes_;        // parallel to points_
  std::vector<LayerSlopes> slopes_;           // the same
  std::vector<GelLayer::Directions> depth_slopes_, load_slopes_;  // (points)
  std::vector<GelLayer> layers_;                                  // by slot
  std::size_t at_ = 0;                                            // the present slot
};

}  // namespace tangere
