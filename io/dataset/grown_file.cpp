// SPDX-License-Identifier: Apache-2.0
// The library finds appended bytes because this code updates the end of the file in its header.
#include "io/dataset/grown_file.hpp"

namespace tangere {
namespace {

constexpr hsize_t kDescriptionBlock = hsize_t{1} << 16;

}  // namespace

GrownFile::GrownFile(const std::string& path, bool overwrite, bool views)
    : part_(path, overwrite),
      placed_(part_),
      file_(h5::create_file(part_.path(), part_.written(), kDescriptionBlock, views)) {}

void GrownFile::close() {
  h5::close_file(file_, part_.path());
  here_ = h5::aligned(part_.size());
}

void GrownFile::append(const h5::Bytes& bytes, const BytesOf& what) {
  placed_.add(here_, bytes.all(), what);
  placed_.flush();
  here_ = h5::aligned(here_ + bytes.size());
}

std::uint64_t GrownFile::append_group(std::string_view prefix, std::vector<h5::FileMember> members,
                                      bool root) {
  constexpr BytesOf kNames{"names of episodes"};
  h5::Bytes out;
  const std::uint64_t group =
      h5::add_large_group(out, here_, prefix, std::move(members), root,
                          [&](const h5::Bytes& bytes) { append(bytes, kNames); });
  append(out, kNames);
  return group;
}

void GrownFile::open(std::uint64_t root) {
  placed_.end_at(here_, root);
  file_ = h5::change_file(part_.path(), part_.written());
}

std::uint64_t GrownFile::commit(const std::function<void(const std::string&)>& last) {
  h5::close_file(file_, part_.path());
  part_.compare();
  if (last) last(part_.path());
  const std::uint64_t bytes = part_.size();
  part_.commit();
  return bytes;
}

}  // namespace tangere
