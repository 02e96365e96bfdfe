// SPDX-License-Identifier: Apache-2.0
// Without a shear each row is a press of its own: the indenter is placed and nothing moves. On a
// path the skin's friction has memory, and the indenter is driven from row to row.
#include "tasks/calibration/channel_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/base/error.hpp"
#include "engine/scene/channel_loads.hpp"
#include "tasks/calibration/calibration.hpp"
#include "tasks/calibration/press.hpp"

namespace tangere {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;
using Eigen::Index;

constexpr int kFewestRows = 3;
constexpr double kPrice = 1.4;  // of a degree of freedom; at 1 the score of fits through all rows
                                // would be 0/0

void check(const ChannelRecording& r) {
  const auto expect = [&](const std::string& what, const std::vector<double>& column) {
    if (column.size() != r.rows() && !column.empty())
      throw InputError(
          fmt::format("a recording of {} depths and {} numbers of {}; expected as many", r.rows(),
                      column.size(), what));
  };
  if (r.rows() == 0) throw InputError("a recording without depths; expected one row at least");
  if (r.channels.empty() || r.channels.size() != r.names.size())
    throw InputError(fmt::format("{} channels with {} names; expected one at least, and as many",
                                 r.channels.size(), r.names.size()));
  expect("x", r.x), expect("y", r.y), expect("shear", r.shear);
  for (std::size_t c = 0; c < r.channels.size(); ++c)
    if (r.channels[c].size() != r.rows())
      throw InputError(fmt::format("{} depths and {} numbers of channel '{}'; expected as many",
                                   r.rows(), r.channels[c].size(), r.names[c]));
  if (r.x.empty() != r.y.empty())
    throw InputError("x without y, or y without x; expected both or none");
  if (!r.x.empty() && !r.shear.empty())
    throw InputError("places x and y beside a shear; expected one of them");
}

/// Numbers by which channels are linear: loads, then products of pairs. (rows, those)
Matrix terms_of(const Scene& scene, const ChannelRequest& request, const ChannelRecording& r) {
  ChannelMap map;
  map.rows = request.rows, map.cols = request.cols, map.shear = request.shear;
  const Model model(without_rates(scene));
  const SensorInfo& info = model.sensors()[0];
  const bool grid = info.rows > 0;
  const auto weights = node_weights(map, grid ? info.rows : 1, grid ? info.cols : info.points);
  const auto n = Index(map.loads());
  Matrix out(Index(r.rows()), n + Index(map.pairs()));
  std::vector<double> loads(map.loads());
  Index row = 0;
  for_fields(model, request.zero, r.depth, r.x, r.y, r.shear, [&](std::span<const double> field) {
    node_loads(map, weights, info.pressure_sign, field, loads);
    Index at = n;
    for (Index k = 0; k < n; ++k) {
      out(row, k) = loads[std::size_t(k)];
      for (Index l = k; l < n; ++l) out(row, at++) = loads[std::size_t(k)] * loads[std::size_t(l)];
    }
    ++row;
  });
  return out;
}

Matrix channels_of(const ChannelRecording& r) {
  Matrix out(Index(r.rows()), Index(r.channels.size()));
  for (std::size_t c = 0; c < r.channels.size(); ++c)
    for (std::size_t k = 0; k < r.rows(); ++k) out(Index(k), Index(c)) = r.channels[c][k];
  return out;
}

Matrix rows_of(const Matrix& all, const std::vector<int>& rows) {
  Matrix out(Index(rows.size()), all.cols());
  for (std::size_t k = 0; k < rows.size(); ++k) out.row(Index(k)) = all.row(rows[k]);
  return out;
}

/// Columns less their means and over their deviations; columns that do not vary are 0.
struct Standard {
  Vector mean, scale;
  explicit Standard(const Matrix& x) : mean(x.colwise().mean().transpose()), scale(x.cols()) {
    for (Index c = 0; c < x.cols(); ++c) {
      const double deviation = std::sqrt((x.col(c).array() - mean[c]).square().mean());
      scale[c] = deviation > 1e-12 * std::abs(mean[c]) ? 1 / deviation : 0;
    }
  }
  [[nodiscard]] Matrix of(const Matrix& x) const {
    return (x.rowwise() - mean.transpose()) * scale.asDiagonal();
  }
};

/// Ridge regression in the eigenvectors of AᵀA.
struct Ridge {
  Matrix weights;  ///< (terms, channels)
  double lambda = 0;

  Ridge(const Matrix& A, const Matrix& Y) {
    const double n = double(A.rows());
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(A.transpose() * A / n);
    const Vector lengths = solver.eigenvalues().cwiseMax(0.0);
    const Matrix parts = solver.eigenvectors().transpose() * (A.transpose() * Y) / n;
    const double whole = Y.squaredNorm() / n;
    double least = HUGE_VAL;
    constexpr double kLeast = 1e-10, kMost = 10, kFactor = 2;
    for (double tried = kLeast; tried <= kMost; tried *= kFactor) {
      const Vector by = (lengths.array() + tried).inverse();
      const Matrix x = by.asDiagonal() * parts;
      const double left = whole - 2 * x.cwiseProduct(parts).sum() +
                          (lengths.asDiagonal() * x).cwiseProduct(x).sum();
      const double spared = 1 - (1 + kPrice * lengths.cwiseProduct(by).sum()) / n;
      const double score = std::max(left, 0.0) / (spared * spared);
      if (!(spared > 0) || !(score < least)) continue;
      least = score, lambda = tried;
      weights = solver.eigenvectors() * x;
    }
    if (weights.size() == 0) weights = Matrix::Zero(A.cols(), Y.cols());
  }
};

Matrix computed(const ChannelMap& map, const Matrix& terms) {
  const auto loads = Index(map.loads()), pairs = Index(map.pairs());
  Matrix out(terms.rows(), Index(map.channels()));
  for (Index c = 0; c < out.cols(); ++c) {
    const Eigen::Map<const Vector> linear(&map.linear[std::size_t(c * loads)], loads),
        quadratic(&map.quadratic[std::size_t(c * pairs)], pairs);
    out.col(c) = terms.leftCols(loads) * linear + terms.rightCols(pairs) * quadratic;
    out.col(c).array() += map.offset[std::size_t(c)];
  }
  return out;
}

ChannelScore score_of(const Matrix& computed, const Matrix& recorded) {
  ChannelScore out;
  out.rows = int(recorded.rows());
  if (out.rows == 0) return out;
  double left = 0, all = 0;
  for (Index c = 0; c < recorded.cols(); ++c) {
    const double off = (computed.col(c) - recorded.col(c)).squaredNorm(),
                 spread = (recorded.col(c).array() - recorded.col(c).mean()).square().sum();
    out.each.push_back(spread > 0 ? 1 - off / spread : off > 0 ? -HUGE_VAL : 1);
    left += off, all += spread;
  }
  out.whole = all > 0 ? 1 - left / all : 0;
  return out;
}

ChannelMap map_of(const ChannelRequest& request, const ChannelRecording& r, const Ridge& ridge,
                  const Standard& by, const Standard& of) {
  ChannelMap map;
  map.unit = request.unit;
  map.rows = request.rows, map.cols = request.cols, map.shear = request.shear;
  map.names = r.names;
  const auto loads = Index(map.loads());
  for (Index c = 0; c < ridge.weights.cols(); ++c) {
    const double back = of.scale[c] > 0 ? 1 / of.scale[c] : 0;
    const Vector weights = back * ridge.weights.col(c).cwiseProduct(by.scale);
    map.offset.push_back(of.mean[c] - weights.dot(by.mean));
    map.linear.insert(map.linear.end(), weights.data(), weights.data() + loads);
    map.quadratic.insert(map.quadratic.end(), weights.data() + loads,
                         weights.data() + weights.size());
  }
  return map;
}

}  // namespace

double ChannelScore::mean() const {
  return std::accumulate(each.begin(), each.end(), 0.0) /
         double(std::max<std::size_t>(1, each.size()));
}

ChannelFit fit_channels(const Scene& scene, const ChannelRequest& request,
                        const ChannelRecording& recording) {
  check(recording);
  const std::vector<int> held_out = held_out_rows(request.hold_out, int(recording.rows()));
  std::vector<int> rows;
  for (int row = 0; row < int(recording.rows()); ++row)
    if (!std::ranges::binary_search(held_out, row)) rows.push_back(row);
  if (std::ssize(rows) < kFewestRows)
    throw InputError(fmt::format("{} rows to fit; expected at least {}", rows.size(), kFewestRows));
  ChannelMap shape;
  shape.rows = request.rows, shape.cols = request.cols, shape.shear = request.shear;
  shape.names = recording.names;
  shape.offset.resize(recording.names.size());
  shape.linear.resize(shape.channels() * shape.loads());
  const TactileDescription& d = scene.sensors.at(0);
  const bool grid = d.points.empty();
  if (const std::string fault =
          channel_map_fault(shape, grid ? d.array.rows : 0, grid ? d.array.cols : 0);
      !fault.empty())
    throw InputError(fault);
  const Matrix terms = terms_of(scene, request, recording), channels = channels_of(recording);
  if (!(terms.cwiseAbs().maxCoeff() > 0))
    throw InputError(
        "the sensor feels nothing in any row; expected depths in m, positive into the skin, and "
        "places on it");
  const Matrix A = rows_of(terms, rows), Y = rows_of(channels, rows);
  const Standard by(A), of(Y);
  const Ridge ridge(by.of(A), of.of(Y));
  ChannelFit out;
  out.map = map_of(request, recording, ridge, by, of);
  out.ridge = ridge.lambda;
  const Matrix found = computed(out.map, terms);
  out.fitted = score_of(rows_of(found, rows), Y);
  out.held_out = score_of(rows_of(found, held_out), rows_of(channels, held_out));
  return out;
}

ChannelScore check_channels(const Scene& scene, const ChannelRequest& request,
                            const ChannelMap& map, const ChannelRecording& recording) {
  check(recording);
  if (recording.names != map.names)
    throw InputError(
        "the other recording has other channels; expected the same names in the same order");
  return score_of(computed(map, terms_of(scene, request, recording)), channels_of(recording));
}

}  // namespace tangere
