// SPDX-License-Identifier: Apache-2.0
// How the library reaches a file that is being written. Its own driver reports a failed write to
// the library, which then can neither close the file nor forget it, and crashes on the second try.
// This one keeps the first failure to itself, tells the library that all went well, and answers
// when it is asked: a file is closed in the ordinary way, and then thrown away.
#pragma once

#include <hdf5.h>

#include <memory>

namespace tangere::h5 {

/// The first failure of the operating system on one file. 0: none so far.
struct WriteFailure {
  int error = 0;  ///< errno
};

/// Makes `access` open files with this driver. Throws IoError when the library refuses it.
void use_checked_driver(hid_t access);

/// Why the last file that this thread could not open was not opened (errno); 0 if that is unknown.
int last_open_error() noexcept;

/// The failures of an open file; null when another driver opened it.
std::shared_ptr<const WriteFailure> write_failure(hid_t file);

/// Whether any file of this process had a failure. Costs nothing to ask.
bool any_write_failure() noexcept;

}  // namespace tangere::h5
