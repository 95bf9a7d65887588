#include "vdb_media/medium.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "unit/vdb_media/march_cases.h"

namespace brume {
namespace {

using namespace march_cases;

std::shared_ptr<const BrickGrid> constant_grid(float value) {
  return BrickGrid::from_dense(Vec3i(-10), Vec3i(21), std::vector<float>(21 * 21 * 21, value), {});
}

// --- Black bodies ---

struct Xyz {
  double x, y, z;
};
Xyz to_xyz(const RgbD& c) {
  return {0.4124564 * c.r + 0.3575761 * c.g + 0.1804375 * c.b,
          0.2126729 * c.r + 0.7151522 * c.g + 0.0721750 * c.b,
          0.0193339 * c.r + 0.1191920 * c.g + 0.9503041 * c.b};
}

TEST(Blackbody, ChromaticityFollowsThePlanckianLocus) {
  // CIE 1931 chromaticities of Planckian radiators; the lobes of the observer are good to 0.003.
  const double rows[][3] = {{2000, 0.5267, 0.4133}, {2856, 0.4476, 0.4074},
                            {4000, 0.3805, 0.3768}, {5000, 0.3451, 0.3516},
                            {6500, 0.3135, 0.3237}, {10000, 0.2807, 0.2884}};
  for (const auto& [kelvin, x, y] : rows) {
    const Xyz c = to_xyz(RgbD(blackbody_radiance(kelvin)));
    EXPECT_NEAR(c.x / (c.x + c.y + c.z), x, 0.004) << kelvin;
    EXPECT_NEAR(c.y / (c.x + c.y + c.z), y, 0.004) << kelvin;
  }
}

// The observer's luminous efficiency, tabulated every 10 nm by the CIE.
constexpr double kEfficiency[] = {
    0.0000, 0.0001, 0.0004, 0.0012, 0.0040, 0.0116, 0.0230, 0.0380, 0.0600, 0.0910, 0.1390,
    0.2080, 0.3230, 0.5030, 0.7100, 0.8620, 0.9540, 0.9950, 0.9950, 0.9520, 0.8700, 0.7570,
    0.6310, 0.5030, 0.3810, 0.2650, 0.1750, 0.1070, 0.0610, 0.0320, 0.0170, 0.0082, 0.0041,
    0.0021, 0.0010, 0.0005, 0.0003, 0.0001, 0.0001, 0.0000, 0.0000};

double planck_per_nm(double nm, double kelvin) {
  const double l = nm * 1e-9;
  return 1.191042972e-16 / std::pow(l, 5) / std::expm1(1.438776877e-2 / (l * kelvin)) * 1e-9;
}

TEST(Blackbody, LuminanceIsThatOfTheSpectrumOverTheBand) {
  double area = 0;
  for (const double v : kEfficiency) area += 10 * v;
  for (const double kelvin : {1500.0, 2500.0, 4000.0, 6500.0, 12000.0, 1e5}) {
    double sum = 0;
    for (int i = 0; i <= 40; ++i) sum += 10 * kEfficiency[i] * planck_per_nm(380 + 10 * i, kelvin);
    const double expected = sum * 400 / area;
    // Below 2000 K blue is clamped, which adds a little.
    EXPECT_NEAR(luminance(RgbD(blackbody_radiance(kelvin))), expected, 0.015 * expected) << kelvin;
  }
}

TEST(Blackbody, GrowsWithTemperatureAndStartsAtNothing) {
  for (const double none : {0.0, -5.0, -1e30, double(NAN), 100.0})
    EXPECT_TRUE(is_black(blackbody_radiance(none))) << none;
  Rgb last;
  for (double kelvin = 200; kelvin < 2e5; kelvin *= 1.003) {
    const Rgb now = blackbody_radiance(kelvin);
    for (int c = 0; c < 3; ++c) EXPECT_GE(now[c], last[c]) << kelvin;
    EXPECT_TRUE(kelvin < 600 || luminance(now) > luminance(last)) << kelvin;
    last = now;
  }
  EXPECT_TRUE(is_finite(blackbody_radiance(1e9)));
  // Far above the band's photon energies light grows in proportion to temperature.
  EXPECT_NEAR(luminance(blackbody_radiance(2e6)) / luminance(blackbody_radiance(1e6)), 2, 0.02);
}

TEST(Blackbody, TableIsSmooth) {
  // Between entries as at them: ratios of close temperatures follow the local power law.
  for (double kelvin = 500; kelvin < 1e5; kelvin *= 1.37) {
    const double below = luminance(RgbD(blackbody_radiance(kelvin * 0.9997))),
                 at = luminance(RgbD(blackbody_radiance(kelvin))),
                 above = luminance(RgbD(blackbody_radiance(kelvin * 1.0003)));
    EXPECT_NEAR(at * at / (below * above), 1, 3e-5) << kelvin;
  }
}

// --- Volumes ---

TEST(Volume, EmissionModes) {
  Volume v = make_volume(constant_grid(0.5f));
  v.sigma_s = RgbD(1, 2, 3);
  v.sigma_a = RgbD(0.5, 0.25, 0);
  const Vec3d p(0.3, 0.4, 0.5), outside(30);
  EXPECT_EQ(v.emission_at(p), RgbD());
  EXPECT_FALSE(v.emits());

  v.emission = {Emission::Mode::Density, 2, 1, Rgb(1, 0.5f, 0.25f), {}};
  EXPECT_TRUE(v.emits());
  EXPECT_EQ(v.emission_at(p), RgbD(2 * 1.5 * 0.5, 2 * 0.5 * 2.25 * 0.5, 2 * 0.25 * 3 * 0.5));
  EXPECT_EQ(v.emission_at(outside), RgbD());

  v.emission = {Emission::Mode::Grid, 2, 1, Rgb(1, 0.5f, 0.25f), {constant_grid(3)}};
  EXPECT_EQ(v.emission_at(p), RgbD(6, 3, 1.5));
  v.emission.grid = {constant_grid(1), constant_grid(2), constant_grid(4)};
  EXPECT_EQ(v.emission_at(p), RgbD(2, 2, 2));

  v.emission = {Emission::Mode::Blackbody, 0.1, 1000, Rgb(1.0f), {constant_grid(1.8f)}};
  const RgbD b(blackbody_radiance(1000 * double(1.8f)));
  const RgbD e = v.emission_at(p);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(e[c], 0.1 * v.sigma_a[c] * 0.5 * b[c], 1e-12 * b[c]);
  EXPECT_TRUE(v.emits());
  v.emission.grid = {constant_grid(0)};
  EXPECT_FALSE(Medium({v}).emits());
}

TEST(Volume, AlbedoGridsAreHeldToOne) {
  Volume v = make_volume(constant_grid(1));
  v.sigma_s = RgbD(2, 4, 8);
  EXPECT_EQ(v.sigma_s_at(Vec3d(0)), RgbD(2, 4, 8));
  v.albedo_grid = {constant_grid(0.25f)};
  EXPECT_EQ(v.sigma_s_at(Vec3d(0)), RgbD(0.5, 1, 2));
  v.albedo_grid = {constant_grid(0), constant_grid(1), constant_grid(7)};
  EXPECT_EQ(v.sigma_s_at(Vec3d(0)), RgbD(0, 4, 8));
}

TEST(Volume, GradientIsThatOfTheDensityInWorldSpace) {
  const Vec3d slope(0.2, -0.3, 0.1);
  Affine3d map = scaling(Vec3d(-0.1, 0.2, 0.15));
  map.m[0][1] = 0.05;
  map.m[2][0] = -0.02;
  const Volume v = make_volume(
      make_grid(Vec3i(-20), Vec3i(41), map, [&](const Vec3d& p) { return 5 + slope.dot(p); }));
  const auto g = v.density_gradient_at(Vec3d(0.11, 0.22, 0.33));
  EXPECT_NEAR(g.value, 5 + slope.dot(Vec3d(0.11, 0.22, 0.33)), 1e-6);
  EXPECT_LT((g.gradient - slope).length(), 2e-5);
  EXPECT_NEAR(v.density_at(Vec3d(0.11, 0.22, 0.33)), g.value, 1e-6);
}

TEST(Volume, HomogeneousBoxesAreHalfOpen) {
  const Volume v = make_box(Vec3d(0), Vec3d(1));
  EXPECT_EQ(v.density_at(Vec3d(0)), 1);
  EXPECT_EQ(v.density_at(Vec3d(1, 0.5, 0.5)), 0);
  EXPECT_EQ(v.density_gradient_at(Vec3d(0.5)).gradient, Vec3d(0.0));
  EXPECT_EQ(Volume().density_at(Vec3d(1e30)), 1);
}

TEST(Volume, BoundsHoldDensityAndEmission) {
  Volume v = make_box(Vec3d(-20), Vec3d(-15));
  v.emission = {Emission::Mode::Grid, 1, 1, Rgb(1.0f), {constant_grid(1)}};
  EXPECT_EQ(v.world_bounds().min, Vec3d(-20));
  EXPECT_EQ(v.world_bounds().max, Vec3d(11));
}

// --- The medium ---

TEST(Medium, VacuumHasNothing) {
  const Volume no_extinction = make_volume(constant_grid(1), RgbD()),
               no_density = make_volume(constant_grid(0)), no_room = make_box(Vec3d(1), Vec3d(1));
  for (const Medium& m : {Medium(), Medium({no_extinction, no_density, no_room})}) {
    EXPECT_TRUE(m.is_vacuum());
    EXPECT_FALSE(m.scatters() || m.emits() || m.is_unbounded() || m.is_chromatic() ||
                 m.is_heterogeneous());
    EXPECT_TRUE(m.bounds().isEmpty());
    EXPECT_EQ(m.voxel_size(), kInfinity);
    EXPECT_EQ(m.sigma_t_at(Vec3d(0)), RgbD());
  }
}

TEST(Medium, KnowsWhatItsVolumesDo) {
  Volume scattering = make_volume(make_lumps(scaling(Vec3d(0.1))), RgbD());
  scattering.sigma_s = RgbD(1.0);
  Volume endless;
  endless.sigma_a = RgbD(1, 2, 1);
  const Medium one({scattering}), two({scattering, endless});
  EXPECT_TRUE(one.scatters() && one.is_heterogeneous());
  EXPECT_FALSE(one.is_unbounded() || one.is_chromatic() || one.emits());
  EXPECT_DOUBLE_EQ(one.voxel_size(), 0.1);
  EXPECT_EQ(one.bounds().min, scattering.world_bounds().min);
  EXPECT_TRUE(two.is_unbounded() && two.is_chromatic());
  const Vec3d p = scattering.world_bounds().center();
  EXPECT_EQ(two.sigma_t_at(p), RgbD(1, 2, 1) + RgbD(scattering.density_at(p)));
}

TEST(Medium, FingerprintFollowsWhatAnAnswerDependsOn) {
  const Volume v = make_volume(make_lumps({}));
  const Fingerprint f = Medium({v}).fingerprint();
  const auto differs = [&](auto change) {
    Volume w = v;
    change(w);
    return Medium({w}).fingerprint() != f;
  };
  EXPECT_FALSE(differs([](Volume& w) { w.name = "another"; }));
  EXPECT_FALSE(differs([](Volume& w) { w.emission.scale = 3; }));  // The mode is None.
  EXPECT_TRUE(differs([](Volume& w) { w.sigma_s = RgbD(0.1); }));
  EXPECT_TRUE(differs([](Volume& w) { w.sigma_a.b += 1e-9; }));
  EXPECT_TRUE(differs([](Volume& w) { w.phase = HenyeyGreenstein(0.1); }));
  EXPECT_TRUE(differs([](Volume& w) { w.albedo_grid = {constant_grid(1)}; }));
  EXPECT_TRUE(differs([](Volume& w) { w.emission.mode = Emission::Mode::Density; }));
  EXPECT_TRUE(differs([](Volume& w) { w.density = constant_grid(1); }));
  EXPECT_NE(Medium({v, v}).fingerprint(), f);
}

}  // namespace
}  // namespace brume
