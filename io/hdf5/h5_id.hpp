// SPDX-License-Identifier: Apache-2.0
// Identifiers of the library that close themselves, and its silence.
#pragma once

#include <hdf5.h>

namespace tangere::h5 {

/// An identifier of the library (file, group, dataset, attribute, type …). The destructor closes
/// it.
class Id {
 public:
  Id() = default;
  explicit Id(hid_t id) : id_(id) {}
  Id(Id&& other) noexcept : id_(other.id_) { other.id_ = -1; }
  Id& operator=(Id&& other) noexcept {
    if (this != &other) {
      reset();
      id_ = other.id_;
      other.id_ = -1;
    }
    return *this;
  }
  ~Id() { reset(); }

  [[nodiscard]] hid_t get() const { return id_; }
  /// Closes without a report. close_file reports what could not be written.
  void reset() noexcept;
  /// Releases an identifier that was closed elsewhere.
  void release() noexcept { id_ = -1; }

 private:
  hid_t id_ = -1;
};

/// RAII: suppresses the library's error output.
class Quiet {
 public:
  Quiet();
  ~Quiet();
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

}  // namespace tangere::h5
