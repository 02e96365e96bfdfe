// SPDX-License-Identifier: Apache-2.0
// The HDF5 library does not check the insides of a file: a damaged heap or tree can crash it.
// Commands that read files run in a child process, so that a crash becomes a message too.
#pragma once

#include <functional>

namespace tangere::apps {

/// Runs `command` in a child process and returns what it returns; it has to report its own errors.
/// SIGINT and SIGTERM reach the child; where it does not answer them itself, the result is
/// kInterrupted or kTerminated. Throws IoError that names the file and the object that were being
/// read when a crash ends the child; where nothing was being read, ends as the child did.
int run_in_child(const std::function<int()>& command);

}  // namespace tangere::apps
