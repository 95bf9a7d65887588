// Memory for what queries reach into at random: in pages of 2 MiB where the system has them, so
// that a million records take few faults to fill and few entries of the TLB to find.
#pragma once

#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>
#include <vector>

namespace brume {

inline constexpr std::size_t kLargePage = std::size_t(2) << 20;

// A hint; one that fails costs nothing.
inline void ask_for_large_pages(void* memory, std::size_t bytes) {
  const auto begin = reinterpret_cast<std::uintptr_t>(memory);
  const std::uintptr_t first = (begin + kLargePage - 1) / kLargePage * kLargePage;
  const std::uintptr_t last = (begin + bytes) / kLargePage * kLargePage;
  if (first < last) ::madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);
}

// `items` is empty.
template <typename T>
void reserve_in_large_pages(std::vector<T>& items, std::size_t count) {
  items.reserve(count);
  ask_for_large_pages(items.data(), items.capacity() * sizeof(T));
}

// `count` of them, not set to anything: the threads that fill them touch them first.
template <typename T>
std::shared_ptr<T[]> make_in_large_pages(std::size_t count) {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
  const std::size_t bytes = count * sizeof(T);
  const std::size_t alignment = bytes >= kLargePage ? kLargePage : 64;
  void* memory = std::aligned_alloc(alignment, (bytes + alignment) / alignment * alignment);
  if (!memory) throw std::bad_alloc();
  ask_for_large_pages(memory, bytes);
  return {static_cast<T*>(memory), [](T* items) { std::free(items); }};
}

}  // namespace brume
