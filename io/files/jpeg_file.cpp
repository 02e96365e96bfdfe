// SPDX-License-Identifier: Apache-2.0
// The library reports errors by a function that must not return. It jumps back to where the call
// began; nothing between has a destructor.
#include "io/files/jpeg_file.hpp"

#include <fmt/format.h>

// jpeglib.h needs what these declare.
#include <csetjmp>
#include <cstdio>
#include <cstdlib>

#include <jpeglib.h>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

/// Where errors go, and what was wrong.
struct JpegErrors {
  jpeg_error_mgr base;  // first: the library's pointer to it is one to this
  std::jmp_buf back;
  char text[JMSG_LENGTH_MAX];
};

void jump_back(j_common_ptr library) {
  auto* const errors = reinterpret_cast<JpegErrors*>(library->err);
  library->err->format_message(library, errors->text);
  std::longjmp(errors->back, 1);
}
void keep_warning(j_common_ptr library, int level) {
  if (level < 0) jump_back(library);  // damaged data
}
void say_nothing(j_common_ptr) {}

void prepare(JpegErrors& errors) {
  jpeg_std_error(&errors.base);
  errors.base.error_exit = jump_back;
  errors.base.emit_message = keep_warning;
  errors.base.output_message = say_nothing;
}

/// Returns whether the bytes were made. `size` and `bytes`: of the file, to be freed.
bool compress(JpegErrors& errors, int rows, int cols, const std::uint8_t* levels, int quality,
              unsigned char** bytes, unsigned long* size) {
  jpeg_compress_struct jpeg{};
  jpeg.err = &errors.base;
  if (setjmp(errors.back) != 0) {
    jpeg_destroy_compress(&jpeg);
    return false;
  }
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, bytes, size);
  jpeg.image_width = static_cast<JDIMENSION>(cols);
  jpeg.image_height = static_cast<JDIMENSION>(rows);
  jpeg.input_components = 3;
  jpeg.in_color_space = JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, quality, TRUE);
  jpeg.dct_method = JDCT_ISLOW;  // the same bits with and without SIMD
  jpeg_start_compress(&jpeg, TRUE);
  while (jpeg.next_scanline < jpeg.image_height) {
    auto* row = const_cast<JSAMPROW>(levels + std::size_t{3} * jpeg.next_scanline * cols);
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  return true;
}

/// Reads the size, and the picture where `levels` has room for it.
bool decompress(JpegErrors& errors, std::span<const char> bytes, int& rows, int& cols,
                std::uint8_t* levels) {
  jpeg_decompress_struct jpeg{};
  jpeg.err = &errors.base;
  if (setjmp(errors.back) != 0) {
    jpeg_destroy_decompress(&jpeg);
    return false;
  }
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  rows = static_cast<int>(jpeg.image_height), cols = static_cast<int>(jpeg.image_width);
  if (levels != nullptr) {
    jpeg.out_color_space = JCS_RGB;
    jpeg.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&jpeg);
    while (jpeg.output_scanline < jpeg.output_height) {
      JSAMPROW row = levels + std::size_t{3} * jpeg.output_scanline * jpeg.output_width;
      jpeg_read_scanlines(&jpeg, &row, 1);
    }
    jpeg_finish_decompress(&jpeg);
  }
  jpeg_destroy_decompress(&jpeg);
  return true;
}

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  throw InputError(fmt::format("{}: {}; expected a picture as JPEG", name, what));
}

}  // namespace

std::string jpeg_bytes(int rows, int cols, std::span<const std::uint8_t> levels, int quality) {
  JpegErrors errors{};
  prepare(errors);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const bool done = compress(errors, rows, cols, levels.data(), quality, &bytes, &size);
  std::string file;
  if (done) file.assign(reinterpret_cast<const char*>(bytes), size);
  std::free(bytes);
  if (!done) throw IoError(fmt::format("a picture as JPEG: {}", errors.text));
  return file;
}

JpegSize jpeg_size(std::span<const char> bytes, const std::string& name) {
  JpegErrors errors{};
  prepare(errors);
  JpegSize size;
  if (!decompress(errors, bytes, size.rows, size.cols, nullptr)) fail(name, errors.text);
  if (size.rows > kLargestPhotograph || size.cols > kLargestPhotograph)
    fail(name, fmt::format("{} x {} pixels; at most {} along a side", size.rows, size.cols,
                           kLargestPhotograph));
  return size;
}

Photograph parse_jpeg(std::span<const char> bytes, const std::string& name) {
  const JpegSize size = jpeg_size(bytes, name);
  Photograph photograph;
  photograph.levels.resize(std::size_t{3} * static_cast<std::size_t>(size.rows) *
                           static_cast<std::size_t>(size.cols));
  JpegErrors errors{};
  prepare(errors);
  if (!decompress(errors, bytes, photograph.rows, photograph.cols, photograph.levels.data()))
    fail(name, errors.text);
  return photograph;
}

}  // namespace tangere
