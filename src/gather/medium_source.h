// What the medium sends towards a point from one stretch of a ray: light scattered straight from
// lights, light that has scattered before, and the medium's own glow.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "core/random.h"
#include "gather/incident_field.h"
#include "gather/lighting.h"
#include "plan/effects.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

// Some of what a ray's medium sends, dimmed back to where the ray starts.
struct MediumLight {
  enum class Kind : std::uint8_t {
    Direct,       // Straight from lights.
    Rescattered,  // Had scattered before, or met a surface.
    Emitted
  };
  Kind kind = Kind::Direct;
  int shell = 0;
  RgbD light;
  // sum of (dp/dc / p) * light * e over samples, e the way the light travels: the directional term
  // before its 1/t (gradients.md 3, T4). Only where asked for, and for anisotropic media.
  RgbGradient directional;
};

// Where rays look in their shells, in [0, 1): even over rays whose turns are.
struct ShellJitter {
  std::span<const float> shifts;  // By shell.
  double turn = 0;
  double at(int shell) const {
    const double u = shifts[static_cast<std::size_t>(shell)] + turn;
    return u - std::floor(u);
  }
};

// What a volume scatters of a stretch of a ray, without its phase function.
struct MediumStretch {
  int shell = 0, volume = 0;
  double distance = 0;  // Of a point that stands for it.
  RgbD weight;          // The integral of transmittance * sigma_s.
};

// Q(p, .) per length at one point, in all directions [W/(m^2 sr) per world unit].
class SourceAtPoint {
 public:
  // What leaves towards `direction`.
  RgbD towards(const Vec3d& direction) const;

 private:
  friend class MediumSource;
  struct Incident {
    HenyeyGreenstein phase;
    Vec3d travel;   // The way the light travels.
    RgbD strength;  // Scattered per length, before the phase function.
  };
  RgbD even_;  // Emission and what scatters isotropically.
  std::vector<Incident> lobes_;
  // Of what has scattered before, what anisotropic volumes scatter, by moment from the second on.
  std::vector<RgbD> moments_;
  int order_ = 0;
};

// Source terms along marched rays. Scratch memory of one thread.
class MediumSource {
 public:
  // Without `directional` its terms are left at 0, and cost nothing.
  MediumSource(const Lighting& lighting, const Effects& effects, bool directional = false);

  // What has scattered already, from now on; null: nothing. It must outlive its use. Shells ask for
  // it one by one, or, where `most_asked` is above 0, at most so many of a ray's do, fewer where
  // less scatters: drawn in proportion to what they scatter, they stand for the others.
  void use_scattered(const IncidentField* scattered, int most_asked = 0) {
    scattered_ = scattered;
    most_asked_ = most_asked;
  }

  // Each shell asks every light, or, where `most` is above 0, at most so many pairs of shell and
  // light of a ray are asked: drawn in proportion to what they bring were nothing in the way and,
  // for gradients (`near`), to that over its distance, they stand for the others.
  // Points on each light are spread evenly over all rays from then on, by `random`.
  void use_lamp_samples(int most, bool near, RandomStream random);

  // Rays one by one, then what they all see: their visibility is traced in packets. add() returns
  // the ray's number. `marched` is that ray's march through `boundaries` up to t_end; `random`
  // gives area lights their points.
  void begin();
  int add(const MarchedShells& marched, const Ray& ray, std::span<const double> boundaries,
          double t_end, const ShellJitter& jitter, RandomStream& random);
  void finish(Counters& counters);
  // Of one ray, in no order.
  std::span<const MediumLight> light(int ray) const {
    const auto r = static_cast<std::size_t>(ray);
    return {lights_.data() + ray_ends_[r], ray_ends_[r + 1] - ray_ends_[r]};
  }

  // Of each shell and volume of `marcher` that scatters.
  void stretches(const MarchedShells& marched, const Ray& ray,
                 std::vector<MediumStretch>& stretches) const;

  // Area lights with `samples` points. Visibility is traced.
  SourceAtPoint source_at(const Vec3d& p, int samples, RandomStream& random,
                          Counters& counters) const;
  // What one light, at light sample position u, makes leave p towards a receiver that looks along
  // w, as if nothing were in the way.
  RgbD unshadowed(const Vec3d& p, const Vec3d& w, int light, const Vec2d& u,
                  Counters& counters) const;
  RgbD emission_at(const Vec3d& p) const;
  // What has scattered before and leaves p towards a receiver that looks along w.
  RgbD scattered_again(const Vec3d& p, const Vec3d& w) const;

 private:
  struct Pending {
    std::size_t entry;  // Of lights_.
    int light, volume;
    LightSample sample;
    Vec3d position{0.0}, towards_receiver{0.0};
    RgbD strength;  // Everything but phase, transmittance to the light and visibility.
  };
  // One shell and one light: what light straight from there is asked for.
  struct Chance {
    int shell, light;
    double begin, end;  // Where in the shell the light shines.
    double brings;      // About how much.
    bool is_cut;        // It does not shine in all of the shell.
    bool is_near;       // Its 1/d^2 decides where in the shell the light comes from.
  };
  void find_chances(const MarchedShells& marched, const Ray& ray,
                    std::span<const double> boundaries, double t_end);
  void add_scattering(const MarchedShells& marched, const Ray& ray,
                      std::span<const double> boundaries, const ShellJitter& jitter,
                      RandomStream& random);
  void add_emission(const MarchedShells& marched, const Ray& ray,
                    std::span<const double> boundaries, double t_end, const ShellJitter& jitter);
  Vec2d lamp_point(int light, RandomStream& random);
  void ask(const MarchedShells& marched, const Ray& ray, const Chance& chance, double jitter,
           double factor, RandomStream& random);

  // Weights of moments for one ray, by volume: of the value, and of its derivatives along two axes
  // across the ray.
  struct RayWeights {
    Harmonics value, along_u, along_v;
  };
  void look_along(const Vec3d& w);
  void add_scattered_again(const MarchedShells& marched, const Ray& ray, RandomStream& random);
  void add_scattered_again(const MediumStretch& stretch, const Ray& ray, double factor);

  const Lighting& lighting_;
  Effects effects_;
  bool directional_;
  const IncidentField* scattered_ = nullptr;
  int most_asked_ = 0, lamp_samples_ = 0;
  bool near_ = false;
  struct LampPoints {
    Vec2d shift{0.0};
    int count = 0;
  };
  std::vector<LampPoints> lamp_points_;  // By light; none: at random.
  std::vector<MediumStretch> stretches_;
  std::vector<RayWeights> weights_;  // By volume.
  Frame across_{Vec3d(0.0, 0.0, 1.0)};
  std::vector<MediumLight> lights_;    // Ray after ray.
  std::vector<std::size_t> ray_ends_;  // In lights_, after a 0.
  std::vector<Pending> pending_;
  struct ScatteringShell {
    int index;
    double begin, end, scatters;  // About how much of it reaches the ray's origin.
  };
  std::vector<double> mean_sigma_s_;  // By volume.
  std::vector<ScatteringShell> scattering_;
  std::vector<double> middles_, brightness_;  // Of theirs.
  std::vector<Chance> chances_;
  std::vector<double> shares_;  // Running sums over volumes, for choosing one.
  std::vector<ShadowRay> shadow_rays_;
  std::vector<std::uint8_t> occluded_;
  std::vector<Lighting::Request> requests_;
  std::vector<RgbD> transmittances_;
};

}  // namespace brume
