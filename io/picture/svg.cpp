// SPDX-License-Identifier: Apache-2.0
// Writes SVG text. These few functions are simpler than the interface of a library.
#include "io/picture/svg.hpp"

#include <fmt/format.h>

#include <cmath>

#include "io/files/printable_text.hpp"

namespace tangere::svg {

std::string escape(const std::string& text) {
  std::string out;
  for (const char c : printable(text)) {
    switch (c) {
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '&': out += "&amp;"; break;
      case '"': out += "&quot;"; break;
      default: out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return out;
}

std::string text(double x, double y, const std::string& content, const char* extra) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, extra,
                     escape(content));
}

std::string begin(double width, double height) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
      "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"Helvetica, Arial, sans-serif\" "
      "font-size=\"12\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"#ffffff\"/>\n",
      width, height);
}

std::string heading(const std::string& title, std::span<const std::string> captions) {
  std::string out = text(kMargin, kHead - 6, title, "font-size=\"16\" font-weight=\"bold\"");
  for (std::size_t k = 0; k < captions.size(); ++k)
    out += text(kMargin, kHead + kLine * (static_cast<double>(k) + 0.7), captions[k]);
  return out;
}

double round_down(double x) {
  const double base = std::pow(10, std::floor(std::log10(x)));
  return x >= 5 * base ? 5 * base : x >= 2 * base ? 2 * base : base;
}

}  // namespace tangere::svg
