// SPDX-License-Identifier: Apache-2.0
// How the library reaches a file that is being written. Its own driver reports a failed write to
// the library, which then can neither close the file nor forget it, and crashes on the second try.
// This one keeps the first failure to itself, tells the library that all went well, and answers
// when it is asked: a file is closed in the ordinary way, and then thrown away.
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
  [[noreturn]] void tell(const std::string& doing) const;
};

/// Makes `access` open files with this driver, which adds all that it writes to `written` and
/// compares what it reads with it; null: with nothing. Throws IoError when the library refuses it.
void use_checked_driver(hid_t access, WrittenBytes* written);

/// While this lives, numbers that are written are those of an object, or of one in a group: so they
/// are called in messages.
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

/// Whether any file of this process had a failure. Costs nothing to ask.
bool any_write_failure() noexcept;

}  // namespace tangere::h5
