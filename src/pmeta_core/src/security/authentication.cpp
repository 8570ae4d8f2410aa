#include "pmeta_core/security/authentication.h"

#include <sodium.h>

#include <cstring>
#include <stdexcept>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

constexpr std::size_t kMacBytes = 32;

// a hash over fields of known order: each is of fixed length or has its length before it, so that
// no two messages give the same bytes
class Stream {
 public:
  Stream(const std::optional<Key>& key, const char* domain) {
    if (!key) throw std::logic_error("signing without a key");
    crypto_generichash_init(&state_, key->data(), key->size(), kMacBytes);
    put(std::string_view(domain));
  }
  ~Stream() { sodium_memzero(&state_, sizeof state_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  void put(std::uint64_t value) {
    std::uint8_t bytes[8];
    for (int i = 0; i < 8; ++i) bytes[i] = static_cast<std::uint8_t>(value >> (8 * i));
    add(bytes, sizeof bytes);
  }
  void put(std::int64_t value) { put(static_cast<std::uint64_t>(value)); }
  void put(std::uint32_t value) { put(std::uint64_t{value}); }
  void put(int value) { put(static_cast<std::int64_t>(value)); }
  void put(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    put(bits);
  }
  void put(std::string_view text) { put(text.data(), text.size()); }
  void put(const std::vector<int>& values) {
    put(std::uint64_t{values.size()});
    for (const int value : values) put(value);
  }
  template <class Item>
  void put(const Item* items, std::size_t count) {
    put(std::uint64_t{count});
    add(items, count * sizeof(Item));
  }
  void put(const ModelView& model) {
    put(model.layout);
    put(model.layout_hash);
    put(model.floats, model.num_floats);
    put(model.doubles, model.num_doubles);
    put(model.present, model.num_present);
    put(model.checksum);
  }

  Mac finish() {
    Mac mac(kMacBytes);
    crypto_generichash_final(&state_, mac.data(), mac.size());
    return mac;
  }

 private:
  void add(const void* data, std::size_t size) {
    if (size > 0) {
      crypto_generichash_update(&state_, static_cast<const unsigned char*>(data), size);
    }
  }

  crypto_generichash_state state_;
};

}  // namespace

ModelView viewOf(const Model& model) {
  ModelView view;
  view.layout = model.layout.text();
  view.layout_hash = model.layout.hash();
  if (const auto* floats = std::get_if<std::vector<float>>(&model.values)) {
    view.floats = floats->data();
    view.num_floats = floats->size();
  } else {
    view.doubles = model.doubles().data();
    view.num_doubles = model.doubles().size();
  }
  view.present = model.present.data();
  view.num_present = model.present.size();
  view.checksum = model.checksum();
  return view;
}

Authenticator::Authenticator(const Key& key) : key_(key) {
  // picks the machine's fastest code
  if (sodium_init() < 0) throw Error("libsodium cannot be used on this machine: unset key_file.");
}

Authenticator::Authenticator(const std::string& key_file) {
  if (!key_file.empty()) *this = Authenticator(readKeyFile(key_file));
}

Mac Authenticator::mac(const AuxiliaryUpdate& update) const {
  return mac(update, viewOf(update.model));
}

Mac Authenticator::mac(const AuxiliaryUpdate& header, const ModelView& model) const {
  Stream stream(key_, "pmeta AuxiliaryUpdate 2");
  stream.put(std::string_view(header.run_id));
  stream.put(header.task);
  stream.put(header.round);
  stream.put(header.weight);
  stream.put(std::string_view(header.settings_hash));
  stream.put(model);
  return stream.finish();
}

Mac Authenticator::mac(const MetaPolicy& meta, int rounds) const {
  return mac(meta, viewOf(meta.model), rounds);
}

Mac Authenticator::mac(const MetaPolicy& header, const ModelView& model, int rounds) const {
  Stream stream(key_, "pmeta MetaPolicy 2");
  stream.put(std::string_view(header.run_id));
  stream.put(header.round);
  stream.put(rounds);
  stream.put(header.participants);
  stream.put(header.incarnation);
  stream.put(static_cast<int>(header.evaluate));
  stream.put(static_cast<int>(header.checkpoint));
  stream.put(std::string_view(header.settings_hash));
  stream.put(model);
  return stream.finish();
}

Mac Authenticator::mac(const TaskReturn& result, const std::string& task_name) const {
  Stream stream(key_, "pmeta TaskReturn 3");
  stream.put(std::string_view(result.run_id));
  stream.put(result.task);
  stream.put(std::string_view(task_name));
  stream.put(result.round);
  stream.put(static_cast<int>(result.split));
  stream.put(static_cast<int>(result.policy));
  stream.put(static_cast<int>(result.scheduled));
  stream.put(result.context_episodes);
  stream.put(result.mean);
  stream.put(result.std);
  stream.put(result.episodes);
  stream.put(result.env_steps);
  stream.put(result.updates);
  stream.put(result.broken_episodes);
  stream.put(result.seconds);
  stream.put(std::uint64_t{result.losses.size()});
  for (const Loss& loss : result.losses) {
    stream.put(std::string_view(loss.name));
    stream.put(loss.value);
  }
  return stream.finish();
}

Mac Authenticator::mac(const AgentNews& news) const {
  Stream stream(key_, "pmeta AgentStatus 1");
  stream.put(std::string_view(news.run_id));
  stream.put(news.task);
  stream.put(std::uint32_t{news.state});
  stream.put(std::string_view(news.message));
  stream.put(news.incarnation);
  return stream.finish();
}

Mac Authenticator::mac(const RoundSummary& summary, const RoundNews& news) const {
  Stream stream(key_, "pmeta RoundSummary 1");
  stream.put(std::string_view(summary.run_id));
  stream.put(std::string_view(news.experiment));
  stream.put(news.stamp);
  stream.put(std::uint32_t{news.state});
  stream.put(std::string_view(news.message));
  stream.put(summary.round);
  stream.put(summary.rounds);
  stream.put(summary.personal_return);
  stream.put(summary.meta_return);
  stream.put(summary.test_return);
  stream.put(summary.participants);
  stream.put(summary.missing);
  stream.put(summary.excluded);
  stream.put(summary.seconds);
  stream.put(summary.eta_seconds);
  stream.put(news.refused);
  return stream.finish();
}

Authenticity Authenticator::compare(const Mac& carried, const Mac& computed) {
  if (carried.empty()) return Authenticity::kUnsigned;
  const bool same = carried.size() == computed.size() &&
                    sodium_memcmp(carried.data(), computed.data(), computed.size()) == 0;
  return same ? Authenticity::kAuthentic : Authenticity::kForged;
}

}  // namespace pmeta
