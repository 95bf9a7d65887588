#include "scene/world.h"

#include "core/error.h"

namespace brume {
namespace {

bool is_at_infinity(const LightDescription& light) {
  return std::holds_alternative<DirectionalLight>(light) ||
         std::holds_alternative<EnvironmentLight>(light);
}

TriangleMesh quad_mesh(const QuadLight& quad, std::uint32_t material) {
  TriangleMesh mesh;
  mesh.name = "quad light";
  mesh.positions = {quad.corner, quad.corner + quad.edge_u, quad.corner + quad.edge_u + quad.edge_v,
                    quad.corner + quad.edge_v};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.materials = {material, material};
  return mesh;
}

Material quad_material(const QuadLight& quad) {
  Material material;
  material.name = "quad light";
  material.albedo = Rgb(0.0f);
  material.emission = quad.radiance;
  return material;
}

void add(FingerprintBuilder& f, const Rgb& c) { f.add(c.r).add(c.g).add(c.b); }

void add(FingerprintBuilder& f, const TriangleMesh& mesh) {
  f.add_bytes(mesh.positions.data(), mesh.positions.size() * sizeof(Vec3d));
  f.add_bytes(mesh.triangles.data(), mesh.triangles.size() * sizeof(mesh.triangles[0]));
  f.add_bytes(mesh.normals.data(), mesh.normals.size() * sizeof(Vec3f));
  f.add(mesh.materials);
  f.add(mesh.casts_shadow);
}

void add(FingerprintBuilder& f, const Material& m) {
  add(f, m.albedo);
  add(f, m.specular);
  f.add(m.roughness);
  add(f, m.emission);
  f.add(m.direct).add(m.two_sided).add(m.emission_lobe.has_value());
  if (const auto& lobe = m.emission_lobe) {
    f.add(lobe->axis.x).add(lobe->axis.y).add(lobe->axis.z).add(lobe->exponent);
    add(f, lobe->radiance);
  }
}

}  // namespace

World::World(const Scene& scene)
    : medium_(scene.volumes), materials_(scene.materials), unit_(scene.unit) {
  if (materials_.empty()) materials_.emplace_back();
  std::vector<TriangleMesh> meshes = scene.meshes;
  for (TriangleMesh& mesh : meshes) {
    remove_bad_triangles(mesh);
    if (mesh.materials.empty()) mesh.materials.assign(mesh.triangles.size(), 0);
    for (const std::uint32_t m : mesh.materials) BRUME_ASSERT(m, <, materials_.size());
  }

  material_light_.assign(materials_.size(), -1);
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const LightDescription& description = scene.lights[i];
    if (medium_.is_unbounded() && is_at_infinity(description))
      throw Error(
          ErrorKind::InvalidInput,
          scene.file.string() + ": /lights/" + std::to_string(i) +
              ": light from infinity does not get through a volume without bounds: give the "
              "volume bounds");
    const int index = static_cast<int>(lights_.size());
    lights_.push_back(make_light(description, unit_, scene.up));
    if (lights_.back()->kind() == Light::Kind::Environment) environment_lights_.push_back(index);
    if (const auto* quad = std::get_if<QuadLight>(&description)) {
      TriangleMesh mesh = quad_mesh(*quad, std::uint32_t(materials_.size()));
      remove_bad_triangles(mesh);
      meshes.push_back(std::move(mesh));
      materials_.push_back(quad_material(*quad));
      material_light_.push_back(index);
    }
  }

  std::vector<std::vector<EmitterTriangle>> emitters(scene.materials.size());
  std::vector<bool> is_used(materials_.size());
  for (const TriangleMesh& mesh : meshes)
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const std::uint32_t m = mesh.materials[t];
      is_used[m] = true;
      if (m >= emitters.size() || !materials_[m].is_emissive() || !materials_[m].direct) continue;
      const auto& corner = mesh.triangles[t];
      emitters[m].push_back(
          {mesh.positions[corner[0]], mesh.positions[corner[1]], mesh.positions[corner[2]]});
    }
  for (std::size_t m = 0; m < emitters.size(); ++m) {
    if (emitters[m].empty()) continue;
    material_light_[m] = static_cast<int>(lights_.size());
    lights_.push_back(make_mesh_light(std::move(emitters[m]), materials_[m].emission,
                                      materials_[m].two_sided, unit_));
  }
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    has_glossy_ |= is_used[m] && materials_[m].is_glossy();
    has_gathered_emitters_ |= is_used[m] && materials_[m].is_emissive() && !materials_[m].direct;
  }

  tracer_ = std::make_unique<RayTracer>(std::move(meshes));
  bounds_ = tracer_->bounds();
  if (!medium_.is_vacuum() && !medium_.is_unbounded()) bounds_.extendBy(medium_.bounds());

  FingerprintBuilder f;
  f.add("world 1").add(unit_);
  for (const TriangleMesh& mesh : tracer_->meshes()) add(f, mesh);
  for (const Material& material : materials_) add(f, material);
  for (const auto& light : lights_) light->add_to(f);
  f.add(medium_.fingerprint());
  fingerprint_ = f.finish();
}

int World::light_at(const Hit& hit) const { return material_light_[hit.material]; }

RgbD World::emission(const Hit& hit, const Vec3d& wo) const {
  const Material& m = material(hit);
  if (!m.is_emissive() || !(m.two_sided || hit.normal.dot(wo) > 0)) return {};
  RgbD radiance(m.emission);
  if (const auto& lobe = m.emission_lobe)
    radiance += RgbD(lobe->radiance) * std::pow(std::max(0.0, wo.dot(lobe->axis)), lobe->exponent);
  return radiance;
}

RgbGradient World::emission_derivative(const Hit& hit, const Vec3d& wo) const {
  const auto& lobe = material(hit).emission_lobe;
  if (!lobe || is_black(emission(hit, wo))) return {};
  const double cosine = std::max(0.0, wo.dot(lobe->axis));
  return outer(RgbD(lobe->radiance) * (lobe->exponent * std::pow(cosine, lobe->exponent - 1)),
               lobe->axis);
}

RgbD World::background(const Vec3d& direction) const {
  RgbD sum;
  for (const int i : environment_lights_) sum += lights_[i]->radiance(direction);
  return sum;
}

}  // namespace brume
