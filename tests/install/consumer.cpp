// Uses the installed headers and libraries as a stranger would: a medium, a surface that light
// cannot pass, a file written and read back.
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "core/parallel.h"
#include "data_gen/analytic_field.h"
#include "geom/ray_tracer.h"
#include "vdb_media/brick_grid.h"
#include "vdb_media/grid_file.h"
#include "vdb_media/grid_writer.h"
#include "vdb_media/ray_marcher.h"

namespace {

bool is_near(const char* what, double value, double expected, double tolerance) {
  const bool good = std::abs(value - expected) <= tolerance;
  std::printf("%-32s %.9g, expected %.9g: %s\n", what, value, expected, good ? "good" : "BAD");
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  // The child that parses grid files is this same program.
  if (const auto status = brume::run_grid_loader_child(argc, argv)) return *status;
  brume::flush_denormals();
  bool good = true;

  // A ramp is what trilinear grids hold exactly.
  const brume::LinearRamp ramp{1, {0.5, 0.25, 0}};
  const brume::Lattice lattice =
      brume::covering_lattice({brume::Vec3d(0.0), brume::Vec3d(1.0)}, 0.125);
  brume::GridToWrite grid;
  grid.count = lattice.count;
  grid.values = brume::sample_field(ramp, lattice);
  grid.index_to_world = lattice.index_to_world();
  const auto file = std::filesystem::temp_directory_path() / "brume_consumer.vdb";
  brume::write_grids(file, {grid});
  const auto loaded = brume::load_grids(file, {{}}, {});
  std::filesystem::remove(file);

  brume::Volume volume;
  volume.density = loaded.at(0).value().channels.at(0);
  volume.sigma_a = brume::RgbD(2.0);
  const brume::Vec3d a(0.1, 0.2, 0.3), b(0.9, 0.7, 0.6);
  const brume::Ray ray{a, (b - a).normalized()};
  brume::MarchCounters counters;
  const brume::RgbD tau =
      brume::optical_depth(brume::Medium({volume}), ray, {0, (b - a).length()}, {}, counters);
  good &=
      is_near("optical depth of a ramp", tau.g, 2 * brume::line_integral(ramp, a, b).value(), 1e-5);

  brume::TriangleMesh floor;
  floor.positions = {{-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1}};
  floor.triangles = {{0, 1, 2}, {0, 2, 3}};
  floor.materials = {0, 0};
  const brume::RayTracer tracer({floor});
  const brume::Hit hit = tracer.intersect(brume::Ray{{0.25, 3, 0.5}, {0, -1, 0}});
  good &= is_near("distance to a floor", hit.t, 3, 1e-6);
  good &= is_near("its normal", hit.normal.y, 1, 1e-6);
  return good ? 0 : 1;
}
