// SPDX-License-Identifier: Apache-2.0
// Iterates by name, so that files with the same content give the same list.
#include "io/hdf5/h5_listing.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "engine/base/error.hpp"

namespace tangere::h5 {
namespace {

template <class T>
std::string numbers_as_text(const Id& object, const std::string& name) {
  return fmt::format("{}", fmt::join(read_numbers<T>(object, name), ", "));
}

}  // namespace

std::vector<std::string> link_names(const Id& group) {
  const Quiet quiet;
  std::vector<std::string> names;
  const auto add = [](hid_t, const char* name, const H5L_info_t*, void* into) -> herr_t {
    static_cast<std::vector<std::string>*>(into)->emplace_back(name);
    return 0;
  };
  hsize_t at = 0;
  if (H5Literate(group.get(), H5_INDEX_NAME, H5_ITER_INC, &at, add, &names) < 0)
    throw IoError(fmt::format("cannot list {}: HDF5 finds its links damaged", place_of(group)));
  return names;
}

std::size_t link_count(const Id& group) {
  const Quiet quiet;
  H5G_info_t info;
  if (H5Gget_info(group.get(), &info) < 0)
    throw IoError(
        fmt::format("cannot count the links of {}: HDF5 finds them damaged", place_of(group)));
  return info.nlinks;
}

std::vector<std::string> attribute_names(const Id& object) {
  const Quiet quiet;
  std::vector<std::string> names;
  const auto add = [](hid_t, const char* name, const H5A_info_t*, void* into) -> herr_t {
    static_cast<std::vector<std::string>*>(into)->emplace_back(name);
    return 0;
  };
  hsize_t at = 0;
  if (H5Aiterate2(object.get(), H5_INDEX_NAME, H5_ITER_INC, &at, add, &names) < 0)
    throw IoError(
        fmt::format("cannot list attributes of {}: HDF5 finds them damaged", place_of(object)));
  return names;
}

std::string attribute_text(const Id& object, const std::string& name) {
  H5T_class_t kind = H5T_NO_CLASS;
  H5T_sign_t sign = H5T_SGN_2;
  {
    const Quiet quiet;
    const Id attribute(H5Aopen(object.get(), name.c_str(), H5P_DEFAULT));
    const Id type(H5Aget_type(attribute.get()));
    kind = H5Tget_class(type.get());
    if (kind == H5T_INTEGER) sign = H5Tget_sign(type.get());
  }
  if (kind == H5T_STRING) return fmt::format("{}", fmt::join(read_texts(object, name), ", "));
  if (kind == H5T_FLOAT) return numbers_as_text<double>(object, name);
  if (kind == H5T_INTEGER && sign == H5T_SGN_NONE)
    return numbers_as_text<std::uint64_t>(object, name);
  if (kind == H5T_INTEGER) return numbers_as_text<std::int64_t>(object, name);
  throw IoError(
      fmt::format("attribute '{}' of {} is neither text nor numbers", name, place_of(object)));
}

std::string type_text(const Id& dataset) {
  const Id type(H5Dget_type(dataset.get()));
  const std::size_t bytes = H5Tget_size(type.get());
  switch (H5Tget_class(type.get())) {
    case H5T_ENUM: return "bool";
    case H5T_STRING: return fmt::format("files of up to {} bytes", bytes);
    case H5T_FLOAT: return fmt::format("float{}", 8 * bytes);
    default:
      return fmt::format("{}int{}", H5Tget_sign(type.get()) == H5T_SGN_NONE ? "u" : "", 8 * bytes);
  }
}

bool is_dataset(const Id& parent, const std::string& name) {
  const Quiet quiet;
  const Id object(H5Oopen(parent.get(), name.c_str(), link_access(H5P_LINK_ACCESS)));
  return object.get() >= 0 && H5Iget_type(object.get()) == H5I_DATASET;
}

}  // namespace tangere::h5
