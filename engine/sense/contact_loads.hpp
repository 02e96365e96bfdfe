// SPDX-License-Identifier: Apache-2.0
// Loads of the contacts between a sensor's body and those that it senses, at the state that is read
// (docs/layer.md). With the wrench (m; f) of these contacts on the sensor's body, in pad axes about
// the pad's origin, and the outward normal o z, the pressing force F and its moments are
//   F = -o f_z,   F x = o m_y,   F y = -o m_x
// Contacts with shear springs have the anchors that follow from the state and its shear state.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/layer/load_control.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/step/shear_state.hpp"
#include "kernels/contact/contact_law.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere {

/// A pair of bodies at a state.
template <class N>
struct PairAt {
  kernels::Frame<N> link2_in_1;
  kernels::Vec6<N> twist;  ///< W of link 2 relative to link 1, link 1's axes and origin
  kernels::LawParameters<N> law;
  kernels::Vec3<N> size;        ///< of the touched shape, as in PairContact
  kernels::Vec3<double> faces;  ///< kernels/step/faces.hpp
};
template <class N>
struct PairPoint {
  kernels::Vec3<N> xi;         ///< link 1's axes [m]
  kernels::Vec3<N> stretched;  ///< elastic displacement s of a shear spring [m]
  double weight;  ///< area for which it stands [m²], where coefficients count per area
};

/// Sets the faces that count of a pair whose other numbers are set.
void choose_faces(const kernels::PairContact& pair, PairAt<double>& at);
/// Returns the numbers of the points of a pair that may touch, in PairContact::points.
std::vector<int> touching_points(const kernels::PairContact& pair, const PairAt<double>& at);
/// Returns the loads of the points of a pair. N: double or Dual<double>.
template <class N>
std::array<N, 3> loads_of_pair(const CompiledSensor& sensor, const kernels::PairContact& pair,
                               const PairAt<N>& at, std::span<const PairPoint<N>> points);

/// Owns the scratch of one thread.
class ContactLoads {
 public:
  /// Computes the loads of one environment, from the poses of PadReader::move().
  PadLoads read(const PadReader& reader, const Batch& batch, int environment,
                const CompiledSensor& sensor);

  /// Contribution of one pair to the cotangents.
  struct Share {
    int pair;
    kernels::TouchCotangent<double> motion;  ///< link 1's axes and origin
    kernels::Vec3<double> stretch;           ///< of the size of body 1, whose points touch
  };
  /// Pulls the cotangent of the loads that were read last back. Valid until the next call.
  /// `numbers`: also by coefficients and sizes. `memory`: added to, three numbers for each entry of
  /// the environment's shear state.
  std::span<const Share> pull_back(const PadLoads& bar, bool numbers, std::span<double> memory);

 private:
  struct Touching {
    int pair;
    PairAt<double> at;
    std::vector<int> index;
    std::vector<PairPoint<double>> points;
  };
  void pull_back_memory(const Touching& of, const PadLoads& bar, std::span<double> memory) const;
  [[nodiscard]] Share share_of(const Touching& of, const PadLoads& bar, bool numbers) const;

  const CompiledModel* model_ = nullptr;
  const CompiledSensor* sensor_ = nullptr;
  const ShearState* state_ = nullptr;
  std::vector<Touching> touching_;
  std::vector<Share> shares_;
};

}  // namespace tangere
