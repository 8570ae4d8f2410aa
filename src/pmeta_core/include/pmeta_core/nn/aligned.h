#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace pmeta {

/// Allocates on 64-byte boundaries: a cache line, and the widest vector register.
template <class T>
struct CacheLineAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{64};

  CacheLineAllocator() = default;
  template <class U>
  CacheLineAllocator(const CacheLineAllocator<U>&) {}

  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, kAlignment); }

  template <class U>
  bool operator==(const CacheLineAllocator<U>&) const {
    return true;
  }
  template <class U>
  bool operator!=(const CacheLineAllocator<U>&) const {
    return false;
  }
};

/// Floats whose first one is on a 64-byte boundary. The kernels take any float pointers and are
/// fastest on these.
using AlignedFloats = std::vector<float, CacheLineAllocator<float>>;

}  // namespace pmeta
