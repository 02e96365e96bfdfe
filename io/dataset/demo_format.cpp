// SPDX-License-Identifier: Apache-2.0
// The layout that robomimic's loader reads (docs/datasets.md).
#include "io/dataset/demo_format.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <numeric>

namespace tangere {
namespace {

template <class T>
std::array<unsigned char, sizeof(T)> bytes_of_number(T value) {
  return std::bit_cast<std::array<unsigned char, sizeof(T)>>(value);
}

/// The type of an observation by EpisodeChannel::own_bytes().
h5::NumberType type_of_observation(std::size_t own, h5::NumberType number) {
  return own == 1 ? h5::NumberType::uint8 : own == 2 ? h5::NumberType::int16 : number;
}

}  // namespace

DemoAttributes::DemoAttributes(const DemoFacts& facts) : samples_(bytes_of_number(facts.rows)) {
  const EpisodeEnd end = facts.end.value_or(EpisodeEnd{});
  total_ = bytes_of_number(end.total);
  terminated_ = bytes_of_number<std::int8_t>(end.terminated ? 1 : 0);
  success_ = bytes_of_number<std::int8_t>(end.success ? 1 : 0);
  policy_ = bytes_of_number<std::int64_t>(end.policy);
  touching_ = bytes_of_number<std::int64_t>(facts.touching.value_or(0));
  all_.push_back({"num_samples", h5::NumberType::int64, false, samples_});
  if (facts.end) {
    all_.push_back({"return", h5::NumberType::float64, false, total_});
    all_.push_back({"terminated", h5::NumberType::int8, false, terminated_});
    all_.push_back({"success", h5::NumberType::int8, false, success_});
    all_.push_back({"policy", h5::NumberType::int64, false, policy_});
  }
  if (facts.touching) all_.push_back({"touching", h5::NumberType::int64, false, touching_});
  const std::span randomized(reinterpret_cast<const unsigned char*>(facts.randomized.data()),
                             facts.randomized.size() * sizeof(double));
  if (!randomized.empty())
    all_.push_back({"randomized", h5::NumberType::float64, true, randomized});
  const std::span gains(reinterpret_cast<const unsigned char*>(facts.gains.data()),
                        facts.gains.size() * sizeof(double));
  if (!gains.empty()) all_.push_back({"picture_gains", h5::NumberType::float64, true, gains});
}

DemoFormat::DemoFormat(const DatasetLayout& layout)
    : is_task_(layout.task.has_value()),
      single_(layout.single),
      randomized_(layout.randomized_names.size()),
      gains_(kColours * layout.gained.size()),
      names_(layout.observation_names()),
      touch_(layout.touch()),
      sources_(layout.recorded()),
      samples_(layout.samples()),
      plans_(chunk_plans(layout)),
      compression_(layout.compression) {
  using h5::NumberType;
  const NumberType number = layout.single ? NumberType::float32 : NumberType::float64;
  gradient_sources_.resize(layout.gradients.size());
  std::iota(gradient_sources_.begin(), gradient_sources_.end(), std::size_t{0});
  std::sort(gradient_sources_.begin(), gradient_sources_.end(), [&](std::size_t a, std::size_t b) {
    return layout.gradients[a].name < layout.gradients[b].name;
  });
  for (const std::size_t k : gradient_sources_) gradients_.push_back(layout.gradients[k]);
  shapes_ = {{layout.action_names().size()}, {}, {}};
  types_ = {NumberType::float32, NumberType::float32, NumberType::boolean};
  const std::vector<std::vector<std::uint64_t>> observed = layout.observation_shapes();
  titles_ = {"actions", "rewards", "dones"};
  for (const char* group : {"obs/", "final_obs/"}) {
    for (const std::string& name : names_) titles_.push_back(group + name);
    shapes_.insert(shapes_.end(), observed.begin(), observed.end());
    const std::vector<std::size_t> own = layout.observation_bytes();
    for (std::size_t k = 0; k < own.size(); ++k)
      types_.push_back(layout.as_jpeg(observed[k], own[k]) ? NumberType::text
                                                           : type_of_observation(own[k], number));
  }
  for (const GradientArray& array : gradients_) {
    const auto from =
        array.shape.begin() +
        (array.per_row ? 0
                       : 1);  // one per episode: the array's own first dimension counts its rows
    shapes_.emplace_back(from, array.shape.end());
    types_.push_back(NumberType::float64);
    titles_.push_back(array.name);
  }
  for (const DatasetSample& sample : samples_) {
    shapes_.push_back(sample.shape);
    types_.push_back(layout.as_jpeg(sample.shape, sample.own_bytes)
                         ? NumberType::text
                         : type_of_observation(sample.own_bytes, number));
    titles_.push_back("samples/" + sample.name);
  }
  for (std::string& title : titles_) title += " of demo_";
  for (std::size_t k = 0; k < shapes_.size(); ++k)
    row_bytes_.push_back(std::accumulate(shapes_[k].begin(), shapes_[k].end(),
                                         h5::bytes_of(types_[k]), std::multiplies<>()));
  h5::Bytes header;
  DemoFacts facts{1, std::nullopt, std::vector<double>(randomized_), std::vector<double>(gains_),
                  std::nullopt};
  if (is_task_) facts.end.emplace();
  if (!touch_.empty()) facts.touching = 0;
  static_cast<void>(describe(header, 0, facts, std::vector<std::uint64_t>(datasets()),
                             std::vector<std::uint32_t>(datasets(), 1), 0));
  header_bytes_ = header.size();
}

std::int64_t DemoFormat::rows_of(std::size_t dataset, std::int64_t rows) const {
  if (dataset < final_obs(0)) return rows;
  if (dataset < gradient(0)) return 1;
  if (dataset >= sample(0)) return samples_[dataset - sample(0)].rows;
  const GradientArray& array = gradients_[dataset - gradient(0)];
  return array.per_row ? rows : static_cast<std::int64_t>(array.shape.at(0));
}

std::int64_t DemoFormat::chunk_rows(std::size_t dataset, std::int64_t rows) const {
  const bool observed = dataset >= kFirst && dataset < gradient(0);
  if (!observed && dataset < sample(0)) return 0;
  const ChunkPlan& cut = plan(dataset);
  // Rows that are far apart in time have chunks of their own.
  if (dataset >= final_obs(0)) return cut.rows > 0 && cut.last_row ? 1 : 0;
  return std::min(cut.rows, rows);
}

std::size_t DemoFormat::data_bytes(std::int64_t rows) const {
  std::size_t bytes = 0;
  for (std::size_t k = 0; k < datasets(); ++k)
    if (chunk_rows(k, rows) == 0 && !as_jpeg(k))
      bytes += h5::aligned(static_cast<std::size_t>(rows_of(k, rows)) * row_bytes_[k]);
  return bytes;
}

h5::Bytes DemoFormat::texts() const {
  std::vector<std::string_view> meanings;
  for (const GradientArray& array : gradients_) meanings.emplace_back(array.meaning);
  h5::Bytes out;
  h5::add_texts(out, meanings);
  return out;
}

void DemoFormat::describe_dataset(h5::Bytes& out, std::size_t dataset, std::int64_t rows,
                                  std::uint64_t address, std::uint32_t width,
                                  std::span<const h5::FileText> texts) const {
  const std::vector<h5::FileFilter> filters = file_filters(compression_, number_bytes(dataset));
  h5::FileDataset file;
  file.type = types_[dataset];
  file.dims = {static_cast<std::uint64_t>(rows_of(dataset, rows))};
  if (as_jpeg(dataset))
    file.text_bytes = width;
  else
    file.dims.insert(file.dims.end(), shapes_[dataset].begin(), shapes_[dataset].end());
  file.address = address;
  if (const std::int64_t chunk = chunk_rows(dataset, rows); chunk > 0) {
    const std::vector<std::uint64_t>& tile = plan(dataset).tile;
    file.chunk = {static_cast<std::uint64_t>(chunk)};
    file.chunk.insert(file.chunk.end(), tile.begin(), tile.end());
    file.filters = filters;
  }
  file.texts = texts;
  h5::add_dataset(out, file);
}

std::uint64_t DemoFormat::describe_observations(h5::Bytes& out, std::uint64_t base,
                                                std::int64_t rows, std::size_t first,
                                                std::span<const std::string> names,
                                                std::span<const std::uint64_t> addresses,
                                                std::span<const std::uint32_t> widths) const {
  std::vector<h5::FileLink> links;
  for (std::size_t name = 0; name < names.size(); ++name) {
    links.push_back({names[name], base + out.size()});
    describe_dataset(out, first + name, rows, addresses[first + name], widths[first + name]);
  }
  const std::uint64_t group = base + out.size();
  h5::add_group(out, links);
  return group;
}

std::uint64_t DemoFormat::describe(h5::Bytes& out, std::uint64_t base, const DemoFacts& facts,
                                   std::span<const std::uint64_t> addresses,
                                   std::span<const std::uint32_t> widths,
                                   std::uint64_t texts) const {
  std::vector<h5::FileLink> links;
  for (const std::size_t dataset : {kActions, kRewards, kDones}) {
    constexpr std::array<std::string_view, kFirst> kNames{"actions", "rewards", "dones"};
    links.push_back({kNames[dataset], base + out.size()});
    describe_dataset(out, dataset, facts.rows, addresses[dataset]);
  }
  links.push_back(
      {"obs", describe_observations(out, base, facts.rows, obs(0), names_, addresses, widths)});
  links.push_back({"final_obs", describe_observations(out, base, facts.rows, final_obs(0), names_,
                                                      addresses, widths)});
  for (std::size_t k = 0; k < gradients_.size(); ++k) {
    const std::array meaning{
        h5::FileText{"meaning", texts, static_cast<std::uint32_t>(k),
                     static_cast<std::uint32_t>(gradients_[k].meaning.size())}};
    links.push_back({gradients_[k].name, base + out.size()});
    describe_dataset(out, gradient(k), facts.rows, addresses[gradient(k)], 1, meaning);
  }
  std::vector<std::string> sampled;
  for (const DatasetSample& one : samples_) sampled.push_back(one.name);
  if (!sampled.empty())
    links.push_back({"samples", describe_observations(out, base, facts.rows, sample(0), sampled,
                                                      addresses, widths)});
  const std::uint64_t group = base + out.size();
  h5::add_group(out, links, DemoAttributes(facts).all());
  return group;
}

}  // namespace tangere
