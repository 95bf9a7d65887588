// The kinds of Light, for make_light(); private to scene/.
#pragma once

#include <memory>
#include <span>

#include "scene/light.h"

namespace brume {

std::unique_ptr<Light> make_quad_light(const QuadLight& description, double unit);
std::unique_ptr<Light> make_environment_light(const EnvironmentLight& description, const Vec3d& up);

// Values that a light's answers depend on, kind first.
void add_values(FingerprintBuilder& fingerprint, Light::Kind kind, std::span<const double> values);

}  // namespace brume
