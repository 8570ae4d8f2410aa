#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace pmeta {

/// Allocates on 64-byte boundaries: a cache line, and the widest vector register.
template <class T>
struct CacheLineAllocator {
  using value_type = T;  ///< what is allocated, as std::allocator_traits wants it
  static constexpr std::align_val_t kAlignment{64};  ///< bytes

  CacheLineAllocator() = default;
  /// Allocators have no state: any serves any type.
  template <class U>
  CacheLineAllocator(const CacheLineAllocator<U>&) {}

  /// Room for n values; throws std::bad_alloc.
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  /// Gives back what allocate() gave.
  void deallocate(T* p, std::size_t) { ::operator delete(p, kAlignment); }

  /// Each can give back what another allocated.
  template <class U>
  bool operator==(const CacheLineAllocator<U>&) const {
    return true;
  }
  /// See ==.
  template <class U>
  bool operator!=(const CacheLineAllocator<U>&) const {
    return false;
  }
};

/// Floats whose first one is on a 64-byte boundary. The kernels take any float pointers and are
/// fastest on these.
using AlignedFloats = std::vector<float, CacheLineAllocator<float>>;

}  // namespace pmeta
