// SPDX-License-Identifier: Apache-2.0
// The few pieces of SVG that all pictures share: text that stays well-formed, round numbers for
// scales.
#pragma once

#include <string>

namespace tangere::svg {

/// Text for elements and attributes; control characters, which XML forbids, become blanks.
std::string escape(const std::string& text);

/// One line of text at (x, y) in SVG units, its baseline at y; `extra`: further attributes.
std::string text(double x, double y, const std::string& content, const char* extra = "");

/// 1, 2 or 5 times a power of ten, at most x; x > 0.
double round_down(double x);

}  // namespace tangere::svg
