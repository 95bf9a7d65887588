#include "scene/material.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "core/random.h"
#include "core/sampling.h"

namespace brume {
namespace {

const Vec3d kNormal = Vec3d(0.2, -0.5, 0.8).normalized();

Material material_of(double roughness, float albedo, float specular) {
  Material m;
  m.albedo = Rgb(albedo);
  m.specular = Rgb(specular);
  m.roughness = float(roughness);
  return m;
}

Vec3d direction_at(double cosine, double phi = 0.4) {
  const double s = std::sqrt(1 - cosine * cosine);
  return Frame(kNormal).to_world({s * std::cos(phi), s * std::sin(phi), cosine});
}

class AcrossRoughness : public testing::TestWithParam<double> {};
// Wide enough for a histogram.
class WideLobes : public testing::TestWithParam<double> {};

TEST_P(AcrossRoughness, IsReciprocal) {
  const Material m = material_of(GetParam(), 0.3f, 0.6f);
  RandomStream random(1);
  for (int i = 0; i < 1000; ++i) {
    const Frame frame(kNormal);
    const Vec3d a = frame.to_world(sample_cosine_hemisphere(random.uniform2()));
    const Vec3d b = frame.to_world(sample_cosine_hemisphere(random.uniform2()));
    const double ab = eval_brdf(m, kNormal, a, b).r, ba = eval_brdf(m, kNormal, b, a).r;
    EXPECT_NEAR(ab, ba, 1e-9 * ab);
  }
}

// Without a colour of its own the lobe never returns more than it gets, and little less when
// smooth.
TEST_P(AcrossRoughness, ConservesEnergy) {
  const Material m = material_of(GetParam(), 0.0f, 1.0f);
  for (const double cosine : {0.05, 0.3, 0.7, 1.0}) {
    RandomStream random(2);
    double sum = 0;
    constexpr int kCount = 40'000;
    for (int i = 0; i < kCount; ++i)
      sum += sample_specular(m, kNormal, direction_at(cosine), random.uniform2()).weight.r / kCount;
    EXPECT_LE(sum, 1 + 1e-12);
    EXPECT_GE(sum, GetParam() < 0.4 ? 0.9 : 0.3) << "cosine " << cosine;
  }
}

// The mixture's samples estimate what uniform directions estimate, and their weights are f cos /
// pdf.
TEST_P(AcrossRoughness, SamplesAgreeWithEvalAndPdf) {
  const Material m = material_of(GetParam(), 0.4f, 0.5f);
  const Vec3d wo = direction_at(0.6);
  RandomStream random(3);
  for (int i = 0; i < 2000; ++i) {
    const double u = random.uniform();
    const BrdfSample s = sample_brdf(m, kNormal, wo, u, random.uniform2());
    if (!(s.pdf > 0)) continue;
    EXPECT_NEAR(s.pdf, pdf_brdf(m, kNormal, s.wi, wo), 1e-6 * s.pdf);
    const double f = eval_brdf(m, kNormal, s.wi, wo).r * kNormal.dot(s.wi) / s.pdf;
    EXPECT_NEAR(s.weight.r, f, 1e-6 * f);
    const BrdfSample g = sample_specular(m, kNormal, wo, random.uniform2());
    if (!(g.pdf > 0)) continue;
    EXPECT_NEAR(g.pdf, pdf_specular(m, kNormal, g.wi, wo), 1e-6 * g.pdf);
    const double h = eval_specular(m, kNormal, g.wi, wo).r * kNormal.dot(g.wi) / g.pdf;
    EXPECT_NEAR(g.weight.r, h, 1e-6 * h);
  }
}

// Chi-square over a grid of cells of equal solid angle; expected counts by a fine midpoint rule of
// the pdf.
TEST_P(WideLobes, SamplesFollowTheirDensity) {
  const Material m = material_of(GetParam(), 0.2f, 0.7f);
  const Vec3d wo = direction_at(0.5);
  constexpr int kRows = 12, kColumns = 24, kFine = 24, kCount = 200'000;
  std::vector<double> expected(kRows * kColumns), seen(kRows * kColumns);
  const Frame frame(kNormal);
  double total = 0;
  for (int y = 0; y < kRows * kFine; ++y)
    for (int x = 0; x < kColumns * kFine; ++x) {
      const double z = (y + 0.5) / (kRows * kFine), phi = 2 * kPi * (x + 0.5) / (kColumns * kFine);
      const double s = std::sqrt(1 - z * z);
      const double p =
          pdf_brdf(m, kNormal, frame.to_world({s * std::cos(phi), s * std::sin(phi), z}), wo) * 2 *
          kPi / (kRows * kFine * kColumns * kFine);
      expected[(y / kFine) * kColumns + x / kFine] += p * kCount;
      total += p;
    }
  RandomStream random(4);
  double lost = 0;
  for (int i = 0; i < kCount; ++i) {
    const double u = random.uniform();
    const BrdfSample s = sample_brdf(m, kNormal, wo, u, random.uniform2());
    if (!(s.pdf > 0)) {
      ++lost;
      continue;
    }
    const Vec3d l = frame.to_local(s.wi);
    const double phi = std::atan2(l.y, l.x) / (2 * kPi);
    const int x = std::min(int((phi - std::floor(phi)) * kColumns), kColumns - 1);
    ++seen[std::min(int(l.z * kRows), kRows - 1) * kColumns + x];
  }
  // What goes below the horizon is no sample; the density integrates to the rest.
  EXPECT_NEAR(total, 1 - lost / kCount, 0.005);
  double chi2 = 0;
  int cells = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (expected[i] < 10) continue;
    chi2 += (seen[i] - expected[i]) * (seen[i] - expected[i]) / expected[i];
    ++cells;
  }
  // Wilson-Hilferty: the cube root is normal; 4 sigma.
  const double v = 2.0 / (9 * (cells - 1));
  EXPECT_LT(std::cbrt(chi2 / (cells - 1)), 1 - v + 4 * std::sqrt(v)) << cells << " cells";
}

INSTANTIATE_TEST_SUITE_P(Rough, AcrossRoughness, testing::Values(0.05, 0.3, 0.6, 1.0));
INSTANTIATE_TEST_SUITE_P(Rough, WideLobes, testing::Values(0.3, 0.6, 1.0));

TEST(Material, DiffuseIsAlbedoOverPi) {
  const Material m = material_of(1, 0.6f, 0.0f);
  EXPECT_NEAR(eval_brdf(m, kNormal, direction_at(0.3), direction_at(0.9, 2)).r, double(0.6f) / kPi,
              1e-12);
  EXPECT_EQ(eval_brdf(m, kNormal, -direction_at(0.3), direction_at(0.9)), RgbD());
  EXPECT_EQ(eval_brdf(m, kNormal, direction_at(0.3), -direction_at(0.9)), RgbD());
}

TEST(Material, BlackReflectsNothing) {
  const Material m = material_of(1, 0.0f, 0.0f);
  EXPECT_FALSE(m.reflects());
  EXPECT_EQ(sample_brdf(m, kNormal, direction_at(0.5), 0.5, {0.5, 0.5}).pdf, 0);
}

// GGX at normal incidence and reflection: D G / (4 cos cos) = 1 / (4 pi alpha^2).
TEST(Material, PeakOfTheLobe) {
  const Material m = material_of(0.5, 0.0f, 1.0f);
  EXPECT_NEAR(eval_specular(m, kNormal, kNormal, kNormal).r, 1 / (4 * kPi * 0.0625), 1e-6);
}

}  // namespace
}  // namespace brume
