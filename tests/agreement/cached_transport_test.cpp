// The cached integrator against answers that hold every order of scattering: slabs by doubling, within
// 1 % of the larger of the answer and 0.02, and furnaces.
#include <gtest/gtest.h>

#include <cstdlib>

#include "bake/scene_settings.h"
#include "data_gen/transport_scenes.h"
#include "render/cached_renderer.h"
#include "scene/scene_file.h"
#include "support/plane_slab.h"
#include "support/scratch_folder.h"

namespace brume {
namespace {

using test::PlaneSlab;
using test::SlabFluxes;

// A scene, its light and all records that do not depend on a view.
class Stage {
 public:
  explicit Stage(const std::filesystem::path& file)
      : scene_(load_scene(file, {})), world_(scene_), lighting_(world_, {.threads = 2}) {
    settings_ = settings_of(scene_.render);
    settings_.volume_bounces = kEveryOrder;
    BakeRequest request;
    request.threads = 2;
    request.deep_only = true;
    deep_ = bake(lighting_, settings_, request, nullptr);
  }
  std::size_t volume_records() const { return deep_.deep.volume_records; }
  double truncation_bound() const { return deep_.deep.truncation_bound; }

  // Mean luminance over blocks of pixels, row by row.
  std::vector<double> see(const std::string& camera, int size, int block) const {
    BakeRequest request;
    request.threads = 2;
    request.views = {{camera, scene_.find_camera(camera), size, size}};
    const BakeResult baked = bake(lighting_, settings_, request, deep_.cache.get());
    PixelFilm film(size, size);
    CachedRenderOptions options;
    options.threads = 2;
    render_cached(lighting_, settings_, *baked.cache,
                  CameraRays(request.views[0].camera, size, size), options, film);
    std::vector<double> means;
    for (int by = 0; by < size; by += block)
      for (int bx = 0; bx < size; bx += block) {
        double sum = 0;
        for (int i = 0; i < block * block; ++i)
          sum += luminance(film.at(bx + i % block, by + i / block).beauty());
        means.push_back(sum / block / block);
      }
    return means;
  }
  // Over enough pixels that the noise of single records does not count.
  double see(const std::string& camera) const { return see(camera, 12, 12)[0]; }

 private:
  Scene scene_;
  World world_;
  Lighting lighting_;
  BakeSettings settings_;
  BakeResult deep_;
};

bool is_shown() { return std::getenv("BRUME_SHOW_AGREEMENT") != nullptr; }

struct SlabCase {
  double optical_depth, albedo, g;
  bool is_diffuse;
};
class CachedSlab : public testing::TestWithParam<SlabCase> {};

TEST_P(CachedSlab, ReflectsAndTransmitsWhatDoublingSays) {
  const SlabCase& c = GetParam();
  const ScratchFolder folder;
  SlabOptions options;
  options.optical_depth = c.optical_depth;
  options.albedo = c.albedo;
  options.anisotropy = c.g;
  if (c.is_diffuse) options.incidence = SlabOptions::Incidence::Diffuse;
  const Stage stage(write_slab(folder.path(), options).front());
  const PlaneSlab slab(c.optical_depth, c.albedo, c.g);
  const SlabFluxes truth = c.is_diffuse ? slab.diffuse() : slab.normal();
  const double reflected = stage.see("reflection"), transmitted = stage.see("transmission");
  if (is_shown())
    std::printf("depth %g, albedo %g, g %g, %s: reflects %.5f (%.5f), transmits %.5f (%.5f); %zu records, "
                "bound %.1e\n",
                c.optical_depth, c.albedo, c.g, c.is_diffuse ? "diffuse" : "beam", reflected,
                truth.reflected, transmitted, truth.transmitted, stage.volume_records(),
                stage.truncation_bound());
  EXPECT_NEAR(reflected, truth.reflected, 0.01 * std::max(0.02, truth.reflected));
  EXPECT_NEAR(transmitted, truth.transmitted, 0.01 * std::max(0.02, truth.transmitted));
  EXPECT_LT(stage.truncation_bound(), 1.5e-3);
}

INSTANTIATE_TEST_SUITE_P(Media, CachedSlab,
                         testing::Values(SlabCase{0.2, 0.9, 0, false}, SlabCase{0.2, 1, 0, true},
                                         SlabCase{1, 0.2, 0, false}, SlabCase{1, 1, 0, true},
                                         SlabCase{1, 0.9, 0.5, false}));

class CachedFurnace : public testing::TestWithParam<FurnaceOptions> {};

TEST_P(CachedFurnace, IsWhite) {
  const ScratchFolder folder;
  const Stage stage(write_furnace(folder.path(), GetParam()).front());
  const std::vector<double> blocks = stage.see("", 32, 8);
  double mean = 0, worst = 0;
  for (const double b : blocks) {
    mean += b / double(blocks.size());
    worst = std::max(worst, std::abs(b - 1));
  }
  if (is_shown())
    std::printf("furnace of depth %g, g %g: mean %.4f, worst block %.4f; %zu records\n",
                GetParam().optical_depth, GetParam().anisotropy, mean, worst,
                stage.volume_records());
  EXPECT_NEAR(mean, 1, 0.01);
  EXPECT_LT(worst, 0.035);
}

INSTANTIATE_TEST_SUITE_P(Media, CachedFurnace,
                         testing::Values(FurnaceOptions{.optical_depth = 2},
                                         FurnaceOptions{.optical_depth = 1, .anisotropy = 0.5}));

}  // namespace
}  // namespace brume
