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
  std::string_view layout;                ///< ModelLayout::text()
  std::uint64_t layout_hash = 0;          ///< ModelLayout::hash(), as the message claims it
  const float* floats = nullptr;          ///< values of a float32 model
  std::size_t num_floats = 0;             ///< how many; 0 for a float64 model
  const double* doubles = nullptr;        ///< values of a float64 model
  std::size_t num_doubles = 0;            ///< how many; 0 for a float32 model
  const std::uint8_t* present = nullptr;  ///< mask, see Model::present
  std::size_t num_present = 0;            ///< how many; 0 where all are present
  std::uint32_t checksum = 0;             ///< Model::checksum(), as the message claims it
};

/// The view of a model that must outlive it; computes the checksum.
ModelView viewOf(const Model& model);

/// What a message about the state of a run says beside its RoundSummary.
struct RoundNews {
  std::string experiment;     ///< its name
  std::uint8_t state = 0;     ///< as in RoundSummary.msg
  std::string message;        ///< the state in a sentence
  std::uint32_t refused = 0;  ///< updates that were refused so far
  std::int64_t stamp = 0;     ///< when it was written, in nanoseconds
};

/// What a message about the state of an agent says that others act on.
struct AgentNews {
  std::string run_id;             ///< of the run that the agent takes part in
  int task = 0;                   ///< whose agent it is
  std::uint8_t state = 0;         ///< as in AgentStatus.msg
  std::string message;            ///< the state in a sentence
  std::uint64_t incarnation = 0;  ///< of the aggregator that it follows; 0: of none yet
};

/// What a message's MAC shows.
enum class Authenticity {
  kAuthentic,  ///< signed with this key; or there is none, and nobody signs
  kUnsigned,   ///< no MAC where one is needed
  kForged,     ///< the MAC is another's: another key, or other contents
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
  /// With that key. Throws Error where libsodium cannot be used.
  explicit Authenticator(const Key& key);
  /// With the key in that file; "" means without one. Throws Error.
  explicit Authenticator(const std::string& key_file);

  bool hasKey() const { return key_.has_value(); }  ///< false: nothing is signed or checked

  /// The MAC of a message; needs a key. The forms with a view take the parameters from there, and
  /// leave the struct's own model aside.
  Mac mac(const AuxiliaryUpdate& update) const;
  Mac mac(const AuxiliaryUpdate& header, const ModelView& model) const;  ///< see above
  /// `rounds`: of the whole run, which its message names too.
  Mac mac(const MetaPolicy& meta, int rounds) const;
  /// The same with the parameters as they arrived.
  Mac mac(const MetaPolicy& header, const ModelView& model, int rounds) const;
  /// `task_name`: which its message names too.
  Mac mac(const TaskReturn& result, const std::string& task_name) const;
  /// What AgentStatus.msg says beside these fields is for people, and not signed.
  Mac mac(const AgentNews& news) const;
  /// Of RoundSummary.msg, all but its state's name.
  Mac mac(const RoundSummary& summary, const RoundNews& news) const;

  /// Compares the MAC that a message carries with the one it should, in constant time.
  static Authenticity compare(const Mac& carried, const Mac& computed);

 private:
  std::optional<Key> key_;
};

}  // namespace pmeta
