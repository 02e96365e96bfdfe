// SPDX-License-Identifier: Apache-2.0
// Layouts and recordings of presses for tests of `tangere calibrate`, and what its JSON says.
#pragma once

#include <functional>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace tangere::apps {

inline constexpr double kPoints = 37;  // of a pitch of 1 mm within 3.5 mm
inline constexpr double kArea = 1e-6;  // of a point [m²]
inline constexpr double kThickness = 4e-3;

/// 11 x 11 points. `more`: attributes.
inline std::string layout(const std::string& more) {
  return "<sensor unit=\"m-kg\"><tactile name=\"skin_guess\" type=\"rect_array\" resolution=\"11 "
         "11\" "
         "rect_pos0=\"-0.005 0.005 0\" rect_pos1=\"0.005 -0.005 0\" axis0=\"0 -1 0\" axis1=\"1 0 "
         "0\" " +
         more + "/></sensor>";
}

/// Rows of a table whose columns follow from the row.
inline std::string table(const std::string& header, int rows,
                         const std::function<std::vector<double>(int)>& row) {
  std::ostringstream text;
  text << std::setprecision(17) << header << "\n";
  for (int k = 0; k < rows; ++k) {
    const char* between = "";
    for (const double x : row(k)) text << between << x, between = ",";
    text << "\n";
  }
  return text.str();
}

inline nlohmann::json number(const nlohmann::json& answer, const std::string& name) {
  for (const nlohmann::json& n : answer["numbers"])
    if (n["number"] == name) return n;
  return {};
}
inline std::string reason(const nlohmann::json& answer, const std::string& name) {
  for (const nlohmann::json& n : answer["untold"])
    if (n["number"] == name) return n["reason"];
  return "told";
}

}  // namespace tangere::apps
