// SPDX-License-Identifier: Apache-2.0
// Makes external links and virtual datasets, and copies groups.
#include "io/hdf5/h5_links.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "engine/base/error.hpp"
#include "io/hdf5/h5_driver.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "io/hdf5/h5_views.hpp"
#include "io/hdf5/reading_note.hpp"

namespace tangere::h5 {
namespace {

void check(bool done, const char* operation, const std::string& name) {
  if (!done) throw IoError(fmt::format("cannot {} '{}': HDF5 refuses it", operation, name));
}

/// Copies attributes one by one: H5Ocopy of HDF5 1.10.8 ends in a segmentation fault if an object
/// has many attributes with text.
void copy_attributes(const Id& from, const Id& to) {
  for (const std::string& name : attribute_names(from)) {
    const Quiet quiet;
    const Id attribute(H5Aopen(from.get(), name.c_str(), H5P_DEFAULT)),
        type(H5Aget_type(attribute.get()));
    const Id space(H5Aget_space(attribute.get()));
    const auto elements = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.get()));
    std::vector<char> bytes(elements * H5Tget_size(type.get()));
    const Id made(
        H5Acreate2(to.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT));
    const bool any = !bytes.empty();
    const bool read = !any || H5Aread(attribute.get(), type.get(), bytes.data()) >= 0;
    const bool written = read && (!any || H5Awrite(made.get(), type.get(), bytes.data()) >= 0);
    // Frees texts that the library allocated, if there are any.
    if (read && any) H5Dvlen_reclaim(type.get(), space.get(), H5P_DEFAULT, bytes.data());
    check(written, "copy attribute", name);
  }
}

}  // namespace

void link_external(const Id& group, const std::string& name, const std::string& file,
                   const std::string& path) {
  const Quiet quiet;
  check(H5Lcreate_external(file.c_str(), path.c_str(), group.get(), name.c_str(), H5P_DEFAULT,
                           H5P_DEFAULT) >= 0,
        "link", name);
}

void link_again(const Id& group, const std::string& name, const std::string& as) {
  const Quiet quiet;
  if (H5Lcreate_hard(group.get(), name.c_str(), group.get(), as.c_str(), H5P_DEFAULT, H5P_DEFAULT) <
      0)
    fail("link again", group, name);
}

void copy_group(const Id& from, const std::string& name, const Id& to, const std::string& as) {
  const Id source = open_group(from, name), copy = create_group(to, as);
  copy_attributes(source, copy);
  for (const std::string& child : link_names(source)) {
    if (!is_dataset(source, child)) {
      copy_group(source, child, copy, child);
      continue;
    }
    const Quiet quiet;
    const NumbersOf numbers(copy.get(), child.c_str());
    const LongCall copies_numbers;
    check(H5Ocopy(source.get(), child.c_str(), copy.get(), child.c_str(), H5P_DEFAULT,
                  H5P_DEFAULT) >= 0,
          "copy", child);
  }
}

void create_virtual(const Id& group, const std::string& name, const Id& like, const Source& first,
                    const Source& last, hsize_t skipped) {
  const Quiet quiet;
  const Dims source = dimensions(like), start(source.size(), 0);
  const auto rows = [&](hsize_t count) {
    Dims dims = source;
    dims[0] = count;
    return dims;
  };
  const auto space_of = [](const Dims& dims) {
    return Id(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
  };
  const auto select = [&](const Id& space, hsize_t from, hsize_t count) {
    Dims at = start;
    at[0] = from;
    H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, at.data(), nullptr, rows(count).data(),
                        nullptr);
  };
  const hsize_t kept = source[0] - skipped;
  const Id space = space_of(rows(kept + 1)), from_first = space_of(source),
           from_last = space_of(rows(1));
  const Id type(H5Dget_type(like.get())), creation(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  H5Pset_fill_value(creation.get(), H5T_NATIVE_DOUBLE, &nothing);
  const auto map = [&](const Source& from, const Id& selected) {
    const std::string file = view_source(from.file), path = view_source(from.path);
    check(H5Pset_virtual(creation.get(), space.get(), file.c_str(), path.c_str(), selected.get()) >=
              0,
          "map", name);
  };
  if (kept > 0) {
    if (skipped > 0) select(from_first, skipped, kept);
    select(space, 0, kept);
    map(first, from_first);
  }
  select(space, kept, 1);
  map(last, from_last);
  const Id dataset(H5Dcreate2(group.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT,
                              creation.get(), H5P_DEFAULT));
  check(dataset.get() >= 0, "create dataset", name);
}

void write_names(const Id& group, const std::string& name, const std::string& prefix,
                 const std::vector<std::int64_t>& numbers) {
  const Quiet quiet;
  const std::int64_t largest =
      numbers.empty() ? 0 : *std::max_element(numbers.begin(), numbers.end());
  const std::size_t longest = prefix.size() + std::to_string(largest).size();
  std::string bytes;
  bytes.reserve(longest * numbers.size());
  for (const std::int64_t number : numbers) {
    const std::string text = prefix + std::to_string(number);
    bytes += text;
    bytes.append(longest - text.size(), '\0');
  }
  const Id type(H5Tcopy(H5T_C_S1));
  H5Tset_size(type.get(), longest);
  H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  const hsize_t count = numbers.size();
  const Id space(H5Screate_simple(1, &count, nullptr)), creation(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  const Id dataset(H5Dcreate2(group.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT,
                              creation.get(), H5P_DEFAULT));
  check(dataset.get() >= 0, "create dataset", name);
  const NumbersOf written(dataset.get());
  if (count > 0)
    check(H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) >= 0,
          "write", name);
}

}  // namespace tangere::h5
