// SPDX-License-Identifier: Apache-2.0
// Containers with 64-byte alignment, so that every row of eight doubles is one cache line and one
// AVX-512 load.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace tangere {

inline constexpr std::size_t kLaneAlignment = 64;

template <class T>
struct LaneAllocator {
  using value_type = T;
  LaneAllocator() = default;
  template <class U>
  explicit LaneAllocator(const LaneAllocator<U>&) noexcept {}
  T* allocate(std::size_t n) {
    if (n > static_cast<std::size_t>(-1) / sizeof(T)) throw std::bad_array_new_length();
    return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t(kLaneAlignment)));
  }
  void deallocate(T* p, std::size_t) noexcept {
    ::operator delete(p, std::align_val_t(kLaneAlignment));
  }
  template <class U>
  bool operator==(const LaneAllocator<U>&) const noexcept {
    return true;
  }
};

/// A unit of raw storage. A vector of single bytes visits each of them where it is destroyed.
struct CacheLine {
  alignas(kLaneAlignment) std::byte bytes[kLaneAlignment];
};
constexpr std::size_t cache_lines(std::size_t bytes) {
  return (bytes + kLaneAlignment - 1) / kLaneAlignment;
}

template <class T>
using AlignedVector = std::vector<T, LaneAllocator<T>>;

}  // namespace tangere
