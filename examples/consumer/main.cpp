// SPDX-License-Identifier: Apache-2.0
// The smallest useful program: takes 100 steps of 16 environments of a scene and prints the hardest
// press on its first sensor.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <vector>

#include <tangere/tangere.hpp>

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: consumer SCENE.xml\n");
    return 2;
  }
  try {
    constexpr int kEnvironments = 16, kSteps = 100;
    const tangere::Model model = tangere::load_model(argv[1]);
    if (model.sensors().empty()) throw tangere::InputError("the scene has no tactile sensor");
    tangere::Batch batch(model, kEnvironments, /*seed=*/1);
    tangere::Stepper stepper(model);
    tangere::Readout readout(model);
    const tangere::ControlProgram program(model, model.timestep(), batch.seed());

    const auto points = static_cast<std::size_t>(model.sensors()[0].points);
    std::vector<double> controls(std::size_t(kEnvironments * model.nu())), field(3 * points);
    double peak = 0;
    for (int step = 0; step < kSteps; ++step) {
      program.evaluate(step, batch, controls);
      stepper.step(batch, controls);
      for (int e = 0; e < kEnvironments; ++e) {
        readout.tactile(batch, e, /*sensor=*/0, field);
        for (std::size_t p = 0; p < points; ++p) peak = std::max(peak, std::abs(field[3 * p + 2]));
      }
    }
    std::printf("%d environments, %d steps, %d failed\n", kEnvironments, kSteps,
                batch.failed_count());
    std::printf("peak normal tactile force: %.6g N\n", peak);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
