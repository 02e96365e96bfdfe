// SPDX-License-Identifier: Apache-2.0
// How failures of the library are reported: the operation, the object, its file and the reason.
#pragma once

#include <string>
#include <string_view>

#include "io/hdf5/h5_id.hpp"

namespace tangere::h5 {

/// Text of the library's error stack, innermost cause first; the operating system's message if any.
std::string last_reason();
/// Names of an object and of its file; "" where it has none.
std::string object_name(hid_t object);
std::string file_name(hid_t object);

/// Throws IoError. `reason` is our own text for failures that the library does not explain.
[[noreturn]] void fail(std::string_view operation, const Id& object, std::string_view child = {},
                       std::string reason = {});

/// Throws if the disk refused an earlier write: the library buffers bytes, and its driver hides
/// failures from it.
void check_written(const Id& object);

}  // namespace tangere::h5
