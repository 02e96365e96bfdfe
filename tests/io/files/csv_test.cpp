// SPDX-License-Identifier: Apache-2.0
// Tests which texts are tables of numbers, and that errors name the place of the mistake.
#include "io/files/csv.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using testing::ElementsAre;
using ::testing::HasSubstr;
using Rows = std::vector<std::vector<double>>;

class Csv : public testing::Test {
 protected:
  Csv() : path_(testing::TempDir() + "tangere_csv_" + std::to_string(getpid()) + test_name()) {}
  ~Csv() override { std::filesystem::remove(path_); }

  Rows read(const std::string& text, std::size_t columns,
            const std::vector<std::string>& names = {}) {
    std::ofstream(path_, std::ios::binary) << text;
    return read_csv(path_, columns, names);
  }

  /// The message of the reader; "" if it succeeds. Leaves out the path.
  std::string complaint(const std::string& text, std::size_t columns,
                        const std::vector<std::string>& names = {}) {
    try {
      read(text, columns, names);
    } catch (const InputError& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.rfind(path_, 0), 0U) << what;
      return what.substr(path_.size());
    }
    return "";
  }

  static std::string test_name() {
    return testing::UnitTest::GetInstance()->current_test_info()->name();
  }
  std::string path_;
};

TEST_F(Csv, ReadsRowsOfNumbers) {
  EXPECT_THAT(read("1,-2.5,3e-2\n+4,.5,6.\n", 3),
              ElementsAre(ElementsAre(1, -2.5, 0.03), ElementsAre(4, 0.5, 6)));
}

TEST_F(Csv, SkipsCommentsEmptyLinesBlanksAndTheHeader) {
  EXPECT_THAT(
      read("\xEF\xBB\xBF# made by hand\r\n\r\n fx , \"fy\"\r\n\t1 , 2 \r\n  # more\r\n3,4", 2),
      ElementsAre(ElementsAre(1, 2), ElementsAre(3, 4)));
}

TEST_F(Csv, NamesTheLineAndWhatIsWrongInIt) {
  EXPECT_EQ(complaint("1,2\n3\n", 2), ":2: 1 column; expected 2, one per control");
  EXPECT_EQ(complaint("# a\n1,2,3\n", 2), ":2: 3 columns; expected 2, one per control");
  EXPECT_EQ(complaint("1,2\n3,x4\n", 2), ":2: column 2: 'x4' is not a number");
  EXPECT_EQ(complaint("1,2\n3 4,5\n", 2), ":2: column 1: '3 4' is not a number");
  EXPECT_EQ(complaint("1,2\n3,\n", 2), ":2: column 2 is empty; expected a number");
  EXPECT_EQ(complaint("1,2\nnan,3\n", 2), ":2: column 1: 'nan'; expected a finite number");
  EXPECT_EQ(complaint("1,-inf\n", 2), ":1: column 2: '-inf'; expected a finite number");
  EXPECT_EQ(complaint("1,1e999\n", 2), ":1: column 2: '1e999' is beyond the range of a double");
  EXPECT_EQ(complaint("0x10,1\n", 2), ":1: column 1: '0x10' is not a number");
  EXPECT_EQ(complaint("1;2\n", 1), ":1: column 1: '1;2' is not a number");
  EXPECT_EQ(complaint("+-1\n", 1), ":1: column 1: '+-1' is not a number");
}

TEST_F(Csv, OnlyTheFirstRowIsAHeader) {
  EXPECT_EQ(complaint("nan,nan\n1,2\n", 2), ":1: column 1: 'nan'; expected a finite number");
  EXPECT_EQ(complaint("fx,1\n1,2\n", 2), ":1: column 1: 'fx' is not a number");
  EXPECT_EQ(complaint("fx,fy\nfx,fy\n", 2), ":2: column 1: 'fx' is not a number");
  EXPECT_EQ(complaint("1,2\nfx,fy\n", 2), ":2: column 1: 'fx' is not a number");
  EXPECT_EQ(complaint("fx,fy,fz\n1,2\n", 2), ":1: 3 columns; expected 2, one per control");
}

TEST_F(Csv, AHeaderMustNotSwapNames) {
  EXPECT_EQ(complaint("fx,fy\n1,2\n", 2, {"fx", "fy"}), "");
  EXPECT_EQ(complaint("left,right\n1,2\n", 2, {"fx", "fy"}), "");
  EXPECT_THAT(complaint("fy,\"fx\"\n1,2\n", 2, {"fx", "fy"}),
              HasSubstr(":1: column 1 is headed 'fy'; expected 'fx'"));
}

TEST_F(Csv, AFileWithoutRowsIsNoTable) {
  for (const char* text : {"", "\n\n", "# nothing\n", "fx,fy\n"})
    EXPECT_EQ(complaint(text, 2), ": no rows of numbers; expected at least one") << text;
}

TEST_F(Csv, BinaryAndEndlessLinesAreRefused) {
  EXPECT_THAT(complaint(std::string("1\0,2\n", 5), 2), HasSubstr(":1: column 1: '1"));
  EXPECT_EQ(complaint(std::string(std::size_t{2} << 20, '1'), 1),
            ":1: line longer than 1048576 bytes; expected a table of numbers");
}

TEST_F(Csv, WhatCannotBeReadIsAnIoError) {
  EXPECT_THROW(read_csv(path_ + ".missing", 1), IoError);
  EXPECT_THROW(read_csv(testing::TempDir(), 1), IoError);
}

}  // namespace
}  // namespace tangere
