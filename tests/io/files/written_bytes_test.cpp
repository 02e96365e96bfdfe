// SPDX-License-Identifier: Apache-2.0
// Random writes, some of them over others, with and without a disk that loses one of them.
#include "io/files/written_bytes.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <optional>
#include <random>
#include <vector>

#include "engine/base/error.hpp"
#include "io/files/part_file.hpp"
#include "tests/files.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

/// A file and what should be in it.
class Disk {
 public:
  Disk() { written.emplace(file, "disk"); }
  ~Disk() { close(file); }
  Disk(const Disk&) = delete;
  Disk& operator=(const Disk&) = delete;

  /// `kept`: whether the bytes reach the file.
  void write(std::uint64_t offset, const std::vector<unsigned char>& bytes, bool kept = true,
             const BytesOf& what = {"numbers"}) {
    written->add(offset, bytes, what);
    if (kept) put(offset, bytes);
  }
  void put(std::uint64_t offset, const std::vector<unsigned char>& bytes) const {
    ASSERT_EQ(pwrite(file, bytes.data(), bytes.size(), static_cast<off_t>(offset)),
              std::ssize(bytes));
  }
  unsigned char at(std::uint64_t offset) const {
    unsigned char byte = 0;
    EXPECT_EQ(pread(file, &byte, 1, static_cast<off_t>(offset)), 1);
    return byte;
  }
  /// What is wrong with the file; empty: nothing.
  std::string complaint() {
    try {
      written->compare_all();
      return {};
    } catch (const IoError& error) {
      return error.what();
    }
  }

  testing::Folder folder;
  int file = open((folder / "disk").c_str(), O_RDWR | O_CREAT, 0600);
  std::optional<WrittenBytes> written;
};

class WrittenBytesTest : public ::testing::TestWithParam<int> {
 protected:
  std::mt19937_64 engine{static_cast<std::uint64_t>(GetParam())};
  std::uint64_t below(std::uint64_t n) { return engine() % n; }
  std::vector<unsigned char> some_bytes(std::size_t most) {
    std::vector<unsigned char> bytes(1 + below(most));
    for (unsigned char& byte : bytes) byte = static_cast<unsigned char>(below(256));
    return bytes;
  }
  /// `lost`: number of the write that does not reach the file.
  void write_at_random(Disk& disk, int writes, int lost = -1) {
    for (int k = 0; k < writes; ++k) {
      const std::uint64_t offset = below(3) == 0 ? disk.written->size() : below(5000);
      const std::vector<unsigned char> bytes = some_bytes(below(2) == 0 ? 9 : 700);
      disk.write(offset, bytes, k != lost, {k % 2 == 0 ? "even" : "odd of ", k % 2 - 1});
      if (below(20) != 0) continue;
      const std::uint64_t end = below(6000);
      disk.written->end_at(end);
      ASSERT_EQ(ftruncate(disk.file, static_cast<off_t>(end)), 0);
    }
  }
};

TEST_P(WrittenBytesTest, AcceptsWhatWasWrittenAndNoOtherByte) {
  Disk disk;
  write_at_random(disk, 60);
  ASSERT_EQ(disk.complaint(), "");
  for (int k = 0; k < 20; ++k) {
    const std::uint64_t at = below(disk.written->size());
    const unsigned char was = disk.at(at);
    disk.put(at, {static_cast<unsigned char>(was ^ (1U << below(8)))});
    disk.written->end_at(disk.written->size());  // compare again
    ASSERT_THAT(disk.complaint(), HasSubstr("'disk' is damaged: bytes ")) << at;
    disk.put(at, {was});
    ASSERT_EQ(disk.complaint(), "");
  }
}

/// A write counts until others have replaced all of it.
TEST_P(WrittenBytesTest, FindsAWriteThatWasLost) {
  Disk whole, lossy;
  const std::mt19937_64 start = engine;
  write_at_random(whole, 60);
  const int lost = static_cast<int>(below(60));
  engine = start;
  write_at_random(lossy, 60, lost);
  const bool same = file_bytes(whole.folder / "disk") == file_bytes(lossy.folder / "disk");
  if (!same) {
    EXPECT_NE(lossy.complaint(), "") << "write " << lost;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, WrittenBytesTest, ::testing::Range(0, 50));

TEST(WrittenBytes, NamesWhatIsDamaged) {
  Disk disk;
  disk.write(0, std::vector<unsigned char>(100, 1), true, {"head"});
  disk.write(100, std::vector<unsigned char>(100, 2), false, {"obs/pad of demo_", 7});
  disk.write(200, std::vector<unsigned char>(100, 3), true, {"tail"});
  EXPECT_THAT(disk.complaint(), HasSubstr("bytes 100 to 199 (obs/pad of demo_7) are not"));
  EXPECT_NO_THROW(disk.written->compare(0, 100));
  EXPECT_THROW(disk.written->compare(150, 1), IoError);
  EXPECT_NO_THROW(disk.written->compare(200, 5));
}

/// Between pieces a file has zeros, and it ends where it should.
TEST(WrittenBytes, SeesWhatNobodyWrote) {
  Disk disk;
  disk.write(0, {1, 2, 3});
  disk.write(50, {4});
  EXPECT_EQ(disk.complaint(), "");
  disk.put(20, {9});
  disk.written->end_at(51);
  EXPECT_THAT(disk.complaint(), HasSubstr("bytes 3 to 49 (unused)"));
  disk.put(20, {0});
  disk.put(60, {0});
  EXPECT_THAT(disk.complaint(), HasSubstr("it has 61 bytes; expected 51"));
}

TEST(PartFile, IsReadBackBeforeItGetsItsName) {
  const testing::Folder folder;
  PartFile part(folder / "out.txt", false);
  part.write("all is well\n");
  const int other = open(part.path().c_str(), O_WRONLY);
  ASSERT_EQ(pwrite(other, "b", 1, 0), 1);
  close(other);
  EXPECT_THROW(part.commit(), IoError);
  EXPECT_FALSE(std::filesystem::exists(folder / "out.txt"));
}

}  // namespace
}  // namespace tangere
