// SPDX-License-Identifier: Apache-2.0
// Three bytes of a file are four characters of a page.
#include "io/view/view_pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/files/jpeg_file.hpp"

namespace tangere {
namespace {

constexpr int kQuality = 85;
constexpr double kCharacters = 4.0 / 3, kShare = 0.5;  // of a byte; of the page

double bytes_of_pictures(const ViewData& data) {
  double bytes = 0;
  for (const ViewEpisode& episode : data.episodes)
    for (const ViewShown& shown : episode.pictures)
      for (const std::string& file : shown.files)
        bytes += kCharacters * static_cast<double>(file.size()) + 4;
  return bytes;
}

/// Keeps pictures 0, 2, 4, … . The others become the one before.
void halve(ViewShown& shown) {
  for (std::int32_t& at : shown.at)
    if (at >= 0) at /= 2;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < shown.files.size(); k += 2)
    shown.files[kept++] = std::move(shown.files[k]);
  shown.files.resize(kept);
}

}  // namespace

ViewOptions beside_pictures(const ViewOptions& options) {
  ViewOptions numbers = options;
  numbers.bytes *= 1 - kShare;
  return numbers;
}

int picture_stride(std::span<const std::string> first, std::int64_t count,
                   const ViewOptions& options) {
  double bytes = 0;
  for (const std::string& file : first) bytes += kCharacters * static_cast<double>(file.size());
  const double needed = bytes * static_cast<double>(count), room = kShare * options.bytes;
  return std::max(1, static_cast<int>(std::ceil(std::min(1e6, needed / room))));
}

std::string page_picture(const ViewPicture& picture, std::span<const std::uint8_t> levels) {
  return jpeg_bytes(picture.rows, picture.cols, levels, kQuality);
}

void add_pictures(const ViewPicture& picture, std::span<const std::int64_t> taken,
                  const ReadPicture& read, int every, ViewEpisode& episode) {
  ViewShown shown;
  std::int64_t newest = -1, last = -1, different = 0;
  for (const std::int64_t row : episode.rows) {
    while (newest + 1 < std::ssize(taken) && taken[std::size_t(newest + 1)] <= row) ++newest;
    if (newest > last) {
      if (different % every == 0) shown.files.push_back(page_picture(picture, read(newest)));
      last = newest, ++different;
    }
    shown.at.push_back(static_cast<std::int32_t>(shown.files.size()) - 1);
  }
  episode.pictures.push_back(std::move(shown));
}

void thin_pictures(ViewData& data, int every, const ViewOptions& options) {
  std::int64_t shown = every;
  while (bytes_of_pictures(data) > kShare * options.bytes && shown < (std::int64_t{1} << 40)) {
    for (ViewEpisode& episode : data.episodes)
      for (ViewShown& one : episode.pictures) halve(one);
    shown *= 2;
  }
  if (shown > 1) data.notes.push_back(fmt::format("One of {} pictures is shown.", shown));
}

}  // namespace tangere
