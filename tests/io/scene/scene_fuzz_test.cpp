// SPDX-License-Identifier: Apache-2.0
// 2 000 mutated scenes: each is read and compiled, or refused with a message. Nothing else may
// happen.
#include <gtest/gtest.h>

#include <iterator>
#include <random>

#include "engine/step/batch.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/files.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

class Mutator {
 public:
  explicit Mutator(unsigned seed) : engine_(seed) {}

  std::string operator()(std::string text) {
    for (int n = at_most(3) + 1; n > 0 && !text.empty(); --n) text = once(std::move(text));
    return text;
  }

 private:
  int at_most(std::size_t n) {
    return static_cast<int>(std::uniform_int_distribution<std::size_t>(0, n)(engine_));
  }

  std::string once(std::string t) {
    const std::size_t at = std::size_t(at_most(t.size() - 1));
    const std::size_t length = std::min(t.size() - at, std::size_t(at_most(40)) + 1);
    switch (at_most(6)) {
      case 0: t[at] = static_cast<char>(at_most(255)); break;
      case 1: t.erase(at, length); break;
      case 2: t.insert(at, t.substr(at, length)); break;
      case 3: t.resize(at); break;
      case 4: {  // swap two pieces
        const std::size_t other = std::size_t(at_most(t.size() - 1));
        std::swap(t[at], t[other]);
        break;
      }
      default: replace_number(t, at); break;
    }
    return t;
  }

  void replace_number(std::string& t, std::size_t at) {
    static const char* const kValues[] = {"nan", "inf",         "-1",  "0", "1e308", "1e-308",
                                          "-0",  "99999999999", "2e9", "",  "x",     "1 2 3 4 5"};
    const std::size_t begin = t.find_first_of("0123456789", at);
    if (begin == std::string::npos) return;
    const std::size_t end = t.find_first_not_of("0123456789.e-+", begin);
    t.replace(begin, (end == std::string::npos ? t.size() : end) - begin,
              kValues[at_most(std::size(kValues) - 1)]);
  }

  std::mt19937_64 engine_;
};

TEST(SceneFuzz, TwoThousandMutantsAreReadOrRefused) {
  const std::string rods = testing::with(
      "type=\"sphere\" radius=\"0.02\"",
      "type=\"capsule\" length=\"0.03\" radius=\"0.02\" general_contact_resolution=\"3 5\"",
      testing::with("type=\"cuboid\" size=\"0.05 0.05 0.01\"",
                    "type=\"cylinder\" length=\"0.01\" radius=\"0.05\""));
  const std::string sources[] = {
      testing::kScene,
      rods,
      file_bytes(std::string(TANGERE_TEST_DATA) + "/scenes/two_balls.xml"),
      file_bytes(std::string(TANGERE_TEST_DATA) + "/scenes/published_dialect_pad.xml"),
      file_bytes(std::string(TANGERE_TEST_DATA) + "/scenes/every_joint.xml"),
      file_bytes(std::string(TANGERE_SOURCE_DIR) + "/scenes/rolling_ball_small.xml")};
  int read = 0, refused = 0;
  for (unsigned seed = 0; seed < 2000; ++seed) {
    const std::string text = Mutator(seed)(sources[seed % std::size(sources)]);
    try {
      SceneFile file = parse_scene(text, "mutant.xml");
      // Valid but huge grids use memory and are no bugs, so they are kept small here.
      for (LinkDescription& l : file.scene.links) {
        if (auto* box = std::get_if<CuboidShape>(&l.body.shape))
          for (int& n : box->contact_resolution) n = std::min(n, 12);
        if (auto* rod = std::get_if<CapsuleShape>(&l.body.shape))
          rod->contact_rings = std::min(rod->contact_rings, 12);
        if (auto* rod = std::get_if<CylinderShape>(&l.body.shape))
          rod->contact_rings = std::min(rod->contact_rings, 12);
      }
      for (TactileDescription& t : file.scene.sensors) {
        t.array.rows = std::min(t.array.rows, 64);
        t.array.cols = std::min(t.array.cols, 64);
      }
      const Model model(file.scene);
      const Batch batch(model, 3);
      ++read;
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()), "");
      ++refused;
    } catch (const IoError&) {
      ++refused;  // a csv that is not there
    }
  }
  EXPECT_GT(read, 100);
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace tangere
