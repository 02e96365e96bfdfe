// SPDX-License-Identifier: Apache-2.0
// Errors are shares of the largest recorded force.
#include "tasks/calibration/press_error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/base/error.hpp"
#include "tasks/calibration/row_forces.hpp"

namespace tangere {
namespace {

constexpr double kSmallest = 0.05;  // of the peak: smaller forces have no error of their own

void check_columns(const PressRecording& r) {
  const bool fields = r.points > 0;
  for (const auto& [name, column, width] :
       {std::tuple{"force", &r.force, std::size_t{1}},
        {"time", &r.time, 1},
        {"shear", &r.shear, 1},
        {"shear force", &r.shear_force, 1},
        {"x", &r.x, 1},
        {"y", &r.y, 1},
        {"the field", &r.field, r.points},
        {"the field along the skin", &r.shear_field, 2 * r.points}}) {
    const bool needed = column == (fields ? &r.field : &r.force);
    if (column->size() != width * r.rows() && (!column->empty() || needed))
      throw InputError(fmt::format("a recording of {} depths and {} numbers of {}; expected {}",
                                   r.rows(), column->size(), name,
                                   width == 1 ? "as many" : "as many for each point"));
  }
}

/// The whole forces at each row: along the normal, and the size of that along the skin [N].
struct RowSums {
  std::vector<double> normal, tangential;
};
RowSums row_sums(const PressRecording& r) {
  const std::vector<double>&normal = r.normal(), &tangential = r.tangential();
  const std::size_t points = r.points;
  RowSums out;
  const std::size_t width = std::max<std::size_t>(points, 1), rows = normal.size() / width;
  for (std::size_t row = 0; row < rows; ++row) {
    double sum = 0, a = 0, b = 0;
    for (std::size_t k = row * width; k < (row + 1) * width; ++k) {
      sum += normal[k];
      if (points == 0)
        a += tangential[k];
      else
        a += tangential[2 * k], b += tangential[2 * k + 1];
    }
    out.normal.push_back(sum), out.tangential.push_back(std::hypot(a, b));
  }
  return out;
}

}  // namespace

PressError error_of(std::span<const double> computed, std::span<const double> recorded,
                    std::span<const int> rows, std::size_t width) {
  PressError out;
  const double peak = peak_of(recorded);
  double recorded_squares = 0;
  for (const int row : rows) {
    double own = 0, squares = 0, off_squares = 0;
    for (std::size_t k = width * std::size_t(row); k < width * (std::size_t(row) + 1); ++k) {
      const double f = recorded[k], off = std::abs(computed[k] - f);
      own = std::max(own, std::abs(f));
      squares += f * f, off_squares += off * off;
      out.largest = std::max(out.largest, off / peak);
    }
    out.root_mean_square += off_squares, recorded_squares += squares;
    if (own > kSmallest * peak)
      out.largest_by_row = std::max(out.largest_by_row, std::sqrt(off_squares / squares));
  }
  out.rows = int(rows.size());
  if (recorded_squares > 0) out.relative = std::sqrt(out.root_mean_square / recorded_squares);
  if (out.rows > 0)
    out.root_mean_square =
        std::sqrt(out.root_mean_square / (double(out.rows) * double(width))) / peak;
  return out;
}

std::size_t normal_width(const PressRecording& r) { return std::max<std::size_t>(r.points, 1); }
std::size_t shear_width(const PressRecording& r) { return std::max<std::size_t>(2 * r.points, 1); }

double largest_ratio(const PressRecording& r) {
  const RowSums sums = row_sums(r);
  const double least = kSmallest * peak_of(sums.normal);
  double ratio = 0;
  for (std::size_t k = 0; k < r.rows(); ++k)
    if (sums.normal[k] > least) ratio = std::max(ratio, sums.tangential[k] / sums.normal[k]);
  return ratio;
}

void check_recording(const PressRecording& r) {
  if (r.rows() == 0) throw InputError("a recording without depths; expected one row at least");
  check_columns(r);
  if (r.points == 0 && r.shear.empty() != r.shear_force.empty())
    throw InputError("shear without its force, or the force without it; expected both or none");
  if (r.points == 0 && !(r.x.empty() && r.y.empty()))
    throw InputError("x or y without a field; expected a press in the middle of the skin");
  if (!r.shear.empty() && !(r.x.empty() && r.y.empty()))
    throw InputError("x or y beside a shear; expected presses at places, or a path");
  for (std::size_t k = 1; k < r.time.size(); ++k)
    if (!(r.time[k] > r.time[k - 1]))
      throw InputError(fmt::format("row {}: time {} s after {} s; expected ascending times", k + 1,
                                   r.time[k], r.time[k - 1]));
  if (!(peak_of(r.normal()) > 0))
    throw InputError("a recording without any force; expected a press of the skin");
}

}  // namespace tangere
