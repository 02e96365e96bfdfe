// SPDX-License-Identifier: Apache-2.0
// A photograph is divided by the gains of its row before use: its white balance was not locked.
#include "apps/calibrate_pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/text_output.hpp"
#include "engine/base/error.hpp"
#include "io/files/csv.hpp"
#include "io/files/jpeg_file.hpp"
#include "io/files/png_file.hpp"
#include "io/files/text_file.hpp"
#include "io/scene/gel_file.hpp"
#include "tasks/calibration/gel_fit.hpp"

namespace tangere::apps {
namespace {

constexpr const char* kTable = "presses.csv";
constexpr const char* kBackground = "background.png";
constexpr double kLongest = 0.1;     // of a ball and of a pixel [m], as of a gel file
constexpr float kLeastChange = 3;    // of a photograph by its press [grey levels]
constexpr double kMostGrowth = 1.3;  // of the radius of a label, either way, without a warning
constexpr double kMostMove = 0.5;    // of its place, by its radius

struct Photographs {
  GelBackground background;
  std::vector<BallPress> presses;
  std::vector<std::string> files;
  std::string background_bytes;
};

std::string in_folder(const std::string& folder, const std::string& file) {
  return (std::filesystem::path(folder) / file).string();
}

/// Reads a photograph as PNG or JPEG.
Photograph read_photograph(const std::string& path) {
  constexpr std::size_t kMostBytes = std::size_t{256} << 20;
  const std::string bytes = read_text_file(path, kMostBytes, "a picture as PNG or JPEG");
  return bytes.starts_with("\xFF\xD8") ? parse_jpeg(bytes, path) : parse_png(bytes, path);
}

/// Largest change of a level within the circle of a press.
float largest_change(const BallPress& press, const GelBackground& background) {
  float most = 0;
  for (int i = 0; i < background.rows; ++i)
    for (int j = 0; j < background.cols; ++j) {
      const double x = j + 0.5 - press.label.x, y = i + 0.5 - press.label.y;
      if (x * x + y * y > press.label.radius * press.label.radius) continue;
      for (std::size_t c = 0; c < kColours; ++c) {
        const std::size_t k =
            kColours * (std::size_t(i) * std::size_t(background.cols) + std::size_t(j)) + c;
        most = std::max(most, std::abs(press.levels[k] - background.levels[k]));
      }
    }
  return most;
}

BallPress read_ball_press(const NamedFields& table, const NamedFields::Row& row,
                          const std::string& folder, const GelBackground& background) {
  const auto number = [&](const char* name, std::optional<double> fallback = {}) {
    const std::optional<std::size_t> column = table.find(name);
    if (!column && !fallback)
      throw InputError(fmt::format("{}: no column '{}'; expected file, x_px, y_px, radius_px",
                                   in_folder(folder, kTable), name));
    return column ? table.number(row, *column) : *fallback;
  };
  BallPress press;
  press.label = {number("x_px"), number("y_px"), number("radius_px")};
  const std::array<double, kColours> gains{number("gain_r", 1), number("gain_g", 1),
                                           number("gain_b", 1)};
  if (!(*std::ranges::min_element(gains) > 0))
    throw InputError(row.place + "a gain that is not positive; expected positive numbers");
  const std::string path = in_folder(folder, row.fields[*table.find("file")]);
  const Photograph photograph = read_photograph(path);
  if (photograph.rows != background.rows || photograph.cols != background.cols)
    throw InputError(
        fmt::format("{}{} has {} x {} pixels, the background {} x {}; expected one size", row.place,
                    path, photograph.cols, photograph.rows, background.cols, background.rows));
  for (std::size_t k = 0; k < photograph.levels.size(); ++k)
    press.levels.push_back(static_cast<float>(double(photograph.levels[k]) / gains[k % kColours]));
  const Imprint& at = press.label;
  if (!(at.radius > 0) || !(at.x >= 0 && at.x <= background.cols) ||
      !(at.y >= 0 && at.y <= background.rows))
    throw InputError(fmt::format(
        "{}an imprint at ({}, {}) of radius {} pixels; expected a circle in the picture", row.place,
        at.x, at.y, at.radius));
  if (const float change = largest_change(press, background); !(change >= kLeastChange))
    throw InputError(fmt::format(
        "{}{} differs from the background by {:.2g} levels at most within its circle; expected a "
        "press, {} levels or more",
        row.place, path, change, kLeastChange));
  return press;
}

Photographs read_photographs(const std::string& folder) {
  Photographs out;
  const Photograph background = read_png(in_folder(folder, kBackground));
  out.background_bytes = png_bytes(background);
  out.background = {
      background.rows, background.cols, {background.levels.begin(), background.levels.end()}};
  const NamedFields table = read_named_fields(in_folder(folder, kTable));
  if (!table.find("file"))
    throw InputError(fmt::format("{}: no column 'file'; expected file, x_px, y_px, radius_px",
                                 in_folder(folder, kTable)));
  for (const NamedFields::Row& row : table.rows) {
    out.presses.push_back(read_ball_press(table, row, folder, out.background));
    out.files.push_back(row.fields[*table.find("file")]);
  }
  return out;
}

/// Returns the last name of a path, also where it ends with '/'.
std::string folder_name(const std::string& folder) {
  const std::filesystem::path path = std::filesystem::path(folder).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).filename().string();
}

/// How far a label was moved [pixels].
double moved(const BallPress& press, const PressScore& score) {
  return std::hypot(score.refined.x - press.label.x, score.refined.y - press.label.y);
}

/// Warns of labels whose circle the fit changed by more than kMostGrowth or kMostMove: one wrong
/// label changes all lamps.
void warn_of_labels(const Photographs& of, const GelFit& fit, const Console& console) {
  for (std::size_t k = 0; k < fit.scores.size(); ++k) {
    const double labelled = of.presses[k].label.radius, found = fit.scores[k].refined.radius,
                 by = moved(of.presses[k], fit.scores[k]);
    const bool grown = found > kMostGrowth * labelled || labelled > kMostGrowth * found;
    if (!grown && by <= kMostMove * labelled) continue;
    console.note(fmt::format(
        "warning: {}: the circle of radius {:.4g} pixels became one of {:.4g} and moved by {:.3g} "
        "pixels; a wrong label spoils the fit: mend it or leave the press out",
        of.files[k], labelled, found, by));
  }
}

/// A search that ends without a reach has made up for it by depth, as where the ball's radius is
/// wrong.
void warn_of_reach(const GelFit& fit, double pixel, const Console& console) {
  constexpr double kLeast = 0.1;  // of a pixel
  if (*fit.gel.reach >= kLeast * pixel) return;
  console.note(
      fmt::format("warning: the gel's reach is {:.3g} m, less than {} of a pixel, at a depth of "
                  "{:.3g} of the imprint's radius; expected --ball to be the radius of the ball, "
                  "not its diameter, and --pixel the side of a pixel",
                  *fit.gel.reach, kLeast, fit.depth_ratio));
}

std::string scores_text(const Photographs& of, const GelFit& fit) {
  const PressScore mean = fit.mean();
  std::size_t worst = 0;
  std::string text = fmt::format("{:<20}{:>9}{:>8}{:>11}{:>8}{:>12}{:>10}\n", "press", "dB", "SSIM",
                                 "refined dB", "SSIM", "moved px", "radius px");
  for (std::size_t k = 0; k < fit.scores.size(); ++k) {
    const PressScore& s = fit.scores[k];
    if (s.psnr < fit.scores[worst].psnr) worst = k;
    text += fmt::format("{:<20}{:>9.2f}{:>8.3f}{:>11.2f}{:>8.3f}{:>12.2f}{:>10.2f}\n", of.files[k],
                        s.psnr, s.ssim, s.aligned_psnr, s.aligned_ssim, moved(of.presses[k], s),
                        s.refined.radius);
  }
  text += fmt::format("{:<20}{:>9.2f}{:>8.3f}{:>11.2f}{:>8.3f}\n", "mean", mean.psnr, mean.ssim,
                      mean.aligned_psnr, mean.aligned_ssim);
  return text +
         fmt::format(
             "each predicted by the lamps of the others; worst: {}\ndepth {:.3g} of the imprint's "
             "radius, reach {:.3g} m, blur {:.3g} m",
             of.files[worst], fit.depth_ratio, *fit.gel.reach, fit.gel.blur);
}

void print_json(const Photographs& of, const GelFit& fit, const Console& console) {
  const auto score = [](const PressScore& s) {
    return Json{{"psnr", s.psnr},
                {"ssim", s.ssim},
                {"refined_psnr", s.aligned_psnr},
                {"refined_ssim", s.aligned_ssim}};
  };
  Json presses = Json::array();
  for (std::size_t k = 0; k < fit.scores.size(); ++k) {
    Json one = score(fit.scores[k]);
    one["file"] = of.files[k];
    one["moved"] = moved(of.presses[k], fit.scores[k]);
    one["radius"] = fit.scores[k].refined.radius;
    presses.push_back(std::move(one));
  }
  console.result({{"command", "calibrate"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"mean", score(fit.mean())},
                  {"depth_ratio", fit.depth_ratio},
                  {"reach", *fit.gel.reach},
                  {"blur", fit.gel.blur},
                  {"presses", presses}});
}

}  // namespace

int run_calibrate_pictures(const PictureCalibration& a, const Console& console) {
  if (!a.ball || !a.pixel)
    throw InputError(
        "--pictures without --ball or --pixel; expected the ball's radius and the side "
        "of a pixel [m]");
  for (const auto& [name, length] : {std::pair{"--ball", *a.ball}, {"--pixel", *a.pixel}})
    if (!(length <= kLongest))
      throw InputError(fmt::format("{} {}; expected metres, {} at most", name, length, kLongest));
  std::optional<PartFile> xml, png;
  const std::filesystem::path path(a.output);
  const std::string picture = path.stem().string() + "_background.png";
  if (!a.output.empty()) {
    xml.emplace(a.output, a.overwrite);
    png.emplace((path.parent_path() / picture).string(), a.overwrite);
  }
  const Photographs photographs = read_photographs(a.folder);
  const GelFit fit = fit_gel(photographs.background, photographs.presses, *a.ball, *a.pixel);
  console.print(scores_text(photographs, fit));
  warn_of_reach(fit, *a.pixel, console);
  warn_of_labels(photographs, fit, console);
  if (xml) {
    const PressScore mean = fit.mean();
    const std::string text = gel_text(fit.gel, picture,
                                      {{"photographs", folder_name(a.folder)},
                                       {"ball", fmt::format("{:.6g}", *a.ball)},
                                       {"depth_ratio", fmt::format("{:.4g}", fit.depth_ratio)},
                                       {"presses", fmt::format("{}", fit.scores.size())},
                                       {"psnr", fmt::format("{:.2f}", mean.psnr)},
                                       {"ssim", fmt::format("{:.3f}", mean.ssim)},
                                       {"refined_psnr", fmt::format("{:.2f}", mean.aligned_psnr)},
                                       {"refined_ssim", fmt::format("{:.3f}", mean.aligned_ssim)}});
    png->write(photographs.background_bytes);
    png->commit();
    xml->write(text);
    xml->commit();
    console.print(fmt::format("wrote {} and {} ({} bytes)", xml->output(), png->output(),
                              text.size() + photographs.background_bytes.size()));
  }
  print_json(photographs, fit, console);
  return kDone;
}

}  // namespace tangere::apps
