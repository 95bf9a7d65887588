#include "scene/light.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "core/image.h"
#include "core/random.h"
#include "core/sampling.h"

namespace brume {
namespace {

const Vec3d kUp(0, 1, 0);

// Irradiance on a surface by the light's own samples.
RgbD irradiance(const Light& light, const Vec3d& p, const Vec3d& n, int count = 40'000) {
  RandomStream random(1);
  RgbD sum;
  for (int i = 0; i < count; ++i) {
    const LightSample s = light.sample(p, random.uniform2());
    EXPECT_TRUE(is_finite(s.weight));
    sum += s.weight * (std::max(0.0, n.dot(s.direction)) / count);
  }
  return sum;
}

// Lambert's formula for a polygon, corners in order; positive when seen from the lit side.
double lambert(const std::vector<Vec3d>& corners, const Vec3d& p, const Vec3d& n, double radiance) {
  double sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3d a = (corners[i] - p).normalized(),
                b = (corners[(i + 1) % corners.size()] - p).normalized();
    const Vec3d c = a.cross(b);
    sum += std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * c.normalized().dot(n);
  }
  return std::abs(sum) * radiance / 2;
}

TEST(Light, PointFallsOffWithMetres) {
  const auto light = make_light(PointLight{{0, 3, 0}, {2, 4, 8}}, 0.01, kUp);
  const LightSample s = light->sample({0, 1, 0}, {0.5, 0.5});
  EXPECT_NEAR(s.distance, 2, 1e-12);
  EXPECT_NEAR(s.direction.y, 1, 1e-12);
  EXPECT_NEAR(s.weight.g, 4 / (0.02 * 0.02), 1e-6);
  EXPECT_TRUE(light->is_delta());
  EXPECT_EQ(light->sample({0, 3, 0}, {0.5, 0.5}).weight, RgbD());
}

TEST(Light, SpotIsSmoothBetweenItsAngles) {
  const auto light = make_light(SpotLight{{0, 1, 0}, {0, -2, 0}, Rgb(6.0f), 20, 30}, 1, kUp);
  const auto at = [&](double deg) {
    const double a = deg * kPi / 180;
    return light->sample({std::sin(a), 1 - std::cos(a), 0}, {0.5, 0.5}).weight.r;
  };
  EXPECT_NEAR(at(0), 6, 1e-9);
  EXPECT_NEAR(at(19.9), 6, 1e-9);
  EXPECT_EQ(at(30.1), 0);
  EXPECT_EQ(at(180), 0);
  const double half = std::acos((std::cos(20 * kPi / 180) + std::cos(30 * kPi / 180)) / 2);
  EXPECT_NEAR(at(half * 180 / kPi), 3, 1e-9);
}

TEST(Light, DirectionalComesFromAgainstItsTravel) {
  const auto light = make_light(DirectionalLight{{1, -1, 0}, Rgb(3.0f)}, 0.01, kUp);
  EXPECT_NEAR(irradiance(*light, {5, 5, 5}, Vec3d(-1, 1, 0).normalized(), 1).r, 3, 1e-6);
  EXPECT_TRUE(std::isinf(light->sample({0, 0, 0}, {0.5, 0.5}).distance));
}

struct QuadCase {
  Vec3d p;
  Vec3d edge_v;
};
class Quads : public testing::TestWithParam<QuadCase> {};

// Near and far, straight and sheared, against Lambert; the receiver never cuts the quad's plane.
TEST_P(Quads, LightAPlaneByLambertsFormula) {
  const auto& [p, edge_v] = GetParam();
  const QuadLight quad{{-0.5, 1, -0.4}, {1.1, 0, 0}, edge_v, Rgb(4.0f)};
  const Vec3d u = quad.edge_u;
  const std::vector<Vec3d> corners = {quad.corner, quad.corner + u, quad.corner + u + edge_v,
                                      quad.corner + edge_v};
  // edge_u x edge_v looks down.
  const Vec3d n = Vec3d(0, 1, 0);
  const double expected = lambert(corners, p, n, 4);
  const auto light = make_light(quad, 1, kUp);
  EXPECT_NEAR(irradiance(*light, p, n, 200'000).r, expected, 0.005 * expected);
  const EmitterTriangle triangles[2] = {{corners[0], corners[1], corners[2]},
                                        {corners[0], corners[2], corners[3]}};
  const auto mesh = make_mesh_light({triangles[0], triangles[1]}, quad.radiance, false, 1);
  EXPECT_NEAR(irradiance(*mesh, p, n, 200'000).r, expected, 0.005 * expected);
  EXPECT_EQ(irradiance(*light, {0.1, 1.5, 0.2}, -n, 100).r, 0) << "the back is dark";
}

// Of many triangles too, in any order.
TEST_P(Quads, MeshesOfManyTrianglesGiveTheSame) {
  const auto& [p, edge_v] = GetParam();
  const Vec3d corner(-0.5, 1, -0.4), u = Vec3d(1.1, 0, 0) / 4, v = edge_v / 4;
  std::vector<EmitterTriangle> triangles;
  for (int i = 0; i < 16; ++i) {
    const Vec3d c = corner + u * (i * 7 % 16 % 4) + v * (i * 7 % 16 / 4);
    triangles.push_back({c, c + u, c + u + v});
    triangles.push_back({c, c + u + v, c + v});
    triangles.push_back({c, c, c + v});  // No area, no light.
  }
  const auto light = make_mesh_light(triangles, Rgb(4.0f), false, 1);
  const Vec3d n = Vec3d(0, 1, 0);
  const double expected =
      lambert({corner, corner + u * 4, corner + u * 4 + edge_v, corner + edge_v}, p, n, 4);
  EXPECT_NEAR(irradiance(*light, p, n, 200'000).r, expected, 0.02 * expected);
}

// The density of samples is what pdf() says: their inverse adds up to the solid angle.
TEST_P(Quads, PdfIsThatOfSamples) {
  const auto& [p, edge_v] = GetParam();
  const auto light = make_light(QuadLight{{-0.5, 1, -0.4}, {1.1, 0, 0}, edge_v, Rgb(4.0f)}, 1, kUp);
  RandomStream random(2);
  const Vec3d normal = Vec3d(1, 0, 0).cross(edge_v).normalized();
  for (int i = 0; i < 1000; ++i) {
    const LightSample s = light->sample(p, random.uniform2());
    ASSERT_GT(s.pdf, 0);
    EXPECT_NEAR(light->pdf(p, s.direction, s.distance, normal), s.pdf, 1e-6 * s.pdf);
    EXPECT_NEAR(s.weight.r, 4 / s.pdf, 1e-6 * s.weight.r);
    EXPECT_NEAR((p + s.direction * s.distance).y, 1, 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Places, Quads,
                         testing::Values(QuadCase{{0.35, 0, 0.2}, {0, 0, 0.9}},
                                         QuadCase{{0.3, 0.9, 0.1}, {0, 0, 0.9}},
                                         QuadCase{{1.5, 0.7, 0.1}, {0, 0, 0.9}},
                                         QuadCase{{0.3, -30, 0.1}, {0, 0, 0.9}},
                                         QuadCase{{0.35, 0, 0.2}, {0.5, 0, 0.9}},
                                         QuadCase{{0.3, 0.7, 0.1}, {-0.4, 0, 0.9}}));

TEST(Light, RectanglesAreSampledEvenlyOverTheirSolidAngle) {
  // From very near, area sampling would put nearly all of its points where they count for nothing.
  const auto light = make_light(QuadLight{{-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, Rgb(1.0f)}, 1, kUp);
  const Vec3d p(0.2, 0.999, 0.3);
  RandomStream random(3);
  double mean = 0;
  for (int i = 0; i < 1000; ++i) {
    const LightSample s = light->sample(p, random.uniform2());
    EXPECT_NEAR(s.weight.r, 2 * kPi, 0.02);
    mean += s.direction.y / 1000;
  }
  EXPECT_NEAR(mean, 0.5, 0.03);  // Uniform over the hemisphere.
}

TEST(Light, NothingIsNeverNaN) {
  const QuadLight flat{{0, 1, 0}, {1, 0, 0}, {2, 0, 0}, Rgb(4.0f)};
  const QuadLight point{{0, 1, 0}, {0, 0, 0}, {0, 0, 1}, Rgb(4.0f)};
  for (const QuadLight& q : {flat, point}) {
    const auto light = make_light(q, 1, kUp);
    EXPECT_EQ(irradiance(*light, {0, 0, 0}, {0, 1, 0}, 100), RgbD());
    EXPECT_EQ(light->pdf({0, 0, 0}, {0, 1, 0}, 1, {0, -1, 0}), 0);
    EXPECT_EQ(light->importance(), 0);
  }
  // On the quad itself, in its plane, at its corner, a hair before it.
  const auto quad = make_light(QuadLight{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}, Rgb(4.0f)}, 1, kUp);
  for (const Vec3d& p : {Vec3d(0.5, 1, 0.5), Vec3d(3, 1, 0.5), Vec3d(0, 1, 0),
                         Vec3d(0.5, 1 - 1e-15, 0.5), Vec3d(0, 1 - 1e-12, 0)}) {
    RandomStream random(4);
    for (int i = 0; i < 100; ++i) {
      const LightSample s = quad->sample(p, random.uniform2());
      EXPECT_TRUE(is_finite(s.weight) && is_finite(s.direction)) << p;
      EXPECT_LE(s.weight.r, 4 * 2 * kPi + 1e-6);
    }
  }
}

TEST(Light, TwoSidedMeshesShineBothWays) {
  const EmitterTriangle t{{0, 1, 0}, {1, 1, 0}, {0, 1, 1}};
  const auto one = make_mesh_light({t}, Rgb(1.0f), false, 1);
  const auto both = make_mesh_light({t}, Rgb(1.0f), true, 1);
  const Vec3d below(0.2, 0, 0.2), above(0.2, 2, 0.2);
  EXPECT_NEAR(irradiance(*both, below, {0, 1, 0}).r, irradiance(*both, above, {0, -1, 0}).r, 1e-9);
  EXPECT_NEAR(irradiance(*one, below, {0, 1, 0}).r + irradiance(*one, above, {0, -1, 0}).r,
              irradiance(*both, above, {0, -1, 0}).r, 1e-9);
}

TEST(Light, ConstantEnvironmentGivesPi) {
  EnvironmentLight d;
  d.radiance = {1, 2, 3};
  d.scale = 0.5;
  const auto light = make_light(d, 1, kUp);
  EXPECT_NEAR(irradiance(*light, {0, 0, 0}, {0, 1, 0}, 200'000).b, 1.5 * kPi, 0.02 * kPi);
  EXPECT_NEAR(light->radiance({0, 0, 1}).g, 1, 1e-6);
}

class ImageEnvironments : public testing::Test {
 protected:
  static constexpr int kWidth = 64, kHeight = 32;

  void SetUp() override {
    file_ = std::filesystem::path(testing::TempDir()) / "brume_light_test_sky.exr";
    Image image;
    image.width = kWidth;
    image.height = kHeight;
    for (const char* name : {"R", "G", "B"})
      image.channels.push_back({name, false, std::vector<float>(kWidth * kHeight, 0.1f)});
    // One small bright patch: row 8 is 47.8 deg from up, column 48 is a quarter turn right of the
    // middle.
    image.channels[0].values[8 * kWidth + 48] = 500;
    write_exr(file_, image, {});
  }
  void TearDown() override { std::filesystem::remove(file_); }
  std::unique_ptr<Light> light(double rotation_deg, const Vec3d& up) const {
    EnvironmentLight d;
    d.file = file_;
    d.rotation_deg = rotation_deg;
    return make_light(d, 1, up);
  }
  static Vec3d brightest(const Light& l) {
    Vec3d best(0.0);
    for (int i = 0; i < 200; ++i)
      for (int j = 0; j < 400; ++j) {
        const double a = kPi * (i + 0.5) / 200, b = 2 * kPi * (j + 0.5) / 400;
        const Vec3d d(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
        if (best.length() == 0 || l.radiance(d).r > l.radiance(best).r) best = d;
      }
    return best;
  }
  std::filesystem::path file_;
};

TEST_F(ImageEnvironments, FaceMinusZWithYUpAndTurnRightHanded) {
  const double a = (8.5 / kHeight) * kPi, b = 0.5 / kWidth * 2 * kPi;
  const Vec3d expected(std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b));
  EXPECT_GT(brightest(*light(0, kUp)).dot(expected), 0.999);
  // 90 deg about +Y takes +X to -Z.
  const Vec3d turned(expected.z, expected.y, -expected.x);
  EXPECT_GT(brightest(*light(90, kUp)).dot(turned), 0.999);
  // With Z up the middle looks along +Y: (x, y, z) becomes (x, -z, y).
  const Vec3d z_up(expected.x, -expected.z, expected.y);
  EXPECT_GT(brightest(*light(0, {0, 0, 1})).dot(z_up), 0.999);
}

TEST_F(ImageEnvironments, SamplesIntegrateToTheIrradiance) {
  const auto sky = light(30, kUp);
  const Vec3d n = Vec3d(0.3, 1, 0.2).normalized();
  RgbD expected;
  constexpr int kRows = 1000, kColumns = 2000;
  for (int y = 0; y < kRows; ++y)
    for (int x = 0; x < kColumns; ++x) {
      const double a = kPi * (y + 0.5) / kRows, b = 2 * kPi * (x + 0.5) / kColumns;
      const Vec3d d(std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b));
      expected += sky->radiance(d) *
                  (std::max(0.0, d.dot(n)) * std::sin(a) * kPi / kRows * 2 * kPi / kColumns);
    }
  const RgbD e = irradiance(*sky, {0, 0, 0}, n, 100'000);
  EXPECT_NEAR(e.r, expected.r, 0.02 * expected.r);
  EXPECT_NEAR(e.g, expected.g, 0.05 * expected.g);
}

TEST_F(ImageEnvironments, PdfIntegratesToOneAndIsThatOfSamples) {
  const auto sky = light(30, kUp);
  RandomStream random(5);
  double one = 0;
  constexpr int kCount = 400'000;
  for (int i = 0; i < kCount; ++i)
    one += sky->pdf({0, 0, 0}, sample_sphere(random.uniform2()), kInfinity, {0, 0, 0}) * 4 * kPi /
           kCount;
  EXPECT_NEAR(one, 1, 0.1);
  for (int i = 0; i < 1000; ++i) {
    const LightSample s = sky->sample({0, 0, 0}, random.uniform2());
    EXPECT_NEAR(s.direction.length(), 1, 1e-12);
    EXPECT_NEAR(sky->pdf({0, 0, 0}, s.direction, kInfinity, {0, 0, 0}), s.pdf, 1e-6 * s.pdf);
  }
}

// Rays that lights send out: as many of them cross a surface as irradiance says.
TEST(Light, EmitsByPower) {
  QuadLight quad;
  quad.corner = {-0.5, 2, -0.5};
  quad.edge_u = {1, 0, 0};
  quad.edge_v = {0, 0, 1};
  quad.radiance = Rgb(3.0f);
  const std::vector<EmitterTriangle> triangles{{{0, 1, 0}, {1, 1.5, 0}, {0, 1, 1}},
                                               {{2, 1, 0}, {2, 1, 1}, {2, 2, 0}},
                                               {{0, 3, 0}, {0.5, 3, 0}, {0, 3.5, 0.5}}};
  std::vector<std::unique_ptr<Light>> lights;
  lights.push_back(make_light(PointLight{{0, 1, 0}, Rgb(1.0f)}, 1, kUp));
  lights.push_back(make_light(SpotLight{{0, 2, 0}, {0.2, -1, 0}, Rgb(2.0f), 30, 30.001}, 1, kUp));
  lights.push_back(make_light(quad, 1, kUp));
  lights.push_back(make_mesh_light(triangles, Rgb(2.0f), false, 1));
  lights.push_back(make_mesh_light(triangles, Rgb(2.0f), true, 1));
  constexpr int kRays = 200'000;
  for (const auto& light : lights) {
    // Downwards through the unit square at height 0.
    int crossing = 0;
    RandomStream random(5);
    for (int i = 0; i < kRays; ++i) {
      const Vec2d place = random.uniform2(), way = random.uniform2();
      const std::optional<Ray> ray = light->emit(place, way);
      ASSERT_TRUE(ray);
      EXPECT_NEAR(ray->direction.length(), 1, 1e-9);
      if (!(ray->direction.y < 0)) continue;
      const Vec3d at = ray->at(-ray->origin.y / ray->direction.y);
      crossing += std::abs(at.x) < 0.5 && std::abs(at.z) < 0.5;
    }
    double received = 0;
    constexpr int kSide = 16;
    for (int i = 0; i < kSide * kSide; ++i)
      received += luminance(irradiance(
                      *light, {(i % kSide + 0.5) / kSide - 0.5, 0, (i / kSide + 0.5) / kSide - 0.5},
                      kUp, 400)) /
                  (kSide * kSide);
    EXPECT_NEAR(crossing / double(kRays), received / light->importance(), 0.006)
        << static_cast<int>(light->kind());
  }
}

TEST(Light, AtInfinityEmitsNothing) {
  EXPECT_FALSE(make_light(DirectionalLight{}, 1, kUp)->emit({0.5, 0.5}, {0.5, 0.5}));
  EXPECT_FALSE(make_light(EnvironmentLight{}, 1, kUp)->emit({0.5, 0.5}, {0.5, 0.5}));
  EXPECT_FALSE(make_mesh_light({}, Rgb(1.0f), false, 1)->emit({0.5, 0.5}, {0.5, 0.5}));
}

}  // namespace
}  // namespace brume
