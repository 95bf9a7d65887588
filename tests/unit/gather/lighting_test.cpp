// Light's way through the medium, asked for by one and by many.
#include "gather/lighting.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

Scene lit_by_all_kinds() {
  Scene s = test::smoky_room();
  s.volumes.push_back(test::haze({0.5, 0.3, 0.1}, RgbD(0.1), 0, test::kUnitBox));
  s.lights.emplace_back(EnvironmentLight{});
  s.lights.emplace_back(DirectionalLight{{0.2, -1, 0.1}, Rgb(1.0f)});
  return s;
}

std::vector<Lighting::Request> requests(const World& world, int count) {
  std::vector<Lighting::Request> all;
  RandomStream random(random_key(4));
  for (int i = 0; i < count; ++i) {
    const int l = i % static_cast<int>(world.lights().size());
    const Vec2d u = random.uniform2();
    const Vec3d p(0.05 + 0.9 * u.x, 0.05 + 0.9 * u.y, 0.05 + 0.9 * random.uniform());
    all.push_back({l, world.lights()[l]->sample(p, random.uniform2()), p});
  }
  return all;
}

// Tables answer alike; lights without one are marched in steps, close to the truth and never far.
TEST(Lighting, ManyAreAnsweredAsOneIs) {
  const World world(lit_by_all_kinds());
  const Lighting lighting(world, {});
  const auto all = requests(world, 3000);
  std::vector<RgbD> found(all.size());
  Counters counters;
  lighting.transmittances(all, found, counters);
  double squares = 0;
  int marched = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const RgbD one = lighting.transmittance(all[i].light, all[i].sample, all[i].p, counters);
    if (world.lights()[all[i].light]->kind() != Light::Kind::Environment) {
      EXPECT_EQ(found[i], one) << i;
      continue;
    }
    ++marched;
    for (int c = 0; c < 3; ++c) {
      squares += (found[i][c] - one[c]) * (found[i][c] - one[c]);
      EXPECT_NEAR(found[i][c], one[c], 0.05) << i;
    }
  }
  ASSERT_GT(marched, 300);
  EXPECT_LT(std::sqrt(squares / (3 * marched)), 0.01);
}

// Where tables are not wanted nothing is coarse.
TEST(Lighting, ExactIsExactForMany) {
  const World world(lit_by_all_kinds());
  const Lighting lighting(world, {.depth = LightDepth::Exact});
  const auto all = requests(world, 100);
  std::vector<RgbD> found(all.size());
  Counters counters;
  lighting.transmittances(all, found, counters);
  for (std::size_t i = 0; i < all.size(); ++i)
    EXPECT_EQ(found[i], lighting.exact_transmittance(all[i].sample, all[i].p, counters)) << i;
}

}  // namespace
}  // namespace brume
