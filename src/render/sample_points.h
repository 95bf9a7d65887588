// Well-spread random numbers for the first few decisions of a pixel's samples: Sobol points with
// hashed Owen scrambling, a separate shuffle for every dimension [Burley20]. Any prefix of the
// samples is well spread, so samples can be added in passes.
#pragma once

#include <cstdint>

#include "core/math.h"
#include "core/random.h"

namespace brume {

class SamplePoints {
 public:
  // `pixel_key` is one pixel's; `index` counts its samples.
  SamplePoints(std::uint64_t pixel_key, std::uint32_t index) : key_(pixel_key), index_(index) {}

  // A point of the unit square; each `dimension` is a set of its own.
  Vec2d square(std::uint32_t dimension) const {
    const std::uint64_t seed = random_key(key_, dimension);
    const std::uint32_t i = scramble(index_, static_cast<std::uint32_t>(seed));
    const std::uint64_t more = mix_bits(seed + 1);
    const std::uint32_t x = scramble_reversed(i, static_cast<std::uint32_t>(more));
    const std::uint32_t y = scramble(sobol_second(i), static_cast<std::uint32_t>(more >> 32));
    return {x * 0x1p-32, y * 0x1p-32};
  }

 private:
  static constexpr std::uint32_t reverse(std::uint32_t x) {
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
  }
  // Each bit is flipped by a hash of the lower ones [LK11, constants of Burley20].
  static constexpr std::uint32_t flip_upwards(std::uint32_t x, std::uint32_t seed) {
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    return x ^ (x * 0x8d22f6e6u);
  }
  static constexpr std::uint32_t scramble(std::uint32_t x, std::uint32_t seed) {
    return reverse(flip_upwards(reverse(x), seed));
  }
  // scramble(reverse(x)): the first Sobol dimension is the index with its bits reversed.
  static constexpr std::uint32_t scramble_reversed(std::uint32_t x, std::uint32_t seed) {
    return reverse(flip_upwards(x, seed));
  }
  static constexpr std::uint32_t sobol_second(std::uint32_t i) {
    std::uint32_t x = 0;
    for (std::uint32_t v = 1u << 31; i; i >>= 1, v ^= v >> 1)
      if (i & 1) x ^= v;
    return x;
  }

  std::uint64_t key_;
  std::uint32_t index_;
};

}  // namespace brume
