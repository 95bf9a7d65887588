// OpenVDB itself as the oracle: types and transforms that grid_writer does not write, its trilinear
// sampler, and optical depths by brute force. The one test that includes it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <sstream>

#include "core/parallel.h"
#include "core/random.h"
#include "grid_fixtures.h"
#include "vdb_media/medium.h"
#include "vdb_media/ray_marcher.h"

namespace brume {
namespace {

using openvdb::Coord;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::filesystem::path kData = BRUME_SHARED_DATA;

class OpenVdb : public testing::Test {
 protected:
  OpenVdb() { openvdb::initialize(); }

  std::filesystem::path write(const openvdb::GridPtrVec& grids, const std::string& name = "a.vdb") {
    openvdb::io::File(file(name).string()).write(grids);
    return file(name);
  }
  std::filesystem::path write(const openvdb::GridBase::Ptr& grid) {
    return write(openvdb::GridPtrVec{grid});
  }
  std::filesystem::path file(const std::string& name) const { return dir_ / name; }

  template <typename Grid>
  typename Grid::Ptr make(const typename Grid::ValueType& background = {}) {
    auto grid = Grid::create(background);
    grid->setName("density");
    return grid;
  }

 private:
  TempDir dir_;
};

template <typename Grid>
class OpenVdbScalar : public OpenVdb {};
using ScalarGrids = testing::Types<openvdb::FloatGrid, openvdb::DoubleGrid, openvdb::Int32Grid,
                                   openvdb::Int64Grid, openvdb::BoolGrid>;
TYPED_TEST_SUITE(OpenVdbScalar, ScalarGrids);

TYPED_TEST(OpenVdbScalar, EachNumberTypeIsRead) {
  using T = typename TypeParam::ValueType;
  auto grid = this->template make<TypeParam>(T(0));
  grid->tree().setValueOn(Coord(3, -4, 5), T(1));
  grid->tree().setValueOn(Coord(4, -4, 5), T(7));
  grid->tree().addTile(1, Coord(64, 64, 64), T(3), true);
  const LoadedGrid loaded = load_density(this->write(grid));
  const BrickGrid& b = *loaded.channels.at(0);
  EXPECT_EQ(node(b, {3, -4, 5}), float(T(1)));
  EXPECT_EQ(node(b, {4, -4, 5}), float(T(7)));
  EXPECT_EQ(node(b, {67, 68, 69}), float(T(3)));
  EXPECT_EQ(node(b, {0, 0, 0}), 0);
  EXPECT_THAT(loaded.warnings, IsEmpty());
}

template <typename Grid>
class OpenVdbVector : public OpenVdb {};
using VectorGrids = testing::Types<openvdb::Vec3SGrid, openvdb::Vec3DGrid, openvdb::Vec3IGrid>;
TYPED_TEST_SUITE(OpenVdbVector, VectorGrids);

TYPED_TEST(OpenVdbVector, EachVectorTypeIsReadAsThreeChannels) {
  using T = typename TypeParam::ValueType;
  auto grid = TypeParam::create(T(0));
  grid->setName("Cd");
  grid->tree().setValueOn(Coord(3, -4, 5), T(1, 2, 3));
  const auto loaded =
      load_grids(this->write(grid), {{GridRole::Color, std::nullopt, true}}, {}).at(0);
  ASSERT_EQ(loaded->channels.size(), 3u);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(node(*loaded->channels[c], {3, -4, 5}), float(c + 1));
}

TEST_F(OpenVdb, MasksAreReadAsOnes) {
  auto grid = make<openvdb::MaskGrid>();
  grid->tree().setValueOn(Coord(1, 2, 3));
  const LoadedGrid loaded = load_density(write(grid));
  EXPECT_EQ(node(*loaded.channels[0], {1, 2, 3}), 1);
  EXPECT_EQ(node(*loaded.channels[0], {1, 2, 4}), 0);
}

TEST_F(OpenVdb, DoublesThatNoFloatHoldsAreAbsurd) {
  auto grid = make<openvdb::DoubleGrid>();
  grid->tree().setValueOn(Coord(0), 1e300);
  grid->tree().setValueOn(Coord(1), -1e300);
  grid->tree().setValueOn(Coord(2), 1e-300);
  grid->tree().setValueOn(Coord(3), 4);
  const LoadedGrid loaded = load_density(write(grid));
  EXPECT_EQ(loaded.bad_voxels.infinite, 2u);
  EXPECT_EQ(loaded.bad_voxels.total(), 2u);
  EXPECT_EQ(loaded.channels[0]->range().max, 4);
}

TEST_F(OpenVdb, HalfFloatsThatOverflowAreCounted) {
  auto grid = make<openvdb::FloatGrid>();
  grid->setSaveFloatAsHalf(true);
  grid->tree().setValueOn(Coord(0), 1e5f);
  grid->tree().setValueOn(Coord(1), 2.0f);
  const LoadedGrid loaded = load_density(write(grid));
  EXPECT_EQ(loaded.bad_voxels.infinite, 1u);
  EXPECT_EQ(node(*loaded.channels[0], Vec3i(1)), 2);
}

TEST_F(OpenVdb, DenormalsBecomeZeroUncounted) {
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().setValueOn(Coord(0), 1e-42f);
  grid->tree().setValueOn(Coord(0, 0, 1), -1e-42f);
  grid->tree().setValueOn(Coord(1), 2.0f);
  const LoadedGrid loaded = load_density(write(grid));
  EXPECT_EQ(loaded.bad_voxels.total(), 0u);
  EXPECT_THAT(loaded.warnings, IsEmpty());
  const BrickGrid& b = *loaded.channels[0];
  for (std::int32_t k = 0; k < std::int32_t(b.stored_brick_count()); ++k)
    for (int i = 0; i < BrickGrid::kBrickFloats; ++i)
      EXPECT_NE(std::fpclassify(b.brick(k)[i]), FP_SUBNORMAL);
}

TEST_F(OpenVdb, OtherTypesAreNamedAndRefused) {
  using UintGrid = openvdb::Grid<openvdb::tree::Tree4<std::uint32_t, 5, 4, 3>::Type>;
  UintGrid::registerGrid();
  auto grid = make<UintGrid>();
  grid->tree().setValueOn(Coord(0), 1u);
  // The loader has never heard of the type, nor would other programs.
  const Error e = load_error(write(grid));
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(), HasSubstr("uint32"));
}

TEST_F(OpenVdb, StoredInactiveValuesCountAsAccessorsGiveThem) {
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().setValueOn(Coord(0), 1.0f);
  grid->tree().setValueOff(Coord(1, 0, 0), 2.0f);
  grid->tree().addTile(1, Coord(64, 0, 0), 3.0f, false);
  const LoadedGrid loaded = load_density(write(grid));
  EXPECT_EQ(node(*loaded.channels[0], {1, 0, 0}), 2);
  EXPECT_EQ(node(*loaded.channels[0], {66, 1, 1}), 3);
}

TEST_F(OpenVdb, BackgroundReachesOnlyWhereAPolicyLetsIt) {
  auto grid = make<openvdb::FloatGrid>(3.0f);
  grid->tree().setValueOn(Coord(2, 2, 2), 1.0f);
  grid->tree().setValueOn(Coord(200, 40, 40), 1.0f);
  const auto file = write(grid);
  GridFileOptions keep, zero;
  keep.background = BackgroundPolicy::Keep;
  zero.background = BackgroundPolicy::Zero;
  const LoadedGrid kept = load_density(file, keep), zeroed = load_density(file, zero);
  RandomStream random(5);
  for (int i = 0; i < 5000; ++i) {
    const Vec3i p(int(random.uniform() * 220) - 8, int(random.uniform() * 60) - 8,
                  int(random.uniform() * 60) - 8);
    const bool inside = p.x >= 2 && p.x <= 200 && p.y >= 2 && p.y <= 40 && p.z >= 2 && p.z <= 40;
    const float value = grid->tree().getValue(Coord(p.x, p.y, p.z));
    EXPECT_EQ(node(*kept.channels[0], p), inside ? value : 0) << p;
    EXPECT_EQ(node(*zeroed.channels[0], p), value == 3 ? 0 : value) << p;
  }
  // The inside of the box is a tile, not voxels.
  EXPECT_LT(kept.channels[0]->stored_brick_count(), 26u * 6 * 6);
}

TEST_F(OpenVdb, ANanBackgroundIsABackgroundToo) {
  auto grid = make<openvdb::FloatGrid>(std::nanf(""));
  grid->tree().setValueOn(Coord(2, 2, 2), 1.0f);
  const auto file = write(grid);
  EXPECT_THAT(load_error(file).what(), HasSubstr("background is nan"));
  GridFileOptions zero;
  zero.background = BackgroundPolicy::Zero;
  const LoadedGrid loaded = load_density(file, zero);
  EXPECT_EQ(loaded.bad_voxels.total(), 0u);
  EXPECT_EQ(loaded.channels[0]->range().max, 1);
}

TEST_F(OpenVdb, TilesOfEveryLevelMatchVoxels) {
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().addTile(1, Coord(0, 0, 0), 1.0f, true);
  grid->tree().addTile(2, Coord(128, 0, 0), 2.0f, true);
  grid->tree().setValueOn(Coord(9, 3, 3), 5.0f);
  const LoadedGrid loaded = load_density(write(grid));
  const BrickGrid& b = *loaded.channels[0];
  openvdb::FloatGrid::ConstAccessor accessor = grid->getConstAccessor();
  RandomStream random(3);
  for (int i = 0; i < 20'000; ++i) {
    const openvdb::Vec3d p(random.uniform() * 300 - 20, random.uniform() * 160 - 20,
                           random.uniform() * 160 - 20);
    EXPECT_NEAR(b.sample({p.x(), p.y(), p.z()}), openvdb::tools::BoxSampler::sample(accessor, p),
                1e-5);
  }
  // The 128^3 tile is stored on its faces only.
  EXPECT_LT(b.stored_brick_count(), 17u * 17 * 17 - 15 * 15 * 15 + 100);
}

TEST_F(OpenVdb, ARootTileStaysATile) {
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().addTile(3, Coord(0, 0, 0), 0.5f, true);  // 4096^3 voxels.
  GridFileOptions options;
  options.max_voxels = 1ull << 37;
  const auto file = write(grid);
  // With the layer of bricks below it the index passes 2^27 entries.
  EXPECT_THAT(load_error(file, {}, options).what(), HasSubstr("extent too large"));
}

TEST_F(OpenVdb, ASparseGridTooWideToIndexIsRefused) {
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().setValueOn(Coord(-(1 << 20)), 1.0f);
  grid->tree().setValueOn(Coord(1 << 20), 1.0f);
  const Error e = load_error(write(grid));
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(), AllOf(HasSubstr("grid density"), HasSubstr("extent too large")));
}

// HARD_CASES T15.
TEST_F(OpenVdb, ATileBombIsRefusedQuicklyInLittleMemory) {
  auto grid = make<openvdb::FloatGrid>();
  for (int i = 0; i < 512; ++i)
    grid->tree().addTile(3, Coord(4096 * (i % 8), 4096 * (i / 8 % 8), 4096 * (i / 64)), 1.0f, true);
  const auto path = write(grid);
  EXPECT_LT(std::filesystem::file_size(path), 100'000u);
  const auto start = std::chrono::steady_clock::now();
  const Error by_count = load_error(path);
  EXPECT_EQ(by_count.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(by_count.what(), HasSubstr("35184372088832 active voxels"));
  // And where the file does not own up to it, or the limit is out of the way.
  GridFileOptions wide;
  wide.max_voxels = ~0ull;
  EXPECT_THAT(load_error(path, {}, wide).what(), HasSubstr("extent too large"));
  const GridFileInfo info = inspect_grid_file(path, wide);
  EXPECT_EQ(info.grids.at(0).active_voxels, 35184372088832ull);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
  rusage children{};
  ASSERT_EQ(::getrusage(RUSAGE_CHILDREN, &children), 0);
  EXPECT_LT(children.ru_maxrss, 3 << 20);  // KiB; other tests' children included.
}

TEST_F(OpenVdb, FilesWithoutGridOffsetsAreRead) {
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().setValueOn(Coord(1, 2, 3), 4.0f);
  std::ostringstream stream(std::ios::binary);
  openvdb::io::Stream(stream).write(openvdb::GridPtrVec{grid});
  write_file(file("a.vdb"), stream.str());
  EXPECT_EQ(node(*load_density(file("a.vdb")).channels[0], {1, 2, 3}), 4);
}

TEST_F(OpenVdb, GridsThatShareATreeAreBothRead) {
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().setValueOn(Coord(1, 2, 3), 4.0f);
  auto other = grid->copy();
  other->setName("heat");
  other->setTransform(openvdb::math::Transform::createLinearTransform(2.0));
  const auto grids = load_grids(write(openvdb::GridPtrVec{grid, other}),
                                {GridRequest{}, {GridRole::Temperature, std::nullopt, true}}, {});
  EXPECT_EQ(node(*grids[0]->channels[0], {1, 2, 3}), 4);
  EXPECT_EQ(node(*grids[1]->channels[0], {1, 2, 3}), 4);
  EXPECT_EQ(grids[1]->channels[0]->voxel_size(), 2);
}

TEST_F(OpenVdb, UnnamedAndHostileNamesAreShownSafely) {
  auto unnamed = openvdb::FloatGrid::create(), hostile = openvdb::FloatGrid::create();
  unnamed->tree().setValueOn(Coord(0), 1.0f);
  hostile->setName("\x1b[2J\nevil");
  const Error e = load_error(write(openvdb::GridPtrVec{unnamed, hostile}));
  EXPECT_THAT(e.what(), AllOf(HasSubstr("(unnamed)"), HasSubstr("\\x1b[2J\\x0aevil")));
}

TEST_F(OpenVdb, AFrustumIsResampledWithAWarning) {
  auto grid = make<openvdb::FloatGrid>();
  // 32x32x32 voxels; 4 units wide in front, twice that behind, 8 deep.
  const openvdb::BBoxd box(openvdb::Vec3d(0), openvdb::Vec3d(31));
  auto map = openvdb::math::NonlinearFrustumMap::Ptr(
      new openvdb::math::NonlinearFrustumMap(box, /*taper=*/0.5, /*depth=*/2.0));
  map =
      openvdb::StaticPtrCast<openvdb::math::NonlinearFrustumMap>(map->postScale(openvdb::Vec3d(4)));
  grid->setTransform(openvdb::math::Transform::Ptr(new openvdb::math::Transform(map)));
  for (int z = 0; z < 32; ++z)
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x) grid->tree().setValueOn(Coord(x, y, z), 1 + 0.05f * float(x));
  const LoadedGrid loaded = load_density(write(grid));
  EXPECT_THAT(loaded.warnings, ElementsAre(AllOf(HasSubstr("frustum"), HasSubstr("resampled"))));
  const BrickGrid& b = *loaded.channels[0];
  ASSERT_FALSE(b.is_empty());
  int compared = 0;
  RandomStream random(11);
  for (int i = 0; i < 5000; ++i) {
    const openvdb::Vec3d p(3 + 25 * random.uniform(), 3 + 25 * random.uniform(),
                           3 + 25 * random.uniform());
    const openvdb::Vec3d w = grid->transform().indexToWorld(p);
    const double expected = 1 + 0.05 * p.x();
    EXPECT_NEAR(b.sample(b.world_to_index().point({w.x(), w.y(), w.z()})), expected, 0.02);
    ++compared;
  }
  EXPECT_EQ(compared, 5000);
  const Box3d bounds = b.world_bounds();
  const openvdb::Vec3d far = grid->transform().indexToWorld(openvdb::Vec3d(31, 31, 31));
  EXPECT_LT(bounds.max.x, far.x() * 1.3);
}

TEST_F(OpenVdb, TransformsThatAreNoneAreRefused) {
  // OpenVDB refuses to make these, so the numbers of a good one are changed in the file.
  auto grid = make<openvdb::FloatGrid>();
  grid->tree().setValueOn(Coord(0), 1.0f);
  const double rows[16] = {0.625, 0.25, 0, 0, 0, 0.75, 0.125, 0, 0.375, 0, 0.875, 0, 3, 4, 5, 1};
  const openvdb::Mat4d m(rows);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(m));
  const std::string good = read_file(write(grid));
  const auto replaced = [&](double from, double to) {
    std::string bytes = good;
    const std::string a(reinterpret_cast<const char*>(&from), 8);
    const std::string b(reinterpret_cast<const char*>(&to), 8);
    for (std::size_t at = bytes.find(a); at != std::string::npos; at = bytes.find(a, at + 8))
      bytes.replace(at, 8, b);
    EXPECT_NE(bytes, good);
    write_file(file("b.vdb"), bytes);
    return load_error(file("b.vdb"));
  };
  EXPECT_NO_THROW(load_density(file("a.vdb")));
  for (const double bad : {std::nan(""), double(INFINITY), 1e12}) {
    const Error e = replaced(0.625, bad);
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_THAT(e.what(), HasSubstr("grid density"));
  }
  EXPECT_EQ(replaced(3, std::nan("")).kind(), ErrorKind::InvalidInput);
}

// Real files.

openvdb::FloatGrid::Ptr read_density(const std::filesystem::path& path) {
  openvdb::io::File archive(path.string());
  archive.open(false);
  return openvdb::gridPtrCast<openvdb::FloatGrid>(archive.readGrid("density"));
}

class RealFile : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    openvdb::initialize();
    path_ = kData / "vdb" / GetParam();
    if (!std::filesystem::exists(path_)) GTEST_SKIP() << "no shared test data";
    theirs_ = read_density(path_);
    ours_ = load_density(path_).channels.at(0);
  }
  std::filesystem::path path_;
  openvdb::FloatGrid::Ptr theirs_;
  std::shared_ptr<const BrickGrid> ours_;
};

TEST_P(RealFile, TrilinearSamplesAgreeEverywhere) {
  openvdb::FloatGrid::ConstAccessor accessor = theirs_->getConstAccessor();
  const openvdb::CoordBBox box = theirs_->evalActiveVoxelBoundingBox();
  RandomStream random(17);
  const double scale = ours_->range().max;
  double worst = 0;
  int lit = 0;
  for (int i = 0; i < 100'000; ++i) {
    openvdb::Vec3d p;
    for (int a = 0; a < 3; ++a) p[a] = box.min()[a] - 3 + random.uniform() * (box.dim()[a] + 5);
    if (i % 3 == 0) p = openvdb::Vec3d(std::round(p.x()), p.y(), std::round(p.z()));
    const double expected = openvdb::tools::BoxSampler::sample(accessor, p);
    worst = std::max(worst, std::abs(ours_->sample({p.x(), p.y(), p.z()}) - expected));
    lit += expected > 0;
  }
  EXPECT_GT(lit, 10'000);
  EXPECT_LT(worst, 1e-6 * scale);
}

// Midpoint rule with OpenVDB's values, interpolated in double.
double brute_force_depth(const openvdb::FloatGrid& grid, const Ray& ray, const Interval& t,
                         double step) {
  openvdb::FloatGrid::ConstAccessor accessor = grid.getConstAccessor();
  const auto steps = static_cast<std::int64_t>(std::ceil((t.end - t.begin) / step));
  const double h = (t.end - t.begin) / static_cast<double>(steps);
  double sum = 0;
  Coord cell(INT_MAX);
  double v[8] = {};
  bool dark = true;
  for (std::int64_t k = 0; k < steps; ++k) {
    const Vec3d w = ray.at(t.begin + (static_cast<double>(k) + 0.5) * h);
    const openvdb::Vec3d p = grid.worldToIndex({w.x, w.y, w.z});
    const Coord c = Coord::floor(p);
    if (c != cell) {
      cell = c;
      dark = true;
      for (int j = 0; j < 8; ++j) {
        v[j] = accessor.getValue(c.offsetBy(j & 1, j >> 1 & 1, j >> 2));
        dark = dark && v[j] == 0;
      }
    }
    if (dark) continue;
    const double fx = p.x() - c.x(), fy = p.y() - c.y(), fz = p.z() - c.z();
    const auto mix = [](double a, double b, double f) { return a + f * (b - a); };
    sum += mix(mix(mix(v[0], v[1], fx), mix(v[2], v[3], fx), fy),
               mix(mix(v[4], v[5], fx), mix(v[6], v[7], fx), fy), fz);
  }
  return sum * h;
}

// 256 midpoints a voxel; what is left is mostly their own error. BRUME_ORACLE_RAYS asks for more
// rays than a test run should take.
TEST_P(RealFile, OpticalDepthAgreesWithBruteForce) {
  const char* asked = std::getenv("BRUME_ORACLE_RAYS");
  const int rays = asked != nullptr ? std::max(1, std::atoi(asked)) : 200;
  Volume volume;
  volume.density = ours_;
  volume.sigma_s = RgbD(1);
  const Box3d bounds = ours_->world_bounds();
  const Vec3d size = bounds.size();

  struct Result {
    double ours = 0, theirs = 0;
  };
  std::vector<Result> results(static_cast<std::size_t>(rays));
  parallel_for(0, results.size(), 4, [&](std::size_t i) {
    RandomStream random(random_key(23, i));
    const auto point = [&] {
      const double x = random.uniform(), y = random.uniform(), z = random.uniform();
      return bounds.min + Vec3d(x * size.x, y * size.y, z * size.z);
    };
    const Vec3d through = point();
    const double z = 2 * random.uniform() - 1, phi = 2 * kPi * random.uniform();
    const double s = std::sqrt(1 - z * z);
    const Vec3d direction(s * std::cos(phi), s * std::sin(phi), z);
    const Ray ray{through - direction * size.length(), direction};
    const Interval t = clip(ray, bounds, {0, kInfinity});
    MarchCounters counters;
    results[i].ours = density_integral(volume, ray, {0, kInfinity}, {}, counters);

    results[i].theirs = brute_force_depth(*theirs_, ray, t, ours_->voxel_size() / 256);
    // A ray that only cuts an edge of the smoke meets few midpoints: take more of them.
    if (results[i].theirs < 2 * ours_->range().max * ours_->voxel_size())
      results[i].theirs = brute_force_depth(*theirs_, ray, t, ours_->voxel_size() / 2048);
  });

  double largest = 0, worst = 0;
  int crossing = 0;
  for (const Result& r : results) largest = std::max(largest, r.theirs);
  for (const Result& r : results) {
    if (r.theirs == 0) {
      EXPECT_LE(r.ours, 1e-9 * largest);  // It may pass between the midpoints.
      continue;
    }
    ++crossing;
    // Rays that only graze the smoke are compared with a ten-thousandth of the largest depth.
    worst = std::max(worst, std::abs(r.ours - r.theirs) / std::max(r.theirs, 1e-4 * largest));
  }
  std::printf("  %s: %d rays, %d cross it, largest relative difference %.2e\n", GetParam(), rays,
              crossing, worst);
  EXPECT_GT(crossing, rays / 4);
  EXPECT_LT(worst, 5e-6);
}

INSTANTIATE_TEST_SUITE_P(Grids, RealFile, testing::Values("smoke1.vdb", "wdas_cloud_sixteenth.vdb"),
                         [](const auto& p) {
                           const std::string name = p.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace brume
