// SPDX-License-Identifier: Apache-2.0
// Tables of numbers that people write with a spreadsheet, a script or by hand: controls, one row
// per step.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace tangere {

/// Reads comma-separated finite numbers, `columns` in every row. Lines that start with `#` and
/// empty lines are skipped; the first row may be a header: words, as many as there are columns.
/// Where `names` are given, a header that puts one of them over another column than its own is an
/// error, because the numbers would drive the wrong joint. Throws IoError when the file cannot be
/// read, InputError ("file:line: …") for any other mistake in it, including a table without rows.
std::vector<std::vector<double>> read_csv(const std::string& path, std::size_t columns,
                                          std::span<const std::string> names = {});

}  // namespace tangere
