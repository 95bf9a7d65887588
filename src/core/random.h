// Counter-based random numbers: a number is a pure function of its key and its index, so no answer
// depends on which thread asked first.
#pragma once

#include <cstdint>

#include "core/math.h"

namespace brume {

// Mixes a word so that every input bit reaches every output bit (the finaliser of SplitMix64 [SLF14]).
constexpr std::uint64_t mix_bits(std::uint64_t x) {
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ULL;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

// A key from parts, in order: (seed, pixel, sample), (seed, record).
template <typename... Parts>
constexpr std::uint64_t random_key(Parts... parts) {
  std::uint64_t h = 0x9e3779b97f4a7c15ULL;
  ((h = mix_bits(h ^ static_cast<std::uint64_t>(parts)) + 0x9e3779b97f4a7c15ULL), ...);
  return h;
}

// Uniform numbers of one key. Copying one repeats its numbers. Not thread-safe; free to make.
class RandomStream {
 public:
  explicit RandomStream(std::uint64_t key) : key_(key) {}

  std::uint64_t bits() { return mix_bits(key_ + 0x9e3779b97f4a7c15ULL * ++index_); }
  // In [0, 1), 53 bits.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  Vec2d uniform2() {
    const double a = uniform();
    return {a, uniform()};
  }

 private:
  std::uint64_t key_, index_ = 0;
};

}  // namespace brume
