// SPDX-License-Identifier: Apache-2.0
// Stiffnesses and friction are fitted as logarithms, the zero in shares of the depth, and what may
// vanish (times, increments of a table) as squares.
#include "tasks/calibration/force_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr double kLeastInfluence = 1e-6;  // root mean square change, of the peak, by a whole number
constexpr double kLeastSlip = 0.03;       // share of the forces that slip, by their squares
constexpr double kLittleFriction = 0.05;  // may be none
constexpr const char* kFrictionless =
    "it is about 0: without friction the forces along the skin fit as well; write mu=\"0\"";
// Steps of x for the differences of intervals: a share of a number, or of depth or peak.
constexpr double kLongestStep = 0.1, kShortestStep = 1e-5, kShorter = 4;
constexpr int kSecantPasses = 4;
constexpr double kAlike = 1.5;  // by their squares

double squares_of(std::span<const double> numbers) {
  double sum = 0;
  for (const double x : numbers) sum += x * x;
  return sum;
}

bool is_table_number(const std::string& name) { return name.starts_with("pressure["); }

std::string reason(const std::string& name) {
  if (name == kFriction) return "nothing slips, so it exceeds every ratio of shear to normal force";
  if (name == kRelaxation) return "the rates of the recording do not show it";
  if (name == kShear) return "everything slips";
  if (name == kSliderForce) return "the slider does not slip, so it exceeds the slider's forces";
  if (name == kForceZero)
    return "nothing tells it from the zero of the depth; record rows above the skin";
  return "the forces do not change with it";
}

}  // namespace

std::string table_number(int k) { return fmt::format("pressure[{}]", k); }

double ForceFit::Scale::value(double x) const {
  if (kind == Kind::exponential) return unit * std::exp(x - 1);
  return kind == Kind::square ? unit * x * x : unit * (x - 1);
}
double ForceFit::Scale::slope(double x) const {
  if (kind == Kind::exponential) return value(x);
  return kind == Kind::square ? 2 * unit * x : unit;
}

double ForceFit::Scale::place(double value) const {
  if (kind == Kind::linear) return 1 + value / unit;
  constexpr double kLeast = 0.03;  // at 0 the derivative by x is 0
  if (kind == Kind::square) return std::sqrt(std::max(value / unit, kLeast * kLeast));
  return value > 0 ? 1 + std::log(value / unit) : 1;
}

ForceFit::ForceFit(Forces forces, std::span<const double> recorded, FitRows rows, double depth,
                   int knots, Whitening whitening)
    : forces_(std::move(forces)),
      recorded_(recorded),
      rows_(std::move(rows)),
      peak_(0),
      depth_(depth),
      knots_(knots),
      whitening_(std::move(whitening)) {
  for (const double f : recorded_) peak_ = std::max(peak_, std::abs(f));
}

ForceFit::Scale ForceFit::scale_of(const std::string& name, const SkinNumbers& start) const {
  if (name == kZero || name == kPlaceX || name == kPlaceY) return {Scale::Kind::linear, depth_};
  if (name == kForceZero) return {Scale::Kind::linear, peak_};
  const bool vanishes = name == kRelaxation || name == kLag || is_table_number(name);
  return {vanishes ? Scale::Kind::square : Scale::Kind::exponential, start.at(name)};
}

ErrorModel ForceFit::errors() const {
  return {.width = rows_.width,
          .split = whitening_ ? 0 : rows_.normal,
          .alike = rows_.alike,
          .known = bool(whitening_)};
}

/// Returns the x at which a fit begins: 1, or that of a number's value.
std::vector<double> ForceFit::begin(const SkinNumbers& at) const {
  std::vector<double> out;
  for (std::size_t k = 0; k < names_.size(); ++k) {
    const auto value = at.find(names_[k]);
    if (value == at.end()) {
      out.push_back(1);
      continue;
    }
    const bool goes_on = k > 0 && is_table_number(names_[k]) && is_table_number(names_[k - 1]);
    out.push_back(scales_[k].place(value->second - (goes_on ? at.at(names_[k - 1]) : 0)));
  }
  return out;
}

void ForceFit::run(std::vector<std::string> names, const FitStart& start, SkinNumbers fixed,
                   std::vector<std::string> held) {
  settled_ = start.settled;
  for (std::size_t at = 0; at < names.size(); ++at) {
    if (names[at] != kTable) continue;
    names.erase(names.begin() + std::ptrdiff_t(at));
    for (int k = knots_; k > 0; --k)
      names.insert(names.begin() + std::ptrdiff_t(at), table_number(k));
  }
  for (;;) {
    names_ = names, held_ = held;
    fixed_ = fixed;
    scales_.clear();
    for (const std::string& name : names) scales_.push_back(scale_of(name, start.scale));
    if (names.empty()) return;
    found_ = minimise([&](std::span<const double> x) { return residuals(x); }, begin(start.at));
    find_confidence();
    std::size_t weak = weakest();
    if (weak == names.size()) find_secants(), weak = weakest();
    if (weak == names.size()) return;
    const bool frictionless = names[weak] == kFriction && vanishes();
    untold_.push_back({names[weak], frictionless ? kFrictionless : reason(names[weak])});
    if (frictionless)
      fixed[kFriction] = 0;
    else if (names[weak] == kFriction ||
             names[weak] == kSliderForce)  // so that it stays without slip
      fixed[names[weak]] = scales_[weak].value(found_.x[weak]);
    if (names[weak] == kForceZero) held.push_back(names[weak]);
    names.erase(names.begin() + std::ptrdiff_t(weak));
  }
}

SkinNumbers ForceFit::numbers_at(std::span<const double> x) const {
  SkinNumbers out = fixed_;
  double pressure = 0;
  for (std::size_t k = 0; k < names_.size(); ++k) {
    const double value = scales_[k].value(x[k]);
    out[names_[k]] = is_table_number(names_[k]) ? pressure += value : value;
  }
  return out;
}

/// Returns the residuals of the fitted rows from differences of all rows [N].
std::vector<double> ForceFit::weighed(const SkinNumbers& numbers,
                                      const std::vector<double>& off) const {
  if (whitening_) return whitening_(numbers, off);
  std::vector<double> out;
  for (const int row : rows_.rows)
    for (std::size_t k = 0; k < rows_.width; ++k) {
      const bool along_skin = rows_.normal > 0 && k >= rows_.normal;
      out.push_back(off[std::size_t(row) * rows_.width + k] / peak_ *
                    (along_skin ? rows_.weight : 1));
    }
  return out;
}

std::vector<double> ForceFit::residuals_of(const SkinNumbers& numbers) const {
  std::vector<double> off = forces_(numbers);
  for (std::size_t k = 0; k < off.size(); ++k) off[k] -= recorded_[k];
  return weighed(numbers, off);
}

std::array<double, 2> ForceFit::force_errors() const {
  std::array<double, 2> out = error_deviations(found_.jacobian, found_.residuals, errors());
  if (out[0] > 0) out[0] *= peak_;
  if (out[1] > 0) out[1] *= peak_ / rows_.weight;
  return out;
}

std::vector<double> ForceFit::residuals(std::span<const double> x) const {
  return residuals_of(numbers_at(x));
}

/// Returns the derivative of the residuals by a zero, in its share of depth or peak.
std::vector<double> ForceFit::slope_by(const std::string& held) const {
  return slope_along([&](double s) {
    SkinNumbers numbers = found();
    numbers[held] += s * scale_of(held, {}).unit;
    return residuals_of(numbers);
  });
}

/// Returns what was found with a change of fitted number or held one k.
SkinNumbers ForceFit::moved(std::size_t k, double dx) const {
  std::vector<double> x = found_.x;
  if (k < x.size()) x[k] += dx;
  SkinNumbers out = numbers_at(x);
  if (k >= x.size()) out[held_[k - x.size()]] += dx * scale_of(held_[k - x.size()], {}).unit;
  return out;
}

/// Returns the change of the residuals by a unit of number k, over `step` to the side on which they
/// change by less: on the other one a force may jump. Over both, if they change by about as much.
std::vector<double> ForceFit::secant(std::size_t k, double step) const {
  const auto at = [&](double s) {
    std::vector<double> x = found_.x;
    x[k] += s;
    return residuals(x);
  };
  std::vector<double> before = at(-step), after = at(step), both = after;
  double squares_before = 0, squares_after = 0;
  for (std::size_t row = 0; row < both.size(); ++row) {
    both[row] = (after[row] - before[row]) / (2 * step);
    before[row] = (found_.residuals[row] - before[row]) / step;
    after[row] = (after[row] - found_.residuals[row]) / step;
    squares_before += before[row] * before[row], squares_after += after[row] * after[row];
  }
  if (squares_before < squares_after / kAlike) return before;
  return squares_after < squares_before / kAlike ? after : both;
}

/// Returns half of the interval of each x.
std::vector<double> ForceFit::half_intervals() const {
  std::vector<double> out;
  for (std::size_t k = 0; k < names_.size(); ++k) {
    std::vector<double> gradient(names_.size());
    gradient[k] = 1;
    out.push_back(confidence_.half_interval(gradient));
  }
  return out;
}

/// Returns a step of number k that is as long, within those that differences can have.
double ForceFit::secant_step(std::size_t k, double length) const {
  double most = kLongestStep;
  if (scales_[k].kind == Scale::Kind::square)
    most = std::clamp(std::abs(found_.x[k]) / 2, kShortestStep, most);
  return std::clamp(length, kShortestStep, most);
}

/// Whether differences over half of the intervals are the derivatives.
bool ForceFit::is_smooth() const {
  const std::vector<double> half = half_intervals();
  for (std::size_t k = 0; k < names_.size(); ++k) {
    const double ratio =
        squares_of(secant(k, secant_step(k, half[k]))) / squares_of(found_.jacobian[k]);
    if (!(ratio > 1 / kAlike && ratio < kAlike)) return false;
  }
  return true;
}

/// Replaces the derivatives by the least of differences over steps from half of an interval down,
/// unless they are alike. A force that jumps, where a point begins to be touched at a speed, has
/// derivatives that say nothing about the next jump.
void ForceFit::find_secants() {
  if (is_smooth()) return;
  std::vector<double> half(names_.size(), HUGE_VAL);
  double share = 1;
  for (int pass = 0; pass < kSecantPasses; ++pass) {
    for (std::size_t k = 0; k < names_.size(); ++k) {
      std::vector<double> slope = secant(k, secant_step(k, share * half[k]));
      if (pass < 2 || squares_of(slope) < squares_of(found_.jacobian[k]))
        found_.jacobian[k] = std::move(slope);
    }
    find_confidence();
    if (pass > 0) share /= kShorter;
    half = half_intervals();
  }
}

void ForceFit::find_confidence() {
  Columns jacobian = found_.jacobian;
  for (const std::string& name : held_) jacobian.push_back(slope_by(name));
  confidence_ = Confidence(jacobian, found_.residuals, errors());
}

void ForceFit::add_errors_of(const ForceFit& before) {
  if (names_.empty() || before.names_.empty()) return;
  const SkinNumbers own = found();
  Columns by;
  for (std::size_t k = 0; k < before.names_.size() + before.held_.size(); ++k)
    by.push_back(slope_along([&](double s) {
      SkinNumbers numbers = before.moved(k, s);
      for (const std::string& name : names_) numbers[name] = own.at(name);
      for (const auto& [name, value] : own) numbers.try_emplace(name, value);
      return residuals_of(numbers);
    }));
  confidence_.add_errors_of(before.confidence_, by);
}

/// Whether a friction that is a hundredth larger leaves the forces as they are.
bool ForceFit::holds(std::size_t friction) const {
  std::vector<double> x = found_.x;
  const std::vector<double> now = residuals(x);
  x[friction] += 0.01;
  const std::vector<double> then = residuals(x);
  double squares = 0;
  for (std::size_t k = 0; k < now.size(); ++k) squares += std::pow(then[k] - now[k], 2);
  return std::sqrt(squares / double(now.size())) < 0.01 * kLeastSlip;
}

/// Whether a friction is about 0: one of 1 would change the forces.
bool ForceFit::vanishes() const {
  SkinNumbers numbers = found();
  if (!(numbers[kFriction] < kLittleFriction)) return false;
  const std::vector<double> now = residuals_of(numbers);
  numbers[kFriction] = 1;
  std::vector<double> then = residuals_of(numbers);
  for (std::size_t k = 0; k < now.size(); ++k) then[k] -= now[k];
  return std::sqrt(squares_of(then) / double(now.size())) > kLeastSlip;
}

/// Returns the first number that has no influence, or that nothing tells from the others, or whose
/// interval goes beyond 0.
std::size_t ForceFit::weakest() const {
  for (std::size_t k = 0; k < names_.size(); ++k) {
    if (is_table_number(names_[k]) || std::ranges::count(settled_, names_[k]) > 0) continue;
    if (found_.influence(k) < kLeastInfluence) return k;
    if (names_[k] == kFriction && holds(k)) return k;
    if (names_[k] == kRelaxation && !(interval(k).low > 0)) return k;
    if (names_[k] == kForceZero && confidence_.rank_misses(k)) return k;
  }
  return names_.size();
}

/// Returns number k with its interval. Pressures of a table are sums of its increments.
FittedNumber ForceFit::interval(std::size_t k) const {
  std::vector<double> gradient(names_.size());
  gradient[k] = scales_[k].slope(found_.x[k]);
  double value = scales_[k].value(found_.x[k]);
  for (std::size_t j = k; j > 0 && is_table_number(names_[k]) && is_table_number(names_[j - 1]);
       --j) {
    gradient[j - 1] = scales_[j - 1].slope(found_.x[j - 1]);
    value += scales_[j - 1].value(found_.x[j - 1]);
  }
  const double half = confidence_.half_interval(gradient);
  if (scales_[k].kind == Scale::Kind::exponential && std::isfinite(half))
    return {names_[k], value, value * std::exp(-half / value), value * std::exp(half / value)};
  return {names_[k], value, value - half, value + half};
}

std::vector<FittedNumber> ForceFit::numbers() const {
  std::vector<FittedNumber> out;
  for (std::size_t k = 0; k < names_.size(); ++k) out.push_back(interval(k));
  return out;
}

std::vector<FittedNumber> ForceFit::moves(std::span<const double> addition) const {
  return answers(weighed(found(), {addition.begin(), addition.end()}));
}

/// Returns by how much each number moves by a change of the residuals.
std::vector<FittedNumber> ForceFit::answers(std::span<const double> change) const {
  const Confidence alone(found_.jacobian);  // of the fitted numbers
  std::vector<FittedNumber> out;
  double pressure = 0;
  for (std::size_t k = 0; k < names_.size(); ++k) {
    const double moved = scales_[k].slope(found_.x[k]) * alone.answer(k, change);
    if (is_table_number(names_[k])) pressure += moved;
    out.push_back({names_[k], is_table_number(names_[k]) ? pressure : moved});
  }
  return out;
}

GivenNumber ForceFit::given(const std::string& name) const {
  constexpr double kError = 0.01;
  GivenNumber out{name, kError * scale_of(name, {}).unit, "", 0, true};
  if (names_.empty()) return out;
  const std::vector<double> slope = slope_by(name);
  Columns all = found_.jacobian;
  all.push_back(slope);
  out.told = !Confidence(all).rank_misses(all.size() - 1);
  if (scales_[0].kind == Scale::Kind::linear) return out;
  std::vector<double> change = slope;
  for (double& x : change) x *= kError;
  // Of a table the last pressure.
  const std::vector<FittedNumber> moved = answers(change), values = numbers();
  std::size_t k = 0;
  while (k + 1 < names_.size() && is_table_number(names_[k + 1])) ++k;
  out.moved = names_[k];
  out.change = moved[k].value / values[k].value;
  return out;
}

void ForceFit::hold(const std::string& name) {
  if (names_.empty() || std::ranges::count(held_, name) > 0) return;
  held_.push_back(name);
  find_confidence();
}

std::optional<double> ForceFit::correlation(const std::string& a, const std::string& b) const {
  const auto i = std::ranges::find(names_, a), j = std::ranges::find(names_, b);
  if (i == names_.end() || j == names_.end()) return std::nullopt;
  return confidence_.correlation(std::size_t(i - names_.begin()), std::size_t(j - names_.begin()));
}

}  // namespace tangere
