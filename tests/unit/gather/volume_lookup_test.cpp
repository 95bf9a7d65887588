// What lies between records of the medium, where the answer is known.
#include "gather/volume_lookup.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "support/scene_builder.h"

namespace brume {
namespace {

double linear(const Vec3d& p) { return 9 + 0.5 * p.x - 0.3 * p.y + 0.8 * p.z; }

void add(VolumeRecords& records, const Vec3d& p, double radius, double value, std::uint64_t key) {
  VolumeRecord r{};
  for (int a = 0; a < 3; ++a) {
    r.position[a] = static_cast<float>(p[a]);
    r.radius[a] = static_cast<float>(radius);
  }
  r.axes[0] = 1;
  r.key = key;
  VolumeMoment m{};
  for (float& v : m.value) v = static_cast<float>(value);
  records.push_back(r, {&m, 1});
}

// A jittered lattice of spacing 1 over [-3, 3]^3.
VolumeRecords lattice() {
  VolumeRecords records;
  RandomStream random(random_key(4));
  for (int i = 0; i < 343; ++i) {
    const Vec2d u = random.uniform2();
    const Vec3d p = Vec3d(i % 7 - 3, i / 7 % 7 - 3, i / 49 - 3) +
                    (Vec3d(u.x, u.y, random.uniform()) - Vec3d(0.5)) * 0.6;
    add(records, p, 1.6, linear(p), random.bits());
  }
  return records;
}

// Exactly linear weights keep within 0.06; soft ones (docs/decisions/0009) within 0.12, and a kernel
// that is not centred at all is 0.27 off.
TEST(VolumeLookup, NearlyReproducesWhatIsLinearWithPositiveWeights) {
  const World world{Scene{}};
  const VolumeCache cache(lattice(), Vec3d(0.0));
  const VolumeLookup lookup(world, cache);
  RandomStream random(random_key(5));
  std::vector<VolumePart> parts;
  for (int i = 0; i < 500; ++i) {
    const Vec2d u = random.uniform2();
    const Vec3d p = (Vec3d(u.x, u.y, random.uniform()) - Vec3d(0.5)) * 4;
    float moments[3];
    ASSERT_TRUE(lookup.moments(p, moments));
    EXPECT_NEAR(moments[1], linear(p), 0.12) << p;
    lookup.find(p, parts);
    double sum = 0;
    for (const VolumePart& part : parts) {
      EXPECT_GT(part.weight, 0);
      sum += part.weight;
    }
    EXPECT_NEAR(sum, 1, 1e-5);
  }
}

TEST(VolumeLookup, NarrowRecordsAreNotDrownedByWideOnes) {
  const World world{Scene{}};
  VolumeRecords records = lattice();
  add(records, {6, 0, 0}, 30, 0, 1);  // Over all of the lattice, and dark.
  const VolumeCache cache(std::move(records), Vec3d(0.0));
  const VolumeLookup lookup(world, cache);
  RandomStream random(random_key(6));
  float moments[3];
  for (int i = 0; i < 200; ++i) {
    const Vec2d u = random.uniform2();
    const Vec3d p = (Vec3d(u.x, u.y, random.uniform()) - Vec3d(0.5)) * 4;
    ASSERT_TRUE(lookup.moments(p, moments));
    EXPECT_NEAR(moments[1], linear(p), 0.09) << p;
  }
  EXPECT_TRUE(lookup.moments({12, 0, 0}, moments));
  EXPECT_EQ(moments[1], 0) << "where it alone reaches it answers";
}

// A sheet of dense smoke in thin haze, bright where it is dense.
TEST(VolumeLookup, RecordsInThinSmokeSayLittleAboutDenseSmoke) {
  Scene scene;
  Volume haze, sheet;
  haze.sigma_s = RgbD(0.1);
  sheet.sigma_s = RgbD(10);
  sheet.bounds = {Vec3d(-0.5, -9, -9), Vec3d(0.5, 9, 9)};
  scene.volumes = {haze, sheet};
  const World world(scene);
  VolumeRecords records;
  add(records, {0, 0.5, 0}, 1.5, 1, 1);
  add(records, {0, -0.5, 0}, 1.5, 1, 2);
  add(records, {1, 0, 0}, 1.5, 0, 3);
  add(records, {-1, 0, 0}, 1.5, 0, 4);
  const VolumeCache cache(std::move(records), Vec3d(0.0));
  const VolumeLookup lookup(world, cache);
  float moments[3];
  ASSERT_TRUE(lookup.moments({0, 0, 0}, moments));
  EXPECT_GT(moments[0], 0.99) << "0.8 where all count alike";
  ASSERT_TRUE(lookup.moments({2, 0, 0}, moments));
  EXPECT_EQ(moments[0], 0) << "where they alone reach they answer";
}

TEST(VolumeLookup, FindsTheNearestWhereNoneCovers) {
  const World world{Scene{}};
  VolumeRecords records;
  add(records, {0, 0, 0}, 0.1, 3, 1);
  const VolumeCache cache(std::move(records), Vec3d(0.0));
  const VolumeLookup lookup(world, cache);
  EXPECT_FALSE(lookup.covers({5, 0, 0}));
  float moments[3];
  EXPECT_TRUE(lookup.moments({5, 0, 0}, moments));
  EXPECT_EQ(moments[0], 3);
  EXPECT_FALSE(lookup.moments({5000, 0, 0}, moments)) << "too far for it to say anything";
  EXPECT_EQ(moments[0], 0);
}

TEST(VolumeLookup, NothingAnswersThroughASurface) {
  Scene scene;
  test::add_rectangle(scene, {0, -9, -9}, {0, 18, 0}, {0, 0, 18},
                      test::add_material(scene, test::diffuse(0.5f)));
  const World world(scene);
  VolumeRecords records;
  add(records, {-0.2, 0, 0}, 1, 5, 1);
  add(records, {0.8, 0, 0}, 1, 1, 2);
  const VolumeCache cache(std::move(records), Vec3d(0.0));
  const VolumeLookup lookup(world, cache);
  std::vector<VolumePart> parts;
  for (const double x : {0.01, 0.2, 0.6}) {
    lookup.find({x, 0, 0}, parts);
    ASSERT_EQ(parts.size(), 1u) << x;
    EXPECT_EQ(cache.all().records[parts[0].record].key, 2u) << x;
  }
}

}  // namespace
}  // namespace brume
