// SPDX-License-Identifier: Apache-2.0
// Everything is created before the first step, so that a run cannot fail late for a reason known
// early.
#include "io/trajectory/trajectory_file.hpp"

#include <fmt/format.h>

#include <deque>
#include <set>

#include "engine/base/error.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5_channels.hpp"

namespace tangere {
namespace {

constexpr std::int64_t kFormatVersion = 5;

void check_names(const Recording& recording) {
  std::set<std::string> names;
  const auto add = [&](const std::string& name) {
    if (!names.insert(name).second)
      throw InputError(fmt::format("two channels named '{}'; expected different names", name));
  };
  for (const Channel& channel : recording.channels) add(channel.name);
  for (const Table& table : recording.tables) add(table.channel.name);
}

}  // namespace

std::uint64_t recorded_bytes(const Recording& recording, bool with_compressed) {
  std::int64_t sum = 0;
  bool overflow = false;
  for (const Channel& channel : recording.channels) {
    if (channel.rows < 0)
      throw InputError(
          fmt::format("{} rows of {}; expected 0 or more", channel.rows, channel.name));
    if (channel.storage != Channel::Storage::plain && !with_compressed) continue;
    std::int64_t bytes = channel.rows;
    overflow |= __builtin_mul_overflow(bytes, h5::bytes_of(channel.type), &bytes);
    for (const std::uint64_t n : channel.shape)
      overflow |= __builtin_mul_overflow(bytes, n, &bytes);
    overflow |= __builtin_add_overflow(sum, bytes, &sum);
  }
  if (overflow) throw InputError("the run needs more than 2^63 bytes");
  return static_cast<std::uint64_t>(sum);
}

struct TrajectoryFile::Impl {
  std::vector<Channel> channels;
  PartFile part;
  h5::Id file;
  std::deque<h5::ChannelWriter> writers;  // parallel to the channels

  Impl(const std::string& output, const Recording& recording, bool overwrite)
      : channels((check_names(recording), recorded_bytes(recording), recording.channels)),
        part(output, overwrite) {
    const std::uint64_t needed = recorded_bytes(recording, false), available = part.free_bytes();
    if (needed > available)
      throw IoError(fmt::format("{}: needs at least {} bytes and the disk has {} free", output,
                                needed, available));
    file = h5::create_file(part.path(), part.written());
    h5::write_attribute(file, "format", "tangere trajectory");
    h5::write_scalar<std::int64_t>(file, "format_version", kFormatVersion);
    h5::write_attributes(file, recording.facts);
    for (const Channel& channel : channels) writers.emplace_back(file, channel);
    add(recording);
  }

  void add(const Recording& recording) {
    for (const auto& [name, attributes] : recording.groups)
      h5::write_attributes(h5::group_at(file, name), attributes);
    for (const Table& table : recording.tables) h5::write_table(file, table);
  }
};

TrajectoryFile::TrajectoryFile(const std::string& output, const Recording& recording,
                               bool overwrite)
    : impl_(std::make_unique<Impl>(output, recording, overwrite)) {}
TrajectoryFile::~TrajectoryFile() = default;

void TrajectoryFile::write(std::int64_t /*step*/, std::size_t channel, const Numbers& numbers) {
  impl_->writers.at(channel).write(numbers);
}

void TrajectoryFile::add(const Recording& recording) { impl_->add(recording); }

void TrajectoryFile::commit() {
  Impl& f = *impl_;
  for (std::size_t k = 0; k < f.channels.size(); ++k)
    if (f.writers[k].rows() != f.channels[k].rows)
      throw IoError(fmt::format("{}: {} rows of {} of '{}' were written; the file is incomplete",
                                f.part.output(), f.writers[k].rows(), f.channels[k].rows,
                                f.channels[k].name));
  f.writers.clear();
  h5::close_file(f.file, f.part.path());
  f.part.commit();
}

}  // namespace tangere
