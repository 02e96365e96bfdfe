// SPDX-License-Identifier: Apache-2.0
// libpng's simplified interface converts all kinds of PNG to RGB. Files of 16 bits that do not say
// how they encode light hold grey levels as others do, not linear light.
#include "io/files/png_file.hpp"

#include <fmt/format.h>
#include <png.h>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"

namespace tangere {
namespace {

/// Frees what libpng keeps of an image.
struct PngImage {
  png_image image{};
  PngImage() { image.version = PNG_IMAGE_VERSION; }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
  ~PngImage() { png_image_free(&image); }
};

}  // namespace

Photograph parse_png(const std::string& bytes, const std::string& name) {
  PngImage png;
  const auto fail = [&](const std::string& what) {
    throw InputError(fmt::format("{}: {}; expected a picture as PNG", name, what));
  };
  if (png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size()) == 0)
    fail(png.image.message);
  if (png.image.width > kLargestPhotograph || png.image.height > kLargestPhotograph)
    fail(fmt::format("{} x {} pixels, more than {} along a side", png.image.width, png.image.height,
                     kLargestPhotograph));
  if ((png.image.format & PNG_FORMAT_FLAG_ALPHA) != 0)
    fail("it has transparency, which no photograph has");
  png.image.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  png.image.format = PNG_FORMAT_RGB;
  Photograph photograph{static_cast<int>(png.image.height), static_cast<int>(png.image.width), {}};
  photograph.levels.resize(PNG_IMAGE_SIZE(png.image));
  if (png_image_finish_read(&png.image, nullptr, photograph.levels.data(), 0, nullptr) == 0)
    fail(png.image.message);
  return photograph;
}

Photograph read_png(const std::string& path) {
  constexpr std::size_t kMostBytes = std::size_t{256} << 20;
  return parse_png(read_text_file(path, kMostBytes, "a picture as PNG"), path);
}

std::string png_bytes(const Photograph& photograph) {
  PngImage png;
  png.image.width = static_cast<png_uint_32>(photograph.cols);
  png.image.height = static_cast<png_uint_32>(photograph.rows);
  png.image.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png.image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png.image, bytes.data(), &size, 0, photograph.levels.data(), 0,
                                nullptr) == 0)
    throw IoError(std::string("a picture as PNG: ") + png.image.message);
  bytes.resize(size);
  return bytes;
}

}  // namespace tangere
