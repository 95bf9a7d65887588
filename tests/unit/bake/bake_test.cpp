// What bakes promise: the same bytes however they were run, bounded records, and no needless work.
#include "bake/bake.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <map>

#include "cache/cache_merge.h"
#include "core/error.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

using test::Stage;

bool same_bytes(const IrradianceCache& a, const IrradianceCache& b) {
  return a.records().size() == b.records().size() && a.origin() == b.origin() &&
         std::memcmp(a.records().data(), b.records().data(), a.records().size_bytes()) == 0 &&
         a.volume()->all() == b.volume()->all();
}

BakeRequest request_of(const std::vector<BakeView>& views, int threads) {
  BakeRequest request;
  request.views = views;
  request.everywhere = views.empty();
  request.threads = threads;
  return request;
}

// What is promised of bytes needs no fine gathers.
BakeSettings quick_settings() {
  BakeSettings settings = test::coarse_settings();
  settings.gather.cells_theta = 4;
  settings.gather.cells_phi = 12;
  settings.gather.shells = 6;
  settings.min_radius = 0.04;
  return settings;
}

const Stage& smoky() {
  static const Stage stage(test::smoky_room(), quick_settings());
  return stage;
}

// Several cells wide.
BakeView wide_view() { return test::room_view(140, 80); }

BakeView other_view() {
  BakeView view = test::room_view(48, 48);
  view.name = "other";
  view.camera.position = {0.95, 0.7, 0.9};
  view.camera.look_at = {0.2, 0.1, 0.3};
  view.camera.fov_deg = 55;
  return view;
}

TEST(Bake, ViewsGiveTheSameBytesForAnyThreadCount) {
  const BakeResult one = smoky().bake(request_of({wide_view()}, 1));
  EXPECT_GT(one.cache->records().size(), 200u);
  EXPECT_GT(one.cache->volume()->size(), 200u);
  EXPECT_EQ(one.stats.records_added, one.cache->size());
  EXPECT_EQ(one.deep.orders, 1);
  for (const int threads : {2, 3, 7})
    EXPECT_TRUE(same_bytes(*one.cache, *smoky().bake(request_of({wide_view()}, threads)).cache))
        << threads << " threads";
}

TEST(Bake, EverywhereGivesTheSameBytesForAnyThreadCount) {
  const BakeResult one = smoky().bake(request_of({}, 1));
  EXPECT_GT(one.cache->records().size(), 200u);
  for (const int threads : {2, 3, 7})
    EXPECT_TRUE(same_bytes(*one.cache, *smoky().bake(request_of({}, threads)).cache))
        << threads << " threads";
}

TEST(Bake, RecordsAreWholeAndFinite) {
  const BakeResult baked = smoky().bake(request_of({wide_view(), other_view()}, 2));
  const BakeSettings& s = smoky().settings;
  std::size_t with_media = 0;
  for (const SurfaceRecord& r : baked.cache->records()) {
    ASSERT_EQ(record_fault(r), nullptr) << record_fault(r);
    for (const float e : r.irradiance) ASSERT_GE(e, 0);
    for (const float radius : r.radius) {
      ASSERT_GT(radius, 0);
      ASSERT_LE(radius, s.max_radius * (1 + 1e-6));
    }
    with_media += r.media_share > 0;
  }
  EXPECT_GT(with_media, baked.cache->records().size() / 4);
}

// Wide records next to a block must not reach past the small ones in its corner.
TEST(Bake, NeighboursClampWideRecords) {
  BakeSettings settings = quick_settings();
  settings.error = 1;
  settings.min_radius = 0.01;
  const Stage stage(test::smoky_room(), settings);
  const BakeResult baked = stage.bake(request_of({wide_view()}, 2));
  std::size_t clamped = 0;
  for (const SurfaceRecord& r : baked.cache->records())
    clamped += (r.flags & kRadiusClampedFlag) != 0;
  EXPECT_GT(clamped, 0u);
}

// A view that has its records gets no more, and everywhere nothing after everywhere.
TEST(Bake, AgainAddsNothing) {
  for (const std::vector<BakeView>& views :
       {std::vector<BakeView>{wide_view()}, std::vector<BakeView>{wide_view(), other_view()},
        std::vector<BakeView>{}}) {
    const BakeRequest request = request_of(views, 2);
    const BakeResult first = smoky().bake(request);
    const BakeResult again = smoky().bake(request, first.cache.get());
    EXPECT_EQ(again.stats.records_added, 0u) << views.size() << " views";
    EXPECT_TRUE(same_bytes(*first.cache, *again.cache)) << views.size() << " views";
    EXPECT_EQ(again.stats.counters.segments, 0u);
  }
}

TEST(Bake, AnotherViewAddsWhatItNeedsAndKeepsTheRest) {
  const BakeResult first = smoky().bake(request_of({wide_view()}, 2));
  const BakeResult both = smoky().bake(request_of({other_view()}, 2), first.cache.get());
  const BakeResult alone = smoky().bake(request_of({other_view()}, 2));
  EXPECT_GT(both.stats.records_added, 0u);
  // The deep records are there already, and so are the walls that both see.
  std::size_t top = 0;
  for (const SurfaceRecord& r : alone.cache->records()) top += r.layer() == kTopLayer;
  EXPECT_LT(both.stats.records_added, top);
  EXPECT_EQ(both.cache->records().size(), first.cache->records().size() + both.stats.records_added);

  std::map<std::pair<std::uint64_t, int>, const SurfaceRecord*> kept;
  for (const SurfaceRecord& r : both.cache->records()) kept[{r.key, r.layer()}] = &r;
  for (const SurfaceRecord& r : first.cache->records()) {
    const auto found = kept.find({r.key, r.layer()});
    ASSERT_NE(found, kept.end());
    EXPECT_EQ(std::memcmp(&r, found->second, sizeof r), 0);
  }
}

// Stops at the n-th question, whichever thread asks.
BakeResult stopped_bake(BakeRequest request, int n, const IrradianceCache* existing = nullptr) {
  std::atomic<int> asked = 0;
  request.stop_requested = [&] { return ++asked > n; };
  return smoky().bake(request, existing);
}

int questions_of(BakeRequest request) {
  std::atomic<int> asked = 0;
  request.stop_requested = [&] {
    ++asked;
    return false;
  };
  smoky().bake(request);
  return asked;
}

TEST(Bake, StoppedAndResumedGivesTheBytesOfAnUnbrokenBake) {
  for (const std::vector<BakeView>& views :
       {std::vector<BakeView>{wide_view(), other_view()}, std::vector<BakeView>{}}) {
    const BakeRequest request = request_of(views, 2);
    const BakeResult whole = smoky().bake(request);
    const int questions = questions_of(request);  // One before each gather, some thousand.
    bool was_stopped_in_cells = false;
    for (const double when : {0.0, 0.02, 0.3, 0.6, 0.8, 0.9, 0.95, 0.99}) {
      const int n = static_cast<int>(when * questions);
      const BakeResult part = stopped_bake(request, n);
      ASSERT_TRUE(part.is_stopped);
      for (const SurfaceRecord& r : part.cache->records())
        was_stopped_in_cells |= (r.flags & kUnfinishedViewFlag) != 0;
      // Broken off a second time on the way.
      const BakeResult more = stopped_bake(request, 200, part.cache.get());
      const BakeResult rest = smoky().bake(request, more.cache.get());
      EXPECT_FALSE(rest.is_stopped);
      EXPECT_TRUE(same_bytes(*whole.cache, *rest.cache)) << views.size() << " views, n " << n;
      // What was gathered is not gathered again.
      EXPECT_EQ(rest.stats.records_added + more.cache->size(), whole.cache->size());
    }
    EXPECT_TRUE(was_stopped_in_cells);
  }
}

TEST(Bake, ShardsTogetherAreTheBytesOfOneProcess) {
  for (const std::vector<BakeView>& views :
       {std::vector<BakeView>{wide_view(), other_view()}, std::vector<BakeView>{}}) {
    BakeRequest request = request_of(views, 2);
    const BakeResult whole = smoky().bake(request);
    for (const std::uint32_t n : {2u, 5u}) {
      std::vector<MergeInput> inputs;
      std::size_t unfinished = 0;
      for (std::uint32_t i = 0; i < n; ++i) {
        request.shard = {i, n};
        const BakeResult part = smoky().bake(request);
        MergeInput& input = inputs.emplace_back();
        input.file = std::to_string(i);
        input.contents.header.shards = {request_hash(request), n, {i}};
        input.contents.records.assign(part.cache->records().begin(), part.cache->records().end());
        input.contents.volume = part.cache->volume()->all();
        std::size_t own = 0;
        for (const SurfaceRecord& r : input.contents.records)
          own += (r.flags & kUnfinishedViewFlag) != 0;
        EXPECT_GT(own, 0u) << "shard " << i << " of " << n << " has nothing to do";
        unfinished += own;
      }
      const MergedCache merged = merge_caches(inputs);
      const Vec3d origin = whole.cache->origin();
      EXPECT_TRUE(same_bytes(
          *whole.cache, IrradianceCache(merged.records, origin, {},
                                        std::make_shared<VolumeCache>(merged.volume, origin))));
      EXPECT_GT(unfinished, whole.cache->records().size() / 10) << "little was shared out";
    }
  }
}

TEST(Bake, ViewsOfOnePlaceShareItsCells) {
  const std::size_t one = smoky().bake(request_of({wide_view()}, 2)).cache->records().size();
  BakeView again = wide_view();
  again.camera.position += Vec3d(1e-3, 0, 0);
  const std::size_t both =
      smoky().bake(request_of({wide_view(), again}, 2)).cache->records().size();
  EXPECT_LT(both, one + one / 10);
}

TEST(Bake, AnUnfinishedViewIsKeptWhenAnotherIsBaked) {
  const BakeRequest request = request_of({wide_view()}, 1);
  BakeResult part;
  for (int n = questions_of(request) / 2;; n += 200) {
    part = stopped_bake(request, n);
    ASSERT_TRUE(part.is_stopped);
    const SurfaceRecord& last =
        part.cache->records().empty() ? SurfaceRecord{} : part.cache->records().back();
    if ((last.flags & kUnfinishedViewFlag) != 0) break;
  }
  const BakeResult other = smoky().bake(request_of({other_view()}, 1), part.cache.get());
  EXPECT_EQ(other.cache->records().size(),
            part.cache->records().size() + other.stats.records_added);
  for (const SurfaceRecord& r : other.cache->records())
    EXPECT_EQ(r.flags & kUnfinishedViewFlag, 0u);
}

// HARD_CASES T12.
TEST(Bake, OneVoxelMakesAnotherFingerprint) {
  const Box3d box(Vec3d(0.25, 0.25, 0.25), Vec3d(0.75, 0.75, 0.75));
  const auto fingerprint = [&](double middle) {
    Scene scene = test::smoky_room();
    scene.volumes[0].density = test::dense_grid(
        box, 17, [&](const Vec3d& p) { return (p - Vec3d(0.5)).length() < 1e-6 ? middle : 1.0; });
    return bake_fingerprint(World(scene), quick_settings());
  };
  EXPECT_EQ(fingerprint(1), fingerprint(1));
  EXPECT_NE(fingerprint(1), fingerprint(1 + 1e-6));
}

TEST(Bake, NothingToHoldMeansNoRecords) {
  const Scene unlit = test::blocks_in_a_room();
  EXPECT_EQ(Stage(unlit).bake(test::room_view(48, 48)).cache->records().size(), 0u);
  EXPECT_EQ(Stage(unlit).bake_everywhere().cache->records().size(), 0u);

  BakeSettings direct = test::coarse_settings(0);
  direct.volume_bounces = 1;
  const BakeResult baked = Stage(test::smoky_room(), direct).bake(test::room_view(48, 48));
  EXPECT_EQ(baked.cache->size(), 0u);
  EXPECT_EQ(baked.stats.counters.rays, 0u);

  Scene no_surfaces;
  test::add_lamps(no_surfaces);
  no_surfaces.lights.erase(no_surfaces.lights.begin());  // The quad is a surface.
  no_surfaces.volumes.push_back(test::smoke(RgbD(3.0), RgbD(1.0), 0));
  EXPECT_EQ(Stage(no_surfaces).bake_everywhere().cache->records().size(), 0u);
}

TEST(Bake, RefusesBouncesOutOfRange) {
  for (const int bounces : {-1, kMaxBounces + 1})
    EXPECT_THROW(Stage(test::smoky_room(), test::coarse_settings(bounces)).bake_everywhere(), Error)
        << bounces;
}

// Only what the scene needs (DESIGN 4.11), baking and rendering.
Counters all_counters(const Stage& stage) {
  const BakeView view = test::room_view(24, 24);
  const BakeResult baked = stage.bake(view);
  Counters counters = baked.stats.counters, rendering;
  EXPECT_GT(counters.gathers + counters.rays, 0u);
  CachedRenderOptions options;
  options.samples = 2;
  options.threads = 2;
  stage.render(*baked.cache, view, options, &rendering);
  EXPECT_GT(rendering.rays, 0u);
  counters += rendering;
  return counters;
}

TEST(Bake, VacuumMarchesNothing) {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  const Counters c = all_counters(Stage(scene));
  EXPECT_EQ(c.march_rays, 0u);
  EXPECT_EQ(c.segments, 0u);
  EXPECT_EQ(c.medium_shadow_rays, 0u);
  EXPECT_EQ(c.light_volume_lookups, 0u);
  EXPECT_GT(c.shadow_rays, 0u);
}

// The medium of a scene may hold nothing: grids of zeros, coefficients of zero.
TEST(Bake, AnEmptyMediumIsVacuum) {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  Volume nothing = test::haze(RgbD(1.0), RgbD(1.0), 0, test::kUnitBox);
  nothing.density = test::dense_grid(test::kUnitBox, 9, [](const Vec3d&) { return 0.0; });
  scene.volumes = {nothing, test::haze(RgbD(0.0), RgbD(0.0), 0, test::kUnitBox)};
  const Counters c = all_counters(Stage(scene));
  EXPECT_EQ(c.march_rays + c.segments + c.medium_shadow_rays + c.light_volume_lookups, 0u);
}

TEST(Bake, AbsorbersTraceNoLightInTheMedium) {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  scene.volumes.push_back(test::smoke(RgbD(0.0), RgbD(2.0), 0));
  const Counters c = all_counters(Stage(scene));
  EXPECT_EQ(c.medium_shadow_rays, 0u);
  EXPECT_GT(c.march_rays, 0u);
}

TEST(Bake, WithoutVolumeBouncesNothingScatters) {
  BakeSettings settings = test::coarse_settings();
  settings.volume_bounces = 0;
  const Counters c = all_counters(Stage(test::smoky_room(), settings));
  EXPECT_EQ(c.medium_shadow_rays, 0u);
  EXPECT_GT(c.segments, 0u);
}

TEST(Bake, GlowAloneTracesNoShadows) {
  Scene scene = test::blocks_in_a_room();
  Volume glow = test::smoke(RgbD(2.0), RgbD(1.0), 0.3);
  glow.emission.mode = Emission::Mode::Density;
  scene.volumes.push_back(glow);
  const Counters c = all_counters(Stage(scene));
  EXPECT_EQ(c.medium_shadow_rays + c.shadow_rays + c.light_volume_lookups, 0u);
  EXPECT_GT(c.march_rays, 0u);
}

TEST(Bake, HomogeneousMediaNeedNoLightVolumes) {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  scene.volumes.push_back(test::haze(RgbD(0.5), RgbD(0.2), 0, test::kUnitBox));
  const Stage stage(scene);
  EXPECT_EQ(stage.lighting.memory_bytes(), 0u);
  const Counters c = all_counters(stage);
  EXPECT_EQ(c.light_volume_lookups, 0u);
  EXPECT_GT(c.medium_shadow_rays, 0u);
}

// HARD_CASES N27: no threshold is absolute.
TEST(Bake, LightTimesAPowerOfTwoIsExactlyThat) {
  Scene bright = test::blocks_in_a_room();
  test::add_lamps(bright, 64);
  bright.volumes.push_back(test::smoke(RgbD(3.0), RgbD(1.0), 0.4));
  const BakeResult one = smoky().bake(test::room_view(48, 48));
  const BakeResult many = Stage(bright, quick_settings()).bake(test::room_view(48, 48));
  ASSERT_EQ(one.cache->records().size(), many.cache->records().size());
  for (std::size_t i = 0; i < one.cache->records().size(); ++i) {
    SurfaceRecord r = one.cache->records()[i];
    const SurfaceRecord& m = many.cache->records()[i];
    for (float& x : r.irradiance) x *= 64;
    for (float& x : r.gradient) x *= 64;
    for (float& x : r.rotational) x *= 64;
    r.error *= 64;
    ASSERT_EQ(std::memcmp(&r, &m, sizeof r), 0) << "record " << i << " of layer " << r.layer();
  }
}

// HARD_CASES N20: two planes 1e-4 of the scene apart.
TEST(Bake, ACrackDoesNotExplode) {
  Scene scene;
  const auto white = test::add_material(scene, test::diffuse(0.6f));
  const double gap = 1e-4 * std::sqrt(2.0);
  test::add_rectangle(scene, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, white);
  test::add_rectangle(scene, {0, 0.5, gap}, {0, 0.5, 0}, {1, 0, 0}, white);
  scene.lights.emplace_back(PointLight{{0.5, 0.25, 1}, Rgb(1.0f)});
  BakeSettings settings = test::coarse_settings(1);
  const Stage stage(scene, settings);
  const double smallest = settings.min_radius;
  const double area = 2 * (1 + 0.5);  // Both sides.

  const BakeResult everywhere = stage.bake_everywhere();
  BakeView view = test::room_view(64, 64);
  view.camera.position = {0.5, 0.2, 1.2};
  view.camera.look_at = {0.5, 0.5, 0};
  const BakeResult seen = stage.bake(view);
  for (const BakeResult* baked : {&everywhere, &seen}) {
    EXPECT_GT(baked->cache->records().size(), 20u);
    EXPECT_LT(baked->cache->records().size(), area / (smallest * smallest));
    for (const SurfaceRecord& r : baked->cache->records()) ASSERT_EQ(record_fault(r), nullptr);
  }
}

}  // namespace
}  // namespace brume
