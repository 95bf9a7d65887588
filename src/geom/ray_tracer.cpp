#include "geom/ray_tracer.h"

#if BRUME_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <mutex>
#include <new>
#include <utility>

#include "core/error.h"
#include "geom/triangle_pieces.h"

namespace brume {
namespace {

// Geometry is moved to the origin and scaled by a power of two to about unit size before it becomes
// float, so all tolerances are in units of the scene and scale exactly.
constexpr double kUlp = 0x1p-23;
// Measured for this purpose (HARD_CASES N14): 32 float ulps of the largest coordinate clear a
// surface.
constexpr double kOffsetUlps = 32;
// Shadow rays often end on a light's surface; this share of their length is left out there.
constexpr double kShadowEnd = 0x1p-17;
// Below this cosine a triangle's plane says less about a hit than Embree's barycentrics do.
constexpr double kGrazing = 1e-5;
// How far Embree's float barycentrics may be from those in double before they are believed instead.
constexpr double kBarycentricSlack = 1e-2;

// The few calls whose arguments differ between Embree 3 and 4.
#if RTC_VERSION_MAJOR >= 4
void intersect1(RTCScene scene, RTCRayHit& r) { rtcIntersect1(scene, &r, nullptr); }
void intersect8(const int* valid, RTCScene scene, RTCRayHit8& r) {
  rtcIntersect8(valid, scene, &r, nullptr);
}
void occluded1(RTCScene scene, RTCRay& r) { rtcOccluded1(scene, &r, nullptr); }
void occluded16(const int* valid, RTCScene scene, RTCRay16& r) {
  rtcOccluded16(valid, scene, &r, nullptr);
}
#else
RTCIntersectContext context() {
  RTCIntersectContext c;
  rtcInitIntersectContext(&c);
  return c;
}
void intersect1(RTCScene scene, RTCRayHit& r) {
  RTCIntersectContext c = context();
  rtcIntersect1(scene, &c, &r);
}
void intersect8(const int* valid, RTCScene scene, RTCRayHit8& r) {
  RTCIntersectContext c = context();
  rtcIntersect8(valid, scene, &c, &r);
}
void occluded1(RTCScene scene, RTCRay& r) {
  RTCIntersectContext c = context();
  rtcOccluded1(scene, &c, &r);
}
void occluded16(const int* valid, RTCScene scene, RTCRay16& r) {
  RTCIntersectContext c = context();
  rtcOccluded16(valid, scene, &c, &r);
}
#endif

struct FirstError {
  std::mutex mutex;
  RTCError code = RTC_ERROR_NONE;
  std::string text;
};

void keep_first_error(void* user, RTCError code, const char* text) {
  auto& first = *static_cast<FirstError*>(user);
  const std::lock_guard lock(first.mutex);
  if (first.code != RTC_ERROR_NONE) return;
  first.code = code;
  first.text = text ? text : "";
}

double max_abs(const Vec3d& v) {
  return std::max(std::abs(v.x), std::max(std::abs(v.y), std::abs(v.z)));
}

// The power of two that takes lengths of up to `extent` into (0.5, 1].
double unit_scale(double extent) {
  if (!(extent > 0)) return 1;
  int exponent = 0;
  std::frexp(extent, &exponent);
  return std::ldexp(1.0, -exponent);
}

// Owns one of Embree's counted references.
template <typename T, void (*Release)(T)>
class Handle {
 public:
  explicit Handle(T handle = nullptr) : handle_(handle) {}
  ~Handle() {
    if (handle_) Release(handle_);
  }
  Handle(Handle&& o) noexcept : handle_(std::exchange(o.handle_, nullptr)) {}
  Handle& operator=(Handle&& o) noexcept {
    std::swap(handle_, o.handle_);
    return *this;
  }
  T get() const { return handle_; }
  explicit operator bool() const { return handle_ != nullptr; }

 private:
  T handle_;
};
using DeviceHandle = Handle<RTCDevice, rtcReleaseDevice>;
using SceneHandle = Handle<RTCScene, rtcReleaseScene>;
using GeometryHandle = Handle<RTCGeometry, rtcReleaseGeometry>;

}  // namespace

struct RayTracer::Impl {
  std::vector<TriangleMesh> meshes;
  Box3d bounds;
  CornerSpread spread;
  double scale = 1;  // World to Embree's units.
  Box3d clip_box;    // World space; a little more than `bounds`.
  FirstError error;  // Before the device, which may report into it until it is released.
  DeviceHandle device;
  SceneHandle scene, shadow_scene;  // The second only where some mesh casts no shadow.

  // What Embree's triangles of a mesh are parts of; empty where none of them was cut.
  std::vector<std::vector<TrianglePiece>> pieces;

  // How far around p float digits are those of larger numbers: no farther than `most`.
  double reach(const Vec3d& p, double most) const {
    return std::min(most, kMostReach * std::max(spread.shortest_cut, max_abs(p - spread.centre)));
  }
  double offset(const Vec3d& p, double most) const { return kOffsetUlps * kUlp * reach(p, most); }

  RTCScene shadows() const { return shadow_scene ? shadow_scene.get() : scene.get(); }

  // A ray as Embree gets it. One that starts outside the scene starts at its box instead, so that a
  // far camera costs no digits.
  struct FloatRay {
    float origin[3], direction[3], t_far = 0;
    bool is_valid = false;
  };
  FloatRay to_float(const Vec3d& o, const Vec3d& d, double t_end) const {
    FloatRay r;
    if (!is_finite(o) || !is_finite(d) || !(t_end > 0)) return r;
    const double length2 = d.length2();
    if (!(std::abs(length2 - 1) < 1e-3)) return r;
    Vec3d start = o;
    double t_start = 0;
    if (!clip_box.intersects(o)) {
      const Interval inside = clip({o, d}, clip_box, {0, t_end});
      if (inside.is_empty()) return r;
      t_start = inside.begin;
      start = o + d * t_start;
      // Rounding at huge distances must not leave the box by more than it has to.
      for (int a = 0; a < 3; ++a) start[a] = std::clamp(start[a], clip_box.min[a], clip_box.max[a]);
    }
    for (int a = 0; a < 3; ++a) {
      r.origin[a] = static_cast<float>((start[a] - spread.centre[a]) * scale);
      r.direction[a] = static_cast<float>(d[a]);
    }
    // Eight is beyond any part of the scene from any start inside its box, and endless rays stay
    // finite.
    r.t_far = static_cast<float>(std::min((t_end - t_start) * scale, 8.0));
    r.is_valid = r.t_far > 0;
    return r;
  }

  // Whether anything of the scene `by` lies on the ray.
  static bool is_cut_off(RTCScene by, const FloatRay& ray);

  double shadow_end(const ShadowRay& ray) const {
    if (!std::isfinite(ray.t_end)) return ray.t_end;
    const Vec3d end = ray.origin + ray.direction * ray.t_end;
    return ray.t_end * (1 - kShadowEnd) - offset(end, 1 / scale);
  }

  Hit hit_at(std::uint32_t mesh_index, std::uint32_t triangle, double b1, double b2) const;
  Hit rebuild(const Ray& ray, double t_end, std::uint32_t mesh, std::uint32_t triangle, double u,
              double v) const;
};

// Surface data at given barycentrics; t is left 0.
Hit RayTracer::Impl::hit_at(std::uint32_t mesh_index, std::uint32_t triangle, double b1,
                            double b2) const {
  const TriangleMesh& mesh = meshes[mesh_index];
  const auto& corner = mesh.triangles[triangle];
  const Vec3d &a = mesh.positions[corner[0]], &b = mesh.positions[corner[1]],
              &c = mesh.positions[corner[2]];
  const Vec3d e1 = b - a, e2 = c - a, cross = e1.cross(e2);
  const double area2 = cross.length2(), area = std::sqrt(area2);
  Hit hit;
  hit.t = 0;
  hit.mesh = mesh_index;
  hit.triangle = triangle;
  hit.material = mesh.materials.empty() ? 0 : mesh.materials[triangle];
  hit.normal = cross / area;
  const double corners = std::max(
      {max_abs(a - spread.centre), max_abs(b - spread.centre), max_abs(c - spread.centre)});
  hit.offset = offset(a + e1 * b1 + e2 * b2, corners);

  // A point within `offset` of an edge is moved in from it: where another wall meets this one
  // there, a new ray would else start on the wall's far side by rounding, and leak.
  double w[3] = {1 - b1 - b2, b1, b2};
  const double edge2[3] = {(c - b).length2(), e2.length2(), e1.length2()};
  bool is_moved = false;
  for (int i = 0; i < 3; ++i) {
    const double distance = w[i] * area;  // Times the edge's length.
    if (distance > 0 && distance * distance >= hit.offset * hit.offset * edge2[i]) continue;
    w[i] = std::min(hit.offset * std::sqrt(edge2[i]) / area, 1.0 / 3);
    is_moved = true;
  }
  if (is_moved) {
    const double sum = w[0] + w[1] + w[2];
    for (double& x : w) x /= sum;
  }
  hit.position = a + e1 * w[1] + e2 * w[2];

  hit.shading_normal = hit.normal;
  if (!mesh.normals.empty()) {
    Vec3d n = Vec3d(mesh.normals[corner[0]]) * w[0] + Vec3d(mesh.normals[corner[1]]) * w[1] +
              Vec3d(mesh.normals[corner[2]]) * w[2];
    if (n.dot(hit.normal) < 0) n = -n;
    const double length = n.length();
    if (length > 0 && std::isfinite(length)) hit.shading_normal = n / length;
  }
  return hit;
}

// Embree says which triangle; where on it is found again in double.
Hit RayTracer::Impl::rebuild(const Ray& ray, double t_end, std::uint32_t mesh_index,
                             std::uint32_t triangle, double u, double v) const {
  if (!pieces[mesh_index].empty()) {
    const TrianglePiece& piece = pieces[mesh_index][triangle];
    const Vec2d at = piece.corners[0] + (piece.corners[1] - piece.corners[0]) * u +
                     (piece.corners[2] - piece.corners[0]) * v;
    triangle = piece.triangle;
    u = at.x;
    v = at.y;
  }
  const TriangleMesh& mesh = meshes[mesh_index];
  const auto& corner = mesh.triangles[triangle];
  const Vec3d& a = mesh.positions[corner[0]];
  const Vec3d e1 = mesh.positions[corner[1]] - a, e2 = mesh.positions[corner[2]] - a;
  const Vec3d cross = e1.cross(e2);
  const double area2 = cross.length2(), slope = cross.dot(ray.direction);
  if (slope * slope > kGrazing * kGrazing * area2) {
    const double t = cross.dot(a - ray.origin) / slope;
    const Vec3d q = ray.origin + ray.direction * t - a;
    const double b1 = q.cross(e2).dot(cross) / area2, b2 = e1.cross(q).dot(cross) / area2;
    if (t > 0 && std::abs(b1 - u) < kBarycentricSlack && std::abs(b2 - v) < kBarycentricSlack) {
      Hit hit = hit_at(mesh_index, triangle, b1, b2);
      hit.t = std::min(t, t_end);
      return hit;
    }
  }
  Hit hit = hit_at(mesh_index, triangle, u, v);
  const double t = (hit.position - ray.origin).dot(ray.direction);
  hit.t = std::clamp(t, 0.0, t_end);
  return hit;
}

RayTracer::RayTracer(std::vector<TriangleMesh> meshes) : impl_(std::make_unique<Impl>()) {
  Impl& impl = *impl_;
  impl.meshes = std::move(meshes);
  for (const TriangleMesh& mesh : impl.meshes)
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t i : triangle) impl.bounds.extendBy(mesh.positions[i]);
  impl.pieces.resize(impl.meshes.size());
  if (impl.bounds.isEmpty()) return;
  impl.spread = corner_spread(impl.meshes);
  impl.scale = unit_scale(std::max(max_abs(impl.bounds.max - impl.spread.centre),
                                   max_abs(impl.bounds.min - impl.spread.centre)));
  impl.clip_box = impl.bounds;
  const Vec3d margin(64 * kOffsetUlps * kUlp / impl.scale);  // Of the largest float there is.
  impl.clip_box.min -= margin;
  impl.clip_box.max += margin;

  impl.device = DeviceHandle(rtcNewDevice("start_threads=0,set_affinity=0"));
  if (!impl.device)
    throw Error(ErrorKind::Resource, "geometry: Embree does not start: error " +
                                         std::to_string(int(rtcGetDeviceError(nullptr))));
  rtcSetDeviceErrorFunction(impl.device.get(), keep_first_error, &impl.error);
  const auto new_scene = [&] {
    SceneHandle scene(rtcNewScene(impl.device.get()));
    rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
    return scene;
  };
  impl.scene = new_scene();
  bool all_cast_shadows = true;
  for (const TriangleMesh& mesh : impl.meshes) all_cast_shadows &= mesh.casts_shadow;
  if (!all_cast_shadows) impl.shadow_scene = new_scene();

  // Embree's builder cuts its work by the number of threads, and the order it leaves triangles in
  // decides which one is hit on a shared edge. One thread, so that the answer is the same
  // everywhere.
  tbb::task_arena arena(1);
  arena.execute([&] {
    for (std::size_t m = 0; m < impl.meshes.size(); ++m) {
      const TriangleMesh& mesh = impl.meshes[m];
      if (mesh.triangles.empty()) continue;
      std::vector<TrianglePiece>& pieces = impl.pieces[m];
      pieces = cut_large_triangles(mesh, impl.spread);
      const std::size_t cut_corners = pieces.empty() ? mesh.positions.size() : 3 * pieces.size();
      const std::size_t triangles = pieces.empty() ? mesh.triangles.size() : pieces.size();
      GeometryHandle geometry(rtcNewGeometry(impl.device.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
      auto* vertices = static_cast<float*>(
          rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                  3 * sizeof(float), cut_corners));
      auto* indices = static_cast<std::uint32_t*>(
          rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                  3 * sizeof(std::uint32_t), triangles));
      if (!vertices || !indices) break;  // The error function has the reason.
      const auto add_vertex = [&](const Vec3d& p) {
        const Vec3d q = is_finite(p) ? (p - impl.spread.centre) * impl.scale : Vec3d(0.0);
        for (int a = 0; a < 3; ++a) *vertices++ = static_cast<float>(std::clamp(q[a], -2.0, 2.0));
      };
      if (pieces.empty()) {
        for (const Vec3d& p : mesh.positions) add_vertex(p);
        for (const auto& triangle : mesh.triangles)
          for (const std::uint32_t i : triangle) *indices++ = i;
      }
      for (const TrianglePiece& piece : pieces) {
        const auto& i = mesh.triangles[piece.triangle];
        const Vec3d &a = mesh.positions[i[0]], &b = mesh.positions[i[1]], &c = mesh.positions[i[2]];
        for (const Vec2d& at : piece.corners) add_vertex(a + (b - a) * at.x + (c - a) * at.y);
      }
      if (!pieces.empty())
        for (std::uint32_t i = 0; i < cut_corners; ++i) *indices++ = i;
      rtcCommitGeometry(geometry.get());
      rtcAttachGeometryByID(impl.scene.get(), geometry.get(), unsigned(m));
      if (impl.shadow_scene && mesh.casts_shadow)
        rtcAttachGeometryByID(impl.shadow_scene.get(), geometry.get(), unsigned(m));
    }
    rtcCommitScene(impl.scene.get());
    if (impl.shadow_scene) rtcCommitScene(impl.shadow_scene.get());
  });
  if (impl.error.code == RTC_ERROR_OUT_OF_MEMORY)
    throw Error(ErrorKind::Resource,
                "geometry: out of memory for the ray tracer: use fewer triangles");
  if (impl.error.code != RTC_ERROR_NONE)
    throw Error(ErrorKind::Internal, "geometry: Embree: " + impl.error.text);
}

RayTracer::~RayTracer() = default;
RayTracer::RayTracer(RayTracer&&) noexcept = default;

const std::vector<TriangleMesh>& RayTracer::meshes() const { return impl_->meshes; }
const Box3d& RayTracer::bounds() const { return impl_->bounds; }
const Vec3d& RayTracer::centre() const { return impl_->spread.centre; }
double RayTracer::offset_at(const Vec3d& p) const { return impl_->offset(p, 1 / impl_->scale); }

std::string RayTracer::library_version() { return "Embree " RTC_VERSION_STRING; }

Hit RayTracer::intersect(const Ray& ray, double t_end) const {
  if (!impl_->scene) return {};
  const Impl::FloatRay f = impl_->to_float(ray.origin, ray.direction, t_end);
  if (!f.is_valid) return {};
  RTCRayHit r{};
  r.ray.org_x = f.origin[0], r.ray.org_y = f.origin[1], r.ray.org_z = f.origin[2];
  r.ray.dir_x = f.direction[0], r.ray.dir_y = f.direction[1], r.ray.dir_z = f.direction[2];
  r.ray.tfar = f.t_far;
  r.ray.mask = ~0u;
  r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  intersect1(impl_->scene.get(), r);
  if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return impl_->rebuild(ray, t_end, r.hit.geomID, r.hit.primID, r.hit.u, r.hit.v);
}

void RayTracer::intersect(std::span<const Ray> rays, std::span<Hit> hits) const {
  BRUME_ASSERT(rays.size(), ==, hits.size());
  constexpr std::size_t kWidth = 8;
  for (std::size_t first = 0; first < rays.size(); first += kWidth) {
    const std::size_t count = std::min(kWidth, rays.size() - first);
    alignas(32) int valid[kWidth] = {};
    RTCRayHit8 r{};
    bool any = false;
    for (std::size_t i = 0; i < kWidth; ++i) {
      r.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      r.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      if (i >= count || !impl_->scene) continue;
      const Ray& ray = rays[first + i];
      const Impl::FloatRay f = impl_->to_float(ray.origin, ray.direction, kInfinity);
      if (!f.is_valid) continue;
      valid[i] = -1;
      any = true;
      r.ray.org_x[i] = f.origin[0], r.ray.org_y[i] = f.origin[1], r.ray.org_z[i] = f.origin[2];
      r.ray.dir_x[i] = f.direction[0], r.ray.dir_y[i] = f.direction[1];
      r.ray.dir_z[i] = f.direction[2];
      r.ray.tfar[i] = f.t_far;
      r.ray.mask[i] = ~0u;
    }
    if (any) intersect8(valid, impl_->scene.get(), r);
    for (std::size_t i = 0; i < count; ++i)
      hits[first + i] = r.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID
                            ? Hit{}
                            : impl_->rebuild(rays[first + i], kInfinity, r.hit.geomID[i],
                                             r.hit.primID[i], r.hit.u[i], r.hit.v[i]);
  }
}

bool RayTracer::Impl::is_cut_off(RTCScene by, const FloatRay& ray) {
  if (!ray.is_valid) return false;
  RTCRay r{};
  r.org_x = ray.origin[0], r.org_y = ray.origin[1], r.org_z = ray.origin[2];
  r.dir_x = ray.direction[0], r.dir_y = ray.direction[1], r.dir_z = ray.direction[2];
  r.tfar = ray.t_far;
  r.mask = ~0u;
  occluded1(by, r);
  return r.tfar < 0;
}

bool RayTracer::is_occluded(const ShadowRay& ray) const {
  if (!impl_->scene) return false;
  return Impl::is_cut_off(impl_->shadows(),
                          impl_->to_float(ray.origin, ray.direction, impl_->shadow_end(ray)));
}

void RayTracer::is_occluded(std::span<const ShadowRay> rays,
                            std::span<std::uint8_t> occluded) const {
  BRUME_ASSERT(rays.size(), ==, occluded.size());
  constexpr std::size_t kWidth = 16;
  for (std::size_t first = 0; first < rays.size(); first += kWidth) {
    const std::size_t count = std::min(kWidth, rays.size() - first);
    alignas(64) int valid[kWidth] = {};
    RTCRay16 r{};
    bool any = false;
    for (std::size_t i = 0; i < count && impl_->scene; ++i) {
      const ShadowRay& ray = rays[first + i];
      const Impl::FloatRay f = impl_->to_float(ray.origin, ray.direction, impl_->shadow_end(ray));
      if (!f.is_valid) continue;
      valid[i] = -1;
      any = true;
      r.org_x[i] = f.origin[0], r.org_y[i] = f.origin[1], r.org_z[i] = f.origin[2];
      r.dir_x[i] = f.direction[0], r.dir_y[i] = f.direction[1], r.dir_z[i] = f.direction[2];
      r.tfar[i] = f.t_far;
      r.mask[i] = ~0u;
    }
    if (any) occluded16(valid, impl_->shadows(), r);
    for (std::size_t i = 0; i < count; ++i) occluded[first + i] = valid[i] && r.tfar[i] < 0;
  }
}

bool RayTracer::sees(const Vec3d& a, const Vec3d& na, const Vec3d& b, const Vec3d& nb) const {
  if (!impl_->scene) return true;
  const auto is_clear = [this](const Vec3d& from, const Vec3d& to) {
    const Vec3d way = to - from;
    const double length = way.length();
    return !(length > 0) ||
           !Impl::is_cut_off(impl_->scene.get(), impl_->to_float(from, way / length, length));
  };
  // A crease between two planes lies at most half as far above the straight way as the points lie
  // below each other's planes.
  const auto raised = [&](const Vec3d& p, const Vec3d& n, const Vec3d& other, Vec3d& top) {
    const double offset = offset_at(p);
    const Vec3d low = p + n * offset;
    const double lift = 0.5 * std::max(0.0, (p - other).dot(n));
    top = low + n * lift;
    return !(lift > offset) || is_clear(low, top);
  };
  Vec3d from, to;
  return raised(a, na, b, from) && raised(b, nb, a, to) && is_clear(from, to);
}

double RayTracer::clearance(const Vec3d& p, const Vec3d& n) const {
  if (!impl_->scene || !is_finite(p)) return kInfinity;
  struct Search {
    const Impl& impl;
    Vec3d p, n;
    double above;  // Lower than that is the surface itself.
    double nearest2 = kInfinity;

    static bool visit(RTCPointQueryFunctionArguments* args) {
      Search& s = *static_cast<Search*>(args->userPtr);
      const TriangleMesh& mesh = s.impl.meshes[args->geomID];
      const auto& pieces = s.impl.pieces[args->geomID];
      const auto& i = mesh.triangles[pieces.empty() ? args->primID : pieces[args->primID].triangle];
      const Vec3d corner[3] = {mesh.positions[i[0]] - s.p, mesh.positions[i[1]] - s.p,
                               mesh.positions[i[2]] - s.p};
      const double found2 = distance2_above(corner, s.n, s.above);
      if (!(found2 < s.nearest2)) return false;
      s.nearest2 = found2;
      args->query->radius = static_cast<float>(std::sqrt(found2) * s.impl.scale * 1.0001);
      return true;
    }
  };
  Search search{*impl_, p, n, 2 * offset_at(p)};
  RTCPointQuery query{};
  query.x = static_cast<float>((p.x - impl_->spread.centre.x) * impl_->scale);
  query.y = static_cast<float>((p.y - impl_->spread.centre.y) * impl_->scale);
  query.z = static_cast<float>((p.z - impl_->spread.centre.z) * impl_->scale);
  query.radius = std::numeric_limits<float>::infinity();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->scene.get(), &query, &context, Search::visit, &search);
  return std::sqrt(search.nearest2);
}

Hit RayTracer::point_on(std::uint32_t mesh, std::uint32_t triangle,
                        const Vec2d& barycentrics) const {
  return impl_->hit_at(mesh, triangle, barycentrics.x, barycentrics.y);
}

}  // namespace brume
