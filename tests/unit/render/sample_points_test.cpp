#include "render/sample_points.h"

#include <gtest/gtest.h>

#include <array>

namespace brume {
namespace {

// Every prefix of 2^2k points has one in each cell of the 2^k x 2^k grid.
TEST(SamplePoints, PrefixesAreStratified) {
  for (const std::uint32_t dimension : {0u, 1u, 7u})
    for (const int k : {1, 2, 3, 4}) {
      const int n = 1 << k;
      std::vector<int> cells(n * n);
      for (int i = 0; i < n * n; ++i) {
        const Vec2d p = SamplePoints(42, i).square(dimension);
        ASSERT_TRUE(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
        ++cells[int(p.y * n) * n + int(p.x * n)];
      }
      for (const int c : cells) EXPECT_EQ(c, 1) << "dimension " << dimension << " of " << n * n;
    }
}

TEST(SamplePoints, DimensionsAndPixelsAreUnrelated) {
  double same_pixel = 0, other_pixel = 0;
  constexpr int kCount = 4096;
  for (int i = 0; i < kCount; ++i) {
    const double a = SamplePoints(1, i).square(0).x - 0.5;
    same_pixel += a * (SamplePoints(1, i).square(1).x - 0.5) * 12 / kCount;
    other_pixel += a * (SamplePoints(2, i).square(0).x - 0.5) * 12 / kCount;
  }
  EXPECT_LT(std::abs(same_pixel), 0.06);
  EXPECT_LT(std::abs(other_pixel), 0.06);
}

}  // namespace
}  // namespace brume
