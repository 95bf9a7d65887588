#include <map>

#include "scene/scene_load.h"

namespace brume {
namespace {

// Voxels outside this range have no meaning that survives the arithmetic (HARD_CASES N05, N13).
constexpr double kMinVoxel = 1e-5, kMaxVoxel = 1e9;

struct Coefficients {
  RgbD sigma_s, sigma_a;
};

Coefficients read_coefficients(const ObjectView& view) {
  const bool by_sigma = view.has("sigma_s") || view.has("sigma_a");
  for (const char* key : {"density_scale", "albedo"})
    if (by_sigma && view.has(key))
      view.fail(key, "stands beside sigma_s or sigma_a, which say the same",
                "give density_scale and albedo, or sigma_s and sigma_a");
  const auto color = [&](const char* key) {
    if (!view.has(key)) return RgbD(0.0);
    const Vec3d v = view.vector(key);
    return RgbD(v.x, v.y, v.z);
  };
  if (by_sigma) return {color("sigma_s"), color("sigma_a")};
  if (!view.has("density_scale") && view.text("type") == "homogeneous")
    view.fail("the medium has no extinction",
              "give density_scale and albedo, or sigma_s and sigma_a");
  const double scale = view.has("density_scale") ? view.number("density_scale") : 1;
  const RgbD albedo = view.has("albedo") ? color("albedo") : RgbD(0.9);
  return {albedo * scale, (RgbD(1.0) - albedo) * scale};
}

Emission::Mode emission_mode(const ObjectView& emission) {
  const std::string mode = emission.text("mode");
  return mode == "density"     ? Emission::Mode::Density
         : mode == "grid"      ? Emission::Mode::Grid
         : mode == "blackbody" ? Emission::Mode::Blackbody
                               : Emission::Mode::None;
}

// All volumes of one file are read in one go.
struct FileRequests {
  std::string pointer;  // Of the first volume that names the file.
  std::vector<GridRequest> requests;
  std::vector<std::optional<LoadedGrid>> grids;

  std::size_t add(const GridRequest& request) {
    for (std::size_t i = 0; i < requests.size(); ++i)
      if (requests[i].role == request.role && requests[i].name == request.name) {
        requests[i].required = requests[i].required || request.required;
        return i;
      }
    requests.push_back(request);
    return requests.size() - 1;
  }
};

struct VdbVolume {
  std::filesystem::path file;
  std::size_t density = 0;
  std::vector<std::size_t> emission;  // In order of preference.
  std::optional<std::size_t> color;
};

class VolumeLoader {
 public:
  explicit VolumeLoader(SceneLoad& load) : load_(load), scene_(load.scene) {}

  void run(const ObjectView& root) {
    const auto views = root.objects("volumes");
    std::vector<std::optional<VdbVolume>> wanted;
    for (const ObjectView& view : views)
      wanted.push_back(view.text("type") == "vdb" ? std::optional(want(view)) : std::nullopt);
    if (load_.options.load_data)
      for (auto& [file, requests] : files_) read(file, requests);
    for (std::size_t i = 0; i < views.size(); ++i)
      scene_.volumes.push_back(wanted[i] ? vdb(views[i], *wanted[i]) : homogeneous(views[i]));
  }

 private:
  VdbVolume want(const ObjectView& view) {
    VdbVolume volume;
    volume.file = resolve_input(load_, view, "file");
    FileRequests& file = files_[volume.file];
    if (file.pointer.empty()) file.pointer = view.pointer("file");
    const ObjectView grids = view.object("grids");
    const auto request = [&](GridRole role, bool required) {
      const char* key = grid_role_name(role);
      GridRequest r{role, std::nullopt, required};
      if (grids.has(key)) {
        r.name = grids.text(key);
        r.required = true;
        if (r.name->empty()) grids.fail(key, "the name is empty", "name a grid or leave it out");
      }
      return file.add(r);
    };

    volume.density = request(GridRole::Density, true);
    const Emission::Mode mode = emission_mode(view.object("emission"));
    const auto is_named = [&](GridRole role) { return grids.has(grid_role_name(role)); };
    if (mode == Emission::Mode::Blackbody) {
      volume.emission = {request(GridRole::Temperature, true)};
    } else if (mode == Emission::Mode::Grid) {
      if (is_named(GridRole::Emission) || !is_named(GridRole::Flame))
        volume.emission.push_back(request(GridRole::Emission, false));
      if (!is_named(GridRole::Emission)) volume.emission.push_back(request(GridRole::Flame, false));
    }
    if (is_named(GridRole::Color)) volume.color = request(GridRole::Color, true);

    const auto warn_unused = [&](GridRole role, bool is_used) {
      if (is_named(role) && !is_used)
        scene_.warnings.push_back(load_.document.file() + ": " +
                                  grids.pointer(grid_role_name(role)) +
                                  ": not read, since the volume's emission mode has no use for it");
    };
    warn_unused(GridRole::Temperature, mode == Emission::Mode::Blackbody);
    warn_unused(GridRole::Flame, mode == Emission::Mode::Grid && !is_named(GridRole::Emission));
    warn_unused(GridRole::Emission, mode == Emission::Mode::Grid);
    return volume;
  }

  void read(const std::filesystem::path& file, FileRequests& requests) {
    requests.grids = at_place(load_.document, requests.pointer, [&] {
      return load_grids(file, requests.requests, load_.options.grids);
    });
    for (std::size_t i = 0; i < requests.grids.size(); ++i) {
      const auto& grid = requests.grids[i];
      if (!grid) continue;
      scene_.grids.push_back(printable(file.filename().string()) + ": " + grid->name + " as " +
                             grid_role_name(requests.requests[i].role));
      scene_.bad_voxels.nan += grid->bad_voxels.nan;
      scene_.bad_voxels.infinite += grid->bad_voxels.infinite;
      scene_.bad_voxels.negative += grid->bad_voxels.negative;
      for (const std::string& w : grid->warnings) scene_.warnings.push_back(w);
    }
  }

  void read_common(const ObjectView& view, Volume& volume) {
    const Coefficients c = read_coefficients(view);
    volume.sigma_s = c.sigma_s;
    volume.sigma_a = c.sigma_a;
    volume.phase = HenyeyGreenstein(view.number("anisotropy"));
    const ObjectView emission = view.object("emission");
    Emission& e = volume.emission;
    e.mode = emission_mode(emission);
    if (e.mode == Emission::Mode::None) return;
    e.scale = emission.number("scale");
    if (e.mode == Emission::Mode::Blackbody)
      e.temperature_scale = emission.number("temperature_scale");
    else
      e.color = emission.color("color");
  }

  Volume homogeneous(const ObjectView& view) {
    Volume volume;
    volume.name = "homogeneous";
    read_common(view, volume);
    if (view.has("bounds")) volume.bounds = view.box("bounds");
    if (volume.emission.mode == Emission::Mode::Grid ||
        volume.emission.mode == Emission::Mode::Blackbody)
      view.object("emission")
          .fail("mode", "a homogeneous volume has no grids", "use \"density\" or \"none\"");
    return volume;
  }

  Volume vdb(const ObjectView& view, const VdbVolume& wanted) {
    Volume volume;
    volume.name = wanted.file.filename().string();
    read_common(view, volume);
    if (!load_.options.load_data) return volume;
    const FileRequests& file = files_.at(wanted.file);
    volume.density = place(view, *file.grids[wanted.density], 1).front();
    if (wanted.color) volume.albedo_grid = place(view, *file.grids[*wanted.color], 3);
    for (const std::size_t i : wanted.emission)
      if (file.grids[i]) {
        const bool is_scalar = volume.emission.mode == Emission::Mode::Blackbody;
        volume.emission.grid = place(view, *file.grids[i], is_scalar ? 1 : 3);
        break;
      }
    if (!wanted.emission.empty() && volume.emission.grid.empty())
      view.object("emission")
          .fail("mode", "the file has neither an emission nor a flame grid",
                "name one in " + view.pointer("grids"));
    return volume;
  }

  std::vector<std::shared_ptr<const BrickGrid>> place(const ObjectView& view,
                                                      const LoadedGrid& grid,
                                                      std::size_t max_channels) {
    if (grid.channels.empty() || grid.channels.size() > max_channels)
      view.fail("file",
                "grid " + grid.name + " has " + std::to_string(grid.channels.size()) + " channels",
                "name another in " + view.pointer("grids"));
    const Affine3d transform = view.transform("transform");
    std::vector<std::shared_ptr<const BrickGrid>> placed;
    for (const auto& channel : grid.channels) {
      const Affine3d total = transform * channel->index_to_world();
      for (int a = 0; a < 3; ++a) {
        const double voxel =
            total.vector({a == 0 ? 1. : 0., a == 1 ? 1. : 0., a == 2 ? 1. : 0.}).length();
        if (!(voxel >= kMinVoxel && voxel <= kMaxVoxel))
          view.fail("transform",
                    "voxels of grid " + grid.name + " become " + std::to_string(voxel) +
                        " scene units wide, outside 1e-5 .. 1e9",
                    "scale it");
      }
      placed.push_back(transform == Affine3d{}
                           ? channel
                           : at_place(load_.document, view.pointer("transform"),
                                      [&] { return channel->with_transform(total); }));
    }
    return placed;
  }

  SceneLoad& load_;
  Scene& scene_;
  std::map<std::filesystem::path, FileRequests> files_;
};

}  // namespace

void load_volumes(SceneLoad& load, const ObjectView& root) { VolumeLoader(load).run(root); }

}  // namespace brume
