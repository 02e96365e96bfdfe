// SPDX-License-Identifier: Apache-2.0
// Slopes are differences over ±σ_d. C and L have a band, because a depth has a part in the rates of
// its neighbours alone.
#include "tasks/calibration/depth_errors.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr double kLeastForceError = 0.1;  // σ_F, by the deviation of a fit without these errors
constexpr double kLeastFactor = 0.01, kMostFactor = 10;  // of σ_F
constexpr int kHalvings = 60;
constexpr double kAgrees = 4;     // factor between two estimates of σ_d²
constexpr double kMatters = 0.2;  // of the forces' errors
constexpr std::size_t kFewestDifferences = 12;

double root_mean_square(std::span<const double> x) {
  double sum = 0;
  for (const double a : x) sum += a * a;
  return x.empty() ? 0 : std::sqrt(sum / double(x.size()));
}

/// Returns σ with Σ r²/(σ² + v) = `freedom`, or the least that is allowed.
double left_error(const std::vector<double>& squares, const std::vector<double>& variances,
                  double freedom, double most) {
  double low = std::log(kLeastForceError * most), high = std::log(most);
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = (low + high) / 2, error = std::exp(2 * middle);
    double sum = 0;
    for (std::size_t i = 0; i < squares.size(); ++i) sum += squares[i] / (error + variances[i]);
    (sum > freedom ? low : high) = middle;
  }
  return std::exp(high);
}

}  // namespace

DepthErrors::DepthErrors(ShiftedForces forces, const PressRecording& recording, FitRows rows,
                         double deviation, bool rates)
    : forces_(std::move(forces)),
      recording_(recording),
      rows_(std::move(rows)),
      deviation_(deviation) {
  const std::vector<double>& t = recording.time;
  if (rates && t.size() > 1)
    rate_step_ =
        deviation / (std::sqrt(2.0) * (t.back() - t.front()) / double(recording.rows() - 1));
}

const DepthErrors::Slopes& DepthErrors::at(const SkinNumbers& numbers) {
  if (slopes_.set && slopes_.numbers == numbers) return slopes_;
  slopes_.numbers = numbers, slopes_.set = true;
  std::vector<double> back = error_;
  for (double& e : back) e = -e;
  std::vector<DepthShift> shifts;
  for (const double depth : {0.0, -deviation_, deviation_})
    shifts.push_back({.depth = depth, .rows = back});
  if (rate_step_ > 0)
    for (const double rate : {-rate_step_, rate_step_})
      shifts.push_back({.rate = rate, .rows = back});
  const std::vector<std::vector<double>> f = forces_(numbers, shifts);
  const std::size_t n = f[0].size();
  slopes_.forces = f[0];
  slopes_.depth.resize(n), slopes_.bend.resize(n), slopes_.rate.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    slopes_.depth[k] = (f[2][k] - f[1][k]) / (2 * deviation_);
    slopes_.bend[k] = (f[2][k] + f[1][k] - 2 * f[0][k]) / (deviation_ * deviation_);
    if (rate_step_ > 0) slopes_.rate[k] = (f[4][k] - f[3][k]) / (2 * rate_step_);
  }
  return slopes_;
}

/// Returns the variance σ_η² of what is not known of the error of a row [m²].
double DepthErrors::left_variance(const Slopes& s, std::size_t row) const {
  double inverse = 1 / (deviation_ * deviation_);
  for (std::size_t k = row * rows_.width; k < (row + 1) * rows_.width; ++k)
    inverse += std::pow(s.depth[k] / force_error_[kind(k)], 2);
  return 1 / inverse;
}

std::vector<double> DepthErrors::forces(const SkinNumbers& numbers) {
  const Slopes& s = at(numbers);
  std::vector<double> out = s.forces;
  if (error_.empty()) return out;
  for (std::size_t k = 0; k < out.size(); ++k) {
    const DepthSlopes by = slopes_at(s, k);
    for (std::size_t i = 0; i < by.row.size(); ++i)
      out[k] += by.slope[i] * error_[std::size_t(by.row[i])];
    out[k] -= s.bend[k] * left_variance(s, k / rows_.width) / 2;
  }
  return out;
}

std::vector<double> DepthErrors::slopes(const SkinNumbers& numbers) { return at(numbers).depth; }

DepthErrors::DepthSlopes DepthErrors::slopes_at(const Slopes& s, std::size_t force) const {
  const int row = int(force / rows_.width), last = int(recording_.rows()) - 1,
            before = std::max(row - 1, 0), after = std::min(row + 1, last);
  DepthSlopes out{{row, before, after}, {s.depth[force], 0, 0}};
  if (rate_step_ > 0) {
    const double slope = s.rate[force] / (recording_.time[std::size_t(after)] -
                                          recording_.time[std::size_t(before)]);
    out.slope[1] = -slope, out.slope[2] = slope;
  }
  return out;
}

double DepthErrors::covariance(const DepthSlopes& a, const DepthSlopes& b) const {
  double sum = 0;
  for (std::size_t i = 0; i < a.row.size(); ++i)
    for (std::size_t j = 0; j < b.row.size(); ++j)
      if (a.row[i] == b.row[j]) sum += a.slope[i] * b.slope[j];
  return deviation_ * deviation_ * sum;
}

std::size_t DepthErrors::kind(std::size_t force) const {
  return rows_.normal > 0 && force % rows_.width >= rows_.normal ? 1 : 0;
}

/// Returns the numbers of the forces of the fitted rows.
std::vector<std::size_t> DepthErrors::fitted() const {
  std::vector<std::size_t> out;
  for (const int row : rows_.rows)
    for (std::size_t k = 0; k < rows_.width; ++k) out.push_back(std::size_t(row) * rows_.width + k);
  return out;
}

DepthErrors::Factor DepthErrors::factor(const Slopes& s) const {
  const std::vector<std::size_t> forces = fitted();
  const std::size_t n = forces.size();
  Factor out;
  out.band = 3 * rows_.width;  // of two rows before, and its own
  out.numbers.resize(n * out.band);
  for (const std::size_t k : forces) out.by.push_back(slopes_at(s, k));
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t first = i + 1 >= out.band ? i + 1 - out.band : 0;
    for (std::size_t j = first; j <= i; ++j) {
      double sum = covariance(out.by[i], out.by[j]) +
                   (i == j ? std::pow(force_error_[kind(forces[i])], 2) : 0);
      for (std::size_t k = std::max(first, j + 1 >= out.band ? j + 1 - out.band : 0); k < j; ++k)
        sum -= out.at(i, k) * out.at(j, k);
      out.at(i, j) = i == j ? std::sqrt(sum) : sum / out.at(j, j);
    }
  }
  return out;
}

std::vector<double> DepthErrors::whitened(const SkinNumbers& numbers,
                                          const std::vector<double>& off) {
  Factor of = factor(at(numbers));
  std::vector<double> out;
  for (const std::size_t k : fitted()) {
    const std::size_t i = out.size();
    double rest = off[k];
    for (std::size_t j = i + 1 >= of.band ? i + 1 - of.band : 0; j < i; ++j)
      rest -= of.at(i, j) * out[j];
    out.push_back(rest / of.at(i, i));
  }
  return out;
}

/// Multiplies σ_F of both kinds of forces so that Σ (L⁻¹ r)² is `freedom`, or nearest to it.
void DepthErrors::scale_force_errors(const SkinNumbers& numbers, const std::vector<double>& off,
                                     double freedom) {
  const std::array<double, 2> before = force_error_;
  double low = std::log(kLeastFactor), high = std::log(kMostFactor);
  for (int k = 0; k < kHalvings / 2; ++k) {
    const double middle = (low + high) / 2;
    for (std::size_t part = 0; part < before.size(); ++part)
      force_error_[part] = std::exp(middle) * before[part];
    double sum = 0;
    for (const double x : whitened(numbers, off)) sum += x * x;
    (sum > freedom ? low : high) = middle;
  }
}

void DepthErrors::choose_errors(const SkinNumbers& numbers, const std::vector<double>& off,
                                const std::array<double, 2>& deviations) {
  const Slopes& s = at(numbers);
  double freedom = 0;
  for (std::size_t part = 0; part < force_error_.size(); ++part) {
    std::vector<double> squares, variances;
    double sum = 0;
    for (const std::size_t k : fitted()) {
      if (kind(k) != part) continue;
      const DepthSlopes by = slopes_at(s, k);
      squares.push_back(off[k] * off[k]), variances.push_back(covariance(by, by));
      sum += squares.back();
    }
    const double most = deviations[part];
    if (squares.empty() || !(most > 0)) continue;
    freedom += sum / (most * most);
    force_error_[part] = left_error(squares, variances, sum / (most * most), most);
  }
  scale_force_errors(numbers, off, freedom);
  Factor of = factor(s);
  std::vector<double> solved = whitened(numbers, off);  // then C⁻¹ r
  for (std::size_t i = solved.size(); i-- > 0;) {
    for (std::size_t j = i + 1; j < std::min(i + of.band, solved.size()); ++j)
      solved[i] -= of.at(j, i) * solved[j];
    solved[i] /= of.at(i, i);
  }
  std::vector<double> error(recording_.rows());
  for (std::size_t i = 0; i < solved.size(); ++i)
    for (std::size_t k = 0; k < of.by[i].row.size(); ++k)
      error[std::size_t(of.by[i].row[k])] +=
          deviation_ * deviation_ * of.by[i].slope[k] * solved[i];
  error_ = error;
  slopes_.set = false;
}

double DepthErrors::size(const SkinNumbers& numbers) {
  const Slopes& s = at(numbers);
  double sum = 0, count = 0;
  for (const std::size_t k : fitted()) {
    if (kind(k) != 0) continue;
    const DepthSlopes by = slopes_at(s, k);
    sum += covariance(by, by), count += 1;
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

double told_depth_error(DepthErrors& errors, const PressRecording& r, const SkinNumbers& numbers,
                        std::span<const double> off) {
  constexpr std::array kFourth = {1.0, -4.0, 6.0, -4.0, 1.0};
  const double scatter = r.depth_scatter();
  if (!(scatter > 0)) return 0;
  const std::vector<double> slope = errors.slopes(numbers);
  const std::vector<int>& rows = errors.rows().rows;
  const std::size_t width = errors.rows().width;
  std::vector<double> left;
  double both = 0, squares = 0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::size_t row = std::size_t(rows[k]), force = width * row;
    left.push_back(off[force]);
    if (k < 2 || k + 2 >= rows.size() || rows[k + 2] - rows[k - 2] != 4) continue;
    double fourth = 0;
    for (std::size_t i = 0; i < kFourth.size(); ++i) fourth += kFourth[i] * r.depth[row - 2 + i];
    both += off[force] * slope[force] * fourth, squares += slope[force] * slope[force];
    ++count;
  }
  if (count < kFewestDifferences || !(squares > 0)) return 0;
  const double ratio = both / (6 * squares) / (scatter * scatter);
  const bool agrees = ratio > 1 / kAgrees && ratio < kAgrees;
  return agrees && errors.size(numbers) > kMatters * root_mean_square(left) ? scatter : 0;
}

}  // namespace tangere
