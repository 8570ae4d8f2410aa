#include "pmeta_core/base/model.h"

#include <zlib.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <set>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

constexpr std::size_t kMaxScalars = std::size_t{1} << 40;

std::uint64_t fnv1a(const std::string& text) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (const unsigned char c : text) hash = (hash ^ c) * 0x100000001b3ULL;
  return hash;
}

// CRC-32 over a block of any length (zlib's counter is 32 bits wide)
std::uint32_t crc(std::uint32_t start, const unsigned char* data, std::size_t n) {
  uLong value = start;
  while (n > 0) {
    const auto chunk = static_cast<uInt>(std::min<std::size_t>(n, 1u << 30));
    value = crc32(value, data, chunk);
    data += chunk;
    n -= chunk;
  }
  return static_cast<std::uint32_t>(value);
}

}  // namespace

std::size_t Block::size() const {
  std::size_t n = 1;
  for (const std::size_t extent : shape) n *= extent;
  return n;
}

ModelLayout::ModelLayout(Precision precision, std::vector<Block> blocks)
    : precision_(precision), blocks_(std::move(blocks)) {
  std::ostringstream text;
  text << (precision == Precision::kFloat32 ? "float32" : "float64") << "\n";
  std::set<std::string> names;
  for (const Block& block : blocks_) {
    if (block.name.empty() || block.name.find_first_of(" \t\n") != std::string::npos) {
      throw Error("a model block needs a name without blanks, not " + shown(block.name) + ".");
    }
    if (!names.insert(block.name).second) {
      throw Error("the model block " + shown(block.name) + " stands twice in one layout.");
    }
    std::size_t n = 1;
    text << block.name;
    for (const std::size_t extent : block.shape) {
      if (extent == 0 || n > kMaxScalars / extent) {
        throw Error("the model block " + shown(block.name) + " has an impossible shape.");
      }
      n *= extent;
      text << " " << extent;
    }
    text << "\n";
    size_ += n;
  }
  if (blocks_.empty()) throw Error("a model layout needs at least one block.");
  text_ = text.str();
  hash_ = fnv1a(text_);
}

ModelLayout ModelLayout::parse(const std::string& text) {
  std::istringstream in(text);
  std::string line;
  std::getline(in, line);
  if (line != "float32" && line != "float64") {
    throw Error("a model layout must begin with float32 or float64.");
  }
  const Precision precision = line == "float32" ? Precision::kFloat32 : Precision::kFloat64;
  std::vector<Block> blocks;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    Block block;
    words >> block.name;
    std::size_t extent = 0;
    while (words >> extent) block.shape.push_back(extent);
    if (!words.eof())
      throw Error("the layout of model block " + shown(block.name) + " is malformed.");
    blocks.push_back(std::move(block));
  }
  ModelLayout layout(precision, std::move(blocks));
  if (layout.text() != text) throw Error("a model layout is not in its canonical form.");
  return layout;
}

Model::Model(const ModelLayout& layout_in) : layout(layout_in) {
  if (layout.precision() == Precision::kFloat32) {
    values = std::vector<float>(layout.size());
  } else {
    values = std::vector<double>(layout.size());
  }
}

const unsigned char* Model::bytes() const {
  return std::visit([](const auto& v) { return reinterpret_cast<const unsigned char*>(v.data()); },
                    values);
}

std::size_t Model::byteCount() const {
  return std::visit([](const auto& v) { return v.size() * sizeof(v[0]); }, values);
}

std::uint32_t Model::checksum() const {
  return crc(crc(0, bytes(), byteCount()), present.data(), present.size());
}

bool Model::operator==(const Model& other) const {
  // bytes, not numbers: equality here means "the same bits"
  return layout == other.layout && present == other.present && byteCount() == other.byteCount() &&
         std::memcmp(bytes(), other.bytes(), byteCount()) == 0;
}

void Model::saveState(StateWriter& writer) const {
  std::visit([&](const auto& v) { writer.array("values", v); }, values);
}

void Model::loadState(StateReader& reader) {
  std::visit(
      [&](auto& v) {
        reader.array("values", v);
        for (std::size_t k = 0; k < v.size(); ++k) {
          if (isPresent(k) && !std::isfinite(v[k])) {
            reader.refuse("values",
                          "holds a value that is not finite (entry " + std::to_string(k) + ")");
          }
        }
      },
      values);
}

void checkModel(const Model& model, const ModelLayout& expected, const std::string& who) {
  if (model.layout != expected) {
    throw Error(who + " sent a model of layout " + hexHash(model.layout.hash()) +
                " but this run has " + hexHash(expected.hash()) +
                ": start it with the same configuration.");
  }
  std::visit(
      [&](const auto& values) {
        using Scalar = typename std::decay_t<decltype(values)>::value_type;
        const bool is_float = std::is_same<Scalar, float>::value;
        if (is_float != (expected.precision() == Precision::kFloat32)) {
          throw Error(who + " sent values in another precision than the layout says.");
        }
        if (values.size() != expected.size()) {
          throw Error(who + " sent " + std::to_string(values.size()) +
                      " values where the layout has " + std::to_string(expected.size()) + ".");
        }
        if (!model.present.empty() && model.present.size() != expected.size()) {
          throw Error(who + " sent a presence mask of " + std::to_string(model.present.size()) +
                      " entries where the layout has " + std::to_string(expected.size()) + ".");
        }
        for (std::size_t k = 0; k < values.size(); ++k) {
          if (model.isPresent(k) && !std::isfinite(values[k])) {
            throw Error(who + " sent a value that is not finite (entry " + std::to_string(k) +
                        ").");
          }
        }
      },
      model.values);
}

double distance(const Model& a, const Model& b) {
  return std::visit(
      [&](const auto& x) {
        const auto& y = std::get<std::decay_t<decltype(x)>>(b.values);
        double sum = 0;
        for (std::size_t k = 0; k < x.size(); ++k) {
          if (!a.isPresent(k) || !b.isPresent(k)) continue;
          const double difference = static_cast<double>(x[k]) - static_cast<double>(y[k]);
          sum += difference * difference;
        }
        return std::sqrt(sum);
      },
      a.values);
}

std::string hexHash(std::uint64_t hash) {
  char text[24];
  std::snprintf(text, sizeof text, "0x%016llx", static_cast<unsigned long long>(hash));
  return text;
}

}  // namespace pmeta
