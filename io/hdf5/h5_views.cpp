// SPDX-License-Identifier: Apache-2.0
// Writes a list of (file, dataset, selection in it, selection in the view), and its checksum.
#include "io/hdf5/h5_views.hpp"

#include <stdexcept>

#include "io/hdf5/h5_objects.hpp"

namespace tangere::h5 {
namespace {

constexpr std::uint32_t kSelectionVersion = 1;

/// Selects a whole dataset of any size.
void add_whole(Bytes& out) {
  constexpr std::uint32_t kAll = 3;
  out.number(kAll);
  out.number(kSelectionVersion);
  out.zeros(8);
}

/// Selects rows in the first dimension and everything in the others.
void add_rows(Bytes& out, std::uint64_t first, std::uint64_t rows,
              const std::vector<std::uint64_t>& dims) {
  constexpr std::uint32_t kBoxes = 2, kOne = 1;
  const std::size_t rank = dims.size();
  out.number(kBoxes);
  out.number(kSelectionVersion);
  out.zeros(4);
  out.number(static_cast<std::uint32_t>(4 + 4 + 2 * 4 * rank));  // number of bytes that follow
  out.number(static_cast<std::uint32_t>(rank));
  out.number(kOne);
  out.number(static_cast<std::uint32_t>(first));
  out.zeros(4 * (rank - 1));
  out.number(static_cast<std::uint32_t>(first + rows - 1));  // the last row, not the one behind it
  for (std::size_t k = 1; k < rank; ++k) out.number(static_cast<std::uint32_t>(dims[k] - 1));
}

}  // namespace

std::string view_source(std::string_view name) {
  std::string escaped;
  for (const char c : name) escaped.append(c == '%' ? 2 : 1, c);
  return escaped;
}

std::string shown_rows(std::span<const ShownRows> parts, const std::vector<std::uint64_t>& dims) {
  constexpr std::uint8_t kVersion = 0;
  for (const std::uint64_t n : dims)
    if (n == 0 || n > UINT32_MAX)
      throw std::logic_error("a virtual dataset of a size that its file cannot say");
  Bytes out;
  out.number(kVersion);
  out.number<std::uint64_t>(parts.size());
  std::uint64_t row = 0;
  for (const ShownRows& part : parts) {
    for (const std::string_view text : {part.file, part.path}) {
      out.text(view_source(text));
      out.zeros(1);
    }
    if (part.first == 0 && part.rows == part.of)
      add_whole(out);
    else
      add_rows(out, part.first, part.rows, dims);
    add_rows(out, row, part.rows, dims);
    row += part.rows;
  }
  out.number(object_checksum(out.all()));
  return {reinterpret_cast<const char*>(out.all().data()), out.size()};
}

}  // namespace tangere::h5
