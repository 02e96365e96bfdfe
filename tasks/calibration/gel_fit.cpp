// SPDX-License-Identifier: Apache-2.0
// Normal equations of single presses are kept, so that leaving one out is a subtraction.
#include "tasks/calibration/gel_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/base/as_size.hpp"
#include "engine/picture/gel_colour.hpp"
#include "engine/picture/membrane.hpp"
#include "engine/picture/surface_image.hpp"

namespace tangere {
namespace {

constexpr int kTerms = static_cast<int>(kShades * kShadePlaces);
constexpr double kFitted = 1.6, kScored = 1.5;  // radii of the discs, by that of the imprint
constexpr double kPixelsPerPoint = 4;           // of the grid on which surfaces are computed
constexpr double kTikhonov = 1e-5;              // of the mean diagonal
constexpr double kStartDepth = 0.9, kStartReach = 0.7, kStartBlur = 0.2;  // by r, R, R
constexpr double kDeepest = 1.25;  // of a press, by R: what holds the ball goes in as well
constexpr int kRounds = 3, kRefinements = 5;
constexpr int kHalf = 5;  // of the windows of a likeness [pixels]

using Lamps = Eigen::Matrix<double, kTerms, int(kColours)>;

/// Sums of the normal equations of all three channels.
struct Equations {
  Eigen::Matrix<double, kTerms, kTerms> matrix = Eigen::Matrix<double, kTerms, kTerms>::Zero();
  Lamps right = Lamps::Zero();
  double squares = 0;

  void add(const Equations& other, double sign) {
    matrix += sign * other.matrix, right += sign * other.right, squares += sign * other.squares;
  }
  [[nodiscard]] Lamps solve() const {
    Eigen::Matrix<double, kTerms, kTerms> m = matrix;
    m.diagonal().array() += kTikhonov * matrix.diagonal().mean() + 1e-12;
    return m.ldlt().solve(right);
  }
  /// Sum of the squared differences that lamps leave.
  [[nodiscard]] double left(const Lamps& lamps) const {
    return squares - 2 * (lamps.cwiseProduct(right)).sum() +
           (lamps.cwiseProduct(matrix * lamps)).sum();
  }
};

/// What is searched besides the lamps.
struct GelShape {
  double depth_ratio, reach, blur;
};

/// The pixels of a press: their terms and how much they differ from the background.
class Renderer {
 public:
  Renderer(const GelBackground& background, double ball, double pixel, const GelShape& shape)
      : background_(background),
        ball_(ball),
        pixel_(pixel),
        ratio_(shape.depth_ratio),
        grid_(grid_of(background, pixel)),
        membrane_(grid_.rows, grid_.cols, shape.reach / grid_.pitch_x, shape.reach / grid_.pitch_y),
        image_(grid_, shape.blur),
        depth_(as_size(grid_.points())),
        height_(depth_.size()),
        p_(as_size(grid_.width)),
        q_(p_.size()) {}

  /// Calls f(first number of the pixel, terms) for the pixels within `radii` of a label, with the
  /// surface of an imprint.
  template <class F>
  void for_pixels(const Imprint& imprint, const Imprint& label, double radii, const F& f) {
    put_surface(imprint);
    const double reach = radii * label.radius;
    const int smaller = std::min(grid_.height, grid_.width);
    std::array<double, kTerms> terms;
    for (int i = std::max(0, int(label.y - reach));
         i < std::min(grid_.height, int(label.y + reach) + 1); ++i) {
      image_.read_slopes(i, p_, q_);
      const double y = picture_place(i, grid_.height, smaller);
      for (int j = std::max(0, int(label.x - reach));
           j < std::min(grid_.width, int(label.x + reach) + 1); ++j) {
        if (!(std::hypot(j + 0.5 - label.x, i + 0.5 - label.y) <= reach)) continue;
        const double p = double(p_[as_size(j)]), q = double(q_[as_size(j)]),
                     n = 1 / std::sqrt(1 + p * p + q * q),
                     x = picture_place(j, grid_.width, smaller);
        const std::array<double, kShades> phi = shades(-p * n, -q * n, n);
        for (std::size_t k = 0; k < kShades; ++k)
          terms[3 * k] = phi[k], terms[3 * k + 1] = phi[k] * x, terms[3 * k + 2] = phi[k] * y;
        f((as_size(i) * as_size(grid_.width) + as_size(j)) * kColours, terms);
      }
    }
  }

 private:
  static PictureGrid grid_of(const GelBackground& of, double pixel) {
    const auto points = [](int pixels) {
      return std::max(4, static_cast<int>(std::lround(pixels / kPixelsPerPoint)));
    };
    const double width = of.cols * pixel, height = of.rows * pixel;
    const int rows = points(of.rows), cols = points(of.cols);
    return {rows, cols, width / cols, height / rows, of.rows, of.cols, width, height};
  }
  void put_surface(const Imprint& at) {
    const double deepest = ratio_ * at.radius * pixel_;
    for (int i = 0; i < grid_.rows; ++i)
      for (int j = 0; j < grid_.cols; ++j) {
        const double x = (j + 0.5) * grid_.pitch_x - at.x * pixel_,
                     y = (i + 0.5) * grid_.pitch_y - at.y * pixel_,
                     square = ball_ * ball_ - x * x - y * y;
        depth_[as_size(i * grid_.cols + j)] = static_cast<float>(
            square > 0 ? std::max(0.0, std::sqrt(square) - ball_ + deepest) : 0.0);
      }
    membrane_.settle(depth_, height_);
    image_.set(height_);
  }

  const GelBackground& background_;
  double ball_, pixel_, ratio_;
  PictureGrid grid_;
  Membrane<float> membrane_;
  SurfaceImage<float> image_;
  std::vector<float> depth_, height_, p_, q_;
};

class Fit {
 public:
  Fit(const GelBackground& background, std::span<const BallPress> presses, double ball,
      double pixel)
      : background_(background), presses_(presses), ball_(ball), pixel_(pixel) {
    for (const BallPress& press : presses) imprints_.push_back(press.label);
    shape_ = {kStartDepth, kStartReach * ball, kStartBlur * ball};
  }

  GelFit run() {
    for (int round = 0; round < kRounds; ++round) {
      search(round == 0 ? std::array{0.30, 0.15} : std::array{0.10, 0.04});
      const Lamps lamps = all_equations().solve();
      Renderer renderer = renderer_of(shape_);
      for (std::size_t k = 0; k < presses_.size(); ++k)
        imprints_[k] = refined(renderer, k, imprints_[k], lamps);
    }
    GelFit fit;
    fit.depth_ratio = shape_.depth_ratio;
    fit.gel.pixel = pixel_;
    fit.gel.reach = shape_.reach;
    fit.gel.blur = shape_.blur;
    fit.gel.background = background_;
    const Equations all = all_equations();
    const Lamps lamps = all.solve();
    for (std::size_t c = 0; c < kColours; ++c)
      for (std::size_t t = 0; t < kShades * kShadePlaces; ++t)
        fit.gel.lamps[c][t / kShadePlaces][t % kShadePlaces] = lamps(int(t), int(c));
    for (std::size_t k = 0; k < presses_.size(); ++k) fit.scores.push_back(score(all, k));
    return fit;
  }

 private:
  [[nodiscard]] Renderer renderer_of(const GelShape& shape) const {
    return {background_, ball_, pixel_, shape};
  }
  [[nodiscard]] double difference(std::size_t press, std::size_t number) const {
    return double(presses_[press].levels[number]) - double(background_.levels[number]);
  }

  [[nodiscard]] Equations equations_of(Renderer& renderer, std::size_t press) const {
    Equations sums;
    renderer.for_pixels(imprints_[press], presses_[press].label, kFitted,
                        [&](std::size_t number, const std::array<double, kTerms>& terms) {
                          const Eigen::Map<const Eigen::Matrix<double, kTerms, 1>> t(terms.data());
                          sums.matrix.selfadjointView<Eigen::Lower>().rankUpdate(t);
                          for (std::size_t c = 0; c < kColours; ++c) {
                            const double d = difference(press, number + c);
                            sums.right.col(int(c)) += d * t;
                            sums.squares += d * d;
                          }
                        });
    sums.matrix =
        Eigen::Matrix<double, kTerms, kTerms>(sums.matrix.selfadjointView<Eigen::Lower>());
    return sums;
  }
  [[nodiscard]] Equations all_equations() const {
    Renderer renderer = renderer_of(shape_);
    Equations sums;
    for (std::size_t k = 0; k < presses_.size(); ++k) sums.add(equations_of(renderer, k), 1);
    return sums;
  }

  /// What the best lamps leave of every third press.
  [[nodiscard]] double left_by(const GelShape& shape) const {
    Renderer renderer = renderer_of(shape);
    Equations sums;
    for (std::size_t k = 0; k < presses_.size(); k += presses_.size() < 6 ? 1 : 3)
      sums.add(equations_of(renderer, k), 1);
    return sums.left(sums.solve());
  }

  /// Multiplies or divides one number after the other as long as that helps.
  void search(const std::array<double, 2>& steps) {
    double best = left_by(shape_);
    for (const double step : steps)
      for (bool better = true; better;) {
        better = false;
        for (double GelShape::*number : {&GelShape::depth_ratio, &GelShape::reach, &GelShape::blur})
          for (const double factor : {1 + step, 1 / (1 + step)}) {
            GelShape tried = shape_;
            tried.*number *= factor;
            tried.depth_ratio = std::min(tried.depth_ratio, deepest_ratio());
            if (const double left = left_by(tried); left < best) {
              best = left, shape_ = tried, better = true;
              break;
            }
          }
      }
  }
  /// At which the largest imprint is as deep as a press may be.
  [[nodiscard]] double deepest_ratio() const {
    double largest = 0;
    for (const BallPress& press : presses_) largest = std::max(largest, press.label.radius);
    return kDeepest * ball_ / (largest * pixel_);
  }

  /// Differences between a photograph and the picture of an imprint, within the fitted disc.
  [[nodiscard]] std::vector<double> residuals(Renderer& renderer, std::size_t press,
                                              const Imprint& at, const Lamps& lamps) const {
    std::vector<double> all;
    renderer.for_pixels(at, presses_[press].label, kFitted,
                        [&](std::size_t number, const std::array<double, kTerms>& terms) {
                          const Eigen::Map<const Eigen::Matrix<double, kTerms, 1>> t(terms.data());
                          for (std::size_t c = 0; c < kColours; ++c)
                            all.push_back(lamps.col(int(c)).dot(t) - difference(press, number + c));
                        });
    return all;
  }

  /// Moves an imprint by Gauss and Newton's method; its lamps are held.
  [[nodiscard]] Imprint refined(Renderer& renderer, std::size_t press, Imprint at,
                                const Lamps& lamps) const {
    constexpr double kStep = 0.25, kFarthest = 3;  // [pixels]
    constexpr double Imprint::*kNumbers[] = {&Imprint::x, &Imprint::y, &Imprint::radius};
    const auto sum = [](const std::vector<double>& r) {
      return Eigen::Map<const Eigen::VectorXd>(r.data(), Eigen::Index(r.size())).squaredNorm();
    };
    std::vector<double> r = residuals(renderer, press, at, lamps);
    for (int pass = 0; pass < kRefinements; ++pass) {
      Eigen::MatrixX3d J(Eigen::Index(r.size()), 3);
      for (int k = 0; k < 3; ++k) {
        Imprint more = at, less = at;
        more.*kNumbers[k] += kStep, less.*kNumbers[k] -= kStep;
        const std::vector<double> a = residuals(renderer, press, more, lamps),
                                  b = residuals(renderer, press, less, lamps);
        for (std::size_t i = 0; i < r.size(); ++i)
          J(Eigen::Index(i), k) = (a[i] - b[i]) / (2 * kStep);
      }
      const Eigen::Map<const Eigen::VectorXd> now(r.data(), Eigen::Index(r.size()));
      const Eigen::Matrix3d normal = J.transpose() * J;
      const Eigen::Vector3d move = -normal.ldlt().solve(J.transpose() * now);
      if (!move.allFinite()) break;
      Imprint next = at;
      for (int k = 0; k < 3; ++k) next.*kNumbers[k] += std::clamp(move[k], -kFarthest, kFarthest);
      next.radius = std::clamp(next.radius, 0.5 * at.radius,
                               kDeepest * ball_ / (shape_.depth_ratio * pixel_));
      std::vector<double> there = residuals(renderer, press, next, lamps);
      if (!(sum(there) < sum(r))) break;
      at = next, r = std::move(there);
    }
    return at;
  }

  [[nodiscard]] std::vector<float> drawn(Renderer& renderer, const Imprint& at, double radii,
                                         const Imprint& label, const Lamps& lamps) const {
    std::vector<float> picture = background_.levels;
    renderer.for_pixels(
        at, label, radii, [&](std::size_t number, const std::array<double, kTerms>& terms) {
          const Eigen::Map<const Eigen::Matrix<double, kTerms, 1>> t(terms.data());
          for (std::size_t c = 0; c < kColours; ++c)
            picture[number + c] = static_cast<float>(
                std::clamp(double(picture[number + c]) + lamps.col(int(c)).dot(t), 0.0, 255.0));
        });
    return picture;
  }

  /// The label of a press, moved by what the labels of the others are off in common.
  [[nodiscard]] Imprint moved_like_others(std::size_t press) const {
    Imprint at = presses_[press].label;
    const double share = 1 / double(presses_.size() - 1);
    for (std::size_t k = 0; k < presses_.size(); ++k) {
      if (k == press) continue;
      at.x += share * (imprints_[k].x - presses_[k].label.x);
      at.y += share * (imprints_[k].y - presses_[k].label.y);
    }
    return at;
  }

  [[nodiscard]] PressScore score(const Equations& all, std::size_t press) const {
    Renderer renderer = renderer_of(shape_);
    Equations others = all;
    others.add(equations_of(renderer, press), -1);
    const Lamps lamps = others.solve();
    const BallPress& of = presses_[press];
    PressScore score;
    score.refined = refined(renderer, press, of.label, lamps);
    const Imprint disc{of.label.x, of.label.y, kScored * of.label.radius};
    const Imprint expected = moved_like_others(press);
    const double farther = kScored + 2 * kHalf / of.label.radius;  // windows reach beyond the disc
    const auto compare = [&](const Imprint& at) {
      return likeness(drawn(renderer, at, farther, of.label, lamps), of.levels, background_.rows,
                      background_.cols, disc);
    };
    const Likeness plain = compare(expected), aligned = compare(score.refined);
    score.psnr = plain.psnr, score.ssim = plain.ssim;
    score.aligned_psnr = aligned.psnr, score.aligned_ssim = aligned.ssim;
    return score;
  }

  const GelBackground& background_;
  std::span<const BallPress> presses_;
  double ball_, pixel_;
  GelShape shape_{};
  std::vector<Imprint> imprints_;
};

void check(const GelBackground& background, std::span<const BallPress> presses, double ball,
           double pixel) {
  if (presses.size() < kFewestPresses)
    throw InputError(
        fmt::format("{} presses; expected at least {}", presses.size(), kFewestPresses));
  const int smaller = std::min(background.rows, background.cols);
  if (!(2 * ball <= pixel * smaller))
    throw InputError(
        fmt::format("a ball of {:.3g} m in pictures of {:.3g} m; expected a smaller one", 2 * ball,
                    pixel * smaller));
  for (const BallPress& press : presses) {
    if (press.levels.size() != background.levels.size())
      throw InputError("a press of another size than the background; expected one size");
    const Imprint& at = press.label;
    if (!(at.radius > 0) || !(at.x >= 0 && at.x <= background.cols) ||
        !(at.y >= 0 && at.y <= background.rows))
      throw InputError(fmt::format(
          "an imprint at ({}, {}) of radius {} pixels; expected a circle in the picture", at.x,
          at.y, at.radius));
    if (!(kStartDepth * at.radius * pixel <= ball))
      throw InputError(fmt::format(
          "an imprint of radius {} pixels, {:.3g} m, of a ball of radius {:.3g} m; expected a "
          "smaller one",
          at.radius, at.radius * pixel, ball));
  }
}

std::array<double, 2 * kHalf + 1> gaussian_window() {
  constexpr double kDeviation = 1.5;
  std::array<double, 2 * kHalf + 1> window{};
  double sum = 0;
  for (int k = -kHalf; k <= kHalf; ++k)
    sum += window[as_size(k + kHalf)] = std::exp(-k * k / (2 * kDeviation * kDeviation));
  for (double& w : window) w /= sum;
  return window;
}

/// Weighted moments of two pictures in a window.
struct WindowMoments {
  double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  void add(double weight, double s, double t) {
    x += weight * s, y += weight * t;
    xx += weight * s * s, yy += weight * t * t, xy += weight * s * t;
  }
  [[nodiscard]] double similarity() const {
    constexpr double kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;
    return (2 * x * y + kC1) * (2 * (xy - x * y) + kC2) /
           ((x * x + y * y + kC1) * (xx - x * x + yy - y * y + kC2));
  }
};

}  // namespace

PressScore GelFit::mean() const {
  PressScore sum;
  for (const PressScore& s : scores) {
    const double share = 1.0 / double(scores.size());
    sum.psnr += share * s.psnr, sum.ssim += share * s.ssim;
    sum.aligned_psnr += share * s.aligned_psnr, sum.aligned_ssim += share * s.aligned_ssim;
  }
  return sum;
}

GelFit fit_gel(const GelBackground& background, std::span<const BallPress> presses, double ball,
               double pixel) {
  check(background, presses, ball, pixel);
  return Fit(background, presses, ball, pixel).run();
}

Likeness likeness(std::span<const float> a, std::span<const float> b, int rows, int cols,
                  const Imprint& disc) {
  const std::array<double, 2 * kHalf + 1> window = gaussian_window();
  double squares = 0, similarity = 0;
  int numbers = 0, windows = 0;
  const auto at = [&](int i, int j, std::size_t c) {
    return (as_size(i) * as_size(cols) + as_size(j)) * kColours + c;
  };
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      if (!(std::hypot(j + 0.5 - disc.x, i + 0.5 - disc.y) <= disc.radius)) continue;
      const bool whole = i >= kHalf && j >= kHalf && i + kHalf < rows && j + kHalf < cols;
      for (std::size_t c = 0; c < kColours; ++c) {
        const double d = double(a[at(i, j, c)]) - double(b[at(i, j, c)]);
        squares += d * d, ++numbers;
        if (!whole) continue;
        WindowMoments moments;
        for (int u = -kHalf; u <= kHalf; ++u)
          for (int v = -kHalf; v <= kHalf; ++v)
            moments.add(window[as_size(u + kHalf)] * window[as_size(v + kHalf)],
                        double(a[at(i + u, j + v, c)]), double(b[at(i + u, j + v, c)]));
        similarity += moments.similarity();
        ++windows;
      }
    }
  return {10 * std::log10(255 * 255 / std::max(squares / numbers, 1e-12)),
          windows > 0 ? similarity / windows : 1};
}

}  // namespace tangere
