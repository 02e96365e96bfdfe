// SPDX-License-Identifier: Apache-2.0
// The few pieces of SVG that all pictures share: text that stays well-formed, and round numbers for
// scales.
#pragma once

#include <span>
#include <string>

namespace tangere::svg {

/// Escapes text for elements and attributes. Control characters, which XML forbids, become blanks.
std::string escape(const std::string& text);

// Places of what stands above a picture of curves.
inline constexpr double kHead = 34, kLine = 17, kMargin = 24;

/// Opens a white drawing of this size; "</svg>\n" closes it.
std::string begin(double width, double height);

/// Returns a title, and captions below it, kLine apart.
std::string heading(const std::string& title, std::span<const std::string> captions);

/// Returns one line of text at (x, y) in SVG units, its baseline at y. `extra`: further attributes.
std::string text(double x, double y, const std::string& content, const char* extra = "");

/// Returns the largest 1, 2 or 5 times a power of ten that is at most x; x > 0.
double round_down(double x);

}  // namespace tangere::svg
