// SPDX-License-Identifier: Apache-2.0
// Pictures of gels and cameras in a page, as JPEG files.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "io/view/view_data.hpp"

namespace tangere {

/// Levels of picture k of an episode, (rows, cols, 3).
using ReadPicture = std::function<std::vector<std::uint8_t>(std::int64_t k)>;

/// Returns the options for the numbers of a page with pictures: half of its bytes is theirs.
ViewOptions beside_pictures(const ViewOptions& options);
/// Returns n so that every n-th picture keeps a page below options.bytes, about. `first`: one
/// picture of each kind; `count`: all that frames would show.
int picture_stride(std::span<const std::string> first, std::int64_t count,
                   const ViewOptions& options);
/// The bytes of a picture in a page.
std::string page_picture(const ViewPicture& picture, std::span<const std::uint8_t> levels);
/// Appends the newest picture at each frame of an episode, or every n-th of them. `taken`: when
/// each picture was taken, counted as the rows of the episode.
void add_pictures(const ViewPicture& picture, std::span<const std::int64_t> taken,
                  const ReadPicture& read, int every, ViewEpisode& episode);
/// Leaves every second picture out until the page is below options.bytes, and notes how many of
/// them it shows: `every` was picture_stride().
void thin_pictures(ViewData& data, int every, const ViewOptions& options);

}  // namespace tangere
