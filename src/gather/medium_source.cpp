#include "gather/medium_source.h"

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
  double pdf(double t) const {
    return height / ((angle_end - angle_begin) * (height * height + (t - t0) * (t - t0)));
  }
};

// Mean transmittance from a shell to the ray's origin, exp(-tau) (1 - exp(-depth)) / depth: exact
// for a source in proportion to density.
RgbD shell_transmittance(const ShellMarcher& marcher, int shell) {
  const RgbD tau = marcher.tau(shell), depth = marcher.tau(shell + 1) - tau;
  return RgbD(one_minus_exp_over(depth.r), one_minus_exp_over(depth.g),
              one_minus_exp_over(depth.b)) *
         exp_neg(tau);
}

double distance_to_segment(const Ray& ray, const Vec3d& point, double a, double b) {
  const double t = std::clamp((point - ray.origin).dot(ray.direction), a, b);
  return (point - ray.at(t)).length();
}

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
    : lighting_(lighting), effects_(effects), directional_(directional) {}

// Where volumes overlap one of them is chosen by how much it scatters, so that light is asked for
// once a shell however many volumes there are.
void MediumSource::add_scattering(const ShellMarcher& marcher, int shell, const Ray& ray, double a,
                                  double b, double jitter, const RgbD& dimming,
                                  RandomStream& random) {
  const World& world = lighting_.world();
  const auto& volumes = world.medium().volumes();
  chances_.clear();
  double sum = 0;
  for (std::size_t i = 0; i < volumes.size(); ++i)
    chances_.push_back(sum += volumes[i].scatters()
                                  ? mean_component(volumes[i].sigma_s) *
                                        marcher.shell(static_cast<int>(i), shell).integral
                                  : 0);
  if (!(sum > 0)) return;
  std::size_t chosen = 0;
  double share = 1;
  if (volumes.size() > 1) {
    const double u = random.uniform() * sum;
    while (chosen + 1 < volumes.size() && chances_[chosen] <= u) ++chosen;
    share = (chances_[chosen] - (chosen > 0 ? chances_[chosen - 1] : 0)) / sum;
    if (!(share > 0)) return;
  }
  const int v = static_cast<int>(chosen);
  const Volume& volume = volumes[chosen];
  const ShellDensity& density = marcher.shell(v, shell);
  const Vec3d drawn = ray.at(density.t_sample);
  const RgbD drawn_strength = dimming * volume.sigma_s_at(drawn) * (density.integral / share);
  for (std::size_t l = 0; l < world.lights().size(); ++l) {
    const Light& light = *world.lights()[l];
    const Vec2d u = random.uniform2();
    const double begin = std::max(a, lit_[l].begin), end = std::min(b, lit_[l].end);
    if (!(begin < end)) continue;
    Vec3d p = drawn;
    RgbD strength = drawn_strength;
    // Close to a point light the 1/d^2 decides where the light comes from, at the edge of a cone
    // the cone, elsewhere the density does.
    const bool is_near =
        (light.kind() == Light::Kind::Point || light.kind() == Light::Kind::Spot) &&
        distance_to_segment(ray, light.centre(), begin, end) < b - a;
    if (is_near || end - begin < b - a) {
      double t = begin + jitter * (end - begin), length = end - begin;
      if (is_near) {
        const EquiAngular near(ray, light.centre(), begin, end);
        t = std::clamp(near.distance(jitter), begin, end);
        length = 1 / near.pdf(t);
      }
      p = ray.at(t);
      strength = dimming * volume.sigma_s_at(p) * (volume.density_at(p) * length / share);
    }
    const LightSample sample = light.sample(p, u);
    if (is_black(sample.weight) || is_black(strength)) continue;
    pending_.push_back({shell, static_cast<int>(l), v, sample, p, strength * sample.weight});
  }
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
void MediumSource::add_scattered_again(const ShellMarcher& marcher, const Ray& ray,
                                       RandomStream& random) {
  stretches(marcher, ray, stretches_);
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
  ShellLight& shell = shells_[stretch.shell];
  shell.rescattered += strength * scattered_->dot(p, std::span(w.value.data(), is_even ? 1 : all));
  if (!directional_ || is_even || all == 1) return;
  // d_w Q with its sign turned, as for light straight from lights.
  const auto slope = [&](const Harmonics& weights) {
    return scattered_->dot_signed(p, std::span(weights.data(), all));
  };
  shell.directional -=
      outer(strength * slope(w.along_u), across_.u) + outer(strength * slope(w.along_v), across_.v);
}

void MediumSource::stretches(const ShellMarcher& marcher, const Ray& ray,
                             std::vector<MediumStretch>& stretches) const {
  const auto& volumes = lighting_.world().medium().volumes();
  stretches.clear();
  for (int i = 0; i < marcher.shell_count(); ++i)
    for (std::size_t v = 0; v < volumes.size(); ++v) {
      const ShellDensity& density = marcher.shell(static_cast<int>(v), i);
      if (!volumes[v].scatters() || !(density.integral > 0)) continue;
      const RgbD weight = shell_transmittance(marcher, i) *
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

const std::vector<ShellLight>& MediumSource::shells(const ShellMarcher& marcher, const Ray& ray,
                                                    std::span<const double> boundaries,
                                                    double t_end, std::span<const double> jitter,
                                                    RandomStream& random, Counters& counters) {
  const auto& volumes = lighting_.world().medium().volumes();
  const int n = marcher.shell_count();
  shells_.assign(n, ShellLight());
  pending_.clear();
  if (scattered_) look_along(ray.direction);
  lit_.clear();
  if (effects_.scattering)
    for (const auto& light : lighting_.world().lights()) lit_.push_back(light->lit_stretch(ray));
  for (int i = 0; i < n; ++i) {
    const double a = boundaries[i], b = std::min(boundaries[i + 1], t_end);
    const RgbD dimming = shell_transmittance(marcher, i);
    if (effects_.scattering) add_scattering(marcher, i, ray, a, b, jitter[i], dimming, random);
    for (std::size_t v = 0; v < volumes.size(); ++v) {
      const Volume& volume = volumes[v];
      const ShellDensity& density = marcher.shell(static_cast<int>(v), i);
      if (!volume.emits()) continue;
      if (volume.emission.mode == Emission::Mode::Grid) {
        // Fire without smoke glows too: drawn evenly, not by density.
        shells_[i].emitted +=
            dimming * volume.emission_at(ray.at(a + jitter[i] * (b - a))) * (b - a);
      } else if (density.integral > 0) {
        const Vec3d p = ray.at(density.t_sample);
        const double rho = volume.density_at(p);
        if (rho > 0)
          shells_[i].emitted += dimming * volume.emission_at(p) * (density.integral / rho);
      }
    }
  }
  if (scattered_) add_scattered_again(marcher, ray, random);
  if (pending_.empty()) return shells_;

  shadow_rays_.clear();
  for (const Pending& p : pending_) shadow_rays_.push_back(shadow_ray(p.position, p.sample));
  occluded_.resize(pending_.size());
  lighting_.world().tracer().is_occluded(shadow_rays_, occluded_);
  counters.medium_shadow_rays += pending_.size();
  const Vec3d towards_receiver = -ray.direction;
  for (std::size_t i = 0; i < pending_.size(); ++i) {
    if (occluded_[i]) continue;
    const Pending& p = pending_[i];
    const RgbD light =
        p.strength * lighting_.transmittance(p.light, p.sample, p.position, counters);
    const HenyeyGreenstein& phase = volumes[p.volume].phase;
    const Vec3d travel = -p.sample.direction;
    const PhaseValue value = phase.eval_with_derivative(travel, towards_receiver);
    shells_[p.shell].scattered += light * value.p;
    if (directional_ && !phase.is_isotropic())
      shells_[p.shell].directional += outer(light * value.derivative, travel);
  }
  return shells_;
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
