// SPDX-License-Identifier: Apache-2.0
// Tests the generator against its published values, and the distributions against their formulas.
#include "engine/model/random.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <vector>

namespace tangere {
namespace {

constexpr int kDraws = 10'000;
// Kolmogorov–Smirnov: one seed in a thousand exceeds this by chance; our seed is fixed.
const double kLargestDistance = 1.95 / std::sqrt(double{kDraws});

double distance(std::vector<double> draws, const std::function<double(double)>& probability) {
  std::sort(draws.begin(), draws.end());
  const auto n = static_cast<double>(draws.size());
  double largest = 0;
  for (std::size_t i = 0; i < draws.size(); ++i) {
    const double p = probability(draws[i]), below = static_cast<double>(i) / n;
    largest = std::max({largest, p - below, below + 1 / n - p});
  }
  return largest;
}

/// Draws that differ in one field of the key.
std::vector<double> series(const Distribution& d, const std::function<RandomKey(int)>& key) {
  std::vector<double> draws;
  for (int i = 0; i < kDraws; ++i) draws.push_back(draw(d, key(i)));
  return draws;
}

RandomKey of_episode(int i) { return {7, i, 0, Purpose::contact, 0}; }

using Words = std::array<std::uint32_t, 4>;

TEST(Philox, GivesThePublishedAnswers) {
  EXPECT_EQ(philox4x32({0, 0, 0, 0}, {0, 0}),
            (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox4x32({~0U, ~0U, ~0U, ~0U}, {~0U, ~0U}),
            (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Random, KeysMeanTheSameNumbersForEver) {
  // Files store seeds, so a change of these numbers changes the meaning of every stored seed.
  // Another implementation computed the second number; in it every bit of the counter comes from
  // one field.
  EXPECT_EQ(uniform({0, 0, 0, Purpose::initial_state, 0}), 0x1.989fa35785a70p-2);
  EXPECT_EQ(
      uniform({0x0123456789abcdef, 0x123456789abc, 0xfedcba987654, Purpose::control, 0xabcdef}),
      0x1.fc0d2ac59d560p-2);
}

TEST(Random, UniformAlongEveryFieldOfTheKey) {
  const Distribution unit{Distribution::Kind::uniform, 0, 1, {}};
  const std::map<std::string, std::function<RandomKey(int)>> fields{
      {"seed",
       [](int i) {
         return RandomKey{std::uint64_t(i), 0, 0, Purpose::contact, 0};
       }},
      {"episode", of_episode},
      {"step",
       [](int i) {
         return RandomKey{7, 0, i, Purpose::contact, 0};
       }},
      {"index", [](int i) {
         return RandomKey{7, 0, 0, Purpose::contact, std::uint32_t(i)};
       }}};
  for (const auto& [name, key] : fields) {
    const std::vector<double> draws = series(unit, key);
    EXPECT_LT(distance(draws, [](double x) { return x; }), kLargestDistance) << name;
    EXPECT_GE(*std::min_element(draws.begin(), draws.end()), 0) << name;
    EXPECT_LT(*std::max_element(draws.begin(), draws.end()), 1) << name;
    // Neighbours along the field are uncorrelated, within five standard deviations of the sample's
    // correlation.
    double product = 0;
    for (std::size_t i = 1; i < draws.size(); ++i)
      product += (draws[i] - 0.5) * (draws[i - 1] - 0.5);
    EXPECT_LT(std::abs(12 * product / kDraws), 5 / std::sqrt(double{kDraws})) << name;
  }
}

TEST(Random, EveryFieldOfTheKeyCounts) {
  const std::vector<RandomKey> keys{{1, 2, 3, Purpose::contact, 4},
                                    {2, 2, 3, Purpose::contact, 4},
                                    {std::uint64_t{1} << 63 | 1, 2, 3, Purpose::contact, 4},
                                    {1, 3, 3, Purpose::contact, 4},
                                    {1, (std::int64_t{1} << 47) + 2, 3, Purpose::contact, 4},
                                    {1, 2, 4, Purpose::contact, 4},
                                    {1, 2, (std::int64_t{1} << 47) + 3, Purpose::contact, 4},
                                    {1, 3, 2, Purpose::contact, 4},
                                    {1, 2, 3, Purpose::tactile, 4},
                                    {1, 2, 3, Purpose::contact, 5}};
  std::vector<double> draws;
  for (const RandomKey& key : keys) draws.push_back(uniform(key));
  std::sort(draws.begin(), draws.end());
  EXPECT_EQ(std::adjacent_find(draws.begin(), draws.end()), draws.end());
}

TEST(Random, UniformBetweenBounds) {
  const Distribution d{Distribution::Kind::uniform, -3, 5, {}};
  const auto draws = series(d, of_episode);
  EXPECT_LT(distance(draws, [](double x) { return (x + 3) / 8; }), kLargestDistance);
  EXPECT_EQ(uniform(of_episode(1), 0.1, 0.1), 0.1);
  const double widest = uniform(of_episode(1), -1e308, 1e308);
  EXPECT_TRUE(std::isfinite(widest));
}

TEST(Random, LogUniformBetweenBounds) {
  const Distribution d{Distribution::Kind::log_uniform, 1e-3, 10, {}};
  const auto draws = series(d, of_episode);
  EXPECT_LT(distance(draws, [](double x) { return std::log(x / 1e-3) / std::log(1e4); }),
            kLargestDistance);
  EXPECT_THAT(draws, ::testing::Each(::testing::AllOf(::testing::Ge(1e-3), ::testing::Le(10))));
  EXPECT_EQ(log_uniform(of_episode(1), 0.1, 0.1), 0.1);
}

TEST(Random, NormalWithItsMeanAndDeviation) {
  const Distribution d{Distribution::Kind::normal, 2, 0.5, {}};
  const auto draws = series(d, of_episode);
  EXPECT_LT(
      distance(draws, [](double x) { return 0.5 * std::erfc(-(x - 2) / 0.5 / std::sqrt(2)); }),
      kLargestDistance);
  // Five standard deviations of the sample's mean and variance.
  double mean = 0, variance = 0;
  for (double x : draws) mean += x / kDraws;
  for (double x : draws) variance += (x - mean) * (x - mean) / kDraws;
  EXPECT_NEAR(mean, 2, 5 * 0.5 / std::sqrt(double{kDraws}));
  EXPECT_NEAR(variance / 0.25, 1, 5 * std::sqrt(2.0 / kDraws));
  EXPECT_EQ(normal(of_episode(1), 2, 0), 2);
}

TEST(Random, ListValuesEquallyLikely) {
  const Distribution d{Distribution::Kind::list, 0, 0, {1, 2, 4, 8, 16}};
  std::map<double, int> counts;
  for (double x : series(d, of_episode)) ++counts[x];
  ASSERT_EQ(counts.size(), 5U);
  double chi_square = 0;
  for (const auto& [value, count] : counts)
    chi_square += std::pow(count - kDraws / 5.0, 2) / (kDraws / 5.0);
  EXPECT_LT(chi_square, 18.5);  // four degrees of freedom, one in a thousand
}

TEST(Random, RefusesWhatIsNoDistribution) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  using Kind = Distribution::Kind;
  const std::vector<Distribution> wrong{
      {Kind::uniform, 1, 0, {}},         {Kind::uniform, kNan, 1, {}},
      {Kind::uniform, 0, kInfinity, {}}, {Kind::log_uniform, 0, 1, {}},
      {Kind::log_uniform, 2, 1, {}},     {Kind::normal, 0, -1, {}},
      {Kind::normal, 0, kNan, {}},       {Kind::list, 0, 0, {}}};
  for (const Distribution& d : wrong) EXPECT_THROW(draw(d, {}), InputError);
}

TEST(Random, RefusesKeysOutOfRange) {
  EXPECT_THROW(uniform({0, -1, 0, Purpose::control, 0}), InputError);
  EXPECT_THROW(uniform({0, std::int64_t{1} << 48, 0, Purpose::control, 0}), InputError);
  EXPECT_THROW(uniform({0, 0, -1, Purpose::control, 0}), InputError);
  EXPECT_THROW(uniform({0, 0, 0, Purpose::control, 1U << 24}), InputError);
}

}  // namespace
}  // namespace tangere
