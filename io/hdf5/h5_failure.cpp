// SPDX-License-Identifier: Apache-2.0
// The library's return codes become IoError here and nowhere else.
#include "io/hdf5/h5_failure.hpp"

#include <fmt/format.h>

#include <memory>

#include "engine/base/error.hpp"
#include "io/hdf5/h5_driver.hpp"

namespace tangere::h5 {

std::string last_reason() {
  std::string text;
  const auto keep_innermost = [](unsigned, const H5E_error2_t* entry, void* into) -> herr_t {
    auto& reason = *static_cast<std::string*>(into);
    if (reason.empty() && entry->desc != nullptr) reason = entry->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_innermost, &text);
  constexpr std::string_view kMark = "error message = '";
  if (const auto start = text.find(kMark); start != std::string::npos) {
    const auto begin = start + kMark.size();
    return text.substr(begin, text.find('\'', begin) - begin);
  }
  return text.empty() ? "HDF5 gives no reason" : text;
}

std::string object_name(hid_t object) {
  const ssize_t size = H5Iget_name(object, nullptr, 0);
  if (size <= 0) return {};
  std::string name(static_cast<std::size_t>(size) + 1, '\0');
  H5Iget_name(object, name.data(), name.size());
  name.resize(static_cast<std::size_t>(size));
  return name;
}

std::string file_name(hid_t object) {
  const ssize_t size = H5Fget_name(object, nullptr, 0);
  if (size <= 0) return {};
  std::string name(static_cast<std::size_t>(size) + 1, '\0');
  H5Fget_name(object, name.data(), name.size());
  name.resize(static_cast<std::size_t>(size));
  return name;
}

void fail(std::string_view operation, const Id& object, std::string_view child,
          std::string reason) {
  if (reason.empty()) reason = last_reason();  // before any other call of the library clears it
  std::shared_ptr<const WriteFailure> failure;
  if (any_write_failure()) {  // then what the library says is only a consequence
    const Id file(H5Iget_file_id(object.get()));
    failure = write_failure(file.get());
  }
  std::string where = object_name(object.get());
  if (!child.empty()) {
    if (!where.ends_with('/')) where += '/';
    where += child;
  }
  const std::string doing =
      fmt::format("cannot {} '{}' in '{}'", operation, where, file_name(object.get()));
  if (failure != nullptr && failure->any()) failure->raise(doing);
  throw IoError(fmt::format("{}: {}", doing, reason));
}

void check_written(const Id& object) {
  if (!any_write_failure()) return;
  const Id file(H5Iget_file_id(object.get()));
  if (const auto failure = write_failure(file.get()); failure != nullptr && failure->any())
    fail("write", object, {}, "the disk refused it");
}

}  // namespace tangere::h5
