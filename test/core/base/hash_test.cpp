#include "pmeta_core/base/hash.h"

#include <gtest/gtest.h>

namespace {

// "abc" by coreutils' b2sum -l 256
TEST(Hash, IsBlake2b) {
  EXPECT_EQ(pmeta::hashText("abc"),
            "bddd813c634239723171ef3fee98579b94964e3bb1cb3e427262c8c068d52319");
  EXPECT_NE(pmeta::hashText(""), pmeta::hashText(std::string(1, '\0')));
}

}  // namespace
