#include "core/random.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace brume {
namespace {

// sum (observed - expected)^2 / expected over equally likely cells.
double chi_square(const std::vector<int>& counts) {
  double total = 0;
  for (const int c : counts) total += c;
  const double expected = total / static_cast<double>(counts.size());
  double sum = 0;
  for (const int c : counts) sum += (c - expected) * (c - expected) / expected;
  return sum;
}

// The 1 - 1e-5 quantile with k degrees of freedom, by Wilson and Hilferty's cube: 4.265 sigma. Seeds
// are fixed, so a failure is a finding and not bad luck.
double chi_square_limit(std::size_t cells) {
  const auto k = static_cast<double>(cells - 1);
  const double c = 1 - 2 / (9 * k) + 4.265 * std::sqrt(2 / (9 * k));
  return k * c * c * c;
}

TEST(RandomStream, IsUniform) {
  for (const std::uint64_t key : {0ull, 1ull, 2ull, 0xffffffffffffffffull}) {
    RandomStream random(key);
    std::vector<int> counts(1000);
    for (int i = 0; i < 1'000'000; ++i) {
      const double u = random.uniform();
      ASSERT_GE(u, 0);
      ASSERT_LT(u, 1);
      ++counts[static_cast<std::size_t>(u * 1000)];
    }
    EXPECT_LT(chi_square(counts), chi_square_limit(1000)) << "key " << key;
  }
}

TEST(RandomStream, PairsAreUniformOnTheSquare) {
  RandomStream random(random_key(3, 4));
  std::vector<int> counts(32 * 32);
  for (int i = 0; i < 1'000'000; ++i) {
    const Vec2d u = random.uniform2();
    ++counts[static_cast<std::size_t>(u.x * 32) * 32 + static_cast<std::size_t>(u.y * 32)];
  }
  EXPECT_LT(chi_square(counts), chi_square_limit(counts.size()));
}

// First numbers of neighbouring keys: what pixels and records draw.
TEST(RandomStream, NeighbouringKeysAreIndependent) {
  std::vector<int> counts(32 * 32);
  for (std::uint64_t pixel = 0; pixel < 1'000'000; ++pixel) {
    const double a = RandomStream(random_key(7, pixel, 0)).uniform();
    const double b = RandomStream(random_key(7, pixel, 1)).uniform();
    ++counts[static_cast<std::size_t>(a * 32) * 32 + static_cast<std::size_t>(b * 32)];
  }
  EXPECT_LT(chi_square(counts), chi_square_limit(counts.size()));
}

TEST(RandomStream, EveryBitIsFair) {
  RandomStream random(9);
  int ones[64] = {};
  constexpr int kDraws = 100'000;
  for (int i = 0; i < kDraws; ++i) {
    const std::uint64_t b = random.bits();
    for (int k = 0; k < 64; ++k) ones[k] += static_cast<int>(b >> k & 1);
  }
  for (int k = 0; k < 64; ++k)
    EXPECT_NEAR(ones[k], kDraws / 2, 5 * std::sqrt(kDraws) / 2) << "bit " << k;
}

TEST(RandomStream, ACopyRepeatsAndTheKeyDecides) {
  RandomStream a(5);
  a.uniform();
  RandomStream b = a;
  EXPECT_EQ(a.bits(), b.bits());
  EXPECT_NE(RandomStream(5).bits(), RandomStream(6).bits());
}

TEST(RandomKey, OrderAndNumberOfPartsMatter) {
  std::set<std::uint64_t> keys;
  for (int a = 0; a < 30; ++a) {
    keys.insert(random_key(a));
    for (int b = 0; b < 30; ++b) keys.insert(random_key(a, b));
  }
  EXPECT_EQ(keys.size(), 30u + 900u);
  // Pinned: caches on disk depend on it.
  EXPECT_EQ(random_key(1, 2), random_key(std::uint64_t(1), 2u));
}

}  // namespace
}  // namespace brume
