// XXH3 checksums and fingerprints. They detect accidents, not forgery.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace brume {

std::uint64_t hash64(const void* data, std::size_t bytes);

// 128 bits, shown as 32 hex digits.
struct Fingerprint {
  std::array<std::uint64_t, 2> words{};
  std::string hex() const;
  friend bool operator==(const Fingerprint&, const Fingerprint&) = default;
};

// Hashes a sequence of values. Each add() is framed by its size, so that no two sequences collide by
// running into each other.
class FingerprintBuilder {
 public:
  FingerprintBuilder();
  ~FingerprintBuilder();
  FingerprintBuilder(const FingerprintBuilder&) = delete;
  FingerprintBuilder& operator=(const FingerprintBuilder&) = delete;

  FingerprintBuilder& add_bytes(const void* data, std::size_t bytes);
  FingerprintBuilder& add(std::string_view text) { return add_bytes(text.data(), text.size()); }
  // For values without padding or pointers: numbers, vectors of numbers, colours.
  template <typename T>
    requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  FingerprintBuilder& add(T value) {
    return add_bytes(&value, sizeof value);
  }
  template <typename T>
    requires std::is_arithmetic_v<T>
  FingerprintBuilder& add(const std::vector<T>& values) {
    return add_bytes(values.data(), values.size() * sizeof(T));
  }
  FingerprintBuilder& add(const Fingerprint& f) { return add_bytes(f.words.data(), 16); }
  Fingerprint finish() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace brume
