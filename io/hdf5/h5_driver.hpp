// SPDX-License-Identifier: Apache-2.0
// File driver of the library for files being written. With the library's own driver, a failed write
// leaves a file that can neither be closed nor released, and a second attempt crashes. This driver
// stores the first failure, reports success to the library, and returns the failure on request, so
// the file is closed normally and then discarded.
#pragma once

#include <hdf5.h>

#include <memory>
#include <string>

#include "io/files/written_bytes.hpp"

namespace tangere::h5 {

/// The first failure on one file.
struct WriteFailure {
  int error = 0;       ///< of the operating system (errno); 0: none so far
  std::string damage;  ///< what the file has in place of what was written; empty: nothing
  [[nodiscard]] bool any() const { return error != 0; }
  /// Throws IoError with the reason, or std::bad_alloc where memory ran out. `doing`: "cannot write
  /// 'run.h5'".
  [[noreturn]] void raise(const std::string& doing) const;
};

/// Makes `access` open files with this driver, which adds all that it writes to `written` and
/// compares what it reads with it; null: with nothing. Throws IoError when the library refuses it.
void use_checked_driver(hid_t access, WrittenBytes* written);

/// RAII label: names the dataset, or the group that contains it, in errors of writes made in this
/// scope.
class NumbersOf {
 public:
  explicit NumbersOf(hid_t object, const char* child = nullptr) noexcept;
  ~NumbersOf();
  NumbersOf(const NumbersOf&) = delete;
  NumbersOf& operator=(const NumbersOf&) = delete;
};

/// Why the last file that this thread could not open was not opened (errno); 0 if that is unknown.
int last_open_error() noexcept;

/// The failures of an open file; null when another driver opened it.
std::shared_ptr<const WriteFailure> write_failure(hid_t file);

/// Whether a write to any file of this process has failed. Reads one flag.
bool any_write_failure() noexcept;

}  // namespace tangere::h5
