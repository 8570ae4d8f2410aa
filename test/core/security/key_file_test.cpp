#include "pmeta_core/security/key_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <set>

#include "../support.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::readFile;
using test::TempDir;
using test::writeFile;

// 01 02 ... 20
const std::string kDigits = "0102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f20";

std::string writeKey(const TempDir& dir, const std::string& text, mode_t mode = 0600) {
  const std::string path = dir / "key";
  unlink(path.c_str());
  writeFile(path, text);
  chmod(path.c_str(), mode);
  return path;
}

TEST(KeyFile, IsReadAsHexadecimalDigits) {
  const TempDir dir;
  Key expected{};
  for (std::size_t i = 0; i < expected.size(); ++i) expected[i] = static_cast<std::uint8_t>(i + 1);
  EXPECT_EQ(readKeyFile(writeKey(dir, kDigits)), expected);
  EXPECT_EQ(readKeyFile(writeKey(dir, kDigits + "\n", 0400)), expected);
}

TEST(KeyFile, CreatedOnesArePrivateAndAllDifferent) {
  const TempDir dir;
  // whatever the user lets others see of new files
  const mode_t old = umask(0);
  std::set<Key> keys;
  for (int i = 0; i < 20; ++i) {
    const std::string path = dir / ("key" + std::to_string(i));
    createKeyFile(path);
    struct stat status {};
    ASSERT_EQ(stat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777, 0600u);
    EXPECT_EQ(readFile(path).size(), 65u);
    keys.insert(readKeyFile(path));
  }
  umask(old);
  EXPECT_EQ(keys.size(), 20u);
}

TEST(KeyFile, IsNeverOverwritten) {
  const TempDir dir;
  const std::string path = writeKey(dir, "precious");
  EXPECT_EQ(errorOf([&] { createKeyFile(path); }),
            path + " is there already and was left as it is: give a new name.");
  EXPECT_EQ(readFile(path), "precious");
  const std::string link = dir / "link";
  ASSERT_EQ(symlink((dir / "nowhere").c_str(), link.c_str()), 0);
  EXPECT_NE(errorOf([&] { createKeyFile(link); }), "(no error)");
  EXPECT_NE(access((dir / "nowhere").c_str(), F_OK), 0);
  EXPECT_EQ(errorOf([&] { createKeyFile(dir / "no/such/folder"); }),
            "the key file " + (dir / "no/such/folder") +
                " cannot be created (No such file or directory).");
}

TEST(KeyFile, ModesThatLetOthersInAreRefused) {
  const TempDir dir;
  for (const mode_t mode : {0644, 0640, 0604, 0620, 0602, 0601, 0610, 0700, 0666, 04600}) {
    const std::string path = writeKey(dir, kDigits, mode);
    char octal[8];
    std::snprintf(octal, sizeof octal, "%04o", mode);
    EXPECT_EQ(errorOf([&] { readKeyFile(path); }), "the key file " + path + " has mode " + octal +
                                                       ", which lets others at it: run chmod 600 " +
                                                       path + ".");
  }
}

TEST(KeyFile, MustBeARegularFile) {
  const TempDir dir;
  EXPECT_EQ(
      errorOf([&] { readKeyFile(dir.path()); }),
      "the key file " + dir.path() + " is not a regular file: make one with ./pmeta key FILE.");
  const std::string pipe = dir / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_NE(errorOf([&] { readKeyFile(pipe); }).find("is not a regular file"), std::string::npos);
  const std::string link = dir / "link";
  ASSERT_EQ(symlink(writeKey(dir, kDigits).c_str(), link.c_str()), 0);
  EXPECT_EQ(errorOf([&] { readKeyFile(link); }),
            "the key file " + link +
                " cannot be opened (it is a symbolic link): make one with ./pmeta key FILE.");
  EXPECT_EQ(errorOf([&] { readKeyFile(dir / "none"); }),
            "the key file " + (dir / "none") +
                " cannot be opened (No such file or directory): make one with ./pmeta key FILE.");
}

TEST(KeyFile, OfAnotherUserIsRefused) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  const TempDir dir;
  const std::string path = writeKey(dir, kDigits);
  ASSERT_EQ(chown(path.c_str(), 12345, 12345), 0);
  EXPECT_EQ(errorOf([&] { readKeyFile(path); }),
            "the key file " + path + " belongs to another user: use a copy of your own.");
}

TEST(KeyFile, WhatIsNoKeyIsRefusedAndNotShown) {
  const TempDir dir;
  const std::string secret = kDigits.substr(0, 62);
  for (const std::string& text :
       {std::string(), secret, secret + "zz", kDigits + "00", kDigits + "\n\n", kDigits + " ",
        " " + kDigits, secret + "\n\n", kDigits.substr(1)}) {
    const std::string path = writeKey(dir, text);
    const std::string error = errorOf([&] { readKeyFile(path); });
    EXPECT_EQ(error, "the key file " + path +
                         " does not hold 64 hexadecimal digits and nothing else: make one with "
                         "./pmeta key FILE.")
        << text;
  }
}

}  // namespace
}  // namespace pmeta
