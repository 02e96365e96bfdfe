// SPDX-License-Identifier: Apache-2.0
// Files of data sets as older versions of the program wrote them.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <string>

namespace tangere::testing {

/// Changes a file to one of a `format_version` before labels had a checksum.
inline void make_older(const std::string& path, std::int64_t version) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT),
              attribute = H5Aopen(file, "format_version", H5P_DEFAULT);
  H5Awrite(attribute, H5T_NATIVE_INT64, &version);
  H5Aclose(attribute);
  for (const char* const name : {"label_sum", "description_sum"})
    if (H5Aexists(file, name) > 0) H5Adelete(file, name);
  H5Fclose(file);
}

}  // namespace tangere::testing
