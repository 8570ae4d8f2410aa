#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/security/key_file.h"

namespace pmeta {

/// A message authentication code: 32 bytes, or none where a message is not signed.
using Mac = std::vector<std::uint8_t>;

/// What a model on its way consists of, wherever it lies: so that a message is checked as it
/// arrived, without a copy. One of `floats` and `doubles` is used.
struct ModelView {
  std::string_view layout;  ///< ModelLayout::text()
  std::uint64_t layout_hash = 0;
  const float* floats = nullptr;
  std::size_t num_floats = 0;
  const double* doubles = nullptr;
  std::size_t num_doubles = 0;
  const std::uint8_t* present = nullptr;
  std::size_t num_present = 0;
  std::uint32_t checksum = 0;
};

/// The view of a model that must outlive it; computes the checksum.
ModelView viewOf(const Model& model);

/// What a message about the state of a run says beside its RoundSummary.
struct RoundNews {
  std::string experiment;
  std::uint8_t state = 0;
  std::string message;
  std::uint32_t refused = 0;
  std::int64_t stamp = 0;  ///< when it was written, in nanoseconds
};

/// What a message about the state of an agent says that others act on.
struct AgentNews {
  std::string run_id;
  int task = 0;
  std::uint8_t state = 0;
  std::string message;
  std::uint64_t incarnation = 0;  ///< of the aggregator that it follows; 0: of none yet
};

enum class Authenticity {
  kAuthentic,
  kUnsigned,  ///< no MAC where one is needed
  kForged,    ///< the MAC is another's: another key, or other contents
};

/// Signs the messages of a run and checks signatures: BLAKE2b with a key (RFC 7693), 32 bytes, over
/// which message it is, and each of its fields in an encoding without ambiguity (lengths before
/// texts and arrays, little endian).
///
/// Whoever holds the key can sign for anybody. That a message is new is not shown by its MAC but by
/// its round, of which each task and the aggregator have one message to give.
class Authenticator {
 public:
  /// Without a key: signs nothing and takes everything as authentic.
  Authenticator() = default;
  explicit Authenticator(const Key& key);
  /// With the key in that file; "" means without one. Throws Error.
  explicit Authenticator(const std::string& key_file);

  bool hasKey() const { return key_.has_value(); }

  /// The MAC of a message; needs a key. The forms with a view take the parameters from there, and
  /// leave the struct's own model aside.
  Mac mac(const AuxiliaryUpdate& update) const;
  Mac mac(const AuxiliaryUpdate& header, const ModelView& model) const;
  Mac mac(const MetaPolicy& meta, int rounds) const;
  Mac mac(const MetaPolicy& header, const ModelView& model, int rounds) const;
  Mac mac(const TaskReturn& result, const std::string& task_name) const;
  Mac mac(const AgentNews& news) const;
  Mac mac(const RoundSummary& summary, const RoundNews& news) const;

  /// Compares the MAC that a message carries with the one it should, in constant time.
  static Authenticity compare(const Mac& carried, const Mac& computed);

 private:
  std::optional<Key> key_;
};

}  // namespace pmeta
