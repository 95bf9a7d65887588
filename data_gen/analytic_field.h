// Density fields whose values, gradients or line integrals are known, to be written as grids and to
// hold grids, marchers and gathers to account.
//
// Lengths are world units. Densities are never negative; a jump (the side of a box) is as sharp as
// the field, and only a grid made of it is as blunt as its voxels.
#pragma once

#include <array>
#include <optional>
#include <variant>
#include <vector>

#include "core/math.h"
#include "data_gen/smoke_plume.h"

namespace brume {

struct ConstantBox {
  Box3d box{Vec3d(-0.5), Vec3d(0.5)};
  double density = 1;  // On the faces too, so that nodes on a face are inside.
};

struct ConstantBall {
  Vec3d centre{0.0};
  double radius = 0.5, density = 1;
};

// max(0, density_at_origin + slope . p): trilinear grids hold it exactly where it is positive.
struct LinearRamp {
  double density_at_origin = 0;
  Vec3d slope{1.0, 0.0, 0.0};
};

// density_at_ground exp(-(up . p) / scale_height), with up . p taken from the ground's height.
struct ExponentialAtmosphere {
  double density_at_ground = 1, scale_height = 1, ground = 0;
  Vec3d up{0.0, 1.0, 0.0};  // Unit length.
};

struct GaussianBump {
  Vec3d centre{0.0};
  double amplitude = 1, width = 0.25;  // amplitude exp(-|p - centre|^2 / (2 width^2))
};
struct GaussianSum {
  double background = 0;
  std::vector<GaussianBump> bumps;
};
// Three bumps of different widths, "G3" of the reference cases.
GaussianSum three_gaussians(double background);

using AnalyticField = std::variant<ConstantBox, ConstantBall, LinearRamp, ExponentialAtmosphere,
                                   GaussianSum, SmokePlume, Dust>;

double density(const AnalyticField& field, const Vec3d& p);
// Nothing for the noises, whose gradients have no closed form. On a jump or a kink: that of the
// side which the field's formula gives.
std::optional<Vec3d> density_gradient(const AnalyticField& field, const Vec3d& p);
// The integral of density along the straight way from a to b; nothing for the noises. Good to about
// 1e-12, of the result or of a whole bump.
std::optional<double> line_integral(const AnalyticField& field, const Vec3d& a, const Vec3d& b);

// Nodes at origin + step (i,j,k), x fastest.
struct Lattice {
  Vec3d origin{0.0};
  double step = 1;
  Vec3i count{2};

  Vec3d node(const Vec3i& i) const { return origin + Vec3d(i.x, i.y, i.z) * step; }
  Affine3d index_to_world() const;
};

// Nodes that begin on bounds.min and reach at least bounds.max: exactly, where the extent is a
// multiple of the step. Throws Error(InvalidInput) for an empty box, a step that is not positive,
// or more than 2^31 nodes.
Lattice covering_lattice(const Box3d& bounds, double step);

// The field at the nodes; the same for any number of threads.
std::vector<float> sample_field(const AnalyticField& field, const Lattice& lattice,
                                int threads = 0);

}  // namespace brume
