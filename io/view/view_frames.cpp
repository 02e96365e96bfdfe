// SPDX-License-Identifier: Apache-2.0
// A number of a page is four bytes, 16/3 characters in base64.
#include "io/view/view_frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

constexpr double kBytesOfNumber = 16.0 / 3;
constexpr double kFixedBytes = 1e6;  // of the page without frames: program, styles, shapes

}  // namespace

std::vector<std::int64_t> frames_of(std::int64_t rows, std::int64_t stride) {
  std::vector<std::int64_t> frames;
  for (std::int64_t row = 0; row < rows; row += stride) frames.push_back(row);
  if (rows > 0 && frames.back() != rows - 1) frames.push_back(rows - 1);
  return frames;
}

std::int64_t stride_for(const std::vector<std::int64_t>& rows, std::size_t numbers,
                        const ViewOptions& options) {
  double total = 0;
  std::int64_t longest = 0;
  for (const std::int64_t count : rows)
    total += static_cast<double>(count), longest = std::max(longest, count);
  // frames_of() may add the last row.
  const std::int64_t most = std::max(1, options.frames - 1);
  const std::int64_t frame_stride = longest <= options.frames ? 1 : (longest + most - 1) / most;
  const double room =
      options.bytes - kFixedBytes - kBytesOfNumber * static_cast<double>(numbers * rows.size());
  const double needed = kBytesOfNumber * static_cast<double>(numbers) * total;
  if (!(room > kBytesOfNumber * static_cast<double>(numbers * rows.size())))
    throw InputError(
        fmt::format("a page of {} episodes takes more than {:.0f} MB with two frames each; ask for "
                    "fewer: --episodes",
                    rows.size(), options.bytes / 1e6));
  const auto byte_stride = static_cast<std::int64_t>(std::ceil(needed / room));
  return std::max({std::int64_t{1}, frame_stride, byte_stride});
}

std::size_t numbers_per_frame(const Scene& scene, const std::vector<ViewSensor>& sensors,
                              std::size_t traces) {
  // Row and time, poses, end effectors, curves.
  std::size_t numbers = 2 + 7 * scene.links.size() + 3 * scene.end_effectors.size() + traces;
  for (const ViewSensor& sensor : sensors) numbers += 1 + 3 * sensor.cells();
  return numbers;
}

std::vector<ViewTrace> coordinate_traces(const std::vector<std::string>& names,
                                         const std::vector<std::string>& units) {
  std::vector<ViewTrace> traces;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const std::string& unit = units[k];
    traces.push_back({fmt::format("q [{}]", unit), names[k], unit, {}});
  }
  return traces;
}

void check_finite_field(std::span<const double> force, const std::string& where) {
  for (const double x : force)
    if (!std::isfinite(x))
      throw IoError(fmt::format("{} has a number that is {}; expected finite numbers", where, x));
}

}  // namespace tangere
