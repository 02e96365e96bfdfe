// SPDX-License-Identifier: Apache-2.0
// label_sum = Σ over attributes of the row hash of content_sum, with the attribute in place of the
// dataset, + T taken + U tunnelled + O overlapping, modulo 2⁶⁴.
#include "io/dataset/label_sum.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <string_view>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

struct Label {
  const char* name;
  h5::NumberType type;
};

// The place in a list counts in the sum: append, change no order.
constexpr std::array<Label, 8> kOfDemos{{{"num_samples", h5::NumberType::int64},
                                         {"return", h5::NumberType::float64},
                                         {"terminated", h5::NumberType::int8},
                                         {"success", h5::NumberType::int8},
                                         {"policy", h5::NumberType::int64},
                                         {"touching", h5::NumberType::int64},
                                         {"randomized", h5::NumberType::float64},
                                         {"picture_gains", h5::NumberType::float64}}};
constexpr std::array<Label, 8> kOfFailures{{{"step", h5::NumberType::int64},
                                            {"status", h5::NumberType::int8},
                                            {"reason", h5::NumberType::text},
                                            {"q", h5::NumberType::float64},
                                            {"v", h5::NumberType::float64},
                                            {"policy", h5::NumberType::int64},
                                            {"randomized", h5::NumberType::float64},
                                            {"picture_gains", h5::NumberType::float64}}};

// In place of the number of a dataset, of which there are fewer.
constexpr std::size_t kFirstOfDemos = std::size_t{1} << 32, kFirstOfFailures = std::size_t{2} << 32;

// Odd, so that every bit of a count changes the sum.
constexpr std::uint64_t kFactorOfTaken = 0xD6E8FEB86659FD93ULL,
                        kFactorOfTunnelled = 0xA0761D6478BD642FULL,
                        kFactorOfOverlapping = 0xE7037ED1A0B428DBULL;

template <class T>
void add_label(ContentSum& sum, std::int64_t episode, std::size_t place, const h5::Id& object,
               const char* name) {
  const std::vector<T> values = h5::read_numbers<T>(object, name);
  sum.add(episode, place, 0, 1, values.size() * sizeof(T), values.data());
}

void add_labels(ContentSum& sum, std::int64_t episode, std::size_t first, const h5::Id& object,
                std::span<const Label> labels) {
  for (std::size_t k = 0; k < labels.size(); ++k) {
    const char* const name = labels[k].name;
    if (H5Aexists(object.get(), name) <= 0) continue;
    if (labels[k].type == h5::NumberType::float64) {
      add_label<double>(sum, episode, first + k, object, name);
    } else if (labels[k].type == h5::NumberType::int64) {
      add_label<std::int64_t>(sum, episode, first + k, object, name);
    } else if (labels[k].type == h5::NumberType::int8) {
      add_label<std::int8_t>(sum, episode, first + k, object, name);
    } else {
      const std::string text = h5::read_text(object, name);
      sum.add(episode, first + k, 0, 1, text.size(), text.data());
    }
  }
}

}  // namespace

void LabelSum::add_demo(std::int64_t episode, std::span<const h5::FileAttribute> attributes) {
  for (const h5::FileAttribute& attribute : attributes) {
    const auto found = std::find_if(kOfDemos.begin(), kOfDemos.end(), [&](const Label& label) {
      return attribute.name == label.name && attribute.type == label.type;
    });
    if (found == kOfDemos.end())
      throw std::logic_error(fmt::format("label_sum does not list '{}'", attribute.name));
    sum_.add(episode, kFirstOfDemos + static_cast<std::size_t>(found - kOfDemos.begin()), 0, 1,
             attribute.values.size(), attribute.values.data());
  }
}

void LabelSum::add_demo(std::int64_t episode, const h5::Id& demo) {
  add_labels(sum_, episode, kFirstOfDemos, demo, kOfDemos);
}

void LabelSum::add_failed(std::int64_t episode, const h5::Id& failed) {
  add_labels(sum_, episode, kFirstOfFailures, failed, kOfFailures);
}

void LabelSum::add(const EpisodeSteps& steps) {
  steps_ += kFactorOfTaken * static_cast<std::uint64_t>(steps.taken) +
            kFactorOfTunnelled * static_cast<std::uint64_t>(steps.tunnelled) +
            kFactorOfOverlapping * static_cast<std::uint64_t>(steps.overlapping);
}

std::uint64_t sum_of_names(std::span<const std::string> names) {
  ContentSum sum;
  for (std::size_t k = 0; k < names.size(); ++k)
    sum.add(static_cast<std::int64_t>(k), 0, 0, 1, names[k].size(), names[k].data());
  return sum.value();
}

void check_mask(const h5::Id& mask, const std::string& name) {
  if (H5Aexists(mask.get(), kMaskSum) <= 0) return;
  const h5::Dims dims = h5::dimensions(mask);
  std::vector<std::string> names;
  if (!dims.empty() && dims.front() > 0) names = h5::read_files(mask, 0, dims.front());
  const auto expected = h5::read_number<std::uint64_t>(mask, kMaskSum);
  if (const std::uint64_t found = sum_of_names(names); found != expected)
    throw IoError(
        fmt::format("the checksum of the names in mask/{} is {:016x}; expected {:016x}; if "
                    "you changed the mask, remove its attribute '{}'",
                    name, found, expected, kMaskSum));
}

}  // namespace tangere
