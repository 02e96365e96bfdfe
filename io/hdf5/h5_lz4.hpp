// SPDX-License-Identifier: Apache-2.0
// Reads chunks that were compressed with LZ4, a filter that HDF5 itself does not have.
#pragma once

namespace tangere::h5 {

/// From this call on the program can read such chunks. Thread-safe.
void allow_lz4();

}  // namespace tangere::h5
