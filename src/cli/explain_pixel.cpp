#include "cli/explain_pixel.h"

#include "cli/outputs.h"
#include "cli/text_table.h"
#include "core/error.h"

namespace brume {
namespace {

struct Answer {
  std::vector<RecordWeight> records;
  double weight_sum = 0;
  RgbD irradiance;
};

Answer ask(const PixelStory& story, const Hit& hit, const Ray& ray) {
  Answer answer;
  if (!story.cache || !hit.is_hit()) return answer;
  const double side = hit.normal.dot(ray.direction) < 0 ? 1 : -1;
  const IrradianceQuery query =
      pixel_query(story.world, hit.position, hit.shading_normal * side,
                  kFootprintPixels * story.rays.pixel_angle() * hit.t);
  answer.records = story.cache->explain(query);
  for (const RecordWeight& r : answer.records) answer.weight_sum += r.weight;
  answer.irradiance = story.cache->irradiance(query).irradiance;
  return answer;
}

Vec3d position_of(const SurfaceRecord& record, const IrradianceCache& cache) {
  return cache.origin() + Vec3d(record.position[0], record.position[1], record.position[2]);
}

Json record_json(const RecordWeight& entry, const PixelStory& story, const Hit& hit, double sum) {
  const SurfaceRecord& r = *entry.record;
  const Vec3d position = position_of(r, *story.cache);
  Json object = Json::object();
  object["key"] = r.key;
  object["layer"] = r.layer();
  object["wave"] = r.wave();
  object["position"] = json_of(position);
  object["distance"] = (position - hit.position).length();
  object["radius"] = {r.radius[0], r.radius[1]};
  object["weight"] = entry.weight;
  object["share"] = entry.weight / sum;
  object["irradiance"] = {r.irradiance[0], r.irradiance[1], r.irradiance[2]};
  object["extrapolated"] = json_of(entry.extrapolated);
  return object;
}

Json story_json(const PixelStory& story, const Hit& hit, const Answer& answer) {
  const PixelResult& p = story.result;
  Json all = Json::object();
  all["pixel"] = {story.pixel.x, story.pixel.y};
  all["resolution"] = {story.size.x, story.size.y};
  all["samples"] = story.samples;
  all["beauty"] = json_of(p.beauty());
  all["layers"] = Json::object();
  for (int l = 0; l < kLayerCount; ++l)
    all["layers"][layer_name(static_cast<Layer>(l))] = json_of(p.layers[l]);
  all["alpha"] = p.alpha;
  all["albedo"] = json_of(p.albedo);
  all["transmittance"] = json_of(p.transmittance);
  all["cache_count"] = p.cache_count;
  all["cost"] = p.cost;
  all["hit"] = nullptr;
  if (hit.is_hit()) {
    all["hit"] = {{"mesh", printable(story.world.tracer().meshes()[hit.mesh].name)},
                  {"triangle", hit.triangle},
                  {"material", printable(story.world.material(hit).name)},
                  {"position", json_of(hit.position)},
                  {"normal", json_of(hit.normal)},
                  {"distance", hit.t}};
  }
  if (story.cache) {
    all["irradiance"] = json_of(answer.irradiance);
    all["records"] = Json::array();
    for (const RecordWeight& r : answer.records)
      all["records"].push_back(record_json(r, story, hit, answer.weight_sum));
  }
  return all;
}

std::vector<std::string> colour_row(const std::string& name, const RgbD& c) {
  return {name, shown_number(c.r), shown_number(c.g), shown_number(c.b)};
}

std::string shown_vector(const Vec3d& v) {
  return shown_number(v.x) + "," + shown_number(v.y) + "," + shown_number(v.z);
}

void print_records(std::ostream& out, const PixelStory& story, const Hit& hit,
                   const Answer& answer) {
  out << "\nirradiance from " << answer.records.size()
      << " records: " << shown_number(answer.irradiance.r) << ' '
      << shown_number(answer.irradiance.g) << ' ' << shown_number(answer.irradiance.b) << '\n';
  if (answer.records.empty()) return;
  std::vector<std::vector<std::string>> rows{
      {"share", "weight", "distance", "radius", "R", "G", "B", "layer", "wave", "position"}};
  for (const RecordWeight& entry : answer.records) {
    const SurfaceRecord& r = *entry.record;
    const Vec3d position = position_of(r, *story.cache);
    rows.push_back({shown_number(entry.weight / answer.weight_sum), shown_number(entry.weight),
                    shown_number((position - hit.position).length()),
                    shown_number(r.radius[0]) + "," + shown_number(r.radius[1]),
                    shown_number(entry.extrapolated.r), shown_number(entry.extrapolated.g),
                    shown_number(entry.extrapolated.b), std::to_string(r.layer()),
                    std::to_string(r.wave()), shown_vector(position)});
  }
  print_table(out, rows);
}

}  // namespace

void explain_pixel(const CommandContext& context, const PixelStory& story) {
  const Ray ray = story.rays.ray(story.pixel.x + 0.5, story.pixel.y + 0.5);
  const Hit hit = story.world.tracer().intersect(ray);
  const Answer answer = ask(story, hit, ray);
  if (context.json) {
    print_json(context, story_json(story, hit, answer));
    return;
  }
  std::ostream& out = context.out;
  out << "pixel " << story.pixel.x << ',' << story.pixel.y << " of " << story.size.x << 'x'
      << story.size.y << ", " << story.samples << " samples\n";
  std::vector<std::vector<std::string>> rows{{"layer", "R", "G", "B"}};
  for (int l = 0; l < kLayerCount; ++l)
    rows.push_back(colour_row(layer_name(static_cast<Layer>(l)), story.result.layers[l]));
  rows.push_back(colour_row("beauty", story.result.beauty()));
  rows.push_back(colour_row("albedo", story.result.albedo));
  rows.push_back(colour_row("transmittance", story.result.transmittance));
  rows.push_back({"cache_count", shown_number(story.result.cache_count)});
  rows.push_back({"cost", shown_number(story.result.cost)});
  print_table(out, rows);
  if (!hit.is_hit()) {
    out << "\nits centre sees no surface\n";
    return;
  }
  out << "\nits centre sees '" << printable(story.world.tracer().meshes()[hit.mesh].name)
      << "', triangle " << hit.triangle << ", material '"
      << printable(story.world.material(hit).name) << "'\n  at " << shown_vector(hit.position)
      << ", normal " << shown_vector(hit.normal) << ", distance " << shown_number(hit.t) << '\n';
  if (story.cache) print_records(out, story, hit, answer);
}

}  // namespace brume
