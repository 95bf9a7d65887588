// Orders of scattering and bounces of the path tracer's cached transport, against the integral
// equation of a wide isotropic slab over a glowing, reflecting floor, solved by numbers alone.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>

#include "plan/effects.h"
#include "support/scene_builder.h"
#include "support/sensor.h"

namespace brume {
namespace {

using test::expect_near;
using test::options_of;
using test::Sensor;

enum class Sun { Overhead, EvenSky };

constexpr double kHeight = 1, kWidth = 4000, kMedium = 0.15, kFloor = 0.4, kLight = 2;
constexpr double kEyeCosine = 0.8;
// tau and albedo of each channel, and what the floor reflects.
const RgbD kTau(1.5, 1.0, 0.6), kAlbedo(0.9, 0.5, 0.8), kReflectance(0.7, 0.5, 0.2);

// Exponential integrals; E_n(0) = 1 / (n - 1).
double e2(double x) { return x > 0 ? std::exp(-x) + x * std::expint(-x) : 1; }
double e3(double x) { return (std::exp(-x) - x * e2(x)) / 2; }

// The source of scattered light as a function of the depth tau below the slab's top, constant over
// cells of equal depth: J = albedo (J_direct + 1/2 integral of E_1(|tau - tau'|) (J' + emission)
// + 1/2 E_2 (tau of the floor - tau) L_floor), J' being that of paths with a scattering less left.
class SlabOnFloor {
 public:
  SlabOnFloor(Sun sun, int channel)
      : sun_(sun),
        depth_(kTau[channel]),
        albedo_(kAlbedo[channel]),
        reflectance_(double(float(kReflectance[channel]))) {
    for (int i = 0; i < kCells; ++i) exchange_[i] = exchange(i);
  }

  double slab_emission() const { return kMedium * (1 - passed(depth_)); }
  double floor_emission() const { return kFloor * passed(depth_); }
  double floor_direct() const { return passed(depth_) * reflectance_ / kPi * direct_irradiance(); }
  double floor_indirect(int bounces, int orders) {
    if (bounces == 0) return 0;
    return passed(depth_) * reflectance_ / kPi * medium_irradiance(bounces, orders);
  }
  double slab_direct() const {
    double sum = 0;
    for (int i = 0; i < kCells; ++i) sum += direct_source(middle(i)) * seen(i);
    return sum;
  }
  double slab_indirect(int bounces, int orders) {
    if (orders == 0) return 0;
    const Source& source = scattered(bounces, 1, orders);
    double sum = -slab_direct();
    for (int i = 0; i < kCells; ++i) sum += source[i] * seen(i);
    return sum;
  }

 private:
  static constexpr int kCells = 150;
  using Source = std::array<double, kCells>;

  double edge(int i) const { return depth_ * i / kCells; }
  double middle(int i) const { return depth_ * (i + 0.5) / kCells; }
  static double passed(double tau) { return std::exp(-tau / kEyeCosine); }
  double seen(int i) const { return passed(edge(i)) - passed(edge(i + 1)); }

  double direct_irradiance() const {
    return sun_ == Sun::Overhead ? kLight * std::exp(-depth_) : 2 * kPi * kLight * e3(depth_);
  }
  double direct_source(double tau) const {
    return albedo_ * kLight *
           (sun_ == Sun::Overhead ? std::exp(-tau) / (4 * kPi) : e2(tau) / 2);
  }
  // Of the light that the medium emits and scatters, with that limit on the bounces before.
  double medium_irradiance(int level, int orders) {
    double sum = 0;
    for (int i = 0; i < kCells; ++i) {
      const double source = kMedium + (orders > 0 ? scattered(level, 1, orders)[i] : 0);
      sum += 2 * kPi * source * (e3(depth_ - edge(i + 1)) - e3(depth_ - edge(i)));
    }
    return sum;
  }
  // Radiance that the floor sends up.
  double floor_radiance(int level, int orders) {
    if (level == 0) return kFloor;
    return kFloor + reflectance_ / kPi *
                        (direct_irradiance() + medium_irradiance(level - 1, orders));
  }
  // Scattered radiance per unit of tau at the `count`th scattering since the last surface, seen
  // from the eye; `level` more reflections are allowed beyond it.
  const Source& scattered(int level, int count, int orders) {
    // Beyond 80 scatterings nothing is left of this slab.
    const int left = std::min(orders - count, 80 - count);
    if (const auto known = known_.find({level, left}); known != known_.end()) return known->second;
    Source source;
    for (int i = 0; i < kCells; ++i) source[i] = direct_source(middle(i));
    if (left > 0) {
      const Source& next = scattered(level, count + 1, orders);
      const double floor = floor_radiance(level, orders);
      for (int i = 0; i < kCells; ++i) {
        double mean = floor * e2(depth_ - middle(i)) / 2;
        for (int j = 0; j < kCells; ++j) mean += (kMedium + next[j]) * exchange_[std::abs(i - j)];
        source[i] += albedo_ * mean;
      }
    }
    return known_[{level, left}] = source;
  }
  // 1/2 integral of E_1(|tau_i - tau|) over a cell so many cells away.
  double exchange(int away) const {
    const double h = depth_ / kCells;
    return away == 0 ? 1 - e2(h / 2) : (e2((away - 0.5) * h) - e2((away + 0.5) * h)) / 2;
  }

  Sun sun_;
  double depth_, albedo_, reflectance_;
  Source exchange_;  // By cells between.
  std::map<std::pair<int, int>, Source> known_;  // By level and scatterings left.
};

Scene slab_on_floor(Sun sun) {
  Scene scene;
  Material floor = test::gathered_emitter(kFloor);
  floor.albedo = Rgb(kReflectance);
  const double half = kWidth / 2;
  test::add_rectangle(scene, {-half, 0, -half}, {0, 0, kWidth}, {kWidth, 0, 0},
                      test::add_material(scene, floor));
  Volume slab;
  slab.bounds = Box3d({-half, 0, -half}, {half, kHeight, half});
  slab.sigma_s = kAlbedo * kTau / kHeight;
  slab.sigma_a = (RgbD(1.0) - kAlbedo) * kTau / kHeight;
  slab.emission.mode = Emission::Mode::Density;
  slab.emission.scale = kMedium;
  scene.volumes = {slab};
  if (sun == Sun::Overhead)
    scene.lights = {DirectionalLight{{0, -1, 0}, Rgb(float(kLight))}};
  else
    scene.lights = {EnvironmentLight{{}, Rgb(float(kLight))}};
  return scene;
}

struct Limits {
  Transport transport;
  int bounces, volume_bounces;
};

class MultipleScattering : public testing::TestWithParam<std::tuple<Sun, Limits>> {};

TEST_P(MultipleScattering, OfASlabOnAFloorSolvesTheIntegralEquation) {
  const auto& [sun, limits] = GetParam();
  const World world(slab_on_floor(sun));
  const double run = std::sqrt(1 - kEyeCosine * kEyeCosine) / kEyeCosine;
  Sensor sensor({0, 3, 0}, {3 * run, 0, 0}, 20);
  PathTracerOptions options = options_of(limits.transport, 160, limits.bounces);
  options.volume_bounces = limits.volume_bounces;
  sensor.expose(world, options);

  RgbD volume_direct, volume_indirect, volume_emission, emission, direct, indirect;
  for (int c = 0; c < 3; ++c) {
    SlabOnFloor slab(sun, c);
    volume_direct[c] = limits.volume_bounces > 0 ? slab.slab_direct() : 0;
    volume_indirect[c] = slab.slab_indirect(limits.bounces, limits.volume_bounces);
    volume_emission[c] = slab.slab_emission();
    emission[c] = slab.floor_emission();
    direct[c] = slab.floor_direct();
    indirect[c] = slab.floor_indirect(limits.bounces, limits.volume_bounces);
  }
  // 150 cells leave 1e-4 of the answer.
  constexpr double kCellError = 5e-4, kMostError = 0.015;
  expect_near(sensor.layer(Layer::VolumeDirect), volume_direct, kCellError, kMostError);
  expect_near(sensor.layer(Layer::VolumeIndirect), volume_indirect, kCellError, kMostError);
  expect_near(sensor.layer(Layer::VolumeEmission), volume_emission, kCellError, kMostError);
  expect_near(sensor.layer(Layer::Emission), emission, kCellError, kMostError);
  expect_near(sensor.layer(Layer::DiffuseDirect), direct, kCellError, kMostError);
  expect_near(sensor.layer(Layer::DiffuseIndirect), indirect, kCellError, kMostError);
}

INSTANTIATE_TEST_SUITE_P(
    OrdersAndBounces, MultipleScattering,
    testing::Combine(testing::Values(Sun::Overhead, Sun::EvenSky),
                     testing::Values(Limits{Transport::Cached, 2, 0},
                                     Limits{Transport::Cached, 2, 1},
                                     Limits{Transport::Cached, 0, 2},
                                     Limits{Transport::Cached, 1, 2},
                                     Limits{Transport::Cached, 2, 3},
                                     Limits{Transport::Cached, 0, kEveryOrder},
                                     Limits{Transport::Cached, 1, kEveryOrder},
                                     // Of many bounces nothing is left either.
                                     Limits{Transport::Full, 12, kEveryOrder})),
    [](const auto& instance) {
      const Limits& limits = std::get<1>(instance.param);
      return std::string(std::get<0>(instance.param) == Sun::Overhead ? "Sun" : "Sky") +
             (limits.transport == Transport::Full ? "Full" : "Cached") +
             std::to_string(limits.bounces) + "Order" +
             (limits.volume_bounces == kEveryOrder ? "Any" : std::to_string(limits.volume_bounces));
    });

}  // namespace
}  // namespace brume
