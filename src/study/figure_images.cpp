#include "study/figure_images.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/error.h"
#include "core/image.h"
#include "render/false_colour.h"
#include "render/preview.h"

namespace brume {
namespace {

constexpr std::array<std::uint8_t, 3> kCovered{52, 58,
                                               70};  // Where something stands on the ground.
constexpr std::array<std::uint8_t, 3> kSite{255, 120, 0};
constexpr int kShownPixels = 320;  // Maps are enlarged to about this width.

std::uint8_t srgb_byte(double linear) {
  return static_cast<std::uint8_t>(std::lround(255 * srgb_encoded(std::clamp(linear, 0.0, 1.0))));
}

// The value that `share` of them do not exceed.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + std::lround(share * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// colour(i) for each pixel of the map that is ground, in squares.
template <typename Colour>
Picture ground_picture(const GroundStudy& study, Colour colour) {
  const int n = study.pixels, scale = std::max(1, kShownPixels / n);
  Picture picture(n * scale, n * scale);
  for (int y = 0; y < n * scale; ++y)
    for (int x = 0; x < n * scale; ++x) {
      const auto i = static_cast<std::size_t>(y / scale * n + x / scale);
      picture.set(x, y, study.is_ground[i] ? colour(i) : kCovered);
    }
  return picture;
}

class ImageFolder {
 public:
  ImageFolder(const std::filesystem::path& folder, const std::string& name)
      : folder_(folder), name_(name) {}

  std::filesystem::path path(const std::string& what) const {
    return folder_ / (name_ + "_" + what + ".png");
  }
  FigureImage write(const Picture& picture, const std::string& what, const std::string& title,
                    const std::string& numbers) const {
    write_png(path(what), picture.width, picture.height, picture.srgb);
    return {path(what), title, numbers};
  }

 private:
  std::filesystem::path folder_;
  std::string name_;
};

std::string percent(double part) { return short_number(100 * part) + " %"; }

FigureRow gradient_row(const GroundStudy& study, const ImageFolder& folder) {
  // One exposure for all, from the gradients that use all samples best.
  std::vector<double> sizes;
  for (const Vec2d& g : study.gradient[static_cast<std::size_t>(GradientSource::FineDifferences)]) {
    sizes.push_back(std::abs(g.x));
    sizes.push_back(std::abs(g.y));
  }
  const double white = std::max(1e-30, quantile(sizes, 0.98));
  FigureRow row;
  row.heading = "Gradient of irradiance";
  row.scale = "Red |dE/dx|, blue |dE/dz|; full brightness " + short_number(white) +
              " W/m³ in every picture (x to the right, z downwards; gamma as irradiance)";
  for (std::size_t s = 0; s < kSourceCount; ++s) {
    const auto& g = study.gradient[s];
    const Picture picture = ground_picture(study, [&](std::size_t i) {
      return std::array<std::uint8_t, 3>{srgb_byte(std::abs(g[i].x) / white), 0,
                                         srgb_byte(std::abs(g[i].y) / white)};
    });
    row.images.push_back(
        folder.write(picture, std::string("gradient_") + gradient_source_key(kGradientSources[s]),
                     gradient_source_name(kGradientSources[s]),
                     "error on the line " + percent(study.line.relative_error[s]) + "; " +
                         short_number(study.ms_per_pixel[s]) + " CPU ms a pixel"));
  }
  return row;
}

Picture irradiance_picture(const GroundStudy& study, const std::vector<double>& irradiance,
                           double white, bool has_sites) {
  Picture picture = ground_picture(study, [&](std::size_t i) {
    const std::uint8_t v = srgb_byte(irradiance[i] / white);
    return std::array<std::uint8_t, 3>{v, v, v};
  });
  if (!has_sites) return picture;
  for (const Vec2d& site : study.record_sites) {
    const int x = static_cast<int>(site.x * picture.width);
    const int y = static_cast<int>(site.y * picture.height);
    for (int dy = -2; dy <= 2; ++dy)
      for (int dx = -2; dx <= 2; ++dx)
        if (dx * dx + dy * dy <= 5) picture.set(x + dx, y + dy, kSite);
  }
  return picture;
}

double shown_white(const GroundStudy& study) {
  return std::max(1e-30, quantile(study.irradiance, 0.995));
}

double mean_irradiance(const GroundStudy& study) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < study.irradiance.size(); ++i)
    if (study.is_ground[i]) sum += study.irradiance[i], ++count;
  return count > 0 ? sum / count : 0;
}

std::vector<FigureRow> extrapolation_rows(const GroundStudy& study, const ImageFolder& folder) {
  const double white = shown_white(study), mean = mean_irradiance(study);
  FigureRow values, errors;
  values.heading =
      "Irradiance extrapolated from " + std::to_string(study.record_sites.size()) + " records";
  values.scale = "White " + short_number(white) + " W/m²; records are the orange dots";
  errors.heading = "Its error";
  errors.is_diverging = true;
  std::vector<double> sizes;
  const auto error = [&](std::size_t m, std::size_t i) {
    return mean > 0 ? (study.extrapolation[m].irradiance[i] - study.irradiance[i]) / mean : 0;
  };
  for (std::size_t i = 0; i < study.irradiance.size(); ++i)
    if (study.is_ground[i]) sizes.push_back(std::abs(error(0, i)));
  errors.high = std::max(1e-6, quantile(sizes, 0.95));
  errors.low = -errors.high;
  errors.scale = "Difference from the converged irradiance, over its mean";
  for (std::size_t m = 0; m < kModeCount; ++m) {
    const std::string mode = gradient_mode_name(kGradientModes[m]);
    const std::string numbers = "rms error " + percent(study.extrapolation[m].relative_rms);
    values.images.push_back(
        folder.write(irradiance_picture(study, study.extrapolation[m].irradiance, white, true),
                     "extrapolated_" + mode, mode, numbers));
    errors.images.push_back(
        folder.write(ground_picture(study,
                                    [&](std::size_t i) {
                                      return map_colour(ColourMap::Diverging,
                                                        0.5 + 0.5 * error(m, i) / errors.high);
                                    }),
                     "extrapolation_error_" + mode, mode, numbers));
  }
  return {values, errors};
}

Image image_of(const std::vector<Rgb>& colour, int width, int height) {
  Image image{width, height, {}};
  for (int c = 0; c < 3; ++c) {
    ImageChannel channel{std::string(1, "RGB"[c]), false, {}};
    for (const Rgb& v : colour) channel.values.push_back(v[c]);
    image.channels.push_back(std::move(channel));
  }
  return image;
}

// Stops that bring the log-average of what is lit to middle grey.
double exposure_stops(const std::vector<Rgb>& colour) {
  double sum = 0, lit = 0;
  for (const Rgb& c : colour)
    if (const double l = luminance(RgbD(c)); l > 0) sum += std::log(l), ++lit;
  return lit > 0 ? std::log2(0.18 / std::exp(sum / lit)) : 0;
}

}  // namespace

std::string short_number(double value) {
  char text[32];
  const double size = std::abs(value);
  if (size != 0 && (size < 1e-3 || size >= 1e5))
    std::snprintf(text, sizeof text, "%.2e", value);
  else
    std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

const char* gradient_source_name(GradientSource source) {
  switch (source) {
    case GradientSource::Differences:
      return "finite differences, 1x samples";
    case GradientSource::FineDifferences:
      return "finite differences, 10x samples";
    case GradientSource::Full:
      return "ours: media and occlusion";
    case GradientSource::Media:
      return "media without occlusion";
    case GradientSource::WardHeckbert:
      return "Ward-Heckbert";
  }
  throw Error(ErrorKind::Internal, "unknown source of gradients");
}

const char* gradient_source_key(GradientSource source) {
  switch (source) {
    case GradientSource::Differences:
      return "differences";
    case GradientSource::FineDifferences:
      return "differences_10x";
    case GradientSource::Full:
      return "full";
    case GradientSource::Media:
      return "media";
    case GradientSource::WardHeckbert:
      return "ward-heckbert";
  }
  throw Error(ErrorKind::Internal, "unknown source of gradients");
}

std::vector<FigureRow> write_ground_images(const FigureScene& scene,
                                           const std::filesystem::path& path) {
  const ImageFolder folder(path, scene.name);
  const GroundStudy& study = *scene.ground;
  const double exposure = exposure_stops(scene.view);
  write_preview(folder.path("view"), image_of(scene.view, scene.width, scene.height),
                {"", false, exposure});
  FigureRow irradiance;
  irradiance.heading = "The scene, and the indirect irradiance of its ground from above";
  irradiance.scale = "From above: white " + short_number(shown_white(study)) +
                     " W/m²; grey-blue is no ground. The view is exposed by " +
                     short_number(exposure) + " stops";
  irradiance.images.push_back({folder.path("view"), "as its camera sees it",
                               "with direct light and what scatters to the eye"});
  irradiance.images.push_back(
      folder.write(irradiance_picture(study, study.irradiance, shown_white(study), false),
                   "irradiance", "converged gathers",
                   percent(study.media_share) + " of it from the medium; standard error " +
                       percent(study.reference_noise)));
  std::vector<FigureRow> rows{irradiance, gradient_row(study, folder)};
  for (FigureRow& row : extrapolation_rows(study, folder)) rows.push_back(std::move(row));
  return rows;
}

std::vector<FigureRow> write_result_images(const FigureScene& scene,
                                           const std::filesystem::path& path) {
  const ImageFolder folder(path, scene.name);
  const ResultStudy& study = *scene.result;
  // Of a frame without noise, whose darkest pixels are not black by chance.
  const double exposure = exposure_stops(study.frames[0].beauty);
  const auto write = [&](const std::vector<Rgb>& colour, const std::string& what,
                         const std::string& title, const std::string& numbers) {
    write_preview(folder.path(what), image_of(colour, study.width, study.height),
                  {"", false, exposure});
    return FigureImage{folder.path(what), title, numbers};
  };
  FigureRow frames, errors;
  frames.heading = "The frame";
  frames.scale = "One exposure for all, " + short_number(exposure) +
                 " stops: the log-average of the first is middle grey";
  errors.heading = "Error of indirect light";
  errors.is_diverging = true;
  std::vector<double> sizes;
  for (const float e : study.frames[1].error) sizes.push_back(std::abs(e));
  errors.high = std::max(1e-6, quantile(sizes, 0.98));
  errors.low = -errors.high;
  errors.scale =
      "Of blocks of pixels, over the reference's mean; the noise of the reference is in it";
  for (std::size_t m = 0; m < kResultModes.size(); ++m) {
    const ResultFrame& frame = study.frames[m];
    const std::string mode = gradient_mode_name(kResultModes[m]);
    frames.images.push_back(write(frame.beauty, mode, mode + " gradients",
                                  "rendered in " + short_number(frame.render_cpu) + " CPU s"));
    Picture picture(study.width, study.height);
    for (int y = 0; y < study.height; ++y)
      for (int x = 0; x < study.width; ++x) {
        const int bx = std::min(study.blocks_x - 1, x * study.blocks_x / study.width);
        const int by = std::min(study.blocks_y - 1, y * study.blocks_y / study.height);
        const double e = frame.error[static_cast<std::size_t>(by * study.blocks_x + bx)];
        picture.set(x, y, map_colour(ColourMap::Diverging, 0.5 + 0.5 * e / errors.high));
      }
    errors.images.push_back(
        folder.write(picture, "error_" + mode, mode + " gradients",
                     (frame.relative_rms > 0
                          ? "rms " + percent(frame.relative_rms) + " without the reference's noise"
                          : std::string("rms below the reference's noise")) +
                         ", mean " + percent(frame.signed_mean)));
  }
  frames.images.push_back(write(study.reference, "reference", "path-traced reference",
                                std::to_string(study.path_samples) + " samples a pixel, " +
                                    short_number(study.path_cpu) + " CPU s"));
  return {frames, errors};
}

}  // namespace brume
