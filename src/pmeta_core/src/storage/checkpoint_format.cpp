// The parts of a checkpoint file that its writer and its reader share.
#include "checkpoint_format.h"

#include <sodium.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

namespace pmeta {

std::string lastError() { return std::strerror(errno); }

hid_t accessWithoutLocks() {
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
#if H5_VERSION_GE(1, 10, 7)
  H5Pset_file_locking(access, false, true);
#endif
  return access;
}

hid_t fileType(StateType type) {
  switch (type) {
    case StateType::kFloat32:
      return H5T_IEEE_F32LE;
    case StateType::kFloat64:
      return H5T_IEEE_F64LE;
    case StateType::kInt64:
      return H5T_STD_I64LE;
    case StateType::kUint64:
      return H5T_STD_U64LE;
    default:
      return H5T_STD_U8LE;
  }
}

hid_t textType(std::size_t n) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, std::max<std::size_t>(n, 1));
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  return type;
}

bool hashOf(int fd, Hash& hash) {
  if (sodium_init() < 0) return false;
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, kHashBytes);
  std::vector<unsigned char> buffer(1 << 20);
  off_t offset = kUserBlock;
  ssize_t n;
  while ((n = ::pread(fd, buffer.data(), buffer.size(), offset)) > 0) {
    crypto_generichash_update(&state, buffer.data(), static_cast<unsigned long long>(n));
    offset += n;
  }
  crypto_generichash_final(&state, hash.data(), kHashBytes);
  return n == 0;
}

UserBlock userBlockOf(std::uint64_t length, const Hash& hash) {
  UserBlock block{};
  std::memcpy(block.data(), kMagic, kVersionAt);
  std::memcpy(&block[kVersionAt], &kCheckpointVersion, sizeof kCheckpointVersion);
  std::memcpy(&block[kLengthAt], &length, sizeof length);
  std::memcpy(&block[kHashAt], hash.data(), kHashBytes);
  return block;
}

}  // namespace pmeta
