#include "core/hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <cstdio>

namespace brume {

std::uint64_t hash64(const void* data, std::size_t bytes) { return XXH3_64bits(data, bytes); }

std::string Fingerprint::hex() const {
  char text[33];
  std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(words[0]),
                static_cast<unsigned long long>(words[1]));
  return text;
}

struct FingerprintBuilder::State {
  XXH3_state_t xxh;
};

FingerprintBuilder::FingerprintBuilder() : state_(new State) { XXH3_128bits_reset(&state_->xxh); }
FingerprintBuilder::~FingerprintBuilder() = default;

FingerprintBuilder& FingerprintBuilder::add_bytes(const void* data, std::size_t bytes) {
  const std::uint64_t size = bytes;
  XXH3_128bits_update(&state_->xxh, &size, sizeof size);
  if (bytes > 0) XXH3_128bits_update(&state_->xxh, data, bytes);
  return *this;
}

Fingerprint FingerprintBuilder::finish() const {
  const XXH128_hash_t h = XXH3_128bits_digest(&state_->xxh);
  return {{h.high64, h.low64}};
}

}  // namespace brume
