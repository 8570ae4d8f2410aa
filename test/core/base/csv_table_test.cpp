#include "pmeta_core/base/csv_table.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::readFile;
using test::TempDir;
using test::writeFile;

constexpr char kGzip[] = PMETA_TEST_DATA "/mountaincar_traj.csv.gz";

std::string refusal(const std::string& text) {
  return errorOf([&] { CsvTable::parse(text, "a.csv"); });
}

TEST(CsvTable, HoldsCellsByRowAndColumn) {
  const CsvTable table = CsvTable::parse("name,x,n\nleft,-1.5e-3,7\nright,.5,-2\n", "a.csv");
  EXPECT_EQ(table.columns(), (std::vector<std::string>{"name", "x", "n"}));
  ASSERT_EQ(table.numRows(), 2u);
  EXPECT_EQ(table.column("n"), 2u);
  EXPECT_EQ(table.text(1, 0), "right");
  EXPECT_EQ(table.number(0, 1), -1.5e-3);
  EXPECT_EQ(table.number(1, 1), 0.5);
  EXPECT_EQ(table.wholeNumber(1, 2), -2);
  EXPECT_EQ(table.line(1), 3);
}

TEST(CsvTable, LineEndsMayBeThoseOfWindowsAndTheLastMayBeMissing) {
  const CsvTable table = CsvTable::parse("a,b\r\n1,2\r\n3,4", "a.csv");
  ASSERT_EQ(table.numRows(), 2u);
  EXPECT_EQ(table.column("b"), 1u);
  EXPECT_EQ(table.number(0, 1), 2);
  EXPECT_EQ(table.number(1, 1), 4);
  EXPECT_EQ(CsvTable::parse("a,b\n", "a.csv").numRows(), 0u);
}

TEST(CsvTable, RefusesWhatIsNoTable) {
  EXPECT_EQ(refusal(""), "a.csv is empty: its first line must name the columns.");
  EXPECT_EQ(refusal("a,,c\n"), "a.csv line 1 has a column without a name.");
  EXPECT_EQ(refusal("a,b,a\n"), "a.csv line 1 names the column 'a' twice.");
  EXPECT_EQ(refusal("a,b,c\n1,2,3\n4,5\n"),
            "a.csv line 3 has 2 cells for 3 columns: it ends before column 'c'.");
  EXPECT_EQ(refusal("a,b\n1,2,3\n"),
            "a.csv line 2 has 3 cells for 2 columns: it goes on after column 'b'.");
  EXPECT_EQ(refusal("a,b\n\n1,2\n"),
            "a.csv line 2 has 1 cells for 2 columns: it ends before column 'b'.");
}

TEST(CsvTable, AWideHeaderIsReadAsFastAsALongOne) {
  std::string header = "c0";
  for (int k = 1; k < 200000; ++k) header += ",c" + std::to_string(k);
  EXPECT_EQ(CsvTable::parse(header + "\n", "a.csv").column("c199999"), 199999u);
  EXPECT_EQ(refusal(header + ",c7\n"), "a.csv line 1 names the column 'c7' twice.");
}

TEST(CsvTable, AColumnsNameIsShownWithoutControlCharacters) {
  EXPECT_EQ(refusal("a,b\x1b[31m\n1\n"),
            "a.csv line 2 has 1 cells for 2 columns: it ends before column 'b?[31m'.");
}

TEST(CsvTable, WhatUnpacksToTooMuchIsRefusedByName) {
  const TempDir dir;
  const std::string path = dir / "bomb.csv.gz";
  const std::string pack = "head -c 70000000 /dev/zero | gzip -1 > " + path;
  ASSERT_EQ(std::system(pack.c_str()), 0);
  EXPECT_EQ(errorOf([&] { CsvTable::load(path); }),
            "cannot read " + path +
                " (it has more than 67108864 bytes when unpacked, and at most that is read).");
}

TEST(CsvTable, RefusesCellsThatAreNoNumbersOfTheirRange) {
  for (const char* cell : {"", "x", "1x", "inf", "0x10", "1e999", " 1", "1;5", "--1"}) {
    const CsvTable table = CsvTable::parse("a,b\n" + std::string(cell) + ",0\n", "a.csv");
    EXPECT_EQ(errorOf([&] { table.number(0, 0); }),
              "a.csv line 2 column a is '" + std::string(cell) + "' but must be a number.");
  }
  const CsvTable table = CsvTable::parse("time,size\n1,nan\n-2.5,0\n", "a.csv");
  EXPECT_EQ(errorOf([&] { table.number(0, 1); }),
            "a.csv line 2 column size is 'nan' but must be a number.");
  EXPECT_EQ(errorOf([&] { table.number(1, 1, Range::above(0)); }),
            "a.csv line 3 column size is '0' but must be a number, above 0.");
  EXPECT_EQ(errorOf([&] { table.wholeNumber(1, 0); }),
            "a.csv line 3 column time is '-2.5' but must be a whole number.");
}

TEST(CsvTable, NamesTheColumnThatIsMissing) {
  const CsvTable table = CsvTable::parse("position,velocity\n0,0\n", "a.csv");
  EXPECT_EQ(errorOf([&] { table.column("theta"); }),
            "a.csv line 1 names no column 'theta': is this the right kind of file?");
}

TEST(CsvTable, ReadsGzipAndPlainFilesAlike) {
  const TempDir dir;
  const CsvTable packed = CsvTable::load(kGzip);
  std::string text = join(packed.columns(), ",") + "\n";
  for (std::size_t row = 0; row < packed.numRows(); ++row) {
    for (std::size_t column = 0; column < packed.columns().size(); ++column) {
      text += (column == 0 ? "" : ",") + packed.text(row, column);
    }
    text += "\n";
  }
  writeFile(dir / "plain.csv", text);
  const CsvTable plain = CsvTable::load(dir / "plain.csv");
  EXPECT_GT(packed.numRows(), 5000u);
  ASSERT_EQ(plain.numRows(), packed.numRows());
  ASSERT_EQ(plain.columns(), packed.columns());
  for (std::size_t row = 0; row < packed.numRows(); ++row) {
    for (std::size_t column = 0; column < packed.columns().size(); ++column) {
      ASSERT_EQ(plain.text(row, column), packed.text(row, column));
    }
  }
}

TEST(CsvTable, SaysWhyAFileCannotBeRead) {
  const TempDir dir;
  const auto loading = [&](const std::string& name) {
    return errorOf([&] { CsvTable::load(dir / name); });
  };
  EXPECT_EQ(loading("none.csv"),
            "the table " + dir.path() + "/none.csv cannot be read (No such file or directory).");
  std::filesystem::create_directory(dir / "folder");
  EXPECT_EQ(loading("folder"),
            "the table " + dir.path() + "/folder cannot be read (it is a folder).");
  writeFile(dir / "empty.csv", "");
  EXPECT_EQ(loading("empty.csv"),
            dir.path() + "/empty.csv is empty: its first line must name the columns.");

  // a copy that broke off: anywhere, but that the last bytes are missing
  const std::string whole = readFile(kGzip);
  for (const std::size_t length :
       {std::size_t{5}, std::size_t{40}, whole.size() / 2, whole.size() - 9, whole.size() - 1}) {
    writeFile(dir / "cut.csv.gz", whole.substr(0, length));
    EXPECT_EQ(loading("cut.csv.gz"),
              "cannot read " + dir.path() +
                  "/cut.csv.gz (its compressed data ends too early: is it cut short?).")
        << length;
  }
  std::string damaged = whole;
  damaged[whole.size() / 2] ^= 0x10;
  writeFile(dir / "damaged.csv.gz", damaged);
  EXPECT_EQ(
      loading("damaged.csv.gz")
          .find("cannot read " + dir.path() + "/damaged.csv.gz (its compressed data is damaged"),
      0u);
}

}  // namespace
}  // namespace pmeta
