// The data_gen program: writes volumes and scenes with known answers.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <memory>

#include "core/error.h"
#include "core/parallel.h"
#include "data_gen/analytic_field.h"
#include "data_gen/oracle_scenes.h"
#include "data_gen/smoky_cornell.h"
#include "data_gen/talk_scenes.h"
#include "data_gen/transport_scenes.h"
#include "vdb_media/grid_writer.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExamples = R"(Examples:
  data_gen smoky-cornell -o out/smoky_cornell
  data_gen smoky-cornell -o out/small --resolution 64 --size 256
  data_gen field ball -o ball.vdb --centre 0,0,0 --radius 0.4 --voxel 0.02
  data_gen field gaussians -o g.vdb --bounds -2,-2,0,2,2,2.5 --background 0.1
  data_gen field plume -o smoke.vdb --bounds -1,0,-1,1,2,1 --seed 3
  data_gen talk window -o out/window --size 256 --density 2
  data_gen talk all -o out/talk
  data_gen oracle scat -o out/oracle
  data_gen oracle all -o out/oracle --step 0.1
  data_gen slab -o out/slab --optical-depth 8 --albedo 0.9 --anisotropy 0.6
  data_gen furnace -o out/furnace --optical-depth 10 --resolution 32

Equal arguments give equal bytes, with any number of threads.)";

Vec3d vec3(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw Error(ErrorKind::Resource, folder.string() + ": cannot make the folder: " +
                                         error.message() + ": choose one that can be written");
}

void print_files(const std::vector<fs::path>& files) {
  for (const fs::path& file : files) std::cout << file.string() << "\n";
}

// A list of three numbers, `x,y,z`.
CLI::Option* add_vector(CLI::App& app, const std::string& name, std::array<double, 3>& value,
                        const std::string& help) {
  return app.add_option(name, value, help)->delimiter(',')->capture_default_str();
}

// What all fields are sampled with.
struct GridOptions {
  std::string file, grid_name = "density";
  std::array<double, 6> bounds{-1, -1, -1, 1, 1, 1};
  double voxel = 0.05;
  bool half = false;
};

void write_field(const AnalyticField& field, const GridOptions& options, int threads) {
  const auto& b = options.bounds;
  const Lattice lattice = covering_lattice({{b[0], b[1], b[2]}, {b[3], b[4], b[5]}}, options.voxel);
  write_grids(options.file, {{.name = options.grid_name,
                              .count = lattice.count,
                              .values = sample_field(field, lattice, threads),
                              .index_to_world = lattice.index_to_world(),
                              .save_as_half = options.half}});
  print_files({options.file});
}

// One subcommand a field; `bind` adds its options and says how they make the field.
class FieldCommands {
 public:
  FieldCommands(CLI::App& parent, const int& threads) : parent_(parent), threads_(threads) {}

  // `state` holds what the options write into, and outlives parsing.
  template <typename State>
  void add(const std::string& name, const std::string& help, void (*bind)(CLI::App&, State&),
           AnalyticField (*make)(const State&)) {
    CLI::App* command = parent_.add_subcommand(name, help);
    auto state = std::make_shared<State>();
    auto grid = std::make_shared<GridOptions>();
    bind(*command, *state);
    command->add_option("-o,--output", grid->file, "The .vdb file to write")->required();
    command
        ->add_option("--bounds", grid->bounds,
                     "Nodes begin at the first corner and reach the second")
        ->delimiter(',')
        ->capture_default_str();
    command->add_option("--voxel", grid->voxel, "Distance between nodes")->capture_default_str();
    command->add_option("--grid-name", grid->grid_name, "Name of the grid")->capture_default_str();
    command->add_flag("--half", grid->half, "Store 16-bit values");
    command->callback([state, grid, make, this] { write_field(make(*state), *grid, threads_); });
  }

 private:
  CLI::App& parent_;
  const int& threads_;
};

struct BoxState {
  std::array<double, 3> min{-0.5, -0.5, -0.5}, max{0.5, 0.5, 0.5};
  double density = 1;
};
struct BallState {
  std::array<double, 3> centre{0, 0, 0};
  double radius = 0.5, density = 1;
};
struct RampState {
  double density = 1;
  std::array<double, 3> slope{1, 0, 0};
};
struct AtmosphereState {
  double density = 1, scale_height = 1, ground = 0;
  std::array<double, 3> up{0, 1, 0};
};
struct GaussiansState {
  double background = 0;
  std::vector<std::array<double, 5>> bumps;
};
struct PlumeState {
  SmokePlume plume;
  std::array<double, 3> source{0, 0, 0};
};

void add_fields(FieldCommands& commands) {
  commands.add<BoxState>(
      "box", "Constant inside a box, zero outside",
      [](CLI::App& app, BoxState& s) {
        add_vector(app, "--min", s.min, "Lower corner");
        add_vector(app, "--max", s.max, "Upper corner");
        app.add_option("--density", s.density, "Density inside")->capture_default_str();
      },
      [](const BoxState& s) -> AnalyticField {
        return ConstantBox{{vec3(s.min), vec3(s.max)}, s.density};
      });
  commands.add<BallState>(
      "ball", "Constant inside a ball, zero outside",
      [](CLI::App& app, BallState& s) {
        add_vector(app, "--centre", s.centre, "Centre");
        app.add_option("--radius", s.radius, "Radius")->capture_default_str();
        app.add_option("--density", s.density, "Density inside")->capture_default_str();
      },
      [](const BallState& s) -> AnalyticField {
        return ConstantBall{vec3(s.centre), s.radius, s.density};
      });
  commands.add<RampState>(
      "ramp", "max(0, density + slope . p)",
      [](CLI::App& app, RampState& s) {
        app.add_option("--density", s.density, "Density at the origin")->capture_default_str();
        add_vector(app, "--slope", s.slope, "Gradient");
      },
      [](const RampState& s) -> AnalyticField {
        return LinearRamp{s.density, vec3(s.slope)};
      });
  commands.add<AtmosphereState>(
      "atmosphere", "Falls exponentially with height",
      [](CLI::App& app, AtmosphereState& s) {
        app.add_option("--density", s.density, "Density at the ground")->capture_default_str();
        app.add_option("--scale-height", s.scale_height, "Height over which it falls to 1/e")
            ->capture_default_str()
            ->check(CLI::PositiveNumber);
        app.add_option("--ground", s.ground, "Height of the ground")->capture_default_str();
        add_vector(app, "--up", s.up, "Upward direction");
      },
      [](const AtmosphereState& s) -> AnalyticField {
        const Vec3d up = vec3(s.up);
        if (up.length2() == 0)
          throw Error(ErrorKind::Usage, "--up: has no length: give a direction such as 0,1,0");
        return ExponentialAtmosphere{s.density, s.scale_height, s.ground, up.normalized()};
      });
  commands.add<GaussiansState>(
      "gaussians", "A background and Gaussian bumps (by default three of different widths)",
      [](CLI::App& app, GaussiansState& s) {
        app.add_option("--background", s.background, "Added everywhere")->capture_default_str();
        app.add_option("--bump", s.bumps, "x,y,z,amplitude,width; may be repeated")->delimiter(',');
      },
      [](const GaussiansState& s) -> AnalyticField {
        if (s.bumps.empty()) return three_gaussians(s.background);
        GaussianSum sum{s.background, {}};
        for (const auto& b : s.bumps) sum.bumps.push_back({{b[0], b[1], b[2]}, b[3], b[4]});
        return sum;
      });
  commands.add<PlumeState>(
      "plume", "A plume of smoke rising along +y, up to a ceiling",
      [](CLI::App& app, PlumeState& s) {
        add_vector(app, "--source", s.source, "Where it rises from");
        app.add_option("--height", s.plume.height, "Up to the ceiling")
            ->capture_default_str()
            ->check(CLI::PositiveNumber);
        app.add_option("--source-radius", s.plume.source_radius, "Radius at the source")
            ->capture_default_str()
            ->check(CLI::PositiveNumber);
        app.add_option("--top-radius", s.plume.top_radius, "Radius at the ceiling")
            ->capture_default_str()
            ->check(CLI::PositiveNumber);
        app.add_option("--curl", s.plume.curl, "How far the flow carries the smoke, in heights")
            ->capture_default_str();
        app.add_option("--detail", s.plume.detail, "Strength of the fine structure")
            ->capture_default_str();
        app.add_option("--seed", s.plume.seed, "Seed")->capture_default_str();
      },
      [](const PlumeState& s) -> AnalyticField {
        SmokePlume plume = s.plume;
        plume.source = vec3(s.source);
        return plume;
      });
  commands.add<Dust>(
      "dust", "Haze with soft clouds, thicker towards the ground",
      [](CLI::App& app, Dust& s) {
        app.add_option("--density", s.density, "Mean at the ground")->capture_default_str();
        app.add_option("--scale-height", s.scale_height, "Height over which it falls to 1/e")
            ->capture_default_str()
            ->check(CLI::PositiveNumber);
        app.add_option("--ground", s.ground, "Height of the ground")->capture_default_str();
        app.add_option("--feature-size", s.feature_size, "Size of the largest clouds")
            ->capture_default_str()
            ->check(CLI::PositiveNumber);
        app.add_option("--contrast", s.contrast, "0 even, 1 clear air between clouds")
            ->capture_default_str();
        app.add_option("--seed", s.seed, "Seed")->capture_default_str();
      },
      [](const Dust& s) -> AnalyticField { return s; });
}

void write_oracles(const std::string& name, const fs::path& folder, double step) {
  make_folder(folder);
  if (name == "all") {
    for (const OracleScene& scene : oracle_scenes(step))
      print_files(write_oracle_scene(scene, folder));
  } else {
    print_files(write_oracle_scene(oracle_scene(name, step), folder));
  }
}

void write_talk_scenes(const std::string& name, const fs::path& folder,
                       const TalkSceneOptions& options) {
  // A wrong name shows before a folder is there.
  const auto& names = talk_scene_names();
  if (name != "all" && std::find(names.begin(), names.end(), name) != names.end())
    make_folder(folder);
  if (name != "all") {
    print_files(write_talk_scene(name, folder, options));
    return;
  }
  for (const std::string& scene : names) {
    make_folder(folder / scene);
    print_files(write_talk_scene(scene, folder / scene, options));
  }
}

void add_talk_command(CLI::App& app, std::string& folder, const int& threads) {
  std::string names;
  for (const std::string& scene : talk_scene_names()) names += scene + ", ";
  struct State {
    std::string name;
    TalkSceneOptions options;
  };
  const auto state = std::make_shared<State>();
  TalkSceneOptions& o = state->options;
  CLI::App* talk = app.add_subcommand("talk", "The scenes that gradients in media are shown on");
  talk->add_option("name", state->name, "One of: " + names + "all (a folder each)")->required();
  talk->add_option("-o,--output", folder, "Folder to write into")->required();
  talk->add_option("--size", o.size_px, "Width of the image, in pixels")->capture_default_str();
  talk->add_option("--resolution", o.resolution, "Nodes along the longest side of a grid")
      ->capture_default_str();
  talk->add_option("--density", o.density, "Multiplies the medium's extinction")
      ->capture_default_str();
  talk->add_option("--albedo", o.albedo, "Scattered part of the medium's extinction");
  talk->add_option("--anisotropy", o.anisotropy, "Mean cosine of its scattering");
  talk->add_option("--contrast", o.contrast,
                   "window, disco: 0 even haze, 1 clear air between clouds of dust");
  talk->add_option("--detail", o.detail,
                   "window: panes along each side; disco: rings of mirrors");
  talk->add_option("--seed", o.seed, "Seed of smoke and dust")->capture_default_str();
  talk->callback([state, &folder, &threads] {
    state->options.threads = threads;
    write_talk_scenes(state->name, folder, state->options);
  });
}

void add_slab_command(CLI::App& app, std::string& folder) {
  const auto options = std::make_shared<SlabOptions>();
  CLI::App* slab = app.add_subcommand(
      "slab",
      "A slab whose reflection and transmission are known; slab.json says how to read them");
  slab->add_option("-o,--output", folder, "Folder to write into")->required();
  slab->add_option("--optical-depth", options->optical_depth, "Along the normal")
      ->capture_default_str();
  slab->add_option("--albedo", options->albedo, "Scattered part of the extinction")
      ->capture_default_str();
  slab->add_option("--anisotropy", options->anisotropy, "Mean cosine of the scattering")
      ->capture_default_str();
  slab->add_flag_callback(
      "--diffuse", [options] { options->incidence = SlabOptions::Incidence::Diffuse; },
      "Lit by a white sky, nothing from below, instead of by a beam along the normal");
  slab->add_option("--width", options->width,
                   "Over the thickness (default: so that an endless slab differs by less than "
                   "0.1 %)");
  slab->add_option("--resolution", options->resolution,
                   "Nodes along each axis of a grid; 0: a box without a grid")
      ->capture_default_str();
  slab->callback([options, &folder] {
    make_folder(folder);
    print_files(write_slab(folder, *options));
  });
}

void add_furnace_command(CLI::App& app, std::string& folder, const int& threads) {
  const auto options = std::make_shared<FurnaceOptions>();
  CLI::App* furnace = app.add_subcommand(
      "furnace", "A white medium in a white environment: radiance is 1 everywhere");
  furnace->add_option("-o,--output", folder, "Folder to write into")->required();
  furnace->add_option("--optical-depth", options->optical_depth, "Across the box, on average")
      ->capture_default_str();
  furnace->add_option("--anisotropy", options->anisotropy, "Mean cosine of the scattering")
      ->capture_default_str();
  furnace
      ->add_option("--block-albedo", options->block_albedo,
                   "Of the block in the medium, which gives off the rest")
      ->capture_default_str();
  furnace
      ->add_option("--resolution", options->resolution,
                   "Nodes along each axis of a lumpy grid; 0: an even medium")
      ->capture_default_str();
  furnace->add_option("--seed", options->seed, "Seed of the lumps")->capture_default_str();
  furnace->callback([options, &folder, &threads] {
    options->threads = threads;
    make_folder(folder);
    print_files(write_furnace(folder, *options));
  });
}

// CLI11's own exit codes never leak.
int run_data_gen(int argc, char** argv) {
  CLI::App app("Writes volumes and scenes with known answers, and the demo scene.", "data_gen");
  app.set_version_flag("--version", "data_gen " BRUME_VERSION);
  app.require_subcommand(1);
  int threads = 0;
  app.add_option("-t,--threads", threads, "Threads; 0: as many as this process may use")
      ->check(CLI::NonNegativeNumber);
  app.fallthrough();

  std::string folder;
  SmokyCornellOptions cornell;
  CLI::App* smoky =
      app.add_subcommand("smoky-cornell", "The demo: a Cornell box with smoke and a beam");
  smoky->add_option("-o,--output", folder, "Folder to write into")->required();
  smoky->add_option("--resolution", cornell.resolution, "Smoke nodes along each axis")
      ->capture_default_str();
  smoky->add_option("--size", cornell.size_px, "Width and height of the image, in pixels")
      ->capture_default_str();
  smoky
      ->add_option("--flight", cornell.flight_frames,
                   "Also this many named cameras, f00, f01 ..., of a flight into the room")
      ->capture_default_str();
  smoky->add_option("--seed", cornell.seed, "Seed of the smoke")->capture_default_str();
  smoky->callback([&] {
    cornell.threads = threads;
    make_folder(folder);
    print_files(write_smoky_cornell(folder, cornell));
  });

  add_talk_command(app, folder, threads);
  add_slab_command(app, folder);
  add_furnace_command(app, folder, threads);

  CLI::App* field = app.add_subcommand("field", "One analytic field as a .vdb");
  field->require_subcommand(1);
  FieldCommands fields(*field, threads);
  add_fields(fields);

  std::string oracle_name;
  double oracle_step = 0.05;
  CLI::App* oracle =
      app.add_subcommand("oracle", "Scenes whose irradiance and gradient are known to many digits");
  std::string names;
  for (const OracleScene& scene : oracle_scenes()) names += scene.name + " ";
  oracle->add_option("name", oracle_name, "One of: " + names + "all")->required();
  oracle->add_option("-o,--output", folder, "Folder to write into")->required();
  oracle->add_option("--step,--h", oracle_step, "Distance between nodes of Gaussian media")
      ->capture_default_str();
  oracle->callback([&] { write_oracles(oracle_name, folder, oracle_step); });

  app.footer(kExamples);  // Now, or every subcommand would have it too.
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
    throw Error(ErrorKind::Usage, std::string("data_gen: ") + e.what() + ": see data_gen --help");
  }
  std::cout.flush();
  if (!std::cout)
    throw Error(ErrorKind::Resource, "standard output: cannot write: give it a reader");
  return 0;
}

}  // namespace
}  // namespace brume

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  brume::flush_denormals();
  try {
    return brume::run_data_gen(argc, argv);
  } catch (const brume::Error& e) {
    std::cerr << "error: " << e.what() << "\n";
    return brume::exit_code(e.kind());
  } catch (const std::bad_alloc&) {
    std::cerr << "error: data_gen: out of memory: choose a lower resolution\n";
    return brume::exit_code(brume::ErrorKind::Resource);
  }
}
