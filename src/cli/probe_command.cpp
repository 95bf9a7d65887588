// brume probe: irradiance, or fluence in the medium, and its gradients at one point, term by term.
//
// Gradients are shown per metre, whatever the scene's unit; positions and radii in scene units
// (SPEC).
#include "cli/cache_session.h"
#include "cli/commands.h"
#include "cli/outputs.h"
#include "cli/probe_volume.h"
#include "cli/progress.h"
#include "cli/shared_options.h"
#include "cli/signals.h"
#include "cli/stopping.h"
#include "cli/text_table.h"
#include "cli/values.h"
#include "core/error.h"
#include "core/random.h"
#include "study/cell_sweep.h"

namespace brume {
namespace {

// Enough that the direct light of an area light is known to about a percent.
constexpr int kDirectSamples = 256;

struct ProbeOptions {
  SceneOptions scene;
  AccuracyOptions accuracy;
  std::optional<Vec3d> position, normal;
  std::optional<double> finite_difference;
  bool sweep_cells = false, in_volume = false;
  std::filesystem::path cache_file;
};

struct Answers {
  GatherPoint point;
  GatherResult gather;
  ProbedGradients gradients;
  RgbD direct;
  double radius = 0;
  std::vector<CellSweepRow> sweep;
};

// How far a point on a surface has to be lifted to clear it; 0 for a point in free space. A surface
// counts as its own within a millionth of the scene.
double surface_offset(const World& world, const Vec3d& position, const Vec3d& normal) {
  const double reach = 1e-6 * world.diagonal();
  if (!(reach > 0) || !std::isfinite(reach)) return 0;
  const Hit hit = world.tracer().intersect({position + normal * reach, -normal}, 2 * reach);
  return hit.is_hit() ? hit.offset : 0;
}

// Light that hits reflect further, over all surfaces.
BakeResult bake_deeper_light(const Lighting& lighting, const BakeSettings& settings,
                             const CommandContext& context, Statistics& statistics) {
  Progress progress(context);
  BakeRequest request;
  request.deep_only = true;
  request.threads = context.threads;
  request.progress = progress.callback();
  request.stop_requested = SignalWatch::stop_requested;
  BakeResult baked = statistics.timed(
      "bake", [&] { return bake(lighting, settings, request, nullptr); });
  statistics.add_bake(baked.stats);
  if (!baked.is_stopped) progress.finish();
  return baked;
}

Answers gather_answers(const ProbeOptions& options, const Lighting& lighting,
                       const BakeSettings& settings, const GatherOptions& point_options,
                       const IrradianceCache& deeper, Statistics& statistics) {
  const Effects effects = plan_effects(lighting.world(), settings.bounces, settings.volume_bounces);
  const HitLight below = light_below(deeper, settings, lighting.world(), 0);
  const std::uint64_t seed = options.accuracy.seed.value_or(settings.seed);
  Answers a;
  a.point.position = *options.position;
  a.point.normal = options.normal->normalized();
  a.point.offset = surface_offset(lighting.world(), a.point.position, a.point.normal);
  a.point.key = probe_key(seed, 0);
  {
    // Full gathers what every other mode needs.
    GatherOptions all = point_options;
    all.gradient = GradientMode::Full;
    Gatherer gatherer(lighting, effects, all);
    a.gather = gatherer.gather(a.point, below, statistics.counters);
    for (std::size_t m = 0; m < kGradientModes.size(); ++m)
      a.gradients.by_mode[m] = gatherer.gradient(kGradientModes[m]);
  }
  a.direct = direct_irradiance(lighting, a.point.position + a.point.normal * a.point.offset,
                               a.point.normal, kDirectSamples, random_key(a.point.key, 1),
                               statistics.counters);
  a.radius = record_radius(
      a.gather, a.point.normal,
      lighting.world().tracer().clearance(a.point.position, a.point.normal), settings,
      lighting.world().unit());
  if (options.finite_difference) {
    GatherOptions values_alone = point_options;
    values_alone.gradient = GradientMode::None;
    Gatherer gatherer(lighting, effects, values_alone);
    Counters of_differences;  // Not the probe's own cost.
    const auto irradiance = [&](std::uint64_t key, const Vec3d& shift) {
      GatherPoint shifted = a.point;
      shifted.key = key;
      shifted.position += shift;
      return gatherer.gather(shifted, below, of_differences).irradiance;
    };
    const std::optional<Frame> surface =
        a.point.offset > 0 ? std::optional(Frame(a.point.normal)) : std::nullopt;
    a.gradients.difference =
        finite_difference(irradiance, surface, *options.finite_difference, seed);
  }
  if (options.sweep_cells) {
    std::vector<std::uint64_t> keys;
    for (int i = 0; i < kNoiseSeeds; ++i) keys.push_back(probe_key(seed, i));
    a.sweep = sweep_cells(lighting, effects, a.point, below, point_options, keys);
  }
  return a;
}

Json sweep_json(const std::vector<CellSweepRow>& sweep, GradientMode mode, double per_metre) {
  Json rows = Json::array();
  for (const CellSweepRow& r : sweep) {
    Json row{{"cells", {r.cells_theta, r.cells_phi}},
             {"irradiance", json_of(r.irradiance)},
             {"irradiance_rms", r.irradiance_rms},
             {"gradient", json_of(r.gradient_of(mode) * per_metre)},
             {"gradient_rms", r.rms_of(mode)},
             {"seconds", r.seconds}};
    for (std::size_t m = 0; m < kGradientModes.size(); ++m)
      row["gradient_rms_modes"][gradient_mode_name(kGradientModes[m])] = r.gradient_rms[m];
    rows.push_back(row);
  }
  return rows;
}

Json answers_json(const Answers& a, const GatherOptions& gather, double per_metre,
                  const Statistics& statistics) {
  Json all = Json::object();
  all["position"] = json_of(a.point.position);
  all["normal"] = json_of(a.point.normal);
  all["irradiance"] = json_of(a.gather.irradiance);
  all["irradiance_direct"] = json_of(a.direct);
  all["irradiance_surface"] = json_of(a.gather.irradiance_surface);
  all["irradiance_media"] = json_of(a.gather.irradiance_media);
  all["irradiance_error"] = a.gather.error;
  add_gradients(all, a.gradients, gather.gradient, per_metre);
  all["gradient_rotational"] = json_of(a.gather.rotational);
  if (!a.sweep.empty()) all["sweep"] = sweep_json(a.sweep, gather.gradient, per_metre);
  all["radius"] = {a.radius, a.radius};
  all["cells"] = {gather.cells_theta, gather.cells_phi};
  all["shells"] = a.gather.shells;
  all["rays"] = statistics.counters.rays;
  all["segments"] = statistics.counters.segments;
  all["seconds"] = statistics.total_seconds();
  return all;
}

void print_sweep(std::ostream& out, const std::vector<CellSweepRow>& sweep, GradientMode mode,
                 double per_metre) {
  const CellSweepRow& last = sweep.back();
  out << "\nLuminance over " << kNoiseSeeds << " seeds; errors are relative, against the mean of "
      << last.cells_theta << 'x' << last.cells_phi << " cells in mode full.\n";
  std::vector<std::vector<std::string>> rows{
      {"cells", "irradiance", "rms", std::string("gradient, ") + gradient_mode_name(mode), "", ""}};
  for (std::size_t m = 1; m < kGradientModes.size(); ++m)
    rows[0].push_back(std::string("rms ") + gradient_mode_name(kGradientModes[m]));
  rows[0].push_back("CPU ms");
  for (const CellSweepRow& r : sweep) {
    const Vec3d g = r.gradient_of(mode) * per_metre;
    rows.push_back({std::to_string(r.cells_theta) + "x" + std::to_string(r.cells_phi),
                    shown_number(luminance(r.irradiance)), shown_number(r.irradiance_rms),
                    shown_number(g.x), shown_number(g.y), shown_number(g.z)});
    for (std::size_t m = 1; m < kGradientModes.size(); ++m)
      rows.back().push_back(shown_number(r.gradient_rms[m]));
    rows.back().push_back(shown_number(1e3 * r.seconds));
  }
  print_table(out, rows);
}

void print_answers(const CommandContext& context, const Answers& a, const GatherOptions& gather,
                   double per_metre) {
  const auto colour = [](const char* name, const RgbD& c) {
    return std::vector<std::string>{name, shown_number(c.r), shown_number(c.g), shown_number(c.b)};
  };
  std::ostream& out = context.out;
  print_table(out, {{"W/m^2", "R", "G", "B"},
                    colour("irradiance (indirect)", a.gather.irradiance),
                    colour("  from surfaces", a.gather.irradiance_surface),
                    colour("  from the medium", a.gather.irradiance_media),
                    colour("direct light", a.direct)});
  out << "standard error of luminance " << shown_number(a.gather.error) << "; radius "
      << shown_number(a.radius) << "; " << gather.cells_theta << 'x' << gather.cells_phi
      << " cells, " << a.gather.shells << " shells\n\n";
  std::vector<std::vector<std::string>> rows =
      gradient_rows(a.gradients, gather.gradient, per_metre);
  add_gradient_rows(rows, "rotational [W/m^2]", a.gather.rotational);
  print_table(out, rows);
  if (!a.sweep.empty()) print_sweep(out, a.sweep, gather.gradient, per_metre);
}

int probe(const ProbeOptions& options, const CommandContext& context) {
  if (options.in_volume && (options.normal || options.sweep_cells))
    throw Error(ErrorKind::Usage, "--volume: goes without --normal and --sweep");
  if (!options.in_volume && !options.normal)
    throw Error(ErrorKind::Usage, "--normal: is missing: give one, or --volume");
  if (options.normal && !(options.normal->length() > 0))
    throw Error(ErrorKind::Usage, "--normal: has no direction: give one, like 0,1,0");
  if (!context.stats_file.empty()) check_writable(context.stats_file);
  SignalWatch watch;
  watch.remember();
  Statistics statistics;
  const Scene scene =
      statistics.timed("load", [&] { return load_scene_verbosely(options.scene, context); });
  const World world = statistics.timed("world", [&] { return World(scene); });

  // --cells, --shells and --gradient speak of the probed point; deeper light is what a bake of this
  // scene would have, or what the cache file holds.
  AccuracyOptions deeper_accuracy = options.accuracy;
  deeper_accuracy.cells.reset();
  deeper_accuracy.shells.reset();
  deeper_accuracy.gradient.reset();
  std::shared_ptr<const IrradianceCache> deeper;
  BakeSettings settings = deeper_accuracy.bake_settings(scene.render);
  if (!options.cache_file.empty()) {
    const OpenedCache opened = open_cache_of_world(options.cache_file, world);
    settings = opened.settings;
    deeper = std::make_shared<IrradianceCache>(opened.cache);
  }
  const Lighting lighting = statistics.timed(
      "lighting", [&] { return Lighting(world, lighting_options(settings, context)); });
  statistics.describe(lighting, plan_effects(world, settings.bounces, settings.volume_bounces));
  if (!deeper) {
    const BakeResult baked = bake_deeper_light(lighting, settings, context, statistics);
    if (baked.is_stopped) return end_stopped_run(context, SignalWatch::signal(), {});
    deeper = baked.cache;
  }
  statistics.records = deeper->size();

  const GatherOptions gather = options.accuracy.bake_settings(settings).gather;
  const double per_metre = 1 / world.unit();
  if (options.in_volume) {
    const VolumeProbe probed = statistics.timed("gather", [&] {
      return probe_volume(lighting, settings, *deeper,
                          {*options.position, gather, options.accuracy.seed.value_or(settings.seed),
                           options.finite_difference},
                          statistics.counters);
    });
    if (context.json)
      print_json(context, volume_probe_json(probed, gather, per_metre, statistics));
    else
      print_volume_probe(context.out, probed, gather, per_metre);
  } else {
    const Answers answers = statistics.timed("gather", [&] {
      return gather_answers(options, lighting, settings, gather, *deeper, statistics);
    });
    if (context.json)
      print_json(context, answers_json(answers, gather, per_metre, statistics));
    else
      print_answers(context, answers, gather, per_metre);
  }
  CommandContext stats_alone = context;
  stats_alone.json = false;
  report_statistics(stats_alone, statistics);
  return 0;
}

}  // namespace

void add_probe_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb =
      app.add_subcommand("probe", "Irradiance, or fluence in the medium, and its gradients at one "
                                  "point, term by term");
  const auto options = std::make_shared<ProbeOptions>();
  add_scene_options(*verb, context, options->scene);
  const auto vector = [](const std::string& option, const std::string& text) {
    return std::optional<Vec3d>(parse_vector(option, text));
  };
  add_parsed(*verb, "--at", "X,Y,Z", options->position, vector, "The point, in scene units")
      ->required()
      ->group("Point");
  add_parsed(*verb, "--normal", "X,Y,Z", options->normal, vector,
             "The side that receives, of any length but 0; not with --volume")
      ->group("Point");
  verb->add_flag("--volume", options->in_volume,
                 "A point of the medium: fluence, what arrives from all around but straight from "
                 "lights")
      ->group("Point");
  add_parsed(
      *verb, "--finite-difference", "H", options->finite_difference,
      [](const std::string& option, const std::string& text) {
        return std::optional<double>(parse_number(option, text, 1e-12, 1e12));
      },
      "Also the gradient by differences over steps of H (scene units), central but along the "
      "normal of a surface: the mean over seeds, each with the same random numbers at both ends, "
      "and its standard error")
      ->group("Point");
  add_parsed(
      *verb, "--sweep", "cells", options->sweep_cells,
      [](const std::string& option, const std::string& text) {
        return parse_choice(option, text,
                            std::vector<std::pair<std::string, bool>>{{"cells", true}});
      },
      "Also how irradiance and the gradients of every mode settle as cells grow from 4x13 to "
      "128x402, over seeds")
      ->group("Point");
  add_path(
      *verb, "--cache", options->cache_file, "C.irc",
      "Further bounces come from this cache of the scene, with its settings (default: they are "
      "baked)")
      ->group("Cache");
  add_accuracy_options(*verb, context, options->accuracy);
  verb->footer(R"(--cells, --shells and --gradient are those of the probed point.

Examples:
  brume probe box.json --at 0,0.5,0 --normal 0,1,0 --cells 64x201
  brume probe box.json --at 0,0.5,0 --normal 0,1,0 --finite-difference 0.01 --json
  brume probe box.json --at 0,0.5,0 --normal 0,1,0 --sweep cells
  brume probe box.json --at 0,0.5,0 --volume --finite-difference 0.01
  brume probe box.json --at 0,0.5,0 --normal 0,1,0 --gradient ward-heckbert --cache box.irc)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return probe(*options, context); };
  });
}

}  // namespace brume
