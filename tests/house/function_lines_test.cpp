// SPDX-License-Identifier: Apache-2.0
// Tests that functions are found and counted, and that the project's are short enough.
#include "tests/house/function_lines.hpp"

#include <gmock/gmock.h>

namespace tangere::house {
namespace {

using ::testing::ElementsAre;
using ::testing::FieldsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string lines(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += "  x();\n";
  return text;
}

TEST(House, FunctionsFitAScreen) {
  EXPECT_THAT(check_functions(read_tree(TANGERE_SOURCE_DIR)), IsEmpty());
}

TEST(FunctionLines, CountsFromTheReturnTypeToTheLastBrace) {
  const Tree tree{{"engine/fits.cpp", "int f(int x) {\n" + lines(88) + "}\n"},
                  {"engine/long.cpp", "\nint\nf(int x) {\n" + lines(88) + "}\n"},
                  {"tests/long.cpp", "int f(int x) {\n" + lines(200) + "}\n"}};
  EXPECT_THAT(check_functions(tree),
              ElementsAre(FieldsAre("engine/long.cpp", 2, HasSubstr("of 91 lines"))));
}

TEST(FunctionLines, LooksIntoNamespacesAndTypes) {
  const std::string method = "  void f() const override {\n" + lines(90) + "  }\n";
  const Tree tree{
      {"io/a.hpp", "namespace a {\ntemplate <class T>\nclass B : C {\n" + method + "};\n}\n"},
      {"io/b.cpp",
       "namespace {\nB::B(int x)\n    : a_{x},\n      b_(x) {\n" + lines(90) + "}\n}\n"},
      {"io/c.cpp", "namespace {\n" + lines(200) + "}\nstruct D {\n" + lines(200) + "};\n"}};
  EXPECT_THAT(check_functions(tree),
              ElementsAre(FieldsAre("io/a.hpp", 4, HasSubstr("of 92 lines")),
                          FieldsAre("io/b.cpp", 2, HasSubstr("of 94 lines"))));
}

TEST(FunctionLines, SeesNoBracesInTextAndComments) {
  const std::string begin = "void f() {\n  g(R\"x(}\"})x\", \"\\\"}\", '}', 1'000);  // }\n";
  const Tree tree{{"io/a.cpp", "#define F(x) \\\n  { x\n" + begin + "  /* } */ if (a) {\n  }\n" +
                                   lines(90) + "}\n"}};
  EXPECT_THAT(check_functions(tree),
              ElementsAre(FieldsAre("io/a.cpp", 3, HasSubstr("of 95 lines"))));
}

}  // namespace
}  // namespace tangere::house
