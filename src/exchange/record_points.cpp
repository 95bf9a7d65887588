#include "exchange/record_points.h"

#include <cstdint>
#include <cstring>

#include "cache/record_filter.h"
#include "core/error.h"
#include "core/image.h"
#include "core/staged_file.h"
#include "vdb_media/point_writer.h"

namespace brume {
namespace {

Vec3f vector(const float* v) { return {v[0], v[1], v[2]}; }

Vec3d world_position(const SurfaceRecord& record, const Vec3d& origin) {
  return origin + Vec3d(record.position[0], record.position[1], record.position[2]);
}

// Where the first radius lies (docs/cache_format.md).
Vec3d axis_of(const SurfaceRecord& record) {
  const Frame frame(Vec3d(record.normal[0], record.normal[1], record.normal[2]));
  return frame.u * std::cos(double(record.axis)) + frame.v * std::sin(double(record.axis));
}

// Irradiance that becomes white: where middle grey, 0.18, is the mean.
double white_irradiance(const CacheContents& contents) {
  double sum = 0;
  for (const SurfaceRecord& r : contents.records)
    sum += luminance(RgbD(r.irradiance[0], r.irradiance[1], r.irradiance[2]));
  return sum > 0 ? sum / static_cast<double>(contents.records.size()) / 0.18 : 1;
}

std::uint8_t shown(double value, double white) {
  return static_cast<std::uint8_t>(
      std::lround(255 * srgb_encoded(std::clamp(value / white, 0.0, 1.0))));
}

constexpr const char* kFloatsBeforeColour[] = {"x", "y", "z", "nx", "ny", "nz"};
constexpr const char* kFloatsAfterColour[] = {
    "irradiance_r", "irradiance_g", "irradiance_b", "gradient_r_x", "gradient_r_y",
    "gradient_r_z", "gradient_g_x", "gradient_g_y", "gradient_g_z", "gradient_b_x",
    "gradient_b_y", "gradient_b_z", "radius_1",     "radius_2",     "axis_x",
    "axis_y",       "axis_z",       "error",        "media_share"};

std::string ply_header(const CacheContents& contents) {
  std::string header = "ply\nformat binary_little_endian 1.0\ncomment brume irradiance records " +
                       contents.header.fingerprint.hex() + "\nelement vertex " +
                       std::to_string(contents.records.size()) + '\n';
  for (const char* name : kFloatsBeforeColour)
    header += "property float " + std::string(name) + '\n';
  for (const char* name : {"red", "green", "blue"})
    header += "property uchar " + std::string(name) + '\n';
  for (const char* name : kFloatsAfterColour)
    header += "property float " + std::string(name) + '\n';
  for (const char* name : {"layer", "wave"}) header += "property uchar " + std::string(name) + '\n';
  return header + "end_header\n";
}

class Bytes {
 public:
  void add(float value) { add_bytes(&value, sizeof value); }
  void add(const float* values, std::size_t count) { add_bytes(values, count * sizeof(float)); }
  void add(std::uint8_t value) { add_bytes(&value, 1); }
  void add_bytes(const void* bytes, std::size_t count) {
    bytes_.append(static_cast<const char*>(bytes), count);
  }
  std::string& text() { return bytes_; }

 private:
  std::string bytes_;
};

}  // namespace

std::vector<std::string> write_ply(const std::filesystem::path& file, const CacheContents& contents,
                                   const PointExport& options) {
  const double white = options.white > 0 ? kPi * options.white : white_irradiance(contents);
  StagedFile out(file);
  Bytes bytes;
  bytes.text() = ply_header(contents);
  double worst_rounding = 0;  // Of a position, in parts of its record's radius.
  for (const SurfaceRecord& r : contents.records) {
    const Vec3d p = world_position(r, contents.header.origin);
    for (int a = 0; a < 3; ++a) {
      const auto rounded = static_cast<float>(p[a]);
      worst_rounding = std::max(worst_rounding, std::abs(rounded - p[a]) / record_radius(r));
      bytes.add(rounded);
    }
    bytes.add(r.normal, 3);
    for (const float e : r.irradiance) bytes.add(shown(e, white));
    bytes.add(r.irradiance, 3);
    bytes.add(r.gradient, 9);
    bytes.add(r.radius, 2);
    const Vec3d axis = axis_of(r);
    for (int a = 0; a < 3; ++a) bytes.add(static_cast<float>(axis[a]));
    bytes.add(r.error);
    bytes.add(r.media_share);
    bytes.add(static_cast<std::uint8_t>(r.layer()));
    bytes.add(static_cast<std::uint8_t>(r.wave()));
    if (bytes.text().size() > (std::size_t(1) << 20)) {
      out.write(bytes.text().data(), bytes.text().size());
      bytes.text().clear();
    }
  }
  out.write(bytes.text().data(), bytes.text().size());
  out.commit();
  if (worst_rounding > 0.01)
    return {printable(file.string()) +
            ": positions are floats there, so far from the origin that some are off by " +
            std::to_string(std::lround(100 * worst_rounding)) + " % of a record's radius"};
  return {};
}

void write_vdb_points(const std::filesystem::path& file, const CacheContents& contents) {
  PointsToWrite points{"records", {}, {}};
  const auto add = [&](const std::string& name, auto value_of) {
    std::vector<decltype(value_of(contents.records.front()))> values;
    values.reserve(contents.records.size());
    for (const SurfaceRecord& r : contents.records) values.push_back(value_of(r));
    points.attributes.push_back({name, std::move(values)});
  };
  for (const SurfaceRecord& r : contents.records)
    points.positions.push_back(world_position(r, contents.header.origin));
  using R = SurfaceRecord;
  add("N", [](const R& r) { return vector(r.normal); });
  add("E", [](const R& r) { return vector(r.irradiance); });
  add("gradE_r", [](const R& r) { return vector(r.gradient); });
  add("gradE_g", [](const R& r) { return vector(r.gradient + 3); });
  add("gradE_b", [](const R& r) { return vector(r.gradient + 6); });
  add("radius", [](const R& r) { return static_cast<float>(record_radius(r)); });
  add("radius_1", [](const R& r) { return r.radius[0]; });
  add("radius_2", [](const R& r) { return r.radius[1]; });
  add("error", [](const R& r) { return r.error; });
  add("media_share", [](const R& r) { return r.media_share; });
  add("layer", [](const R& r) { return static_cast<std::int32_t>(r.layer()); });
  add("wave", [](const R& r) { return static_cast<std::int32_t>(r.wave()); });
  write_points(file, points);
}

}  // namespace brume
