#include "pmeta_core/base/model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "../support.h"
#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

using test::errorOf;

ModelLayout table(std::size_t states = 6, std::size_t actions = 4) {
  return {Precision::kFloat64, {{"q_table", {states, actions}}}};
}

ModelLayout network() {
  return {Precision::kFloat32,
          {{"actor.weight", {3, 2}}, {"actor.bias", {3}}, {"temperature", {}}}};
}

std::string refusal(const std::string& text) {
  return errorOf([&] { ModelLayout::parse(text); });
}

TEST(ModelLayout, TextSizeAndHashAreAsSpeltOut) {
  EXPECT_EQ(table(64, 4).text(), "float64\nq_table 64 4\n");
  EXPECT_EQ(table(64, 4).size(), 256u);
  EXPECT_EQ(network().text(), "float32\nactor.weight 3 2\nactor.bias 3\ntemperature\n");
  EXPECT_EQ(network().size(), 10u);

  // FNV-1a with the prime spelt out as its two bits' worth of shifts
  std::uint64_t hash = 14695981039346656037ULL;
  const std::string text = network().text();
  for (const char c : text) {
    hash ^= static_cast<unsigned char>(c);
    hash = (hash << 40) + hash * 0x1b3;
  }
  EXPECT_EQ(network().hash(), hash);
}

TEST(ModelLayout, ParseUndoesText) {
  for (const ModelLayout& layout : {table(), network(), table(1, 1)}) {
    const ModelLayout parsed = ModelLayout::parse(layout.text());
    EXPECT_EQ(parsed, layout);
    EXPECT_EQ(parsed.hash(), layout.hash());
    EXPECT_EQ(parsed.size(), layout.size());
    EXPECT_EQ(parsed.precision(), layout.precision());
    ASSERT_EQ(parsed.blocks().size(), layout.blocks().size());
    for (std::size_t i = 0; i < parsed.blocks().size(); ++i) {
      EXPECT_EQ(parsed.blocks()[i].name, layout.blocks()[i].name);
      EXPECT_EQ(parsed.blocks()[i].shape, layout.blocks()[i].shape);
    }
  }
}

TEST(ModelLayout, DifferentLayoutsDifferInHash) {
  EXPECT_NE(table(6, 4), table(4, 6));
  EXPECT_NE(table(6, 4).hash(), table(4, 6).hash());
  EXPECT_NE(ModelLayout(Precision::kFloat32, {{"q_table", {6, 4}}}), table());
}

TEST(ModelLayout, RefusesHostileText) {
  const std::string head = "a model layout must begin with float32 or float64.";
  EXPECT_EQ(refusal(""), head);
  EXPECT_EQ(refusal("float16\nq 1\n"), head);
  EXPECT_EQ(refusal("float64 \nq 1\n"), head);
  EXPECT_EQ(refusal("float64\n"), "a model layout needs at least one block.");
  EXPECT_EQ(refusal("float64\nq 4\nq 4\n"), "the model block 'q' stands twice in one layout.");
  EXPECT_EQ(refusal("float64\n\nq 4\n"), "a model block needs a name without blanks, not ''.");

  const std::string shape = "the model block 'q' has an impossible shape.";
  EXPECT_EQ(refusal("float64\nq 0\n"), shape);
  EXPECT_EQ(refusal("float64\nq -1\n"), shape);
  EXPECT_EQ(refusal("float64\nq 18446744073709551615\n"), shape);
  EXPECT_EQ(refusal("float64\nq 4294967296 4294967296\n"), shape);
  EXPECT_EQ(refusal("float64\nq 1048576 1048576 1048576 1048576\n"), shape);
  EXPECT_EQ(refusal("float64\nq 1099511627777\n"), shape);

  const std::string malformed = "the layout of model block 'q' is malformed.";
  EXPECT_EQ(refusal("float64\nq four\n"), malformed);
  EXPECT_EQ(refusal("float64\nq 4.5\n"), malformed);
  EXPECT_EQ(refusal("float64\nq 4 x 4\n"), malformed);

  // numbers that wrap round to a fine extent, blanks, signs, a missing end of line
  for (const std::string text :
       {"float64\nq 99999999999999999999999\n", "float64\nq -18446744073709551615\n",
        "float64\nq  4\n", "float64\nq 4 \n", "float64\nq +4\n", "float64\nq 04\n", "float64\nq 4",
        "float64\r\nq 4\r\n", "float64\nq 4\n\n"}) {
    EXPECT_NE(refusal(text), "(no error)") << text;
  }
}

TEST(ModelLayout, RefusesBadNames) {
  for (const std::string name : {"", "a b", "a\tb", "a\nb"}) {
    EXPECT_EQ(errorOf([&] {
                ModelLayout(Precision::kFloat64, {{name, {2}}});
              }),
              "a model block needs a name without blanks, not " + shown(name) + ".");
  }
}

TEST(Model, BeginsAtZeroAndPresentInItsPrecision) {
  const Model doubles(table());
  EXPECT_EQ(doubles.doubles(), std::vector<double>(24, 0.0));
  EXPECT_EQ(doubles.byteCount(), 24 * 8u);
  const Model floats(network());
  EXPECT_EQ(floats.floats(), std::vector<float>(10, 0.0f));
  EXPECT_EQ(floats.byteCount(), 10 * 4u);
  for (std::size_t k = 0; k < 10; ++k) EXPECT_TRUE(floats.isPresent(k));
}

TEST(Model, ChecksumIsCrc32) {
  // the check value of CRC-32: 0xcbf43926 for "123456789"; eight of them as a double
  Model model(table(1, 1));
  std::memcpy(model.doubles().data(), "12345678", 8);
  model.present = {'9'};
  EXPECT_EQ(model.checksum(), 0xcbf43926u);
}

TEST(Model, ChecksumAndEqualityNoticeEveryBit) {
  Model model(table(3, 2));
  for (std::size_t k = 0; k < model.size(); ++k) model.doubles()[k] = 0.1 * k - 0.2;
  model.present = {1, 1, 0, 0, 1, 1};
  const std::uint32_t checksum = model.checksum();
  for (std::size_t bit = 0; bit < 8 * model.byteCount(); ++bit) {
    Model changed = model;
    reinterpret_cast<unsigned char*>(changed.doubles().data())[bit / 8] ^= 1u << (bit % 8);
    EXPECT_NE(changed.checksum(), checksum) << "bit " << bit;
    EXPECT_FALSE(changed == model) << "bit " << bit;
  }
  for (std::size_t bit = 0; bit < 8 * model.present.size(); ++bit) {
    Model changed = model;
    changed.present[bit / 8] ^= 1u << (bit % 8);
    EXPECT_NE(changed.checksum(), checksum) << "mask bit " << bit;
    EXPECT_FALSE(changed == model) << "mask bit " << bit;
  }
  EXPECT_TRUE(Model(model) == model);
}

TEST(Model, EqualityIsOfBits) {
  Model a(table(1, 1)), b(table(1, 1));
  a.doubles() = {0.0};
  b.doubles() = {-0.0};
  EXPECT_FALSE(a == b);
  a.doubles() = b.doubles() = {std::nan("")};
  EXPECT_TRUE(a == b);
}

TEST(CheckModel, AcceptsWhatFits) {
  Model model(table());
  EXPECT_EQ(errorOf([&] { checkModel(model, table(), "task 2"); }), "(no error)");
  model.present.assign(24, 1);
  model.present[3] = 0;
  model.doubles()[3] = std::nan("");
  EXPECT_EQ(errorOf([&] { checkModel(model, table(), "task 2"); }), "(no error)");
}

TEST(CheckModel, SaysWhatDoesNotFit) {
  const auto refused = [](const Model& model) {
    return errorOf([&] { checkModel(model, table(), "task 2"); });
  };
  EXPECT_EQ(refused(Model(network())),
            "task 2 sent a model of layout " + hexHash(network().hash()) + " but this run has " +
                hexHash(table().hash()) + ": start it with the same configuration.");

  Model model(table());
  model.values = std::vector<float>(24);
  EXPECT_EQ(refused(model), "task 2 sent values in another precision than the layout says.");
  model.values = std::vector<double>(23);
  EXPECT_EQ(refused(model), "task 2 sent 23 values where the layout has 24.");
  model = Model(table());
  model.present.assign(25, 1);
  EXPECT_EQ(refused(model), "task 2 sent a presence mask of 25 entries where the layout has 24.");
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    model = Model(table());
    model.doubles()[23] = bad;
    EXPECT_EQ(refused(model), "task 2 sent a value that is not finite (entry 23).");
  }
  EXPECT_NE(refused(Model()), "(no error)");
}

TEST(CheckModel, ChecksFloatsToo) {
  Model model(network());
  model.floats()[9] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(errorOf([&] { checkModel(model, network(), "task 0"); }),
            "task 0 sent a value that is not finite (entry 9).");
}

TEST(Distance, IsEuclideanOverEntriesPresentInBoth) {
  Model a(table(2, 2)), b(table(2, 2));
  a.doubles() = {1, 2, 3, 4};
  b.doubles() = {4, 6, 3, 16};
  EXPECT_DOUBLE_EQ(distance(a, b), 13);
  a.present = {1, 1, 1, 0};
  EXPECT_DOUBLE_EQ(distance(a, b), 5);
  EXPECT_DOUBLE_EQ(distance(b, a), 5);
  b.present = {0, 1, 1, 1};
  EXPECT_DOUBLE_EQ(distance(a, b), 4);
  b.present = {0, 0, 0, 0};
  EXPECT_EQ(distance(a, b), 0);
}

TEST(Distance, OfFloatsIsTakenInDouble) {
  Model a(network()), b(network());
  a.floats().assign(10, 16777216.0f);
  b.floats().assign(10, -16777214.0f);
  // the squares' sum is no float
  EXPECT_DOUBLE_EQ(distance(a, b), 33554430.0 * std::sqrt(10.0));
}

TEST(HexHash, HasSixteenDigits) {
  EXPECT_EQ(hexHash(0), "0x0000000000000000");
  EXPECT_EQ(hexHash(0xabcdef), "0x0000000000abcdef");
  EXPECT_EQ(hexHash(~0ULL), "0xffffffffffffffff");
}

}  // namespace
}  // namespace pmeta
