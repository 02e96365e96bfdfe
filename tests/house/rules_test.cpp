// SPDX-License-Identifier: Apache-2.0
// Tests that the project keeps its own rules, and that the checkers find violations.
#include "tests/house/rules.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tangere::house {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

auto Says(const std::string& file, int line, const std::string& message) {
  return AllOf(Field(&Violation::file, file), Field(&Violation::line, line),
               Field(&Violation::message, HasSubstr(message)));
}

const Tree& project() {
  static const Tree tree = read_tree(TANGERE_SOURCE_DIR);
  return tree;
}

TEST(House, IsSeenAsAWhole) {
  for (const char* path :
       {"kernels/contact/contact_types.hpp", "engine/model/model.hpp", "tasks/run/rollout.hpp",
        "tests/CMakeLists.txt", "cmake/install.cmake", "README.md", "run-demo", ".ci/run"})
    EXPECT_TRUE(project().contains(path)) << path;
  for (const auto& [path, text] : project()) {
    EXPECT_FALSE(path.starts_with("build/") || path.starts_with("out/") ||
                 path.starts_with(".git/"))
        << path;
    EXPECT_FALSE(text.empty()) << path;
  }
}

TEST(House, IncludesPointOneWay) { EXPECT_THAT(check_includes(project()), IsEmpty()); }
TEST(House, KernelsShareNothingAcrossInstructionSets) {
  EXPECT_THAT(check_kernel_includes(project()), IsEmpty());
}
TEST(House, PublicHeadersStandAlone) { EXPECT_THAT(check_public_headers(project()), IsEmpty()); }
TEST(House, PrivateHeadersStayInside) { EXPECT_THAT(check_private_headers(project()), IsEmpty()); }
TEST(House, HeavyHeadersStayWhereTheyAre) {
  EXPECT_THAT(check_heavy_headers(project()), IsEmpty());
}
TEST(House, SourcesHaveTheirHeaders) { EXPECT_THAT(check_own_headers(project()), IsEmpty()); }
TEST(House, RoomsDoNotIncludeEachOtherInACircle) {
  EXPECT_THAT(check_circles(project()), IsEmpty());
}
TEST(House, SourcesAreShortAndSayWhy) { EXPECT_THAT(check_sources(project()), IsEmpty()); }
TEST(House, FoldersAndLinksAreDocumented) { EXPECT_THAT(check_documents(project()), IsEmpty()); }

TEST(HouseRules, SeeAnIncludeThatPointsTheWrongWay) {
  const Tree tree{
      {"engine/model/model.hpp", "#include \"kernels/numbers/lanes.hpp\"\n"},
      {"io/files/file.hpp", ""},
      {"kernels/numbers/lanes.hpp", "#include <cmath>\n #  include \"engine/model/model.hpp\"\n"},
      {"tasks/run/rollout.cpp",
       "#include \"io/files/file.hpp\"\n#include \"engine/model/model.hpp\"\n"},
      {"engine/step/batch.hpp", "#include \"engine/model/model.hpp\"\n"},
      {"engine/model/compile.cpp", "#include \"engine/step/batch.hpp\"\n"},
      {"apps/main.cpp", "#include \"io/files/file.hpp\"\n"}};
  EXPECT_THAT(
      check_includes(tree),
      ElementsAre(
          Says("engine/model/compile.cpp", 1, "engine/model must not include engine/step"),
          Says("kernels/numbers/lanes.hpp", 2, "kernels/numbers must not include engine/model"),
          Says("tasks/run/rollout.cpp", 1, "tasks/run must not include io/files")));
}

TEST(HouseRules, SeeANameFromOutsideTheRoot) {
  const Tree tree{{"engine/step/a.hpp", "#include \"b.hpp\"\n#include \"c.hpp\"\n"},
                  {"engine/step/b.hpp", ""}};
  EXPECT_THAT(check_includes(tree),
              ElementsAre(Says("engine/step/a.hpp", 2, "no file of the project")));
}

TEST(HouseRules, SeeALibraryInTheWrongFolder) {
  const Tree tree{
      {"engine/model/a.cpp", "#include <vector>\n#include <hdf5.h>\n#include <CLI/CLI.hpp>\n"},
      {"io/hdf5/b.cpp", "#include <hdf5.h>\n"},
      {"kernels/step/c.cpp", "#include <Eigen/Dense>\n"}};
  EXPECT_THAT(check_includes(tree), ElementsAre(Says("engine/model/a.cpp", 2, "<hdf5.h>"),
                                                Says("engine/model/a.cpp", 3, "<CLI/"),
                                                Says("kernels/step/c.cpp", 1, "<Eigen/Dense>")));
}

TEST(HouseRules, SeeAFolderNobodyTold) {
  EXPECT_THAT(check_includes({{"engine/a.cpp", ""}, {"misc/a.cpp", ""}}),
              ElementsAre(Says("engine/a.cpp", 0, "does not know"),
                          Says("misc/a.cpp", 0, "does not know")));
}

TEST(HouseRules, SeeAContainerBehindAKernel) {
  const Tree tree{{"kernels/table/step_part.hpp", "#include \"kernels/step/lu.hpp\"\n"},
                  {"kernels/step/lu.hpp", "#include \"kernels/view.hpp\"\n#include <cmath>\n"},
                  {"kernels/view.hpp", "#include <vector>\n"},
                  {"kernels/table.cpp", "#include <string>\n"}};
  EXPECT_THAT(check_kernel_includes(tree), ElementsAre(Says("kernels/view.hpp", 1, "<vector>")));
}

TEST(HouseRules, SeeAPublicHeaderThatNeedsALibrary) {
  const Tree tree{{"apps/tangere.hpp", "#include \"engine/a.hpp\"\n"},
                  {"engine/a.hpp", "#include <vector>\n#include \"engine/b.hpp\"\n"},
                  {"engine/b.hpp", "#include <Eigen/LU>\n#include \"engine/gone.hpp\"\n"},
                  {"engine/hidden.hpp", "#include <Eigen/LU>\n"}};
  EXPECT_THAT(check_public_headers(tree), ElementsAre(Says("engine/b.hpp", 1, "Eigen/LU"),
                                                      Says("engine/b.hpp", 2, "engine/gone.hpp")));
  EXPECT_THAT(check_public_headers({}), Contains(Says("apps/tangere.hpp", 0, "missing")));
}

TEST(HouseRules, SeeAPrivateHeaderOutside) {
  const std::string three =
      "#include \"engine/open.hpp\"\n#include \"engine/free.hpp\"\n#include \"engine/shut.hpp\"\n";
  const std::string arrays = "#include \"engine/model/compiled_model.hpp\"\n";
  const Tree tree{{"apps/a.cpp", three},
                  {"bench/a.cpp", three},
                  {"apps/tangere.hpp", "#include \"engine/open.hpp\"\n"},
                  {"engine/a.cpp", three},
                  {"engine/free.hpp", ""},
                  {"engine/model/compiled_model.hpp", ""},
                  {"engine/open.hpp", arrays},
                  {"engine/shut.hpp", arrays},
                  {"examples/a.cpp", "#include \"kernels/lane.hpp\"\n#include \"io/b.hpp\"\n"},
                  {"io/b.hpp", "#include <engine/shut.hpp>\n"},
                  {"kernels/lane.hpp", ""},
                  {"tests/a.cpp", three}};
  EXPECT_THAT(check_private_headers(tree),
              ElementsAre(Says("apps/a.cpp", 3, "engine/shut.hpp"),
                          Says("examples/a.cpp", 1, "kernels/lane.hpp")));
}

TEST(HouseRules, SeeAHeavyHeaderBehindAnother) {
  const Tree tree{{"apps/arguments.cpp", "#include <CLI/CLI.hpp>\n"},
                  {"apps/one.cpp", "#include \"apps/one.hpp\"\n"},
                  {"apps/one.hpp", "#include <CLI/App.hpp>\n"},
                  {"io/files/a.cpp", "#include <regex>\n"},
                  {"tests/io/a_test.cpp", "#include <regex>\n"}};
  EXPECT_THAT(check_heavy_headers(tree), ElementsAre(Says("apps/one.cpp", 0, "<CLI/App.hpp>"),
                                                     Says("io/files/a.cpp", 0, "<regex>")));
}

TEST(HouseRules, SeeASourceWithoutItsHeader) {
  const Tree tree{{"apps/main.cpp", ""},
                  {"engine/step/a.cpp", ""},
                  {"engine/step/b.cpp", ""},
                  {"engine/step/b.hpp", ""},
                  {"tests/io/a_test.cpp", ""}};
  EXPECT_THAT(check_own_headers(tree),
              ElementsAre(Says("engine/step/a.cpp", 0, "engine/step/a.hpp")));
}

TEST(HouseRules, SeeACircleOfRooms) {
  const Tree tree{{"engine/step/a.hpp", "#include \"engine/step/b.hpp\"\n"},
                  {"engine/step/b.hpp", ""},
                  {"engine/step/b.cpp", "#include \"engine/step/c.hpp\"\n"},
                  {"engine/step/c.hpp", "#include \"engine/step/a.hpp\"\n"},
                  {"engine/step/d.hpp", "#include \"engine/step/a.hpp\"\n"},
                  {"io/picture/projection.hpp", ""},
                  {"io/picture/scene_plot.hpp", ""},
                  {"tests/a.hpp", "#include \"tests/b.hpp\"\n"},
                  {"tests/b.hpp", "#include \"tests/a.hpp\"\n"}};
  EXPECT_THAT(check_circles(tree),
              ElementsAre(Says("engine/step/a", 0, "engine/step/a, engine/step/b, engine/step/c"),
                          Says("io/picture/projection", 0, "is listed as a circle")));
}

TEST(HouseRules, SeeAHeadlessOrOverlongSource) {
  const std::string head = "// SPDX-License-Identifier: Apache-2.0\n// Why.\n";
  std::string longest = head, too_long = head + "\n", marks;
  for (int i = 2; i < 600; ++i) longest += "\n", too_long += "\n";
  for (int i = 0; i < 99; ++i) marks += "µ";
  const std::string script = "# SPDX-License-Identifier: Apache-2.0\n# " + std::string(118, 'x');
  const Tree tree{
      {"cmake/fits.sh", script + "\n"},
      {"cmake/wide.sh", script + "x\n"},
      {"engine/bare.hpp", "#pragma once\n"},
      {"engine/empty.cpp", ""},
      {"engine/longest.cpp", longest},
      {"engine/mute.cpp", "// SPDX-License-Identifier: Apache-2.0\n#include <vector>\n"},
      {"engine/relation.cpp", head + "// e\nint by_mass = 0;\nread(\"of_mass\");\n"},
      {"engine/too_long.cpp", too_long},
      {"engine/wide.cpp", head + "// " + marks + "\n// e\u0304" + std::string(96, 'x') + "\n"},
      {"io/page/wide.js",
       "// SPDX-License-Identifier: Apache-2.0\n" + std::string(101, 'x') + "\n"},
      {"python/fits.py", "# SPDX-License-Identifier: Apache-2.0\n#" + marks + "\n"},
      {"run-demo", "#!/usr/bin/env bash\n# SPDX-License-Identifier: Apache-2.0\n"},
      {"tests/CMakeLists.txt", "add_test()\n"}};
  EXPECT_THAT(
      check_sources(tree),
      ElementsAre(
          Says("cmake/wide.sh", 2, "121 columns"), Says("engine/bare.hpp", 1, "SPDX"),
          Says("engine/bare.hpp", 2, "why"), Says("engine/empty.cpp", 1, "SPDX"),
          Says("engine/empty.cpp", 2, "why"), Says("engine/mute.cpp", 2, "why"),
          Says("engine/relation.cpp", 4, "'by_mass'"), Says("engine/too_long.cpp", 0, "601 lines"),
          Says("engine/wide.cpp", 3, "102 columns"), Says("io/page/wide.js", 2, "101 columns"),
          Says("tests/CMakeLists.txt", 1, "SPDX")));
}

TEST(HouseRules, SeeAnUndocumentedFolderAndADeadLink) {
  const std::string page =
      "# Title\n\nSee [there](../docs/solver.md#newton), [far](https://example.org/x), "
      "[all](../docs/) and [gone](gone.md).\n";
  const Tree tree{
      {"docs/README.md", "# A\n\nB\n"}, {"docs/solver.md", "x"}, {"engine/README.md", page},
      {"io/README.md", "# io\n"},       {"io/a.cpp", ""},        {"tasks/a.cpp", ""}};
  EXPECT_THAT(check_documents(tree),
              ElementsAre(Says("io/README.md", 0, "nothing"), Says("tasks", 0, "no README.md"),
                          Says("engine/README.md", 3, "gone.md")));
}

TEST(HouseRules, SeeAFolderInAFolderWithoutItsPage) {
  const Tree tree{{"engine/README.md", "# A\n\nB\n"},   {"engine/step/inner/a.hpp", ""},
                  {"examples/README.md", "# A\n\nB\n"}, {"examples/own/a.cpp", ""},
                  {"python/README.md", "# A\n\nB\n"},   {"python/tangere/a.py", ""},
                  {"tests/README.md", "# A\n\nB\n"},    {"tests/main.cpp", ""},
                  {"tests/io/scene/a_test.cpp", ""}};
  EXPECT_THAT(check_documents(tree), ElementsAre(Says("engine/step/inner", 0, "no README.md"),
                                                 Says("python/tangere", 0, "no README.md"),
                                                 Says("tests/io", 0, "no README.md")));
}

TEST(HouseRules, SeeATableThatIsTooWide) {
  const std::string dots(97, '.');
  const Tree tree{{"docs/README.md", "# A\n\n| " + dots + "|\n| ×" + dots + "|\n| a |\n"}};
  EXPECT_THAT(check_documents(tree), ElementsAre(Says("docs/README.md", 4, "101 columns")));
}

}  // namespace
}  // namespace tangere::house
