#include "vdb_media/medium.h"

#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace brume {
namespace {

bool contains(const Box3d& box, const Vec3d& p) {
  return p.x >= box.min.x && p.x < box.max.x && p.y >= box.min.y && p.y < box.max.y &&
         p.z >= box.min.z && p.z < box.max.z;
}

// Half-open like the boxes of rays; an endless box has no far side to leave out.
bool has_volume(const Box3d& box) {
  return box.min.x < box.max.x && box.min.y < box.max.y && box.min.z < box.max.z;
}

bool is_infinite(const Box3d& box) {
  for (int a = 0; a < 3; ++a)
    if (std::isinf(box.min[a]) || std::isinf(box.max[a])) return true;
  return false;
}

float sample_at(const BrickGrid& grid, const Vec3d& p) {
  return grid.sample(grid.world_to_index().point(p));
}

// One channel for all three colours, or one each.
Rgb sample_color(const std::vector<std::shared_ptr<const BrickGrid>>& grid, const Vec3d& p) {
  if (grid.size() == 1) return Rgb(sample_at(*grid[0], p));
  return {sample_at(*grid[0], p), sample_at(*grid[1], p), sample_at(*grid[2], p)};
}

bool has_density(const Volume& v) {
  return v.is_homogeneous() ? has_volume(v.bounds) : !v.density->is_empty();
}

// Whether any light can come of the emission as it is set.
bool has_light(const Volume& v) {
  const Emission& e = v.emission;
  bool grid_has_values = false;
  for (const auto& g : e.grid) grid_has_values |= !g->is_empty();
  switch (e.mode) {
    case Emission::Mode::None:
      return false;
    case Emission::Mode::Density:
      return e.scale > 0 && !is_black(e.color) && !is_black(v.sigma_t()) && has_density(v);
    case Emission::Mode::Grid:
      return e.scale > 0 && !is_black(e.color) && grid_has_values;
    case Emission::Mode::Blackbody:
      return e.scale > 0 && e.temperature_scale > 0 && !is_black(v.sigma_a) && grid_has_values &&
             has_density(v);
  }
  return false;
}

}  // namespace

bool Volume::scatters() const { return !is_black(sigma_s) && has_density(*this); }

bool Volume::emits() const { return has_light(*this); }

bool Volume::is_chromatic() const {
  const RgbD s = sigma_t();
  return s.r != s.g || s.g != s.b;
}

bool Volume::is_empty() const {
  const bool dims = !is_black(sigma_t()) && has_density(*this);
  return !dims && !emits();
}

Box3d Volume::world_bounds() const {
  Box3d box;
  if (is_homogeneous()) {
    if (has_volume(bounds)) box = bounds;
  } else {
    box = density->world_bounds();
  }
  // The other modes give off light only where there is density.
  if (emission.mode == Emission::Mode::Grid)
    for (const auto& g : emission.grid) box.extendBy(g->world_bounds());
  return box;
}

double Volume::density_at(const Vec3d& p) const {
  if (is_homogeneous()) return contains(bounds, p) ? 1 : 0;
  return sample_at(*density, p);
}

BrickGrid::ValueGradient Volume::density_gradient_at(const Vec3d& p) const {
  if (is_homogeneous()) return {density_at(p), Vec3d(0.0)};
  const Affine3d& world_to_index = density->world_to_index();
  BrickGrid::ValueGradient g = density->sample_gradient(world_to_index.point(p));
  g.gradient = world_to_index.transposed_vector(g.gradient);
  return g;
}

RgbD Volume::sigma_s_at(const Vec3d& p) const {
  if (albedo_grid.empty()) return sigma_s;
  const Rgb a = sample_color(albedo_grid, p);
  // Values are >= 0 by contract of the grid; more than 1 would make energy.
  return sigma_s * RgbD(std::min(a.r, 1.0f), std::min(a.g, 1.0f), std::min(a.b, 1.0f));
}

RgbD Volume::emission_at(const Vec3d& p) const {
  const RgbD color = RgbD(emission.color) * emission.scale;
  switch (emission.mode) {
    case Emission::Mode::None:
      break;
    case Emission::Mode::Density:
      return color * sigma_t() * density_at(p);
    case Emission::Mode::Grid:
      return emission.grid.empty() ? RgbD() : color * RgbD(sample_color(emission.grid, p));
    case Emission::Mode::Blackbody: {
      const double d = density_at(p);
      if (d == 0 || emission.grid.empty()) return RgbD();
      const double kelvin = emission.temperature_scale * sample_at(*emission.grid[0], p);
      return RgbD(blackbody_radiance(kelvin)) * sigma_a * (emission.scale * d);
    }
  }
  return RgbD();
}

struct Medium::Pyramids {
  struct One {
    std::once_flag made;
    std::optional<BrickPyramid> pyramid;
  };
  std::deque<One> of;  // By volume.
};

Medium::Medium(std::vector<Volume> volumes)
    : volumes_(std::move(volumes)), pyramids_(std::make_shared<Pyramids>()) {
  std::erase_if(volumes_, [](const Volume& v) { return v.is_empty(); });
  pyramids_->of.resize(volumes_.size());
  for (const Volume& v : volumes_) {
    scatters_ |= v.scatters();
    emits_ |= v.emits();
    chromatic_ |= v.is_chromatic();
    unbounded_ |= is_infinite(v.world_bounds());
    heterogeneous_ |= !v.is_homogeneous();
    bounds_.extendBy(v.world_bounds());
    if (v.density) voxel_size_ = std::min(voxel_size_, v.density->voxel_size());
    for (const auto* channels : {&v.albedo_grid, &v.emission.grid})
      for (const auto& g : *channels) voxel_size_ = std::min(voxel_size_, g->voxel_size());
  }
}

const BrickPyramid& Medium::pyramid(int volume) const {
  const auto v = static_cast<std::size_t>(volume);
  Pyramids::One& one = pyramids_->of[v];
  std::call_once(one.made, [&] { one.pyramid.emplace(volumes_[v].density); });
  return *one.pyramid;
}

RgbD Medium::sigma_t_at(const Vec3d& p) const {
  RgbD sum;
  for (const Volume& v : volumes_) sum += v.sigma_t() * v.density_at(p);
  return sum;
}

RgbD Medium::sigma_s_at(const Vec3d& p) const {
  RgbD sum;
  for (const Volume& v : volumes_)
    if (v.scatters()) sum += v.sigma_s_at(p) * v.density_at(p);
  return sum;
}

Fingerprint Medium::fingerprint() const {
  FingerprintBuilder builder;
  const auto add_vector = [&](const Vec3d& v) { builder.add(v.x).add(v.y).add(v.z); };
  const auto add_color = [&](const RgbD& c) { builder.add(c.r).add(c.g).add(c.b); };
  const auto add_grids = [&](const std::vector<std::shared_ptr<const BrickGrid>>& grids) {
    builder.add(grids.size());
    for (const auto& g : grids) builder.add(g->fingerprint());
  };
  builder.add("medium").add(volumes_.size());
  for (const Volume& v : volumes_) {
    builder.add(v.is_homogeneous());
    if (v.is_homogeneous()) {
      add_vector(v.bounds.min);
      add_vector(v.bounds.max);
    } else {
      builder.add(v.density->fingerprint());
    }
    add_color(v.sigma_s);
    add_color(v.sigma_a);
    add_grids(v.albedo_grid);
    builder.add(v.phase.g()).add(v.emission.mode);
    if (v.emission.mode == Emission::Mode::None) continue;
    builder.add(v.emission.scale).add(v.emission.temperature_scale);
    add_color(RgbD(v.emission.color));
    add_grids(v.emission.grid);
  }
  return builder.finish();
}

}  // namespace brume
