// SPDX-License-Identifier: Apache-2.0
// Whether files of data sets and of exports are whole.
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "io/dataset/dataset_files.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/export/exported_set.hpp"
#include "io/hdf5/h5_lz4.hpp"
#include "python/module/module.hpp"

namespace tangere::python {

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace {

/// Keeps the GIL: h5py may share the library for HDF5 (episode_writer.cpp).
void check_file(const std::filesystem::path& path) { check_shard(path.string()); }

void check_stored_mask(const std::filesystem::path& path, const std::string& name) {
  check_mask_of(path.string(), name);
}

void check_set(const std::filesystem::path& path) { check_complete(find_dataset(path.string())); }

std::uintptr_t filter_address() { return reinterpret_cast<std::uintptr_t>(h5::lz4_filter()); }

void check_export(const std::filesystem::path& path) { find_export(path.string()); }

}  // namespace

void add_data_files(nb::module_& m) {
  m.def("check_shard", check_file, "path"_a,
        "Reads a file of a data set whole. IoError: it cannot be read, or its numbers or its\n"
        "description do not have the checksums that it stores; the message names both.");
  m.def("check_mask", check_stored_mask, "path"_a, "name"_a,
        "IoError: the names in a mask of a merged file do not have the checksum that it stores.");
  m.def("check_dataset", check_set, "path"_a,
        "Compares the shards of a folder with each other. IoError: one is missing, belongs to\n"
        "another run, or holds other episodes than its number says.");
  m.def("lz4_filter", filter_address,
        "The address of HDF5's filter 32004, which unpacks LZ4, as h5py.h5z.register_filter() "
        "takes it.");
  m.def("check_export", check_export, "path"_a,
        "Compares counts and sizes of the files of an export. IoError: one is missing or differs.");
}

}  // namespace tangere::python
