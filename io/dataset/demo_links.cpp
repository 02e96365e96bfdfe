// SPDX-License-Identifier: Apache-2.0
// For each batch of demos, the file has the contents of its virtual datasets first, then the
// objects.
#include "io/dataset/demo_links.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <set>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "io/hdf5/h5_views.hpp"

namespace tangere {
namespace {

using h5::Bytes;

constexpr const char* kSamples = "samples";
constexpr std::int64_t kMostDemoRows = 1 << 26;  // of a demo; a claim becomes that many bytes

/// "/data/demo_3/obs/pad".
std::string path_of(std::int64_t demo, std::string_view group, std::string_view name = {}) {
  return name.empty() ? fmt::format("/data/demo_{}/{}", demo, group)
                      : fmt::format("/data/demo_{}/{}/{}", demo, group, name);
}

std::vector<std::uint64_t> dims_of(std::uint64_t rows, const DemoArray& array) {
  std::vector<std::uint64_t> dims{rows};
  dims.insert(dims.end(), array.shape.begin(), array.shape.end());
  return dims;
}

using PlainNames = std::vector<std::pair<std::size_t, std::string>>;

/// Names without dots, of observations that have some; none that another one has.
PlainNames plain_names(const std::vector<DemoArray>& arrays) {
  PlainNames found;
  std::set<std::string> taken;
  for (const DemoArray& array : arrays) taken.insert(array.name);
  for (std::size_t k = 0; k < arrays.size(); ++k) {
    std::string name = arrays[k].name;
    std::replace(name.begin(), name.end(), '.', '_');
    if (taken.insert(name).second) found.emplace_back(k, name);
  }
  return found;
}

bool has_numbers(const DemoArray& array) {
  return array.type != h5::NumberType::text &&
         std::find(array.shape.begin(), array.shape.end(), 0) == array.shape.end();
}

/// Virtual datasets with the observations of a batch of demos, one row later or with one row more.
class ShownObservations {
 public:
  /// `skipped`: rows of obs to leave out before final_obs follows. Appends the contents.
  ShownObservations(Bytes& out, std::uint64_t base, std::span<const DemoArray> arrays,
                    std::string_view file, std::span<const LinkedDemo> demos, std::uint64_t skipped)
      : out_(out),
        base_(base),
        arrays_(arrays),
        skipped_(skipped),
        texts_(add_texts(file, demos)) {}

  /// Appends the datasets of the next demo. Returns links to them, by plain names as well.
  std::vector<h5::FileLink> add(const DemoFacts& facts, const PlainNames& plain = {}) {
    std::vector<h5::FileLink> links;
    for (std::size_t k = 0; k < arrays_.size(); ++k) {
      const DemoArray& array = arrays_[k];
      if (array.type == h5::NumberType::text) continue;  // of obs and final_obs differ in length
      links.push_back({array.name, base_ + out_.size()});
      for (const auto& [of, name] : plain)
        if (of == k) links.push_back({name, base_ + out_.size()});
      h5::FileDataset dataset{array.type, dims_of(rows(facts), array)};
      if (has_numbers(array)) dataset.view = h5::FileView{texts_, next_++};
      h5::add_dataset(out_, dataset);
    }
    return links;
  }
  /// The same in a group. Returns its address.
  std::uint64_t add_group(const DemoFacts& facts, const PlainNames& plain = {}) {
    const std::vector<h5::FileLink> links = add(facts, plain);
    const std::uint64_t group = base_ + out_.size();
    h5::add_group(out_, links);
    return group;
  }

 private:
  /// Returns the address of the texts.
  std::uint64_t add_texts(std::string_view file, std::span<const LinkedDemo> demos) {
    std::vector<std::string> texts;
    for (const LinkedDemo& demo : demos)
      for (const DemoArray& array : arrays_)
        if (has_numbers(array)) texts.push_back(text(file, demo, array));
    out_.align();
    const std::uint64_t address = base_ + out_.size();
    h5::add_texts(out_, std::vector<std::string_view>(texts.begin(), texts.end()));
    return address;
  }
  [[nodiscard]] std::uint64_t rows(const DemoFacts& facts) const {
    return static_cast<std::uint64_t>(facts.rows) + 1 - skipped_;
  }
  [[nodiscard]] std::string text(std::string_view file, const LinkedDemo& demo,
                                 const DemoArray& array) const {
    const auto of = static_cast<std::uint64_t>(demo.facts.rows);
    const std::string obs = path_of(demo.number, "obs", array.name),
                      last = path_of(demo.number, "final_obs", array.name);
    std::vector<h5::ShownRows> parts;
    if (of > skipped_) parts.push_back({file, obs, skipped_, of - skipped_, of});
    parts.push_back({file, last, 0, 1, 1});
    return h5::shown_rows(parts, dims_of(rows(demo.facts), array));
  }

  Bytes& out_;
  std::uint64_t base_;
  std::span<const DemoArray> arrays_;
  std::uint64_t skipped_, texts_;
  std::uint32_t next_ = 0;
};

h5::NumberType type_of(const h5::Id& dataset) {
  const h5::Id type(H5Dget_type(dataset.get()));
  const std::size_t bytes = H5Tget_size(type.get());
  if (H5Tget_class(type.get()) == H5T_STRING) return h5::NumberType::text;
  return bytes == 1               ? h5::NumberType::uint8
         : bytes == 2             ? h5::NumberType::int16
         : bytes == sizeof(float) ? h5::NumberType::float32
                                  : h5::NumberType::float64;
}

DemoArray array_of(const h5::Id& group, const std::string& name) {
  const h5::Id dataset = h5::open_dataset(group, name);
  const h5::Dims dims = h5::dimensions(dataset);
  if (dims.empty()) throw IoError(fmt::format("{} is one number; expected rows", name));
  return {name, type_of(dataset), {dims.begin() + 1, dims.end()}};
}

/// Appends a group with links to the observations of a demo, by both names. Returns its address.
std::uint64_t add_obs_links(Bytes& out, std::uint64_t base, const DemoMembers& members,
                            std::string_view file, const LinkedDemo& demo) {
  std::vector<std::string> paths;
  for (const DemoArray& array : members.observations)
    paths.push_back(path_of(demo.number, "obs", array.name));
  std::vector<h5::FileLink> links;
  for (std::size_t k = 0; k < paths.size(); ++k)
    links.push_back({members.observations[k].name, h5::kNowhere, file, paths[k]});
  for (const auto& [of, name] : members.plain_names)
    links.push_back({name, h5::kNowhere, file, paths[of]});
  const std::uint64_t group = base + out.size();
  h5::add_group(out, links);
  return group;
}

}  // namespace

DemoMembers members_of(const h5::Id& demo) {
  DemoMembers members;
  members.names = h5::link_names(demo);
  // These virtual datasets are laid out anew for this file.
  members.names.erase(std::remove(members.names.begin(), members.names.end(), "next_obs"),
                      members.names.end());
  for (const std::string& name : members.names)
    if (name.starts_with("grad_") || name == "loss" || name == kSamples)
      members.besides.push_back(name);
  const h5::Id obs = h5::open_group(demo, "obs");
  for (const std::string& name : h5::link_names(obs))
    members.observations.push_back(array_of(obs, name));
  members.plain_names = plain_names(members.observations);
  if (h5::has_link(demo, kSamples)) {
    const h5::Id samples = h5::open_group(demo, kSamples);
    for (const std::string& name : h5::link_names(samples))
      members.samples.emplace_back(array_of(samples, name),
                                   h5::dimensions(h5::open_dataset(samples, name)).at(0));
  }
  members.actions = array_of(demo, "actions");
  const std::vector<std::string> names = h5::attribute_names(demo);
  members.is_task = std::binary_search(names.begin(), names.end(), "terminated");
  if (members.is_task)
    members.policies = std::ssize(h5::read_texts(h5::open_group(demo, "/scene"), "policies"));
  members.varies = std::binary_search(names.begin(), names.end(), "randomized");
  members.has_gains = std::binary_search(names.begin(), names.end(), "picture_gains");
  members.has_touch = !stored_touch(h5::open_group(demo, "/scene")).empty();
  return members;
}

DemoFacts facts_of(const h5::Id& demo, const DemoMembers& members) {
  const auto flag = [&](const char* name) {
    return h5::read_number<std::int64_t>(demo, name) != 0;
  };
  DemoFacts facts;
  facts.rows = h5::read_number<std::int64_t>(demo, "num_samples");
  if (facts.rows < 1 || facts.rows > kMostDemoRows)
    throw IoError(fmt::format("a demo has {} rows; expected 1 to {}", facts.rows, kMostDemoRows));
  if (members.is_task) {
    const double total = h5::read_number<double>(demo, "return");
    const auto policy = h5::read_number<std::int64_t>(demo, "policy");
    if (policy < 0 || policy >= members.policies)
      throw IoError(fmt::format("its policy is {}; expected 0 to {}, one of 'policies' in /scene",
                                policy, members.policies - 1));
    facts.end = EpisodeEnd{facts.rows, total, flag("terminated"), flag("success"),
                           static_cast<int>(policy)};
  }
  if (members.varies) facts.randomized = h5::read_numbers<double>(demo, "randomized");
  if (members.has_gains) facts.gains = h5::read_numbers<double>(demo, "picture_gains");
  if (members.has_touch) facts.touching = h5::read_number<std::int64_t>(demo, "touching");
  if (const std::int64_t touching = facts.touching.value_or(0);
      touching < 0 || touching > facts.rows)
    throw IoError(
        fmt::format("something is felt in {} of its rows; expected 0 to {}", touching, facts.rows));
  return facts;
}

void check_members(const h5::Id& demo, const DemoMembers& members, const DemoFacts& facts) {
  const auto check = [](const h5::Id& group, const DemoArray& array, std::int64_t rows) {
    const h5::Id dataset = h5::open_dataset(group, array.name);
    if (!std::ranges::equal(h5::dimensions(dataset),
                            dims_of(static_cast<std::uint64_t>(rows), array)) ||
        type_of(dataset) != array.type)
      throw IoError(fmt::format("{} does not have {} rows, or the shape and type of the first demo",
                                array.name, rows));
  };
  for (const std::string& name : members.names)
    if (name != "obs" && name != "final_obs" && name != kSamples && name != members.actions.name)
      h5::open_dataset(demo, name);
  check(demo, members.actions, facts.rows);
  const h5::Id obs = h5::open_group(demo, "obs"), last = h5::open_group(demo, "final_obs");
  for (const DemoArray& array : members.observations) {
    check(obs, array, facts.rows);
    check(last, array, 1);
  }
  if (members.samples.empty()) return;
  const h5::Id samples = h5::open_group(demo, kSamples);
  for (const auto& [array, rows] : members.samples)
    check(samples, array, static_cast<std::int64_t>(rows));
}

std::vector<h5::FileMember> add_demo_links(Bytes& out, std::uint64_t base,
                                           const DemoMembers& members, std::string_view file,
                                           std::span<const LinkedDemo> demos) {
  ShownObservations next(out, base, members.observations, file, demos, 1);
  std::vector<h5::FileMember> groups;
  for (const LinkedDemo& demo : demos) {
    std::vector<std::string> paths;
    for (const std::string& name : members.names) paths.push_back(path_of(demo.number, name));
    std::vector<h5::FileLink> links;
    for (std::size_t k = 0; k < paths.size(); ++k) {
      const bool renamed = members.names[k] == "obs" && !members.plain_names.empty();
      if (renamed)
        links.push_back({"obs", add_obs_links(out, base, members, file, demo)});
      else
        links.push_back({members.names[k], h5::kNowhere, file, paths[k]});
    }
    links.push_back({"next_obs", next.add_group(demo.facts, members.plain_names)});
    groups.push_back({demo.number, base + out.size()});
    h5::add_group(out, links, DemoAttributes(demo.facts).all());
  }
  return groups;
}

std::vector<h5::FileMember> add_minari_episodes(Bytes& out, std::uint64_t base,
                                                const DemoMembers& members, std::string_view file,
                                                std::span<const LinkedDemo> demos,
                                                std::int64_t first, std::uint64_t seed) {
  using Number = std::array<unsigned char, sizeof(std::int64_t)>;
  ShownObservations observations(out, base, members.observations, file, demos, 0),
      states(out, base, members.states, file, demos, 0);
  std::vector<h5::FileMember> groups;
  for (const LinkedDemo& demo : demos) {
    const std::int64_t episode = first + static_cast<std::int64_t>(groups.size());
    const std::string actions = path_of(demo.number, "actions"),
                      rewards = path_of(demo.number, "rewards"),
                      dones = path_of(demo.number, "dones");
    const bool terminated = demo.facts.end && demo.facts.end->terminated;
    const std::uint64_t all_false = base + out.size();
    out.zeros(static_cast<std::size_t>(demo.facts.rows));
    out.align();
    const std::uint64_t never = base + out.size();
    h5::add_dataset(
        out,
        {h5::NumberType::boolean, {static_cast<std::uint64_t>(demo.facts.rows)}, {}, all_false});
    const std::uint64_t shown = observations.add_group(demo.facts);
    std::vector<std::string> paths;
    for (const std::string& name : members.besides) paths.push_back(path_of(demo.number, name));
    std::vector<h5::FileLink> besides = states.add(demo.facts);
    for (std::size_t k = 0; k < paths.size(); ++k)
      besides.push_back({members.besides[k], h5::kNowhere, file, paths[k]});
    const std::uint64_t infos = base + out.size();
    h5::add_group(out, besides);  // also if empty, because Minari prints no episode without it
    const std::array links{
        h5::FileLink{"actions", h5::kNowhere, file, actions},
        h5::FileLink{"infos", infos},
        h5::FileLink{"observations", shown},
        h5::FileLink{"rewards", h5::kNowhere, file, rewards},
        h5::FileLink{terminated ? "terminations" : "truncations", h5::kNowhere, file, dones},
        h5::FileLink{terminated ? "truncations" : "terminations", never}};
    const auto id = std::bit_cast<Number>(episode), rows = std::bit_cast<Number>(demo.facts.rows),
               number = std::bit_cast<Number>(demo.number), drawn = std::bit_cast<Number>(seed);
    const std::array attributes{
        h5::FileAttribute{"id", h5::NumberType::int64, false, id},
        h5::FileAttribute{"total_steps", h5::NumberType::int64, false, rows},
        h5::FileAttribute{"seed", h5::NumberType::uint64, false, drawn},
        h5::FileAttribute{"demo", h5::NumberType::int64, false, number}};
    groups.push_back({episode, base + out.size()});
    h5::add_group(out, links, attributes);
  }
  return groups;
}

}  // namespace tangere
