// Exports as other programs read them: Assimp and Python for PLY, OpenVDB's own reader for points
// and splatted grids.
#include "exchange/record_points.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointCount.h>
#include <openvdb/points/PointDataGrid.h>

#include <assimp/Importer.hpp>
#include <cstdio>

#include "core/error.h"
#include "exchange/splat.h"
#include "unit/cache/sample_records.h"

namespace brume {
namespace {

CacheContents sample_contents(std::size_t count) {
  CacheContents contents;
  contents.header = sample_header();
  contents.records = sample_records(count, 2, 3);
  return contents;
}

Vec3d world_position(const CacheContents& contents, std::size_t i) {
  const float* p = contents.records[i].position;
  return contents.header.origin + Vec3d(p[0], p[1], p[2]);
}

TEST(RecordPoints, AssimpReadsThePly) {
  const ScratchFolder folder;
  const CacheContents contents = sample_contents(100);
  EXPECT_THAT(write_ply(folder / "a.ply", contents, {}), testing::IsEmpty());
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "a.ply").string(), 0);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  ASSERT_EQ(scene->mNumMeshes, 1u);
  const aiMesh& mesh = *scene->mMeshes[0];
  ASSERT_EQ(mesh.mNumVertices, 100u);
  ASSERT_TRUE(mesh.HasNormals());
  ASSERT_TRUE(mesh.HasVertexColors(0));
  for (std::size_t i = 0; i < 100; ++i) {
    const Vec3d p = world_position(contents, i);
    EXPECT_NEAR(mesh.mVertices[i].x, p.x, 1e-5);
    EXPECT_NEAR(mesh.mVertices[i].z, p.z, 1e-5);
    EXPECT_EQ(mesh.mNormals[i].y, contents.records[i].normal[1]);
  }
}

TEST(RecordPoints, PythonReadsEveryPropertyOfThePly) {
  if (std::system("python3 --version >/dev/null 2>&1") != 0) GTEST_SKIP() << "no python3";
  const ScratchFolder folder;
  const CacheContents contents = sample_contents(10);
  write_ply(folder / "a.ply", contents, {});
  write_bytes(folder / "read.py", R"(
import struct, sys
data = open(sys.argv[1], 'rb').read()
end = data.index(b'end_header\n') + 11
lines = data[:end].decode().split('\n')
assert lines[:2] == ['ply', 'format binary_little_endian 1.0'], lines[:2]
count = int([l for l in lines if l.startswith('element vertex')][0].split()[2])
properties = [l.split()[1:] for l in lines if l.startswith('property')]
layout = '<' + ''.join({'float': 'f', 'uchar': 'B'}[t] for t, _ in properties)
assert len(data) - end == count * struct.calcsize(layout), 'size'
for row in struct.iter_unpack(layout, data[end:]):
    r = dict(zip([n for _, n in properties], row))
    print(r['irradiance_g'].hex(), r['gradient_b_z'].hex(), r['radius_2'].hex(), r['layer'], r['wave'])
)");
  std::FILE* pipe = ::popen(
      ("python3 '" + (folder / "read.py").string() + "' '" + (folder / "a.ply").string() + "' 2>&1")
          .c_str(),
      "r");
  ASSERT_NE(pipe, nullptr);
  std::string output;
  char buffer[4096];
  while (const std::size_t got = std::fread(buffer, 1, sizeof buffer, pipe))
    output.append(buffer, got);
  ASSERT_EQ(::pclose(pipe), 0) << output;
  std::istringstream rows(output);
  for (std::size_t i = 0; i < 10; ++i) {
    std::string green, gradient, radius;
    int layer = 0, wave = 0;
    ASSERT_TRUE(rows >> green >> gradient >> radius >> layer >> wave) << output;
    EXPECT_EQ(std::stod(green), contents.records[i].irradiance[1]);
    EXPECT_EQ(std::stod(gradient), contents.records[i].gradient[8]);
    EXPECT_EQ(std::stod(radius), contents.records[i].radius[1]);
    EXPECT_EQ(layer, 2);
    EXPECT_EQ(wave, 3);
  }
}

TEST(RecordPoints, PlySaysWhereFloatsAreTooCoarse) {
  const ScratchFolder folder;
  CacheContents contents = sample_contents(10);
  contents.header.origin = Vec3d(1e6);
  EXPECT_THAT(write_ply(folder / "a.ply", contents, {}),
              testing::ElementsAre(testing::HasSubstr("positions are floats")));
}

class VdbFile {
 public:
  explicit VdbFile(const std::filesystem::path& path) : file_(path.string()) {
    openvdb::initialize();
    file_.open();
  }
  template <typename Grid>
  typename Grid::Ptr grid(const std::string& name) {
    return openvdb::gridPtrCast<Grid>(file_.readGrid(name));
  }

 private:
  openvdb::io::File file_;
};

TEST(RecordPoints, OpenVdbReadsThePointsAndTheirAttributes) {
  namespace points = openvdb::points;
  const ScratchFolder folder;
  const CacheContents contents = sample_contents(500);
  write_vdb_points(folder / "a.vdb", contents);
  const auto grid = VdbFile(folder / "a.vdb").grid<points::PointDataGrid>("records");
  ASSERT_TRUE(grid);
  ASSERT_EQ(points::pointCount(grid->tree()), 500u);
  std::vector<bool> seen(contents.records.size());
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
    const points::AttributeHandle<openvdb::Vec3f, points::NullCodec> place(
        leaf->constAttributeArray("P"));
    const points::AttributeHandle<openvdb::Vec3f> light(leaf->constAttributeArray("E"));
    const points::AttributeHandle<openvdb::Vec3f> normal(leaf->constAttributeArray("N"));
    const points::AttributeHandle<openvdb::Vec3f> blue(leaf->constAttributeArray("gradE_b"));
    const points::AttributeHandle<float> radius(leaf->constAttributeArray("radius_1"));
    const points::AttributeHandle<std::int32_t> wave(leaf->constAttributeArray("wave"));
    for (auto i = leaf->beginIndexOn(); i; ++i) {
      const openvdb::Vec3d p =
          grid->indexToWorld(i.getCoord().asVec3d() + openvdb::Vec3d(place.get(*i)));
      const auto found =
          std::find_if(contents.records.begin(), contents.records.end(),
                       [&](const SurfaceRecord& r) { return r.irradiance[0] == light.get(*i)[0]; });
      ASSERT_NE(found, contents.records.end());
      const auto k = static_cast<std::size_t>(found - contents.records.begin());
      seen[k] = true;
      const Vec3d expected = world_position(contents, k);
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(p[a], expected[a], 1e-7);
      EXPECT_EQ(normal.get(*i)[2], found->normal[2]);
      EXPECT_EQ(blue.get(*i)[1], found->gradient[7]);
      EXPECT_EQ(radius.get(*i), found->radius[0]);
      EXPECT_EQ(wave.get(*i), 3);
    }
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), true), 500);
}

TEST(RecordPoints, EmptyCachesMakeEmptyFiles) {
  const ScratchFolder folder;
  const CacheContents contents = sample_contents(0);
  write_ply(folder / "a.ply", contents, {});
  write_vdb_points(folder / "a.vdb", contents);
  write_splat(folder / "b.vdb", contents, {0.1});
  EXPECT_EQ(openvdb::points::pointCount(
                VdbFile(folder / "a.vdb").grid<openvdb::points::PointDataGrid>("records")->tree()),
            0u);
  EXPECT_EQ(VdbFile(folder / "b.vdb").grid<openvdb::FloatGrid>("count")->activeVoxelCount(), 0u);
}

TEST(RecordPoints, TheSameRecordsGiveTheSameBytes) {
  const ScratchFolder folder;
  const CacheContents contents = sample_contents(200);
  for (const char* name : {"a", "b"}) {
    write_ply(folder / (std::string(name) + ".ply"), contents, {});
    write_vdb_points(folder / (std::string(name) + ".vdb"), contents);
    write_splat(folder / (std::string(name) + "s.vdb"), contents, {0.05});
  }
  EXPECT_TRUE(read_bytes(folder / "a.ply") == read_bytes(folder / "b.ply"));
  EXPECT_TRUE(read_bytes(folder / "a.vdb") == read_bytes(folder / "b.vdb"));
  EXPECT_TRUE(read_bytes(folder / "as.vdb") == read_bytes(folder / "bs.vdb"));
}

// One disc in the plane y = 0, whose irradiance grows along x as its gradient says.
CacheContents one_disc() {
  CacheContents contents;
  SurfaceRecord record = sample_records(1).front();
  std::fill(std::begin(record.gradient), std::end(record.gradient), 0.0f);
  for (int a = 0; a < 3; ++a) record.position[a] = 0;
  record.normal[0] = record.normal[2] = 0;
  record.normal[1] = 1;
  record.irradiance[0] = 4;
  record.gradient[0] = 2;
  record.radius[0] = record.radius[1] = 1;
  contents.records = {record};
  return contents;
}

TEST(Splat, FillsTheDiscWithItsExtrapolation) {
  const ScratchFolder folder;
  write_splat(folder / "a.vdb", one_disc(), {0.1});
  VdbFile file(folder / "a.vdb");
  const auto light = file.grid<openvdb::Vec3SGrid>("irradiance");
  const auto weight = file.grid<openvdb::FloatGrid>("weight");
  const auto count = file.grid<openvdb::FloatGrid>("count");
  ASSERT_TRUE(light && weight && count);
  EXPECT_EQ(light->activeVoxelCount(), weight->activeVoxelCount());
  // Voxel centres inside a circle of ten voxels: pi 10^2, and one layer of them.
  EXPECT_NEAR(double(light->activeVoxelCount()), kPi * 100, 10);
  EXPECT_EQ(light->evalActiveVoxelBoundingBox().dim().y(), 1);
  const auto irradiance = light->getAccessor();
  EXPECT_NEAR(irradiance.getValue({5, 0, 0})[0], 4 + 2 * 0.5, 1e-5);
  EXPECT_NEAR(irradiance.getValue({-9, 0, 0})[0], 4 - 2 * 0.9, 1e-5);
  EXPECT_NEAR(weight->getAccessor().getValue({5, 0, 0}), 0.5, 1e-5);
  EXPECT_EQ(count->getAccessor().getValue({5, 0, 0}), 1);
}

TEST(Splat, AveragesDiscsByWeight) {
  const ScratchFolder folder;
  CacheContents contents = one_disc();
  contents.records.push_back(contents.records[0]);
  contents.records[0].gradient[0] = contents.records[1].gradient[0] = 0;
  contents.records[1].irradiance[0] = 1;
  contents.records[1].position[0] = 0.5f;
  write_splat(folder / "a.vdb", contents, {0.1});
  VdbFile file(folder / "a.vdb");
  const auto light = file.grid<openvdb::Vec3SGrid>("irradiance");
  // At x = 0.4 the weights are 0.6 and 0.9.
  EXPECT_NEAR(light->getAccessor().getValue({4, 0, 0})[0], (0.6 * 4 + 0.9 * 1) / 1.5, 1e-5);
}

TEST(Splat, RefusesVoxelsBeyondCounting) {
  const ScratchFolder folder;
  EXPECT_THROW(write_splat(folder / "a.vdb", one_disc(), {1e-6}), Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.vdb"));
}

}  // namespace
}  // namespace brume
