// SPDX-License-Identifier: Apache-2.0
// Tests flow maps: numbers computed by hand, one scale for all fields, zero without contact, no
// scale left in the result.
#include "engine/sense/flow_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "engine/base/error.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

template <class T>
class FlowMap : public ::testing::Test {
 protected:
  using Field = std::vector<T>;

  /// Flow map of whole fields, one after the other.
  Field flow(const std::vector<Field>& fields, double smallest = 0) {
    std::vector<ShearField<T>> in;
    std::size_t points = 0;
    for (const Field& f : fields) in.push_back({f}), points += f.size() / 3;
    Field out(2 * points, T(7));
    longest = normalised_flow(std::span<const ShearField<T>>(in), std::span<T>(out), smallest);
    return out;
  }
  static double largest_length(const Field& map) {
    double largest = 0;
    for (std::size_t k = 0; k < map.size(); k += 2)
      largest = std::max(largest, std::hypot(double(map[k]), double(map[k + 1])));
    return largest;
  }
  static Field random_field(unsigned seed, int points, double scale) {
    std::mt19937 engine(seed);
    std::normal_distribution<double> normal(0, scale);
    Field f;
    for (int k = 0; k < 3 * points; ++k) f.push_back(static_cast<T>(normal(engine)));
    return f;
  }
  double longest = -1;
};
using Types = ::testing::Types<float, double>;
TYPED_TEST_SUITE(FlowMap, Types);

TYPED_TEST(FlowMap, DividesShearByTheLongestOfAllFields) {
  // Lengths are 5, 0 on one pad and 10, 2.5 on the other. Pressure is larger than all of them but
  // does not count.
  const auto map = this->flow({{3, 4, 100, 0, 0, 50}, {-6, 8, -1000, 0, -2.5, 0}});
  EXPECT_EQ(this->longest, 10);
  using T = TypeParam;
  EXPECT_THAT(map, ElementsAre(T(0.3), T(0.4), T(0), T(0), T(-0.6), T(0.8), T(0), T(-0.25)));
}

TYPED_TEST(FlowMap, OfOnePadAloneHasItsOwnScale) {
  using T = TypeParam;
  EXPECT_THAT(this->flow({{3, 4, 100, 0, 0, 50}}), ElementsAre(T(0.6), T(0.8), T(0), T(0)));
}

TYPED_TEST(FlowMap, TakesTheChangeSinceAnotherField) {
  using T = TypeParam;
  const std::vector<T> before = {1, 1, 9, 2, 0, 9}, now = {4, 5, -9, 2, 0, -9};
  const ShearField<T> fields[] = {{now, before}};
  std::vector<T> map(4);
  EXPECT_EQ(normalised_flow(std::span<const ShearField<T>>(fields), std::span<T>(map)), 5);
  EXPECT_THAT(map, ElementsAre(T(0.6), T(0.8), T(0), T(0)));
}

TYPED_TEST(FlowMap, IsZeroWithoutShear) {
  using T = TypeParam;
  EXPECT_THAT(this->flow({std::vector<T>(12, T(0)), std::vector<T>(6, T(0))}), Each(T(0)));
  EXPECT_EQ(this->longest, 0);
  EXPECT_THAT(this->flow({{0, 0, 5, 0, 0, 1}}), Each(T(0)));  // pressure alone
  EXPECT_TRUE(this->flow({}).empty());
}

TYPED_TEST(FlowMap, IsZeroUpToTheSmallestThatCounts) {
  using T = TypeParam;
  EXPECT_THAT(this->flow({{3, 4, 0}}, 5), ElementsAre(T(0), T(0)));
  EXPECT_EQ(this->longest, 5);
  EXPECT_THAT(this->flow({{3, 4, 0}}, 4.99), ElementsAre(T(0.6), T(0.8)));
}

TYPED_TEST(FlowMap, HasALongestArrowOfOneAndNoScale) {
  using T = TypeParam;
  // A power of two changes no digit; another factor changes the last digits. The ends of the range
  // neither overflow nor vanish.
  constexpr int kFar = sizeof(T) == 4 ? 100 : 1000;
  const double tiny = std::ldexp(1.0, -kFar), huge = std::ldexp(1.0, kFar);
  const double rounding = 4 * double(std::numeric_limits<T>::epsilon());
  const auto one = this->flow({this->random_field(1, 20, 1), this->random_field(2, 30, 5)});
  EXPECT_NEAR(this->largest_length(one), 1, rounding);
  EXPECT_LT(this->largest_length({one.begin(), one.begin() + 40}), 0.9)
      << "the first pad has a scale of its own";
  for (const double scale : {1e-3, 7.0, 1e4, tiny, huge}) {
    std::vector<std::vector<T>> fields = {this->random_field(1, 20, 1),
                                          this->random_field(2, 30, 5)};
    for (auto& f : fields)
      for (T& x : f) x = static_cast<T>(double(x) * scale);
    const auto map = this->flow(fields);
    EXPECT_NEAR(this->largest_length(map), 1, rounding) << scale;
    for (std::size_t k = 0; k < map.size(); ++k) {
      const bool exact = scale == tiny || scale == huge;
      EXPECT_NEAR(map[k], one[k], exact ? 0 : rounding) << scale << " [" << k << "]";
    }
  }
}

TYPED_TEST(FlowMap, OfTheSmallestForceThereIsIsNotInfinite) {
  using T = TypeParam;
  EXPECT_THAT(this->flow({{std::numeric_limits<T>::denorm_min(), 0, 0}}), ElementsAre(T(1), T(0)));
}

TYPED_TEST(FlowMap, RefusesSizesThatDoNotFit) {
  using T = TypeParam;
  const std::vector<T> six(6), five(5), three(3);
  std::vector<T> map(4);
  const auto refused = [&](ShearField<T> field, std::span<T> out) {
    EXPECT_THROW(normalised_flow(std::span<const ShearField<T>>(&field, 1), out), InputError);
  };
  refused({five}, map);
  refused({six, three}, map);
  refused({three}, map);
  refused({six}, std::span<T>(map).first(3));
}

TEST(FlowMapOfARun, IsZeroBeforeContactAndThenTheShearWithoutItsScale) {
  const Model model(testing::rolling_ball(false, 32));
  Batch batch(model, 1);
  Stepper stepper(model);
  Readout readout(model);
  const std::size_t points = 32 * 32;
  std::vector<double> field(3 * points), map(2 * points);
  const ShearField<double> fields[] = {{field}};
  double longest = 0;
  for (int step = 0; step < 130; ++step) {
    testing::step_all(stepper, batch, testing::rolling_ball_control(step));
    readout.tactile(batch, 0, 0, field);
    longest = normalised_flow(fields, map);
    if (step == 50) {
      EXPECT_EQ(longest, 0);
      EXPECT_THAT(map, Each(0.0));
    }
  }
  ASSERT_GT(longest, 0);
  double most = 0;
  for (std::size_t k = 0; k < points; ++k) {
    most = std::max(most, std::hypot(map[2 * k], map[2 * k + 1]));
    EXPECT_NEAR(map[2 * k] * longest, field[3 * k], 1e-15 * longest);
    EXPECT_NEAR(map[2 * k + 1] * longest, field[3 * k + 1], 1e-15 * longest);
  }
  EXPECT_NEAR(most, 1, 1e-15);
}

/// Derivatives against differences by every number of two fields; one has an earlier field
/// subtracted.
TEST(FlowMap, DerivativesMatchDifferences) {
  std::vector<double> first, second, before, weights;
  for (int i = 0; i < 15; ++i)
    first.push_back(std::sin(3.0 * i)), second.push_back(std::cos(5.0 * i)),
        before.push_back(0.3 * std::sin(i));
  for (int i = 0; i < 20; ++i) weights.push_back(std::sin(7.0 * i + 1));
  const auto value = [&] {
    const ShearField<double> fields[] = {{first, {}}, {second, before}};
    std::vector<double> flow(20);
    normalised_flow(fields, flow);
    double sum = 0;
    for (std::size_t i = 0; i < 20; ++i) sum += weights[i] * flow[i];
    return sum;
  };
  std::vector<double> by_first(15), by_second(15), by_before(15);
  const ShearField<double> fields[] = {{first, {}}, {second, before}};
  const ShearCotangent out[] = {{by_first, {}}, {by_second, by_before}};
  normalised_flow_vjp(fields, weights, out);
  const auto check = [&](std::vector<double>& numbers, const std::vector<double>& derivatives) {
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const double at = numbers[i], e = 1e-6;
      numbers[i] = at + e;
      const double ahead = value();
      numbers[i] = at - e;
      const double behind = value();
      numbers[i] = at;
      EXPECT_NEAR((ahead - behind) / (2 * e), derivatives[i], 1e-8) << i;
    }
  };
  check(first, by_first);
  check(second, by_second);
  check(before, by_before);
}

TEST(FlowMap, WithoutContactHasNoDerivatives) {
  const std::vector<double> nothing(6), weights(4, 1.0);
  std::vector<double> out(6);
  const ShearField<double> fields[] = {{nothing, {}}};
  const ShearCotangent cotangents[] = {{out, {}}};
  normalised_flow_vjp(fields, weights, cotangents);
  for (const double x : out) EXPECT_EQ(x, 0.0);
}

}  // namespace
}  // namespace tangere
