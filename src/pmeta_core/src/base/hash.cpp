#include "pmeta_core/base/hash.h"

#include <sodium.h>

#include <array>

#include "pmeta_core/base/error.h"

namespace pmeta {

std::string hashText(const std::string& bytes) {
  constexpr std::size_t kBytes = 32;
  if (sodium_init() < 0) throw Error("libsodium cannot be initialised.");
  std::array<unsigned char, kBytes> hash{};
  crypto_generichash(hash.data(), kBytes, reinterpret_cast<const unsigned char*>(bytes.data()),
                     bytes.size(), nullptr, 0);
  std::array<char, 2 * kBytes + 1> text{};
  return sodium_bin2hex(text.data(), text.size(), hash.data(), kBytes);
}

}  // namespace pmeta
