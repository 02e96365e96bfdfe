// SPDX-License-Identifier: Apache-2.0
// Tests what texts of files may put on a terminal and into a picture.
#include "io/files/printable_text.hpp"

#include <gtest/gtest.h>

#include "io/picture/svg.hpp"

namespace tangere {
namespace {

TEST(PrintableText, OrdinaryTextStays) {
  const std::string text = "a\tb\nµ 木 \U0001F916 é";
  EXPECT_EQ(printable(text), text);
}

TEST(PrintableText, WhatMovesCursorsOrTurnsLinesIsSpeltOut) {
  EXPECT_EQ(printable("\x1b[2J"), "\\u001b[2J");
  EXPECT_EQ(printable("a\rb\x7f"), "a\\u000db\\u007f");
  EXPECT_EQ(printable("\u009b31m"), "\\u009b31m");
  EXPECT_EQ(printable("x\u202egpj.exe\u2069\u061c"), "x\\u202egpj.exe\\u2069\\u061c");
  EXPECT_EQ(printable("\uFFFE\uFFFF\u2028"), "\\ufffe\\uffff\\u2028");
  EXPECT_EQ(printable("\u202e", "\\\\u"), "\\\\u202e");
}

TEST(PrintableText, BytesThatAreNoUtf8AreSpeltOut) {
  EXPECT_EQ(printable("\xff"), "\\xff");
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // a surrogate
  EXPECT_EQ(printable("\xc0\x9b"), "\\xc0\\x9b");           // overlong
  EXPECT_EQ(printable("ok\x9b"), "ok\\x9b");
  EXPECT_EQ(printable("\xe2\x80"), "\\xe2\\x80");  // cut off
}

TEST(PrintableText, PicturesHoldOnlyCharactersOfXml) {
  EXPECT_EQ(svg::escape("\uFFFE<\x1b>\xed\xa0\x80\n"), "\\ufffe&lt;\\u001b&gt;\\xed\\xa0\\x80 ");
}

}  // namespace
}  // namespace tangere
