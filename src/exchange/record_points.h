// Records as points that other programs show: PLY, and OpenVDB points.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cache/cache_file.h"

namespace brume {

struct PointExport {
  // Radiance of a white surface that becomes white on the screen, in PLY's red, green, blue; 0:
  // such that the mean irradiance becomes middle grey.
  double white = 0;
};

// Binary, little-endian, one vertex a record, in world space:
//   float x y z, nx ny nz; uchar red green blue (sRGB); float irradiance_r/g/b, gradient_r_x ...
//   gradient_b_z, radius_1 radius_2 (along axis_x/y/z and across), error, media_share; uchar layer
//   wave
// Returns warnings, one line each. Throws Error(Resource).
std::vector<std::string> write_ply(const std::filesystem::path& file, const CacheContents& contents,
                                   const PointExport& options);

// A PointDataGrid "records" with the attributes N, E, gradE_r, gradE_g, gradE_b (vectors), radius,
// radius_1, radius_2, error, media_share, and layer, wave (integers). Throws as write_points()
// does.
void write_vdb_points(const std::filesystem::path& file, const CacheContents& contents);

}  // namespace brume
