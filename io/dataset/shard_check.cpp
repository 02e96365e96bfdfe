// SPDX-License-Identifier: Apache-2.0
// Reads a shard through a fresh handle and compares its numbers with its metadata.
#include "io/dataset/shard_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <span>
#include <vector>

#include "engine/base/error.hpp"
#include "io/dataset/content_sum.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/dataset/label_sum.hpp"
#include "io/files/jpeg_file.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

constexpr std::size_t kReadBytes = std::size_t{4} << 20;

constexpr std::int64_t kMostLookups = 1'000'000;  // for episodes that a damaged file only claims
constexpr std::size_t kMostProblems = 100;        // of a shard; more lines would not help

class ShardChecker {
 public:
  ShardChecker(const std::string& path, bool finite)
      : finite_(finite), file_(h5::open_file(path)), scene_(h5::open_group(file_, "scene")) {}

  /// Checks the first and the last episode, except sums. Only counts the others.
  ShardReport sample() {
    if (!is_of_this_format() || !is_described()) return {content_, problems_};
    const h5::Id data = h5::open_group(file_, "data"), failed = h5::open_group(file_, "failed");
    for (const std::int64_t episode : {content_.first_episode, end_ - 1})
      add_episode(data, failed, episode);
    static_cast<void>(count_episodes(data, failed));
    return {content_, problems_};
  }

  ShardReport check() {
    const h5::Quiet quiet;  // once, not for each of a million calls
    summed_ = true;
    if (!is_of_this_format() || !is_described()) return {content_, problems_};
    const h5::Id data = h5::open_group(file_, "data"), failed = h5::open_group(file_, "failed");
    check_attributes(file_);
    check_attributes(data);
    if (end_ - content_.first_episode > kMostLookups && !count_episodes(data, failed))
      return {content_, problems_};
    for (std::int64_t episode = content_.first_episode; episode < end_; ++episode)
      add_episode(data, failed, episode);
    if (number(data, "total") != content_.rows)
      fail(fmt::format("/data counts {} rows; its demos have {}", number(data, "total"),
                       content_.rows));
    // Missing numbers and wrong counts are already reported and would change the sum as well.
    const std::uint64_t expected = h5::read_number<std::uint64_t>(file_, "content_sum");
    if (problems_.empty() && sum_.value() != expected)
      fail(fmt::format("the checksum of its numbers is {:016x}; expected {:016x}", sum_.value(),
                       expected));
    check_label_sum();
    check_description_sum();
    check_masks();
    problems_.insert(problems_.end(), not_finite_.begin(), not_finite_.end());
    return {content_, problems_};
  }

  ShardReport check_merged() {
    const h5::Quiet quiet;
    if (!is_of_this_format() || !is_described()) return {content_, problems_};
    const h5::Id data = h5::open_group(file_, "data"), failed = h5::open_group(file_, "failed");
    if (!count_episodes(data, failed)) return {content_, problems_};
    summed_ = true;
    for (std::int64_t episode = content_.first_episode; episode < end_; ++episode) {
      const std::string demo = fmt::format("demo_{}", episode);
      if (!h5::has_link(data, demo)) {
        try_failed(failed, episode);
        continue;
      }
      const h5::Id group = h5::open_group(data, demo);
      if (is_copied(group)) return labels_ = {}, content_ = {}, check();
      labels_.add_demo(episode, group);
    }
    check_label_sum();
    check_description_sum();
    check_masks();
    return {content_, problems_};
  }

 private:
  /// Whether numbers of a demo are in this file.
  static bool is_copied(const h5::Id& demo) {
    H5L_info_t link;
    return H5Lget_info(demo.get(), "actions", &link, H5P_DEFAULT) >= 0 &&
           link.type == H5L_TYPE_HARD;
  }
  [[nodiscard]] bool is_of_this_format() {
    if (h5::read_text(file_, "format") != kFormatName) {
      fail("it is not a tangere data set");
    } else if (const std::int64_t version = number(file_, "format_version");
               version < kWholeRowsFormat || version > kDatasetFormat) {
      fail(fmt::format("its format_version is {}; expected {} to {} (generate the data set again)",
                       version, kWholeRowsFormat, kDatasetFormat));
    } else {
      sum_ = ContentSum(version == kWholeRowsFormat);
      content_.has_label_sum = version > kUnlabelledFormat;
    }
    return problems_.empty();
  }
  /// Whether /scene and the root say what the episodes have.
  [[nodiscard]] bool is_described() {
    try {
      read_description();
    } catch (const IoError& error) {
      fail(error.what());
    }
    return problems_.empty();
  }
  void read_description() {
    content_.first_episode = within(file_, "first_episode", 0);
    end_ = content_.first_episode + within(file_, "episodes", 0);
    content_.steps = stored_steps(file_);
    names_ = h5::read_texts(scene_, "observations");
    touch_ = stored_touch(scene_);
    for (const std::string& name : touch_)
      if (std::count(touch_.begin(), touch_.end(), name) > 1 ||
          std::find(names_.begin(), names_.end(), name) == names_.end())
        throw IoError(fmt::format(
            "'touch' of /scene names '{}'; expected stored observations, each once", name));
    single_ = h5::read_text(scene_, "observation_type") == "float32";
    const std::int64_t steps = within(scene_, "steps", 1), every = within(scene_, "every", 1);
    if (steps < every)
      throw IoError(fmt::format("its episodes have {} steps and a row every {}; expected a row",
                                steps, every));
    rows_ = steps / every;
    is_task_ = !h5::read_text(scene_, "task").starts_with("none");
    if (is_task_) policies_ = std::ssize(h5::read_texts(scene_, "policies"));
    if (H5Aexists(scene_.get(), "picture_gain_names") > 0)
      gains_ = h5::read_texts(scene_, "picture_gain_names").size();
    gradients_ = stored_gradients(scene_);
    samples_ = stored_samples(scene_, every, rows_);
    windows_ = stored_windows(scene_, every);
  }
  /// Reads every attribute, also those that nothing else here needs.
  static void check_attributes(const h5::Id& object) {
    for (const std::string& name : h5::attribute_names(object))
      static_cast<void>(h5::attribute_text(object, name));
  }
  void check_label_sum() {
    if (!problems_.empty() || !content_.has_label_sum) return;
    try {
      if (content_.steps) labels_.add(*content_.steps);
      const auto expected = h5::read_number<std::uint64_t>(file_, "label_sum");
      if (labels_.value() != expected)
        fail(
            fmt::format("the checksum of its episodes' labels (return, success, randomized …) is "
                        "{:016x}; expected {:016x}",
                        labels_.value(), expected));
    } catch (const IoError& error) {
      fail(error.what());
    }
  }
  /// Of a merged file. A mask that a user has put there has no checksum.
  void check_masks() {
    if (!problems_.empty() || !h5::has_link(file_, "mask")) return;
    try {
      const h5::Id masks = h5::open_group(file_, "mask");
      for (const std::string& name : h5::link_names(masks))
        check_mask(h5::open_dataset(masks, name), name);
    } catch (const IoError& error) {
      fail(error.what());
    }
  }
  /// Files of older versions have no such sum.
  void check_description_sum() {
    if (!problems_.empty()) return;
    try {
      const std::uint64_t found = description_sum(file_);
      if (!content_.has_label_sum && H5Aexists(file_.get(), "description_sum") <= 0) return;
      const auto expected = h5::read_number<std::uint64_t>(file_, "description_sum");
      if (found != expected)
        fail(fmt::format("the checksum of its description is {:016x}; expected {:016x}", found,
                         expected));
    } catch (const IoError& error) {
      fail(error.what());
    }
  }
  /// Whether there are as many as stored in the file; bounds the loops over them.
  [[nodiscard]] bool count_episodes(const h5::Id& data, const h5::Id& failed) {
    const auto demos = static_cast<std::int64_t>(h5::link_count(data));
    const auto lost = static_cast<std::int64_t>(h5::link_count(failed));
    if (demos + lost == end_ - content_.first_episode) return true;
    fail(fmt::format("it has {} demos and {} failed episodes; expected {} together", demos, lost,
                     end_ - content_.first_episode));
    return false;
  }
  void add_episode(const h5::Id& data, const h5::Id& failed, std::int64_t episode) {
    const std::string demo = fmt::format("demo_{}", episode);
    const bool is_demo = h5::has_link(data, demo);
    if (is_demo == h5::has_link(failed, fmt::format("episode_{}", episode)))
      fail(fmt::format("episode {} is not in exactly one of /data and /failed", episode));
    if (is_demo)
      try_demo(data, demo, episode);
    else
      try_failed(failed, episode);
  }
  void try_failed(const h5::Id& failed, std::int64_t episode) {
    ++content_.failed;
    const std::string name = fmt::format("episode_{}", episode);
    if (!summed_ || !h5::has_link(failed, name)) return;
    try {
      labels_.add_failed(episode, h5::open_group(failed, name));
    } catch (const IoError& error) {
      fail(fmt::format("{}: {}", name, error.what()));
    }
  }
  void fail(const std::string& what) {
    if (problems_.size() < kMostProblems) problems_.push_back(what);
  }
  void try_demo(const h5::Id& data, const std::string& demo, std::int64_t episode) {
    try {
      const h5::Id group = h5::open_group(data, demo);
      check_attributes(group);
      if (summed_) labels_.add_demo(episode, group);
      add_demo(group, episode);
    } catch (const IoError& error) {
      fail(fmt::format("{}: {}", demo, error.what()));
    }
  }
  static std::int64_t number(const h5::Id& object, const std::string& name) {
    return h5::read_number<std::int64_t>(object, name);
  }

  /// A count that a file may claim: up to 2⁵³, so that sums of two cannot overflow.
  static std::int64_t within(const h5::Id& object, const char* name, std::int64_t least) {
    constexpr std::int64_t kMost = std::int64_t{1} << 53;
    const std::int64_t value = number(object, name);
    if (value < least || value > kMost)
      throw IoError(fmt::format("its '{}' is {}; expected {} to {}", name, value, least, kMost));
    return value;
  }

  void add_demo(const h5::Id& demo, std::int64_t episode) {
    const std::int64_t rows = number(demo, "num_samples");
    if (is_task_ ? rows < 1 || rows > rows_ : rows != rows_)
      return fail(fmt::format("demo_{} has {} rows, expected {}{}", episode, rows,
                              is_task_ ? "1 to " : "", rows_));
    if (const std::int64_t by = is_task_ ? number(demo, "policy") : 0;
        is_task_ && (by < 0 || by >= policies_))
      fail(fmt::format("demo_{}: its policy is {}; expected 0 to {}, one of 'policies' in /scene",
                       episode, by, policies_ - 1));
    if (const std::size_t gains = H5Aexists(demo.get(), "picture_gains") > 0
                                      ? h5::read_numbers<double>(demo, "picture_gains").size()
                                      : 0;
        gains != gains_)
      fail(fmt::format("demo_{}: it has {} 'picture_gains'; expected {}, those that /scene names",
                       episode, gains, gains_));
    // These values need no checksum: without a task every reward is 0, and only the last row ends
    // the episode.
    if (is_task_) {
      add<float>(h5::open_dataset(demo, "rewards"), "rewards", episode, names_.size() + 1, 0, rows);
    } else {
      check_list<float>(demo, "rewards", episode, rows, 0);
    }
    check_list<std::int8_t>(demo, "dones", episode, rows, 1);
    add<float>(h5::open_dataset(demo, "actions"), "actions", episode, 0, 0, rows);
    const h5::Id obs = h5::open_group(demo, "obs"), final_obs = h5::open_group(demo, "final_obs");
    touching_.assign(touch_.empty() ? 0 : static_cast<std::size_t>(rows), 0);
    for (std::size_t k = 0; k < names_.size(); ++k) {
      const bool touch = std::find(touch_.begin(), touch_.end(), names_[k]) != touch_.end();
      add_observation(obs, names_[k], episode, k + 1, 0, rows, touch);
      add_observation(final_obs, names_[k], episode, k + 1, rows, 1);
    }
    for (const StoredWindow& window : windows_) check_window(obs, window, episode);
    if (!touch_.empty())
      check_touching(demo, episode);
    else if (H5Aexists(demo.get(), "touching") > 0)
      fail(fmt::format("demo_{}: 'touching' is there; /scene names no touch", episode));
    for (std::size_t k = 0; k < gradients_.size(); ++k)
      add_gradient(demo, gradients_[k], episode, names_.size() + 2 + k, rows);
    for (std::size_t k = 0; k < samples_.size(); ++k)
      add_sample(h5::open_group(demo, "samples"), samples_[k], episode,
                 names_.size() + 2 + gradients_.size() + k);
    if (h5::has_link(demo, "next_obs"))
      for (const std::string& name : names_)
        if (const h5::Id dataset = h5::open_dataset(obs, name);
            !h5::has_files(dataset))  // no view shows those
          in_type_of(dataset,
                     [&](auto zero) { check_next<decltype(zero)>(demo, name, episode, rows); });
    content_.rows += rows;
    ++content_.demos;
  }

  void check_touching(const h5::Id& demo, std::int64_t episode) {
    const std::int64_t stored = number(demo, "touching"),
                       there = std::count(touching_.begin(), touching_.end(), 1);
    if (stored != there)
      fail(fmt::format("demo_{}: 'touching' is {}; something is felt in {} of its rows", episode,
                       stored, there));
  }

  void check_window(const h5::Id& obs, const StoredWindow& window, std::int64_t episode) {
    const h5::Dims dims = h5::dimensions(h5::open_dataset(obs, window.name));
    if (dims.size() < 2 || dims[1] != static_cast<hsize_t>(window.readings))
      fail(fmt::format("demo_{}: {} has no windows of {} readings, which /scene says", episode,
                       window.name, window.readings));
  }

  void add_sample(const h5::Id& samples, const StoredSample& stored, std::int64_t episode,
                  std::size_t index) {
    add_observation(samples, stored.name, episode, index, 0, stored.rows);
  }

  /// Adds a dataset whose row 0 is row `first` of the episode.
  void add_observation(const h5::Id& group, const std::string& name, std::int64_t episode,
                       std::size_t index, std::int64_t first, std::int64_t rows,
                       bool touch = false) {
    const h5::Id dataset = h5::open_dataset(group, name);
    if (h5::has_files(dataset)) return add_files(dataset, name, episode, index, first, rows);
    in_type_of(dataset, [&](auto zero) {
      add<decltype(zero)>(dataset, name, episode, index, first, rows, touch);
    });
  }

  /// The same of pictures in JPEG files, which must have one size.
  void add_files(const h5::Id& dataset, const std::string& name, std::int64_t episode,
                 std::size_t index, std::int64_t first, std::int64_t rows) {
    const std::string full = fmt::format("demo_{}: {}", episode, name);
    if (!has_rows(dataset, full, rows)) return;
    constexpr std::int64_t kTogether = 64;
    JpegSize size;
    for (std::int64_t row = 0; row < rows; row += kTogether)
      for (const std::string& file :
           h5::read_files(dataset, static_cast<hsize_t>(row),
                          static_cast<hsize_t>(std::min(kTogether, rows - row)))) {
        const std::int64_t at = first++;
        try {
          const JpegSize found = jpeg_size(file, fmt::format("row {}", at));
          if (size == JpegSize{}) size = found;
          if (found != size)
            return fail(fmt::format("{}: row {} has {} x {} pixels; expected {} x {}", full, at,
                                    found.rows, found.cols, size.rows, size.cols));
        } catch (const InputError& error) {
          return fail(fmt::format("{}: {}", full, error.what()));
        }
        if (!summed_) continue;
        RowSum bytes;
        bytes.add(0, {reinterpret_cast<const unsigned char*>(file.data()), file.size()});
        sum_.add(episode, index, at, file.size(), bytes);
      }
  }

  /// Calls body(T{}) with a number of an observation: a byte of a picture, the number of a body,
  /// or the type of the others.
  template <class Body>
  void in_type_of(const h5::Id& dataset, const Body& body) {
    const h5::Id type(H5Dget_type(dataset.get()));
    if (H5Tget_size(type.get()) == 1)
      body(std::uint8_t{});
    else if (H5Tget_size(type.get()) == 2)
      body(std::int16_t{});
    else
      single_ ? body(float{}) : body(double{});
  }

  void add_gradient(const h5::Id& demo, const StoredGradient& stored, std::int64_t episode,
                    std::size_t index, std::int64_t rows) {
    const h5::Id dataset = h5::open_dataset(demo, stored.name);
    if (h5::read_text(dataset, "meaning") != stored.meaning)
      fail(fmt::format("demo_{}: the meaning of {} differs from that in /scene", episode,
                       stored.name));
    const h5::Dims dims = h5::dimensions(dataset);
    if (dims.empty())
      return fail(fmt::format("demo_{}: {} is one number; expected a list", episode, stored.name));
    add<double>(dataset, stored.name, episode, index, 0,
                stored.per_row ? rows : static_cast<std::int64_t>(dims[0]));
  }

  /// A list of zeros whose last number is `last`.
  template <class T>
  void check_list(const h5::Id& demo, const std::string& name, std::int64_t episode,
                  std::int64_t rows, T last) {
    const h5::Id dataset = h5::open_dataset(demo, name);
    if (!has_rows(dataset, fmt::format("demo_{}: {}", episode, name), rows)) return;
    const auto step = static_cast<std::int64_t>(kReadBytes / sizeof(T));
    std::vector<T> list;
    for (std::int64_t row = 0; row < rows; row += step) {
      list.resize(static_cast<std::size_t>(std::min(step, rows - row)));
      h5::read_box(dataset, {static_cast<hsize_t>(row)}, {list.size()}, list.data());
      const bool ends = row + std::ssize(list) == rows;
      const auto zeros = list.end() - (ends ? 1 : 0);
      if (std::any_of(list.begin(), zeros, [](T x) { return x != T{0}; }) ||
          (ends && list.back() != last))
        return fail(fmt::format("demo_{}: {} are not what was written", episode, name));
    }
  }

  /// next_obs of merged files: obs from its second row on, then final_obs.
  template <class T>
  void check_next(const h5::Id& demo, const std::string& name, std::int64_t episode,
                  std::int64_t rows) {
    const h5::Id next = h5::open_dataset(demo, "next_obs/" + name),
                 obs = h5::open_dataset(demo, "obs/" + name),
                 last = h5::open_dataset(demo, "final_obs/" + name);
    const std::string full = fmt::format("demo_{}: next_obs/{}", episode, name);
    if (!has_rows(next, full, rows)) return;
    h5::Dims count = h5::dimensions(next);
    count[0] = 1;
    std::size_t width = 1;
    for (std::size_t i = 1; i < count.size(); ++i) width *= count[i];
    if (width == 0) return;
    const auto step =
        static_cast<std::int64_t>(std::max<std::size_t>(1, kReadBytes / (width * sizeof(T))));
    std::vector<T> shown, there;
    const auto read = [&](const h5::Id& dataset, std::int64_t first, std::int64_t taken,
                          std::vector<T>& into) {
      h5::Dims offset(count.size(), 0);
      offset[0] = static_cast<hsize_t>(first);
      count[0] = static_cast<hsize_t>(taken);
      into.resize(count[0] * width);
      h5::read_box(dataset, offset, count, into.data());
    };
    for (std::int64_t row = 0; row < rows;) {
      const bool at_last = row + 1 == rows;
      const std::int64_t taken = at_last ? 1 : std::min(step, rows - 1 - row);
      read(next, row, taken, shown);
      read(at_last ? last : obs, at_last ? 0 : row + 1, taken, there);
      if (std::memcmp(shown.data(), there.data(), shown.size() * sizeof(T)) != 0)
        return fail(fmt::format("{} is not obs one row later, in rows {} to {}", full, row,
                                row + taken - 1));
      row += taken;
    }
  }

  bool has_rows(const h5::Id& dataset, const std::string& name, std::int64_t rows) {
    const h5::Dims dims = h5::dimensions(dataset);
    const bool right = !dims.empty() && dims[0] == static_cast<hsize_t>(rows);
    if (!right) fail(fmt::format("{} does not have {} rows", name, rows));
    return right;
  }

  template <class T>
  void check_finite(std::span<const T> numbers, const std::string& name, std::int64_t first,
                    std::size_t width) {
    if (!std::is_floating_point_v<T> || !finite_ || not_finite_.size() >= kMostProblems) return;
    const auto bad =
        std::find_if(numbers.begin(), numbers.end(), [](T x) { return !std::isfinite(double(x)); });
    if (bad == numbers.end()) return;
    const auto at = static_cast<std::size_t>(bad - numbers.begin());
    not_finite_.push_back(fmt::format("{}: row {} has a number that is {}; expected finite numbers",
                                      name, first + static_cast<std::int64_t>(at / width), *bad));
  }

  /// Adds a dataset whose row 0 is row `first` of the episode. If it is `touch`, marks the rows
  /// that are not all zero.
  template <class T>
  void add(const h5::Id& dataset, const std::string& name, std::int64_t episode, std::size_t index,
           std::int64_t first, std::int64_t rows, bool touch = false) {
    const std::string full = fmt::format("demo_{}: {}", episode, name);
    if (!has_rows(dataset, full, rows)) return;
    h5::Dims count = h5::dimensions(dataset), offset(count.size(), 0);
    std::size_t width = 1;
    for (std::size_t i = 1; i < count.size(); ++i) width *= count[i];
    if (width == 0) return;
    const auto step =
        static_cast<std::int64_t>(std::max<std::size_t>(1, kReadBytes / (width * sizeof(T))));
    auto& buffer = std::get<std::vector<T>>(buffers_);
    for (std::int64_t row = 0; row < rows; row += step) {
      count[0] = static_cast<hsize_t>(std::min(step, rows - row));
      offset[0] = static_cast<hsize_t>(row);
      // It only grows: a vector writes zeros where it grows, and the next dataset has another size.
      buffer.resize(std::max<std::size_t>(buffer.size(), count[0] * width));
      const std::span<const T> numbers(buffer.data(), count[0] * width);
      h5::read_box(dataset, offset, count, buffer.data());
      check_finite(numbers, full, first + row, width);
      for (std::size_t i = 0; touch && i < count[0]; ++i)
        if (any_number(numbers.subspan(i * width, width)))
          touching_[static_cast<std::size_t>(row) + i] = 1;
      if (summed_)
        sum_.add(episode, index, first + row, static_cast<std::int64_t>(count[0]),
                 width * sizeof(T), buffer.data());
    }
  }

  bool finite_, summed_ = false;
  std::vector<std::string> problems_, not_finite_;
  h5::Id file_, scene_;
  std::vector<std::string> names_, touch_;  // of observations; of those that are touch
  std::vector<char> touching_;              // per row of the demo at hand
  std::size_t gains_ = 0;                   // of pictures, in a demo
  std::vector<StoredGradient> gradients_;
  std::vector<StoredSample> samples_;
  std::vector<StoredWindow> windows_;
  bool single_ = false, is_task_ = false;
  std::int64_t rows_ = 0, end_ = 0, policies_ = 0;
  std::tuple<std::vector<float>, std::vector<double>, std::vector<std::uint8_t>,
             std::vector<std::int16_t>>
      buffers_;
  ContentSum sum_;
  LabelSum labels_;
  ShardContent content_;
};

}  // namespace

ShardReport examine_shard(const std::string& path) {
  try {
    return ShardChecker(path, true).check();
  } catch (const IoError& error) {
    return {{}, {error.what()}};
  }
}

ShardReport examine_merged(const std::string& path) {
  try {
    return ShardChecker(path, true).check_merged();
  } catch (const IoError& error) {
    return {{}, {error.what()}};
  }
}

void sample_shard(const std::string& path) {
  const ShardReport report = ShardChecker(path, false).sample();
  if (!report.problems.empty())
    throw IoError(fmt::format("'{}' is damaged: {}", path, report.problems.front()));
}

ShardContent check_shard(const std::string& path) {
  const ShardReport report = ShardChecker(path, false).check();
  if (!report.problems.empty())
    throw IoError(fmt::format("'{}' is damaged: {}", path, report.problems.front()));
  return report.content;
}

}  // namespace tangere
