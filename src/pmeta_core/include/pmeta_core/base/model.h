#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "pmeta_core/base/state.h"

namespace pmeta {

/// One named tensor of a model, in row-major order.
struct Block {
  std::string name;  ///< unique in its layout, e.g. "q_table" or "critic1.layer0.weight"
  std::vector<std::size_t> shape;  ///< every extent positive

  std::size_t size() const;  ///< the product of the shape's extents, 1 for a scalar
};

/// Scalar type of a model: networks use float32, tables float64, and nothing is rounded on the way.
enum class Precision { kFloat32, kFloat64 };

/// Names and shapes of a model's blocks, which lie one after the other in its flat values.
class ModelLayout {
 public:
  ModelLayout() = default;
  /// Throws Error if two blocks share a name, or a name or extent is empty.
  ModelLayout(Precision precision, std::vector<Block> blocks);

  /// Reads what text() wrote; throws Error on anything else. Safe on hostile text.
  static ModelLayout parse(const std::string& text);

  Precision precision() const { return precision_; }            ///< of every block
  const std::vector<Block>& blocks() const { return blocks_; }  ///< in the order of the flat values
  std::size_t size() const { return size_; }                    ///< number of scalars
  const std::string& text() const { return text_; }             ///< "float64\nq_table 64 4\n"
  std::uint64_t hash() const { return hash_; }                  ///< FNV-1a over text()

  /// The same precision, and the same names and shapes in the same order.
  bool operator==(const ModelLayout& other) const { return text_ == other.text_; }
  /// The opposite of ==.
  bool operator!=(const ModelLayout& other) const { return !(*this == other); }

 private:
  Precision precision_ = Precision::kFloat64;
  std::vector<Block> blocks_;
  std::size_t size_ = 0;
  std::string text_;
  std::uint64_t hash_ = 0;
};

/// Parameters of a policy: flat values in the layout's precision, and which entries are present.
///
/// A task that owns only part of a table (its states out of the union of all tasks' states) marks
/// the rest as absent; absent entries are never averaged. Networks leave `present` empty: all are
/// present.
struct Model {
  ModelLayout layout;  ///< says what each of the values is
  /// Of the layout's precision, layout.size() of them.
  std::variant<std::vector<float>, std::vector<double>> values;
  std::vector<std::uint8_t> present;  ///< empty, or one 0/1 per scalar

  Model() = default;
  /// All values zero, all present.
  explicit Model(const ModelLayout& layout);

  /// Does entry k count? True for all where `present` is empty.
  bool isPresent(std::size_t k) const { return present.empty() || present[k] != 0; }
  std::size_t size() const { return layout.size(); }  ///< scalars, absent ones included

  /// The values of a float64 model; throws std::bad_variant_access on any other.
  std::vector<double>& doubles() { return std::get<std::vector<double>>(values); }
  /// The same, to be read only.
  const std::vector<double>& doubles() const { return std::get<std::vector<double>>(values); }
  /// The values of a float32 model; throws std::bad_variant_access on any other.
  std::vector<float>& floats() { return std::get<std::vector<float>>(values); }
  /// The same, to be read only.
  const std::vector<float>& floats() const { return std::get<std::vector<float>>(values); }

  /// Bytes of the values, for checksums.
  const unsigned char* bytes() const;
  std::size_t byteCount() const;  ///< how many bytes() are: 4 or 8 a value

  /// CRC-32 over values and presence mask.
  std::uint32_t checksum() const;

  /// The same layout, presence and values, bit for bit: NaN equals itself, 0 is not -0.
  bool operator==(const Model& other) const;

  /// The values alone: layout and presence follow from the settings. Loading writes them in place
  /// and refuses a present one that is not finite.
  void saveState(StateWriter& writer) const;
  void loadState(StateReader& reader);  ///< refuses a saved model of another size or precision
};

/// Throws Error unless `model` has the layout `expected`, matching sizes and finite values wherever
/// an entry is present. `who` names the sender in the message.
void checkModel(const Model& model, const ModelLayout& expected, const std::string& who);

/// Euclidean distance between two models of one layout over the entries present in both.
double distance(const Model& a, const Model& b);

/// "0x" and 16 hexadecimal digits: how hashes are shown to people.
std::string hexHash(std::uint64_t hash);

}  // namespace pmeta
