// SPDX-License-Identifier: Apache-2.0
// Reads objects that are laid out without the library through the library.
#include "io/hdf5/h5_objects.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <numeric>

#include "engine/base/error.hpp"
#include "io/dataset/grown_file.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_links.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "io/hdf5/h5_trees.hpp"
#include "io/hdf5/h5_views.hpp"
#include "tests/files.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using h5::Bytes;
using ::tangere::testing::Folder;

/// A file that the library begins, with objects appended behind its end.
class Extended {
 public:
  explicit Extended(std::string path) : path_(std::move(path)) {
    h5::Id file = h5::create_file(path_);
    h5::close_file(file, path_);
    base_ = std::filesystem::file_size(path_);
  }
  Bytes& objects() { return objects_; }
  [[nodiscard]] std::uint64_t base() const { return base_; }
  [[nodiscard]] std::uint64_t here() const { return base_ + objects_.size(); }

  /// Writes the objects and opens the file. `address`: address of the object called "object".
  h5::Id open(std::uint64_t address) {
    std::string bytes = read();
    bytes.append(reinterpret_cast<const char*>(objects_.all().data()), objects_.size());
    std::array<unsigned char, h5::kSuperblockBytes> head{};
    std::memcpy(head.data(), bytes.data(), head.size());
    h5::set_end_of_file(head, bytes.size());
    std::memcpy(bytes.data(), head.data(), head.size());
    std::ofstream(path_, std::ios::binary) << bytes;
    h5::Id file = h5::change_file(path_);
    h5::link_object(file, "object", address);
    h5::close_file(file, path_);
    return h5::open_file(path_);
  }

 private:
  [[nodiscard]] std::string read() const { return file_bytes(path_); }
  std::string path_;
  std::uint64_t base_ = 0;
  Bytes objects_;
};

std::vector<unsigned char> raw(const std::vector<float>& numbers) {
  std::vector<unsigned char> bytes(numbers.size() * sizeof(float));
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

TEST(H5Objects, HaveTheLibrarysChecksum) {
  // The values that Jenkins' lookup3.c prints for these.
  const auto sum = [](std::string_view text) {
    return h5::object_checksum({reinterpret_cast<const unsigned char*>(text.data()), text.size()});
  };
  EXPECT_EQ(sum(""), 0xDEADBEEFU);
  EXPECT_EQ(sum("Four score and seven years ago"), 0x17770551U);
}

TEST(H5Objects, ADatasetHoldsItsNumbersWhereverTheyAre) {
  const Folder folder;
  Extended file(folder / "file.h5");
  const std::vector<float> numbers{1, 2, 3, 4, 5, 6.5F};
  const std::uint64_t data = file.here();
  file.objects().add(raw(numbers));
  const std::uint64_t dataset = file.here();
  h5::add_dataset(file.objects(), {h5::NumberType::float32, {2, 3}, {}, data});
  const h5::Id opened = file.open(dataset), object = h5::open_dataset(opened, "object");
  ASSERT_EQ(h5::dimensions(object), (h5::Dims{2, 3}));
  std::vector<float> read(6);
  h5::read_box(object, {0, 0}, {2, 3}, read.data());
  EXPECT_EQ(read, numbers);
  EXPECT_GT(H5Tequal(h5::Id(H5Dget_type(object.get())).get(), H5T_IEEE_F32LE), 0);
}

TEST(H5Objects, ADatasetSharesTextsThatTheLibraryReadsAndCopies) {
  const Folder folder;
  // Lengths below and above the least that the library allocates.
  for (const std::size_t length : {1UL, 23UL, 4000UL, 4063UL, 4064UL, 100000UL}) {
    const std::string path = folder / (std::to_string(length) + ".h5"), second(length, 'x');
    Extended file(path);
    const std::array<std::string_view, 2> texts{"größer", second};
    h5::add_texts(file.objects(), texts);
    h5::FileDataset dataset{h5::NumberType::float64, {0}, {}, h5::kNowhere};
    const std::array attributes{
        h5::FileText{"first", file.base(), 0, static_cast<std::uint32_t>(texts[0].size())},
        h5::FileText{"second", file.base(), 1, static_cast<std::uint32_t>(texts[1].size())}};
    dataset.texts = attributes;
    const std::uint64_t address = file.here();
    h5::add_dataset(file.objects(), dataset);
    const h5::Id opened = file.open(address), object = h5::open_dataset(opened, "object");
    EXPECT_EQ(h5::read_text(object, "first"), "größer");
    EXPECT_EQ(h5::read_text(object, "second"), second) << length;
    const h5::Id memory = h5::create_memory_file();
    ASSERT_GE(H5Ocopy(opened.get(), "object", memory.get(), "copy", H5P_DEFAULT, H5P_DEFAULT), 0);
    EXPECT_EQ(h5::read_text(h5::open_dataset(memory, "copy"), "second"), second);
    h5::write_attribute(memory, "own", "the library's");
    const h5::Id attribute(H5Aopen(object.get(), "first", H5P_DEFAULT)),
        own(H5Aopen(memory.get(), "own", H5P_DEFAULT));
    EXPECT_GT(
        H5Tequal(h5::Id(H5Aget_type(attribute.get())).get(), h5::Id(H5Aget_type(own.get())).get()),
        0);
  }
}

TEST(H5Objects, AListHasAsManyTextsAsItCanNumber) {
  h5::Bytes out;
  EXPECT_NO_THROW(h5::add_texts(out, std::vector<std::string_view>(65535, "x")));
  EXPECT_THROW(h5::add_texts(out, std::vector<std::string_view>(65536, "x")), std::logic_error);
}

TEST(H5Objects, EveryTypeIsTheLibrarysOwn) {
  const Folder folder;
  const h5::Id boolean(H5Tenum_create(H5T_STD_I8LE));
  const std::int8_t no = 0, yes = 1;
  H5Tenum_insert(boolean.get(), "FALSE", &no);
  H5Tenum_insert(boolean.get(), "TRUE", &yes);
  const std::vector<std::pair<h5::NumberType, hid_t>> types{
      {h5::NumberType::float32, H5T_IEEE_F32LE}, {h5::NumberType::float64, H5T_IEEE_F64LE},
      {h5::NumberType::int8, H5T_STD_I8LE},      {h5::NumberType::int64, H5T_STD_I64LE},
      {h5::NumberType::uint64, H5T_STD_U64LE},   {h5::NumberType::boolean, boolean.get()}};
  for (std::size_t k = 0; k < types.size(); ++k) {
    Extended file(folder / ("file" + std::to_string(k) + ".h5"));
    h5::add_dataset(file.objects(), {types[k].first, {0}, {}, h5::kNowhere});
    const h5::Id opened = file.open(file.base()), object = h5::open_dataset(opened, "object");
    EXPECT_GT(H5Tequal(h5::Id(H5Dget_type(object.get())).get(), types[k].second), 0) << k;
    EXPECT_EQ(h5::dimensions(object), h5::Dims{0}) << "without numbers";
  }
}

TEST(H5Objects, ChunksAreFoundThroughIndexesOfAnyDepth) {
  const Folder folder;
  // 64 chunks fill a node; 5000 need three levels.
  for (const std::size_t count : {1UL, 64UL, 65UL, 5000UL}) {
    constexpr std::uint64_t kRows = 2;
    Extended file(folder / (std::to_string(count) + ".h5"));
    std::vector<h5::FileChunk> chunks;
    std::vector<float> numbers;
    for (std::size_t k = 0; k < count; ++k) {
      const auto first = static_cast<float>(4 * k);
      const std::vector<float> chunk{first, first + 1, first + 2, first + 3};
      chunks.push_back({{kRows * k}, file.here(), 16});
      file.objects().add(raw(chunk));
      numbers.insert(numbers.end(), chunk.begin(), chunk.end());
    }
    const std::uint64_t before = file.here();
    const std::uint64_t index = h5::add_chunk_index(file.objects(), file.base(), chunks, 2, kRows);
    EXPECT_EQ(file.here() - before, h5::chunk_index_bytes(count, 2));
    const std::uint64_t dataset = file.here();
    // The last chunk has a row more than the dataset.
    h5::add_dataset(file.objects(),
                    {h5::NumberType::float32, {kRows * count - 1, 2}, {kRows, 2}, index});
    const h5::Id opened = file.open(dataset), object = h5::open_dataset(opened, "object");
    numbers.resize(numbers.size() - 2);
    std::vector<float> read(numbers.size());
    h5::read_box(object, {0, 0}, {kRows * count - 1, 2}, read.data());
    EXPECT_EQ(read, numbers) << count;
    float one = 0;
    const std::uint64_t middle = count / 2;
    h5::read_box(object, {middle, 1}, {1, 1}, &one);
    EXPECT_EQ(one, static_cast<float>(2 * middle + 1)) << count;
  }
}

TEST(H5Objects, GroupsOfAnySizeListAndFindTheirMembers) {
  const Folder folder;
  for (const int count : {0, 1, 8, 9, 300, 20000}) {
    Extended file(folder / (std::to_string(count) + ".h5"));
    std::vector<h5::FileMember> members;
    std::vector<std::string> names;
    for (int k = 0; k < count; ++k) {
      members.push_back({k, file.here()});
      names.push_back("demo_" + std::to_string(k));
      const auto number = static_cast<std::int64_t>(k);
      std::array<unsigned char, sizeof number> bytes{};
      std::memcpy(bytes.data(), &number, sizeof number);
      const std::array attributes{h5::FileAttribute{"k", h5::NumberType::int64, false, bytes}};
      h5::add_group(file.objects(), {}, attributes);
    }
    const std::uint64_t address =
        h5::add_large_group(file.objects(), file.base(), "demo_", members);
    const h5::Id opened = file.open(address), group = h5::open_group(opened, "object");
    std::sort(names.begin(), names.end());
    EXPECT_EQ(h5::link_names(group), names);
    EXPECT_EQ(h5::link_count(group), names.size());
    EXPECT_FALSE(h5::has_link(group, "demo_"));
    for (int k = 0; k < count; ++k)
      ASSERT_EQ(
          h5::read_numbers<std::int64_t>(h5::open_group(group, "demo_" + std::to_string(k)), "k")
              .at(0),
          k);
  }
}

TEST(H5Objects, AGroupHoldsLinksAndLists) {
  const Folder folder;
  Extended file(folder / "file.h5");
  h5::add_group(file.objects(), {});
  const std::uint64_t inner = file.base(), outer = file.here();
  const std::array<double, 3> values{1.5, -2, 1e300};
  std::array<unsigned char, sizeof values> bytes{};
  std::memcpy(bytes.data(), values.data(), sizeof values);
  const std::array attributes{h5::FileAttribute{"values", h5::NumberType::float64, true, bytes}};
  const std::array links{h5::FileLink{"größe", inner}};
  h5::add_group(file.objects(), links, attributes);
  const h5::Id opened = file.open(outer), group = h5::open_group(opened, "object");
  EXPECT_THAT(h5::link_names(group), ::testing::ElementsAre("größe"));
  EXPECT_THAT(h5::read_numbers<double>(group, "values"), ::testing::ElementsAre(1.5, -2, 1e300));
  EXPECT_TRUE(h5::link_names(h5::open_group(group, "größe")).empty());
  H5O_info_t info;
  ASSERT_GE(H5Oget_info2(group.get(), &info, H5O_INFO_NUM_ATTRS), 0);
  EXPECT_EQ(info.num_attrs, 1U) << "h5py's len(), and what h5diff compares";
}

/// A file with two datasets of shape `shape` per row: "many" of five rows and "one" of one, with
/// consecutive numbers.
void write_sources(const std::string& path, h5::Dims shape, bool single) {
  h5::Id file = h5::create_file(path);
  double next = 0;
  for (const hsize_t rows : {hsize_t{5}, hsize_t{1}}) {
    shape[0] = rows;
    std::vector<double> numbers;
    for (hsize_t k = 0;
         k < std::accumulate(shape.begin(), shape.end(), hsize_t{1}, std::multiplies<>()); ++k)
      numbers.push_back(next++);
    const char* const name = rows == 1 ? "one" : "many";
    const h5::Id dataset = single ? h5::create_dataset<float>(file, name, shape)
                                  : h5::create_dataset<double>(file, name, shape);
    h5::write_box(dataset, h5::Dims(shape.size(), 0), shape, numbers.data());
  }
  h5::close_file(file, path);
}

/// What a virtual dataset shows, as the library understands it.
struct Shown {
  h5::Dims dims;
  std::vector<std::string> sources;
  std::vector<std::vector<hsize_t>> boxes;  ///< of each source, then where it is shown
  std::vector<double> numbers;
  friend bool operator==(const Shown&, const Shown&) = default;
};

Shown shown(const h5::Id& dataset) {
  Shown said;
  said.dims = h5::dimensions(dataset);
  const h5::Id creation(H5Dget_create_plist(dataset.get()));
  std::size_t count = 0;
  EXPECT_GE(H5Pget_virtual_count(creation.get(), &count), 0);
  for (std::size_t k = 0; k < count; ++k) {
    std::array<char, 64> file{}, path{};
    H5Pget_virtual_filename(creation.get(), k, file.data(), file.size());
    H5Pget_virtual_dsetname(creation.get(), k, path.data(), path.size());
    said.sources.push_back(std::string(file.data()) + ":" + path.data());
    for (const hid_t id :
         {H5Pget_virtual_srcspace(creation.get(), k), H5Pget_virtual_vspace(creation.get(), k)}) {
      const h5::Id space(id);
      std::vector<hsize_t> first(said.dims.size()), last(said.dims.size());
      if (H5Sget_select_type(id) == H5S_SEL_ALL) continue;
      EXPECT_GE(H5Sget_select_bounds(id, first.data(), last.data()), 0);
      first.insert(first.end(), last.begin(), last.end());
      said.boxes.push_back(first);
    }
  }
  const h5::Id type(H5Dget_type(dataset.get()));
  said.numbers.resize(
      std::accumulate(said.dims.begin(), said.dims.end(), hsize_t{1}, std::multiplies<>()));
  h5::read_box(dataset, h5::Dims(said.dims.size(), 0), said.dims, said.numbers.data());
  return said;
}

TEST(H5Objects, AViewIsTheLibrarysOwn) {
  for (const bool single : {true, false})
    for (const h5::Dims& shape : {h5::Dims{0}, h5::Dims{0, 3}, h5::Dims{0, 2, 3, 4}})
      for (const std::uint64_t skipped : {0U, 1U, 4U, 5U}) {
        const Folder folder;
        write_sources(folder / "source.h5", shape, single);
        h5::Id library = h5::create_file(folder / "library.h5", nullptr, 2048, true);
        {
          const h5::Id source = h5::open_file(folder / "source.h5");
          h5::create_virtual(library, "object", h5::open_dataset(source, "many"),
                             {"source.h5", "/many"}, {"source.h5", "/one"}, skipped);
        }
        h5::close_file(library, folder / "library.h5");
        Extended file(folder / "file.h5");
        h5::FileDataset dataset{single ? h5::NumberType::float32 : h5::NumberType::float64,
                                {shape.begin(), shape.end()}};
        dataset.dims[0] = 6 - skipped;
        std::vector<h5::ShownRows> parts;
        if (skipped < 5) parts.push_back({"source.h5", "/many", skipped, 5 - skipped, 5});
        parts.push_back({"source.h5", "/one", 0, 1, 1});
        const std::string text = h5::shown_rows(parts, dataset.dims);
        // The second in its list.
        h5::add_texts(file.objects(), std::array<std::string_view, 2>{"another", text});
        dataset.view = h5::FileView{file.base(), 1};
        const std::uint64_t address = file.here();
        h5::add_dataset(file.objects(), dataset);
        {
          const h5::Id opened = file.open(address), expected = h5::open_file(folder / "library.h5");
          const h5::Id object = h5::open_dataset(opened, "object"),
                       like = h5::open_dataset(expected, "object");
          const Shown said = shown(object);
          EXPECT_EQ(said, shown(like)) << "from row " << skipped;
          const std::size_t before = skipped * said.numbers.size() / (6 - skipped);
          EXPECT_EQ(said.numbers.front(), static_cast<double>(before));
          EXPECT_GT(H5Tequal(h5::Id(H5Dget_type(object.get())).get(),
                             h5::Id(H5Dget_type(like.get())).get()),
                    0);
        }
        std::filesystem::remove(folder / "source.h5");
        const h5::Id opened = h5::open_file(folder / "file.h5");
        EXPECT_TRUE(std::isnan(shown(h5::open_dataset(opened, "object")).numbers.front()))
            << "the source is missing";
      }
}

TEST(H5Objects, AGroupLinksToOtherFiles) {
  const Folder folder;
  write_sources(folder / "source.h5", {0, 2}, true);
  Extended file(folder / "file.h5");
  const std::array links{h5::FileLink{"fünf", h5::kNowhere, "source.h5", "/many"},
                         h5::FileLink{"nowhere", h5::kNowhere, "absent.h5", "/one"}};
  h5::add_group(file.objects(), links);
  const h5::Id opened = file.open(file.base()), group = h5::open_group(opened, "object");
  EXPECT_THAT(h5::link_names(group), ::testing::ElementsAre("fünf", "nowhere"));
  float last = 0;
  h5::read_box(h5::open_dataset(group, "fünf"), {4, 1}, {1, 1}, &last);
  EXPECT_EQ(last, 9);
  EXPECT_THROW(static_cast<void>(h5::open_dataset(group, "nowhere")), IoError);
  H5L_info_t info;
  ASSERT_GE(H5Lget_info(group.get(), "fünf", &info, H5P_DEFAULT), 0);
  EXPECT_EQ(info.type, H5L_TYPE_EXTERNAL);
}

TEST(H5Objects, TheFirstGroupOfAFileMayBeALargeOne) {
  const Folder folder;
  const std::string path = folder / "file.h5";
  GrownFile file(path, false, true);
  file.close();
  std::vector<h5::FileMember> members;
  h5::Bytes out;
  constexpr int kMany = 50000;  // bytes leave the memory on the way
  for (int k = 0; k < kMany; ++k) {
    members.push_back({k, file.here() + out.size()});
    h5::add_group(out, {});
  }
  file.append(out, {"groups"});
  file.open(file.append_group("episode_", members, true));
  h5::write_scalar<std::int64_t>(file.file(), "total", kMany);
  EXPECT_FALSE(std::filesystem::exists(path));
  const std::uint64_t bytes = file.commit();
  EXPECT_EQ(bytes, std::filesystem::file_size(path));
  const h5::Id opened = h5::open_file(path);
  EXPECT_EQ(h5::link_count(opened), kMany);
  EXPECT_EQ(h5::read_numbers<std::int64_t>(opened, "total").at(0), kMany);
  for (int k = 0; k < kMany; k += 7)
    EXPECT_TRUE(h5::has_link(opened, "episode_" + std::to_string(k)));
  EXPECT_TRUE(h5::link_names(h5::open_group(opened, "/episode_49999")).empty());
}

}  // namespace
}  // namespace tangere
