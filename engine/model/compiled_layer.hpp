// SPDX-License-Identifier: Apache-2.0
// The law of a sensor's pressure where its points are no linear springs, compiled: a coupled layer
// (docs/layer.md) or a table (docs/table.md).
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "engine/model/layer_compliance.hpp"
#include "engine/model/monotone_cubic.hpp"
#include "engine/model/surface_compliance.hpp"

namespace tangere {

/// Numbers of a layer's material.
struct LayerMaterial {
  double thickness = 0, poisson = 0;  ///< t [m], ν
};

/// Derivatives of a layer's compliance by its material. They are computed when they are first read,
/// by one thread; copies share them.
class SharedSlopes {
 public:
  [[nodiscard]] const LayerSlopes& at(const LayerGrid& grid) const {
    std::call_once(state_->once, [&] { state_->slopes = compile_layer_slopes(grid); });
    return state_->slopes;
  }

 private:
  struct State {
    std::once_flag once;
    LayerSlopes slopes;
  };
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

struct CompiledLayer {
  /// Pressure [Pa] by depth [m], of points that are not coupled; the numbers of cells are then not
  /// set. None: the layer below.
  std::optional<MonotoneCubic> table{};
  LayerGrid grid{};
  /// Different for each compiled layer, so that a solver tells whether it still has the factor of
  /// this one. 0: a layer that was not compiled, of which nothing is used again.
  std::uint64_t number = 0;
  int side = 1;                      ///< points along the side of a cell
  int most_systems = 30;             ///< of Newton's method before relaxation takes over
  int most_sweeps = 2000;            ///< of relaxation before the layer counts as unsolved
  std::vector<int> cell_of_point;    ///< (points) row-major
  std::vector<CellWeights> weights;  ///< (points) row-major
  LayerCompliance compliance;
  SharedSlopes slopes;
  double modulus = 0;         ///< E [Pa], of a table 1, where kn is `stiffness`; proportional to kn
  double stiffness = 0;       ///< kn of the scene [N/m]
  double relaxation = 0;      ///< τ [s]
  double area = 0;            ///< for which a point stands [m²]
  double deepest = 0;         ///< where depth ends [m]
  bool feedback = false;      ///< the layer is the contact as well
  bool load_control = false;  ///< it carries the loads of the contacts of CompiledSensor::contacts
  int outward = 1;            ///< 1 or -1: whether the pad's z points out of the skin
  /// Of a contact: how far above the surface a body may be that the gel's bulge touches [m].
  [[nodiscard]] double bulge() const { return feedback ? 0.1 * grid.thickness : 0; }
  /// Returns how C(0) changes with the material [m], at E = 1 Pa.
  [[nodiscard]] double own_change(const LayerMaterial& by) const {
    if (by.thickness == 0 && by.poisson == 0) return 0;
    const LayerSlopes& of = slopes.at(grid);
    return by.thickness * of.thickness.own + by.poisson * of.poisson.own;
  }
  std::array<int, 2> direction{1, 1};          ///< 1 or -1: whether rows count along axis0, cols
                                               ///< along axis1
  std::optional<SurfaceCompliance> surface{};  ///< of a sensor with markers or pictures
};

}  // namespace tangere
