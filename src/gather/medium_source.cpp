#include "gather/medium_source.h"

#include "core/lattice.h"

namespace brume {
namespace {

// Distances along a ray in proportion to 1/d^2 from a point near it (equi-angular,
// gradients.md 7.5).
struct EquiAngular {
  double t0, height, angle_begin, angle_end;

  EquiAngular(const Ray& ray, const Vec3d& point, double a, double b) {
    t0 = (point - ray.origin).dot(ray.direction);
    // A floor keeps a ray through the light finite; it is far below any voxel.
    height = std::max((point - ray.at(t0)).length(), 1e-7 * (b - a));
    angle_begin = std::atan((a - t0) / height);
    angle_end = std::atan((b - t0) / height);
  }
  double distance(double u) const {
    return t0 + height * std::tan(angle_begin + u * (angle_end - angle_begin));
  }
  double mean_inverse_square(double a, double b) const {
    return (angle_end - angle_begin) / (height * (b - a));
  }
  double pdf(double t) const {
    return height / ((angle_end - angle_begin) * (height * height + (t - t0) * (t - t0)));
  }
};

}  // namespace

RgbD SourceAtPoint::towards(const Vec3d& direction) const {
  RgbD sum = even_;
  for (const Incident& i : lobes_) sum += i.strength * i.phase.eval(i.travel, direction);
  if (moments_.empty()) return sum;
  Harmonics y;
  evaluate_harmonics(order_, -direction, y);
  for (std::size_t k = 0; k < moments_.size(); ++k) sum += moments_[k] * y[k + 1];
  for (int c = 0; c < 3; ++c) sum[c] = std::max(0.0, sum[c]);
  return sum;
}

MediumSource::MediumSource(const Lighting& lighting, const Effects& effects, bool directional)
    : lighting_(lighting), effects_(effects), directional_(directional) {
  for (const Volume& v : lighting.world().medium().volumes())
    mean_sigma_s_.push_back(v.scatters() ? mean_component(v.sigma_s) : 0);
}

void MediumSource::use_lamp_samples(int most, bool near, RandomStream random) {
  lamp_samples_ = most;
  near_ = near;
  lamp_points_.clear();
  for (std::size_t l = 0; l < lighting_.world().lights().size(); ++l)
    lamp_points_.push_back({random.uniform2(), 0});
}

Vec2d MediumSource::lamp_point(int light, RandomStream& random) {
  if (lamp_points_.empty()) return random.uniform2();
  LampPoints& points = lamp_points_[static_cast<std::size_t>(light)];
  return lattice_point(points.count++, points.shift);
}

// Every pair of a shell that scatters and a light that shines there.
void MediumSource::find_chances(const MarchedShells& marched, const Ray& ray,
                                std::span<const double> boundaries, double t_end) {
  chances_.clear();
  scattering_.clear();
  middles_.clear();
  for (int i = 0; i < marched.shell_count(); ++i) {
    double scatters = 0;
    for (std::size_t v = 0; v < mean_sigma_s_.size(); ++v)
      scatters += mean_sigma_s_[v] * marched.shell(static_cast<int>(v), i).integral;
    if (!(scatters > 0)) continue;
    const double a = boundaries[i], b = std::min(boundaries[i + 1], t_end);
    scattering_.push_back({i, a, b, scatters * mean_component(marched.transmittance(i))});
    middles_.push_back(0.5 * (a + b));
  }
  brightness_.assign(middles_.size(), 1);
  const auto& lights = lighting_.world().lights();
  for (std::size_t l = 0; l < lights.size(); ++l) {
    const Light& light = *lights[l];
    const Interval lit = light.lit_stretch(ray);
    if (lamp_samples_ > 0) light.brightness_along(ray, middles_, brightness_);
    const bool is_point = light.kind() == Light::Kind::Point || light.kind() == Light::Kind::Spot;
    const Vec3d centre = light.centre();
    const double t0 = (centre - ray.origin).dot(ray.direction);
    const double height2 = is_point ? (centre - ray.at(t0)).length2() : kInfinity;
    for (std::size_t i = 0; i < scattering_.size(); ++i) {
      const ScatteringShell& shell = scattering_[i];
      const double begin = std::max(shell.begin, lit.begin), end = std::min(shell.end, lit.end);
      if (!(begin < end)) continue;
      // Close to a point light the 1/d^2 decides where the light comes from, at the edge of a cone
      // the cone, elsewhere the density does.
      const double length = shell.end - shell.begin;
      const double beside = std::max({0.0, begin - t0, t0 - end});
      const bool is_near = height2 + beside * beside < length * length;
      const bool is_cut = end - begin < length;
      double brings = shell.scatters * brightness_[i];
      if (is_cut) brings *= (end - begin) / length;
      if (is_near && lamp_samples_ > 0) {
        const EquiAngular near(ray, centre, begin, end);
        const double middle = middles_[i] - t0;
        brings *= (height2 + middle * middle) * near.mean_inverse_square(begin, end);
      }
      if (brings > 0)
        chances_.push_back({shell.index, static_cast<int>(l), begin, end, brings, is_cut, is_near});
    }
  }
}

// Evenly along the running sum of what is drawn by.
void MediumSource::add_scattering(const MarchedShells& marched, const Ray& ray,
                                  std::span<const double> boundaries, const ShellJitter& jitter,
                                  RandomStream& random) {
  if (lamp_samples_ == 0 || chances_.size() <= static_cast<std::size_t>(lamp_samples_)) {
    for (const Chance& c : chances_) ask(marched, ray, c, jitter.at(c.shell), 1, random);
    return;
  }
  const auto inverse_t = [&](const Chance& c) {
    return 2 / (boundaries[c.shell] + boundaries[c.shell + 1]);
  };
  double sum = 0, over_distance = 0;
  for (const Chance& c : chances_) {
    sum += c.brings;
    over_distance += c.brings * inverse_t(c);
  }
  const double distance = near_ && over_distance > 0 ? sum / over_distance : 0;
  const double spacing = sum * (near_ ? 2 : 1) / lamp_samples_;
  double next = random.uniform() * spacing, running = 0;
  for (const Chance& c : chances_) {
    const double share = c.brings * (1 + distance * inverse_t(c));
    int times = 0;
    for (running += share; next < running; next += spacing) ++times;
    if (times > 0) ask(marched, ray, c, jitter.at(c.shell), times * spacing / share, random);
  }
}

// Where volumes overlap one of them is chosen by how much it scatters.
void MediumSource::ask(const MarchedShells& marched, const Ray& ray, const Chance& chance,
                       double jitter, double factor, RandomStream& random) {
  const World& world = lighting_.world();
  const auto& volumes = world.medium().volumes();
  shares_.clear();
  double sum = 0;
  for (std::size_t i = 0; i < volumes.size(); ++i)
    shares_.push_back(sum +=
                      mean_sigma_s_[i] * marched.shell(static_cast<int>(i), chance.shell).integral);
  std::size_t chosen = 0;
  double share = 1;
  if (volumes.size() > 1) {
    const double u = random.uniform() * sum;
    while (chosen + 1 < volumes.size() && shares_[chosen] <= u) ++chosen;
    share = (shares_[chosen] - (chosen > 0 ? shares_[chosen - 1] : 0)) / sum;
    if (!(share > 0)) return;
  }
  const int v = static_cast<int>(chosen);
  const Volume& volume = volumes[chosen];
  const ShellDensity density = marched.shell(v, chance.shell);
  const Light& light = *world.lights()[static_cast<std::size_t>(chance.light)];
  const Vec2d u = lamp_point(chance.light, random);
  const RgbD dimming = marched.transmittance(chance.shell) * (factor / share);
  Vec3d p = ray.at(density.t_sample);
  double integral = density.integral;
  if (chance.is_near || chance.is_cut) {
    double t = chance.begin + jitter * (chance.end - chance.begin);
    double length = chance.end - chance.begin;
    if (chance.is_near) {
      const EquiAngular near(ray, light.centre(), chance.begin, chance.end);
      t = std::clamp(near.distance(jitter), chance.begin, chance.end);
      length = 1 / near.pdf(t);
    }
    p = ray.at(t);
    integral = volume.density_at(p) * length;
  }
  const RgbD strength = dimming * volume.sigma_s_at(p) * integral;
  const LightSample sample = light.sample(p, u);
  if (is_black(sample.weight) || is_black(strength)) return;
  pending_.push_back(
      {lights_.size(), chance.light, v, sample, p, -ray.direction, strength * sample.weight});
  lights_.push_back({MediumLight::Kind::Direct, chance.shell, {}, {}});
}

void MediumSource::look_along(const Vec3d& w) {
  constexpr double kStep = 1e-3;
  const auto& volumes = lighting_.world().medium().volumes();
  const int order = scattered_->order();
  weights_.resize(volumes.size());
  Harmonics at_w;
  evaluate_harmonics(order, w, at_w);
  for (std::size_t v = 0; v < volumes.size(); ++v)
    phase_weights(volumes[v].phase.g(), order, at_w, weights_[v].value);
  if (!directional_ || order == 0) return;
  across_ = Frame(w);
  const auto slope = [&](const Vec3d& e, Harmonics RayWeights::*of) {
    Harmonics ahead, behind;
    evaluate_harmonics(order, (w + e * kStep).normalized(), ahead);
    evaluate_harmonics(order, (w - e * kStep).normalized(), behind);
    for (int k = 0; k < harmonic_count(order); ++k) ahead[k] = (ahead[k] - behind[k]) / (2 * kStep);
    for (std::size_t v = 0; v < volumes.size(); ++v)
      phase_weights(volumes[v].phase.g(), order, ahead, weights_[v].*of);
  };
  slope(across_.u, &RayWeights::along_u);
  slope(across_.v, &RayWeights::along_v);
}

// Drawn evenly along the running sum of what stretches scatter.
void MediumSource::add_scattered_again(const MarchedShells& marched, const Ray& ray,
                                       RandomStream& random) {
  stretches(marched, ray, stretches_);
  double sum = 0;
  for (const MediumStretch& s : stretches_) sum += mean_component(s.weight);
  const double asked = std::max(1.0, std::ceil(most_asked_ * std::min(1.0, sum)));
  const bool asks_all = most_asked_ == 0 || asked >= double(stretches_.size());
  const double spacing = sum / asked;
  double next = asks_all ? 0 : random.uniform() * spacing, running = 0;
  for (const MediumStretch& s : stretches_) {
    if (asks_all) {
      add_scattered_again(s, ray, 1);
      continue;
    }
    const double share = mean_component(s.weight);
    int times = 0;
    for (running += share; next < running; next += spacing) ++times;
    if (times > 0) add_scattered_again(s, ray, times * spacing / share);
  }
}

// At the place that stands for the shell's density: where dense smoke is bright, both belong
// together.
void MediumSource::add_scattered_again(const MediumStretch& stretch, const Ray& ray,
                                       double factor) {
  const Volume& volume = lighting_.world().medium().volumes()[stretch.volume];
  const std::size_t all = harmonic_count(scattered_->order());
  const Vec3d p = ray.at(stretch.distance);
  const RgbD strength = stretch.weight * factor;
  const bool is_even = volume.phase.is_isotropic();
  const RayWeights& w = weights_[stretch.volume];
  const RgbD light = strength * scattered_->dot(p, std::span(w.value.data(), is_even ? 1 : all));
  lights_.push_back({MediumLight::Kind::Rescattered, stretch.shell, light, {}});
  if (!directional_ || is_even || all == 1) return;
  // d_w Q with its sign turned, as for light straight from lights.
  const auto slope = [&](const Harmonics& weights) {
    return scattered_->dot_signed(p, std::span(weights.data(), all));
  };
  lights_.back().directional -=
      outer(strength * slope(w.along_u), across_.u) + outer(strength * slope(w.along_v), across_.v);
}

void MediumSource::stretches(const MarchedShells& marched, const Ray& ray,
                             std::vector<MediumStretch>& stretches) const {
  const auto& volumes = lighting_.world().medium().volumes();
  stretches.clear();
  for (int i = 0; i < marched.shell_count(); ++i)
    for (std::size_t v = 0; v < volumes.size(); ++v) {
      const ShellDensity density = marched.shell(static_cast<int>(v), i);
      if (!volumes[v].scatters() || !(density.integral > 0)) continue;
      const RgbD weight = marched.transmittance(i) *
                          volumes[v].sigma_s_at(ray.at(density.t_sample)) * density.integral;
      if (!is_black(weight))
        stretches.push_back({i, static_cast<int>(v), density.t_sample, weight});
    }
}

RgbD MediumSource::scattered_again(const Vec3d& p, const Vec3d& w) const {
  RgbD sum;
  if (!scattered_) return sum;
  Harmonics at_w, weights;
  evaluate_harmonics(scattered_->order(), w, at_w);
  for (const Volume& v : lighting_.world().medium().volumes()) {
    if (!v.scatters()) continue;
    phase_weights(v.phase.g(), scattered_->order(), at_w, weights);
    const std::span all(weights.data(), harmonic_count(scattered_->order()));
    sum += v.sigma_s_at(p) * v.density_at(p) * scattered_->dot(p, all);
  }
  return sum;
}

void MediumSource::begin() {
  lights_.clear();
  ray_ends_.assign(1, 0);
  pending_.clear();
}

int MediumSource::add(const MarchedShells& marched, const Ray& ray,
                      std::span<const double> boundaries, double t_end, const ShellJitter& jitter,
                      RandomStream& random) {
  if (effects_.scattering) {
    find_chances(marched, ray, boundaries, t_end);
    add_scattering(marched, ray, boundaries, jitter, random);
  }
  if (effects_.emission) add_emission(marched, ray, boundaries, t_end, jitter);
  if (scattered_) {
    look_along(ray.direction);
    add_scattered_again(marched, ray, random);
  }
  ray_ends_.push_back(lights_.size());
  return static_cast<int>(ray_ends_.size()) - 2;
}

void MediumSource::add_emission(const MarchedShells& marched, const Ray& ray,
                                std::span<const double> boundaries, double t_end,
                                const ShellJitter& jitter) {
  const auto& volumes = lighting_.world().medium().volumes();
  for (int i = 0; i < marched.shell_count(); ++i) {
    const double a = boundaries[i], b = std::min(boundaries[i + 1], t_end);
    RgbD light;
    for (std::size_t v = 0; v < volumes.size(); ++v) {
      const Volume& volume = volumes[v];
      if (!volume.emits()) continue;
      if (volume.emission.mode == Emission::Mode::Grid) {
        // Fire without smoke glows too: drawn evenly, not by density.
        light += volume.emission_at(ray.at(a + jitter.at(i) * (b - a))) * (b - a);
        continue;
      }
      const ShellDensity density = marched.shell(static_cast<int>(v), i);
      if (!(density.integral > 0)) continue;
      const Vec3d p = ray.at(density.t_sample);
      const double rho = volume.density_at(p);
      if (rho > 0) light += volume.emission_at(p) * (density.integral / rho);
    }
    if (!is_black(light))
      lights_.push_back({MediumLight::Kind::Emitted, i, light * marched.transmittance(i), {}});
  }
}

void MediumSource::finish(Counters& counters) {
  if (pending_.empty()) return;
  const auto& volumes = lighting_.world().medium().volumes();
  shadow_rays_.clear();
  for (const Pending& p : pending_) shadow_rays_.push_back(shadow_ray(p.position, p.sample));
  occluded_.resize(pending_.size());
  lighting_.world().tracer().is_occluded(shadow_rays_, occluded_);
  counters.medium_shadow_rays += pending_.size();
  requests_.clear();
  for (std::size_t i = 0; i < pending_.size(); ++i)
    if (!occluded_[i])
      requests_.push_back({pending_[i].light, pending_[i].sample, pending_[i].position});
  transmittances_.resize(requests_.size());
  lighting_.transmittances(requests_, transmittances_, counters);
  for (std::size_t i = 0, lit = 0; i < pending_.size(); ++i) {
    if (occluded_[i]) continue;
    const Pending& p = pending_[i];
    const RgbD light = p.strength * transmittances_[lit++];
    const HenyeyGreenstein& phase = volumes[p.volume].phase;
    const Vec3d travel = -p.sample.direction;
    const PhaseValue value = phase.eval_with_derivative(travel, p.towards_receiver);
    lights_[p.entry].light = light * value.p;
    if (directional_ && !phase.is_isotropic())
      lights_[p.entry].directional = outer(light * value.derivative, travel);
  }
}

RgbD MediumSource::unshadowed(const Vec3d& p, const Vec3d& w, int light, const Vec2d& u,
                              Counters& counters) const {
  const World& world = lighting_.world();
  const LightSample s = world.lights()[light]->sample(p, u);
  if (is_black(s.weight)) return {};
  RgbD strength;
  for (const Volume& v : world.medium().volumes())
    if (v.scatters())
      strength += v.sigma_s_at(p) * (v.density_at(p) * v.phase.eval(-s.direction, -w));
  if (is_black(strength)) return {};
  return strength * s.weight * lighting_.transmittance(light, s, p, counters);
}

RgbD MediumSource::emission_at(const Vec3d& p) const {
  RgbD sum;
  for (const Volume& v : lighting_.world().medium().volumes())
    if (v.emits()) sum += v.emission_at(p);
  return sum;
}

SourceAtPoint MediumSource::source_at(const Vec3d& p, int samples, RandomStream& random,
                                      Counters& counters) const {
  const World& world = lighting_.world();
  SourceAtPoint source;
  source.even_ = emission_at(p);
  if (scattered_) {
    const int all = harmonic_count(scattered_->order());
    source.order_ = scattered_->order();
    source.moments_.assign(all - 1, RgbD());
    for (const Volume& v : world.medium().volumes()) {
      if (!v.scatters()) continue;
      const RgbD strength = v.sigma_s_at(p) * v.density_at(p);
      double factor = 0.25 * kInvPi;
      for (int l = 0, k = 0; l <= source.order_; ++l, factor *= v.phase.g())
        for (; k < (l + 1) * (l + 1); ++k) {
          const RgbD moment = strength * scattered_->moment(p, k) * factor;
          if (k == 0)
            source.even_ += moment;
          else
            source.moments_[k - 1] += moment;
        }
    }
  }
  if (!effects_.scattering) return source;
  for (std::size_t l = 0; l < world.lights().size(); ++l) {
    const Light& light = *world.lights()[l];
    const int n = light.is_delta() ? 1 : samples;
    for (int i = 0; i < n; ++i) {
      const LightSample s = light.sample(p, random.uniform2());
      if (is_black(s.weight)) continue;
      ++counters.medium_shadow_rays;
      if (world.tracer().is_occluded(shadow_ray(p, s))) continue;
      const RgbD incident =
          s.weight * lighting_.transmittance(static_cast<int>(l), s, p, counters) / double(n);
      for (const Volume& v : world.medium().volumes()) {
        if (!v.scatters()) continue;
        const RgbD scattered = incident * v.sigma_s_at(p) * v.density_at(p);
        if (is_black(scattered)) continue;
        if (v.phase.is_isotropic())
          source.even_ += scattered * (0.25 * kInvPi);
        else
          source.lobes_.push_back({v.phase, -s.direction, scattered});
      }
    }
  }
  return source;
}

}  // namespace brume
