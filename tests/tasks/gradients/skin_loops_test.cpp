// SPDX-License-Identifier: Apache-2.0
// Tests shear springs against a real skin: shear loops that a probe recorded
// (tests/data/skin_loops) are fitted by identify(), and the fit is compared with a cycle that it
// has not seen.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>

#include "io/scene/scene_reader.hpp"
#include "tasks/gradients/identification.hpp"

namespace tangere {
namespace {

constexpr double kStep = 0.1;  // of the scene [s]
constexpr double kLag = 0.55;  // of the recorded force [s]

/// A recorded cycle in steps of the scene.
struct Cycle {
  std::vector<double> displacement, force;  // [m], [N]

  explicit Cycle(const std::string& name) {
    std::ifstream file(TANGERE_SOURCE_DIR "/tests/data/skin_loops/" + name);
    std::string row;
    std::getline(file, row);
    std::vector<double> t, x, f;
    char comma = 0;
    for (double a = 0, b = 0, c = 0; file >> a >> comma >> b >> comma >> c;)
      t.push_back(a), x.push_back(b), f.push_back(c);
    if (t.size() < 2) throw std::runtime_error(name + " has no rows");
    const auto at = [&](const std::vector<double>& y, double time) {
      const auto k = std::size_t(
          std::max<std::ptrdiff_t>(std::upper_bound(t.begin(), t.end() - 1, time) - t.begin(), 1));
      return y[k - 1] + (y[k] - y[k - 1]) * (time - t[k - 1]) / (t[k] - t[k - 1]);
    };
    for (double time = 0; time < t.back() - kLag; time += kStep)
      displacement.push_back(at(x, time)), force.push_back(at(f, time + kLag));
  }
  [[nodiscard]] RecordedRun run() const {
    return {[this](std::int64_t step, int, std::span<double> u) {
              u[0] = displacement[std::size_t(step)];
            },
            std::int64_t(displacement.size()), 1};
  }
  [[nodiscard]] FieldSequence recorded() const {
    FieldSequence s;
    for (const double f : force) s.readings.push_back({0, 0, f});
    return s;
  }
};

std::vector<double> gauge(const Scene& scene, const Cycle& cycle) {
  std::vector<double> force;
  for (const auto& reading : simulate_fields(scene, cycle.run()).readings)
    force.push_back(reading[2]);
  return force;
}

/// Root mean square of the difference, over the peak of what was recorded.
double misfit(const std::vector<double>& force, const Cycle& cycle) {
  double sum = 0;
  for (std::size_t k = 0; k < force.size(); ++k) sum += std::pow(force[k] - cycle.force[k], 2);
  return std::sqrt(sum / double(force.size())) /
         *std::max_element(cycle.force.begin(), cycle.force.end());
}

/// Work that is not given back [J].
double loop(const std::vector<double>& force, const Cycle& cycle) {
  double work = 0;
  for (std::size_t k = 1; k < force.size(); ++k)
    work += (force[k] + force[k - 1]) / 2 * (cycle.displacement[k] - cycle.displacement[k - 1]);
  return work;
}

/// The share of the force that is left at the end of the standstill at the far end.
double left(const std::vector<double>& force, const Cycle& cycle) {
  const auto& x = cycle.displacement;
  const double far = *std::max_element(x.begin(), x.end()) - 1e-5;
  const auto first =
      std::size_t(std::find_if(x.begin(), x.end(), [&](double y) { return y > far; }) - x.begin());
  std::size_t last = first;
  while (last + 1 < x.size() && x[last + 1] > far) ++last;
  EXPECT_GT(last - first, 30U) << "three seconds";
  return force[last] / force[first];
}

class SkinLoops : public ::testing::Test {
 protected:
  SkinLoops()
      : third("shear.csv"),
        first("shear_first.csv"),
        scene(read_scene(TANGERE_SOURCE_DIR "/tests/data/skin_loops/skin.xml").scene) {}

  Scene fitted(const std::vector<std::string>& numbers) {
    IdentificationOptions options;
    options.numbers = numbers;
    const Identification found = identify(scene, third.run(), third.recorded(), options);
    EXPECT_TRUE(found.converged);
    EXPECT_LT(found.gradient_difference, 1e-4);
    for (std::size_t k = 0; k < numbers.size(); ++k)
      RecordProperty(numbers[k], std::to_string(found.values()[k]));
    return with_numbers(scene, numbers, found.values());
  }
  void record(const std::string& of, const std::vector<double>& force, const Cycle& cycle) {
    RecordProperty(of + " misfit", std::to_string(misfit(force, cycle)));
    RecordProperty(of + " loop", std::to_string(loop(force, cycle)) + " of " +
                                     std::to_string(loop(cycle.force, cycle)));
    RecordProperty(of + " left", std::to_string(left(force, cycle)) + " of " +
                                     std::to_string(left(cycle.force, cycle)));
  }

  Cycle third, first;
  Scene scene;
};

TEST_F(SkinLoops, AreThoseOfSpringsThatSlip) {
  const Scene found =
      fitted({"contact slider slab ks", "contact slider slab mu", "contact lattice slab ks"});
  for (const Cycle* const cycle : {&third, &first}) {
    const std::vector<double> force = gauge(found, *cycle);
    record(cycle == &third ? "third" : "first", force, *cycle);
    EXPECT_LE(misfit(force, *cycle), 0.065);
    EXPECT_GE(left(force, *cycle), 0.96);
    EXPECT_NEAR(left(cycle->force, *cycle), 0.974, 0.02);
    EXPECT_NEAR(loop(force, *cycle) / loop(cycle->force, *cycle), 1, 0.4);
  }
}

}  // namespace
}  // namespace tangere
