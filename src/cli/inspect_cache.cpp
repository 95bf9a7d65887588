#include "cli/inspect_cache.h"

#include <array>
#include <map>

#include "cache/cache_file.h"
#include "cache/irradiance_cache.h"
#include "cli/cache_input.h"
#include "cli/cache_session.h"
#include "cli/outputs.h"
#include "cli/record_page.h"
#include "cli/self_check.h"
#include "cli/text_table.h"
#include "core/error.h"

namespace brume {
namespace {

RgbD irradiance_of(const SurfaceRecord& record) {
  return {record.irradiance[0], record.irradiance[1], record.irradiance[2]};
}

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

RgbGradient gradient_of(const SurfaceRecord& record) {
  return {vector(record.gradient), vector(record.gradient + 3), vector(record.gradient + 6)};
}

std::string shown_vector(const Vec3d& v) {
  return shown_number(v.x) + " " + shown_number(v.y) + " " + shown_number(v.z);
}

std::string shown_colour(const RgbD& c) { return shown_vector({c.r, c.g, c.b}); }

// Counts of positive values in bins of equal ratio; zeros apart, as they have no logarithm.
struct Histogram {
  static constexpr std::size_t kBins = 12;
  std::size_t zeros = 0, others = 0;  // Others: not finite.
  double least = kInfinity, most = 0;
  std::array<std::size_t, kBins> counts{};

  explicit Histogram(const std::vector<double>& values) {
    for (const double value : values)
      if (value > 0 && value < kInfinity) {
        least = std::min(least, value);
        most = std::max(most, value);
      }
    for (const double value : values) {
      if (value == 0) {
        ++zeros;
      } else if (value > 0 && value < kInfinity) {
        ++counts[bin_of(value)];
      } else {
        ++others;
      }
    }
  }
  bool has_bins() const { return most > 0; }
  double edge(std::size_t i) const {
    return least * std::pow(most / least, static_cast<double>(i) / kBins);
  }

 private:
  std::size_t bin_of(double value) const {
    if (!(most > least)) return 0;
    const double at = std::log(value / least) / std::log(most / least) * kBins;
    return std::min(static_cast<std::size_t>(std::max(at, 0.0)), kBins - 1);
  }
};

struct Summary {
  std::map<int, std::map<int, std::size_t>> counts;  // Of surfaces: by layer, by wave.
  std::map<int, std::size_t> volume_counts;          // By wave.
  std::size_t unfinished = 0;   // Of a stopped bake, of shards, or what a filter left.
  std::optional<Box3d> bounds;  // World space.
  std::vector<double> radii, relative_errors, gradients;
};

Summary summarise(const CacheContents& contents) {
  Summary summary;
  const auto extend = [&](const float* position) {
    const Vec3d p = contents.header.origin + vector(position);
    if (!is_finite(p)) return;
    if (!summary.bounds) summary.bounds.emplace();
    summary.bounds->extendBy(p);
  };
  for (const SurfaceRecord& record : contents.records) {
    ++summary.counts[record.layer()][record.wave()];
    summary.unfinished += (record.flags & kUnfinishedViewFlag) != 0;
    extend(record.position);
    const double light = luminance(irradiance_of(record));
    summary.radii.push_back(std::sqrt(double(record.radius[0]) * record.radius[1]));
    summary.relative_errors.push_back(record.error == 0 ? 0 : record.error / light);
    summary.gradients.push_back(luminance(gradient_of(record)).length());
  }
  for (const VolumeRecord& record : contents.volume.records) {
    ++summary.volume_counts[record.wave()];
    extend(record.position);
  }
  return summary;
}

Json histogram_json(const Histogram& histogram) {
  Json object = Json::object();
  object["zeros"] = histogram.zeros;
  object["not_finite"] = histogram.others;
  object["edges"] = Json::array();
  object["counts"] = Json::array();
  if (histogram.has_bins()) {
    for (std::size_t i = 0; i <= Histogram::kBins; ++i)
      object["edges"].push_back(histogram.edge(i));
    object["counts"] = histogram.counts;
  }
  return object;
}

Json record_json(const SurfaceRecord& record, const Vec3d& origin, std::size_t index) {
  Json object = Json::object();
  object["index"] = index;
  object["key"] = shown_key(record.key);
  object["layer"] = record.layer();
  object["wave"] = record.wave();
  object["radius_clamped"] = (record.flags & kRadiusClampedFlag) != 0;
  object["position"] = json_of(origin + vector(record.position));
  object["normal"] = json_of(vector(record.normal));
  object["irradiance"] = json_of(irradiance_of(record));
  object["gradient"] = json_of(gradient_of(record));
  object["gradient_rotational"] = Json::array();
  for (int c = 0; c < 3; ++c)
    object["gradient_rotational"].push_back(
        {record.rotational[2 * c], record.rotational[2 * c + 1]});
  object["axis"] = record.axis;
  object["radius"] = {record.radius[0], record.radius[1]};
  object["error"] = record.error;
  object["media_share"] = record.media_share;
  return object;
}

struct Answers {
  IrradianceQuery query;
  std::vector<RecordWeight> parts;
  InterpolatedIrradiance irradiance;
};

// `world` may be null: then nothing hides any record.
Answers ask(const IrradianceCache& cache, const InspectCacheOptions& options, const World* world) {
  Answers answers;
  IrradianceQuery& query = answers.query;
  query.position = *options.at;
  query.min_radius = options.min_radius;
  if (cache.records().empty()) return answers;
  query.layer = options.layer.value_or(cache.records().back().layer());
  if (options.normal) {
    query.normal = options.normal->normalized();
  } else {
    double nearest = kInfinity;
    for (const SurfaceRecord& record : cache.records()) {
      if (record.layer() != query.layer) continue;
      const double distance = (cache.origin() + vector(record.position) - query.position).length2();
      if (distance < nearest) {
        nearest = distance;
        query.normal = vector(record.normal);
      }
    }
  }
  if (world)
    query = query.layer == kTopLayer
                ? pixel_query(*world, query.position, query.normal, query.min_radius)
                : hit_query(*world, query.layer, query.position, query.normal, query.min_radius);
  answers.parts = cache.explain(query);
  answers.irradiance = cache.irradiance(query);
  return answers;
}

Json answers_json(const Answers& answers, const IrradianceCache& cache) {
  Json object = Json::object();
  object["position"] = json_of(answers.query.position);
  object["normal"] = json_of(answers.query.normal);
  object["layer"] = answers.query.layer;
  object["irradiance"] = json_of(answers.irradiance.irradiance);
  object["clamped"] = answers.irradiance.clamped;
  object["media_share"] = answers.irradiance.media_share;
  object["records"] = Json::array();
  for (const RecordWeight& part : answers.parts) {
    Json record = record_json(*part.record, cache.origin(),
                              static_cast<std::size_t>(part.record - cache.records().data()));
    record["weight"] = part.weight;
    record["extrapolated"] = json_of(part.extrapolated);
    object["records"].push_back(record);
  }
  return object;
}

void print_row(std::ostream& out, const std::string& name, const std::string& value) {
  out << "  " << name << std::string(name.size() < 16 ? 16 - name.size() : 1, ' ') << value << '\n';
}

void print_histogram(std::ostream& out, const std::string& title, const Histogram& histogram) {
  constexpr std::size_t kWidth = 40;
  out << '\n' << title << '\n';
  std::size_t highest = std::max<std::size_t>({1, histogram.zeros, histogram.others});
  for (const std::size_t count : histogram.counts) highest = std::max(highest, count);
  const auto bar = [&](const std::string& label, std::size_t count) {
    // What is there is seen, be it one record of a million.
    const std::size_t length = (count * kWidth + highest - 1) / highest;
    out << "  " << label << std::string(label.size() < 26 ? 26 - label.size() : 1, ' ')
        << std::string(length, '#') << std::string(length < kWidth ? kWidth - length : 0, ' ')
        << ' ' << count << '\n';
  };
  if (histogram.zeros > 0) bar("0", histogram.zeros);
  if (histogram.has_bins())
    for (std::size_t i = 0; i < Histogram::kBins; ++i)
      bar(shown_number(histogram.edge(i)) + " to " + shown_number(histogram.edge(i + 1)),
          histogram.counts[i]);
  if (histogram.others > 0) bar("not finite", histogram.others);
}

void print_records(std::ostream& out, const CacheContents& contents, std::size_t begin,
                   std::size_t end) {
  std::vector<std::vector<std::string>> rows = {
      {"record", "key", "layer", "wave", "position", "normal", "irradiance", "radii", "error"}};
  for (std::size_t i = begin; i < end; ++i) {
    const SurfaceRecord& record = contents.records[i];
    rows.push_back({std::to_string(i), shown_key(record.key), std::to_string(record.layer()),
                    std::to_string(record.wave()),
                    shown_vector(contents.header.origin + vector(record.position)),
                    shown_vector(vector(record.normal)), shown_colour(irradiance_of(record)),
                    shown_number(record.radius[0]) + " " + shown_number(record.radius[1]),
                    shown_number(record.error)});
  }
  out << '\n';
  print_table(out, rows);
}

void print_answers(std::ostream& out, const Answers& answers, const IrradianceCache& cache) {
  out << "\nat " << shown_vector(answers.query.position) << ", normal "
      << shown_vector(answers.query.normal) << ", layer " << answers.query.layer << ": ";
  if (answers.parts.empty()) {
    out << "no record answers\n";
    return;
  }
  out << "irradiance " << shown_colour(answers.irradiance.irradiance)
      << (answers.irradiance.clamped ? " (clamped)" : "") << ", from the medium "
      << shown_number(100 * answers.irradiance.media_share) << " %\n";
  double sum = 0;
  for (const RecordWeight& part : answers.parts) sum += part.weight;
  std::vector<std::vector<std::string>> rows = {
      {"record", "key", "wave", "weight", "share %", "distance", "irradiance", "extrapolated"}};
  for (const RecordWeight& part : answers.parts) {
    const Vec3d p = cache.origin() + vector(part.record->position);
    rows.push_back({std::to_string(part.record - cache.records().data()),
                    shown_key(part.record->key), std::to_string(part.record->wave()),
                    shown_number(part.weight), shown_number(100 * part.weight / sum),
                    shown_number((answers.query.position - p).length()),
                    shown_colour(irradiance_of(*part.record)), shown_colour(part.extrapolated)});
  }
  print_table(out, rows);
}

std::string shown_waves(const std::map<int, std::size_t>& waves) {
  std::size_t total = 0;
  std::string by_wave;
  for (const auto& [wave, count] : waves) {
    total += count;
    by_wave += (by_wave.empty() ? "" : ", ") + std::to_string(wave) + ": " + std::to_string(count);
  }
  return std::to_string(total) + " records; by wave " + by_wave;
}

// How the light of deep records was solved for; null where the file tells nothing.
Json solve_json(const CacheContents& contents) {
  const Json solve = Json::parse(contents.notes.solve, nullptr, false);
  return solve.is_object() ? solve : Json(nullptr);
}

void print_solve(std::ostream& out, const CacheContents& contents) {
  const Json solve = solve_json(contents);
  if (solve.is_null()) return;
  const auto number = [&](const char* key) {
    return solve.contains(key) && solve[key].is_number() ? shown_number(solve[key]) : "?";
  };
  print_row(out, "solve",
            number("orders") + " orders, ratio " + number("ratio") + ", rest below " +
                number("truncation_bound") + " of the light at every record");
  if (solve.contains("changes") && solve["changes"].is_array()) {
    std::string changes;
    for (const Json& change : solve["changes"])
      if (change.is_number())
        changes += (changes.empty() ? "" : ", ") + shown_number(100 * double(change));
    if (!changes.empty()) print_row(out, "changes", changes + " % of the light, order by order");
  }
  if (number("scatterings") != "0")
    print_row(out, "scatterings",
              number("scatterings") + " between two orders" +
                  (solve.value("accelerated", false) ? ", the rest by GMRES" : ""));
}

AnswerCheck answer_check(const CacheContents& contents) {
  return summarise(read_checks(contents.notes.checks), contents.records, contents.header.origin);
}

void print_summary(std::ostream& out, const std::filesystem::path& file, const CacheCheck& check,
                   const Summary& summary) {
  const CacheContents& contents = check.opening.contents;
  out << printable(file.string()) << ": irradiance cache, format " << kCacheFormatVersion << '.'
      << contents.header.format_minor << '\n';
  print_row(out, "creator", printable(contents.header.creator));
  print_row(out, "fingerprint", contents.header.fingerprint.hex());
  print_row(out, "settings", printable(contents.header.settings, CacheHeader::kMaxSettingsBytes));
  print_row(out, "origin", shown_vector(contents.header.origin));
  if (summary.bounds)
    print_row(out, "bounds",
              shown_vector(summary.bounds->min) + "  to  " + shown_vector(summary.bounds->max));
  print_row(out, "records",
            std::to_string(contents.records.size()) + " on surfaces, " +
                std::to_string(contents.volume.size()) + " in volumes, in " +
                std::to_string(contents.sealed_blocks) + " blocks");
  if (summary.unfinished > 0)
    print_row(out, "part",
              std::to_string(summary.unfinished) +
                  " records of a stopped bake, of shards or of another cache's part: `bake "
                  "--cache-mode missing` goes on");
  const ShardSet& shards = contents.header.shards;
  if (shards.count > 0)
    print_row(out, "shards",
              std::to_string(shards.done.size()) + " of " + std::to_string(shards.count));
  print_row(out, "bad records", std::to_string(check.bad_records));
  print_row(out, "valid bytes",
            std::to_string(check.valid_bytes) + " of " + std::to_string(check.file_bytes) +
                (contents.is_complete ? ", complete" : ""));
  for (const auto& [layer, waves] : summary.counts)
    print_row(out, "layer " + std::to_string(layer), shown_waves(waves));
  if (contents.volume.size() > 0)
    print_row(out, "medium",
              shown_waves(summary.volume_counts) + "; moments up to order " +
                  std::to_string(contents.volume.order));
  print_solve(out, contents);
  if (const AnswerCheck answers = answer_check(contents); answers.points > 0)
    print_row(out, "answers", check_sentence(answers));
}

Json summary_json(const CacheCheck& check, const Summary& summary) {
  const CacheContents& contents = check.opening.contents;
  Json object = Json::object();
  object["format_version"] = kCacheFormatVersion;
  object["format_minor"] = contents.header.format_minor;
  object["record_count"] = contents.records.size() + contents.volume.size();
  object["records"] = {{"surface", contents.records.size()}, {"volume", contents.volume.size()}};
  object["solve"] = solve_json(contents);
  const AnswerCheck answers = answer_check(contents);
  object["verification"] = answers.points > 0 ? check_json(answers) : Json(nullptr);
  object["fingerprint"] = contents.header.fingerprint.hex();
  object["creator"] = printable(contents.header.creator);
  object["settings"] = settings_json(contents.header.settings);
  object["origin"] = json_of(contents.header.origin);
  object["bounds"] = nullptr;
  if (summary.bounds)
    object["bounds"] = Json::array({json_of(summary.bounds->min), json_of(summary.bounds->max)});
  object["sealed_blocks"] = contents.sealed_blocks;
  object["bad_records"] = check.bad_records;
  object["unfinished_records"] = summary.unfinished;
  object["shards"] = {{"count", contents.header.shards.count},
                      {"done", contents.header.shards.done}};
  object["complete"] = contents.is_complete;
  object["partial"] = summary.unfinished > 0;
  object["valid_bytes"] = check.valid_bytes;
  object["file_bytes"] = check.file_bytes;
  if (check.opening.state != CacheState::Loaded) object["fault"] = check.opening.reason;
  object["layers"] = Json::array();
  for (const auto& [layer, waves] : summary.counts)
    for (const auto& [wave, count] : waves)
      object["layers"].push_back({{"layer", layer}, {"wave", wave}, {"records", count}});
  object["volume_order"] = contents.header.volume_order;
  object["volume_waves"] = Json::array();
  for (const auto& [wave, count] : summary.volume_counts)
    object["volume_waves"].push_back({{"wave", wave}, {"records", count}});
  object["histograms"] = {{"radius", histogram_json(Histogram(summary.radii))},
                          {"relative_error", histogram_json(Histogram(summary.relative_errors))},
                          {"gradient", histogram_json(Histogram(summary.gradients))}};
  return object;
}

// Surfaces are those the records were baked on, or a warning tells.
void warn_of_another_scene(const std::filesystem::path& file, const CacheContents& contents,
                           const World& world, const CommandContext& context) {
  bool is_its_own = false;
  try {
    const BakeSettings settings = read_bake_settings(contents.header.settings, file);
    is_its_own = bake_fingerprint(world, settings) == contents.header.fingerprint;
  } catch (const Error&) {  // Settings of another version: nothing is known of its scene.
  }
  if (!is_its_own)
    context.warn(printable(file.string()) + ": was not baked from this scene as it is now");
}

struct OfScene {
  Scene scene;
  World world;

  explicit OfScene(Scene loaded) : scene(std::move(loaded)), world(scene) {}
};

void write_page(const std::filesystem::path& file, const CacheContents& contents,
                const InspectCacheOptions& options, const OfScene* of_scene,
                const CommandContext& context) {
  RecordPageOptions page;
  page.title = file.filename().string();
  page.three_js = options.three_js;
  page.facts = {{"creator", contents.header.creator},
                {"fingerprint", contents.header.fingerprint.hex()}};
  const Json settings = settings_json(contents.header.settings);
  if (settings.is_object())
    for (const auto& [key, value] : settings.items()) page.facts.emplace_back(key, value.dump());
  if (of_scene) {
    const Scene& scene = of_scene->scene;
    page.up = scene.up;
    page.camera = scene.camera;
    if (!page.camera && !scene.cameras.empty()) page.camera = scene.cameras.begin()->second;
    page.world = &of_scene->world;
  }
  for (const std::string& warning : write_record_page(options.html, contents, page))
    context.warn(warning);
  context.note(printable(options.html.string()) + ": written; any browser opens it");
}

}  // namespace

int inspect_cache(const std::filesystem::path& file, const InspectCacheOptions& options,
                  const SceneOptions& scene, CommandContext& context) {
  if (!options.html.empty()) check_writable(options.html);
  // Both ways read every byte and check every sum and value; a deep one goes on after what is
  // wrong.
  CacheCheck check = check_cache(file);
  const bool is_sound = check.opening.state == CacheState::Loaded;
  const bool is_readable =
      is_sound ||
      (options.deep && check.opening.state == CacheState::Corrupt && check.valid_bytes > 0);
  const auto fault = [&] {
    return Error(ErrorKind::InvalidInput, file.string() + ": " + check.opening.reason);
  };
  if (!is_readable) throw fault();

  const CacheContents& contents = check.opening.contents;
  const std::size_t count = contents.records.size();
  std::pair<std::size_t, std::size_t> range = options.records.value_or(std::pair(count, count));
  if (options.records && (range.first > range.second || range.first > count))
    throw Error(ErrorKind::Usage, "--records: " + std::to_string(range.first) + ":" +
                                      std::to_string(range.second) + " is no range of the " +
                                      std::to_string(count) + " surface records");
  range.second = std::min(range.second, count);

  std::optional<OfScene> of_scene;
  if (!scene.file.empty()) {
    of_scene.emplace(load_scene_verbosely(scene, context));
    warn_of_another_scene(file, contents, of_scene->world, context);
  }
  std::optional<IrradianceCache> cache;
  std::optional<Answers> answers;
  if (options.at) {
    cache.emplace(contents.records, contents.header.origin, contents.curve_order);
    answers = ask(*cache, options, of_scene ? &of_scene->world : nullptr);
  }
  const Summary summary = summarise(contents);
  if (context.json) {
    Json object = summary_json(check, summary);
    if (options.records) {
      object["listed"] = Json::array();
      for (std::size_t i = range.first; i < range.second; ++i)
        object["listed"].push_back(record_json(contents.records[i], contents.header.origin, i));
    }
    if (answers) object["at"] = answers_json(*answers, *cache);
    print_json(context, object);
  } else {
    print_summary(context.out, file, check, summary);
    if (!options.records && !answers) {
      print_histogram(context.out, "radius [world units]", Histogram(summary.radii));
      print_histogram(context.out, "relative error", Histogram(summary.relative_errors));
      print_histogram(context.out, "gradient of luminance [W/m^2 per world unit]",
                      Histogram(summary.gradients));
    }
    if (options.records) print_records(context.out, contents, range.first, range.second);
    if (answers) print_answers(context.out, *answers, *cache);
  }
  if (!options.html.empty())
    write_page(file, contents, options, of_scene ? &*of_scene : nullptr, context);
  if (!is_sound) throw fault();
  return 0;
}

}  // namespace brume
