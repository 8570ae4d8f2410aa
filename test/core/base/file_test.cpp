#include "pmeta_core/base/file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "pmeta_core/base/error.h"
#include "support.h"

namespace pmeta {
namespace {

std::string errorOf(const std::string& path, std::size_t most = kLargestFile) {
  try {
    readFile(path, "the settings file", most);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(File, IsReadWhole) {
  const test::TempDir dir;
  const std::string text("a\0b\r\n\xff", 6);
  std::ofstream(dir / "file", std::ios::binary) << text;
  EXPECT_EQ(readFile(dir / "file", "the file"), text);
  requireRegularFile(dir / "file", "the file");
}

TEST(File, AFifoIsRefusedAtOnce) {
  const test::TempDir dir;
  ASSERT_EQ(mkfifo((dir / "fifo").c_str(), 0600), 0);
  EXPECT_EQ(errorOf(dir / "fifo"),
            "the settings file " + dir / "fifo" + " cannot be read (it is not a regular file).");
  EXPECT_THROW(requireRegularFile(dir / "fifo", "the file"), Error);
  EXPECT_THROW(requireRegularFile("/dev/null", "the file"), Error);
}

TEST(File, OnlyOnesOwnDescriptorsMayBePipes) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  ASSERT_EQ(write(ends[1], "a: 1\n", 5), 5);
  close(ends[1]);
  const std::string name = "/dev/fd/" + std::to_string(ends[0]);
  EXPECT_EQ(errorOf(name),
            "the settings file " + name + " cannot be read (it is not a regular file).");
  EXPECT_EQ(readFileOrPipe(name, "the settings file"), "a: 1\n");
  close(ends[0]);
  EXPECT_THROW(readFileOrPipe("/dev/zero", "the settings file"), Error);
}

TEST(File, WhyItCannotBeReadIsSaid) {
  const test::TempDir dir;
  EXPECT_EQ(errorOf(dir / "none"),
            "the settings file " + dir / "none" + " cannot be read (No such file or directory).");
  EXPECT_EQ(errorOf(dir.path()),
            "the settings file " + dir.path() + " cannot be read (it is a folder).");
  std::ofstream(dir / "long") << "12345";
  EXPECT_EQ(errorOf(dir / "long", 4),
            "the settings file " + dir / "long" +
                " cannot be read (it has 5 bytes, and at most 4 are read).");
}

}  // namespace
}  // namespace pmeta
