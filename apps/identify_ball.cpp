// SPDX-License-Identifier: Apache-2.0
// proto
#include <fmt/format.h>
#include "engine/control.hpp"
#include "engine/parameters.hpp"
#include "io/scene_reader.hpp"
#include "tasks/identification.hpp"
#include <cstdlib>
#include <cmath>
using namespace tangere;
int main(int argc, char** argv) {
  Scene scene = read_scene(argv[1]).scene;
  const double noise = argc > 2 ? atof(argv[2]) : 0.01;
  const std::uint64_t seed = argc > 3 ? atoi(argv[3]) : 1;
  const Model model(scene);
  const ControlProgram program(model, model.timestep(), 0);
  RecordedRun run{[&](std::int64_t t, int e, std::span<double> u) { program.evaluate(t, e, u); }, program.steps(), 5};
  FieldSequence rec = simulate_fields(scene, run);
  double peak = 0;
  for (auto& r : rec.readings) for (double f : r) peak = std::max(peak, std::abs(f));
  const int cols = model.sensors()[0].cols;
  for (std::size_t k = 0; k < rec.readings.size(); k += 2) {
    double s[3] = {0,0,0}, cr=0, cc=0; auto& r = rec.readings[k]; int slip = 0, touch = 0;
    for (std::size_t i = 0; i < r.size(); i += 3) { for (int c = 0; c < 3; ++c) s[c] += r[i+c]; cr += r[i+2]*double(i/3/cols); cc += r[i+2]*double(i/3%cols);
      if (r[i+2] > 0) { ++touch; if (std::hypot(r[i], r[i+1]) > 0.499 * r[i+2]) ++slip; } }
    fmt::print("{:.3f} s  shear {:+.4f} {:+.4f} normal {:.4f}  centre {:.1f} {:.1f}  points {} slip {}\n", double(k+1)*double(run.every)*model.timestep(), s[0], s[1], s[2], cr/s[2], cc/s[2], touch, slip);
  }
  add_noise(rec, noise * peak, seed);
  const Parameters p(model);
  IdentificationOptions o; o.numbers = {"tactile pad kn", "tactile pad kt", "tactile pad mu", "body ball density"};
  const double factor[] = {0.5, 2, 0.6, 1.6};
  Scene start = scene;
  for (int k = 0; k < p.count(); ++k) for (int j = 0; j < 4; ++j) if (p.infos()[k].name == o.numbers[j]) p.in(start, k) *= factor[j];
  const Identification r = identify(start, run, rec, o);
  for (auto& q : r.points) fmt::print("{:.6e} |g| {:.3e}  {:.5f} {:.5f} {:.5f} {:.4f}\n", q.misfit, q.gradient, q.values[0], q.values[1], q.values[2], q.values[3]);
  fmt::print("converged {} noise {:.3e} (true {:.3e}) cond {:.3g} dev {:.2e} {:.2e} {:.2e} {:.2e} graddiff {:.2e}\n", r.converged, r.noise, noise*peak, r.condition, r.deviation[0], r.deviation[1], r.deviation[2], r.deviation[3], r.gradient_difference);
}
