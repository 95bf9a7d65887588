#include "bake/light_transport.h"

#include <algorithm>
#include <array>

#include "core/parallel.h"
#include "core/spherical_harmonics.h"
#include "gather/gather.h"
#include "gather/incident_field.h"

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

RgbD rgb(const float* c) { return {c[0], c[1], c[2]}; }

}  // namespace

LightTransport::LightTransport(const World& world, const IrradianceCache& deep,
                               std::vector<DeepRow>& surface_rows,
                               std::vector<DeepRow>& volume_rows, int threads)
    : order_(deep.volume()->order()),
      moments_(harmonic_count(deep.volume()->order())),
      surface_count_(surface_rows.size()),
      volume_count_(volume_rows.size()),
      threads_(threads) {
  for (const Volume& v : world.medium().volumes()) anisotropies_.push_back(v.phase.g());
  const VolumeLookup medium(world, *deep.volume());
  std::vector<Sums> surface_sums(static_cast<std::size_t>(resolve_thread_count(threads)));
  std::vector<Sums> volume_sums(surface_sums.size());
  for (std::size_t t = 0; t < surface_sums.size(); ++t) {
    surface_sums[t].of.resize(surface_count_);
    volume_sums[t].of.resize(volume_count_);
  }
  const auto link = [&](std::vector<DeepRow>& from, std::vector<Row>& to,
                        std::vector<EvenRow>& even, const auto& position) {
    for (const DeepRow& row : from) stratum_count_ += row.strata.strata.size();
    if (order_ > 0)
      to.resize(from.size());
    else
      even.resize(from.size());
    parallel_for_slots(threads, from.size(), 16, [&](std::size_t i, int slot) {
      Row row = linked(world, position(i, from[i].offset) + deep.origin(), from[i], deep, medium);
      from[i].strata = {};
      if (order_ > 0)
        to[i] = std::move(row);
      else
        even[i] = summed(row, surface_sums[static_cast<std::size_t>(slot)],
                         volume_sums[static_cast<std::size_t>(slot)]);
    });
  };
  link(surface_rows, surface_rows_, even_surface_rows_, [&](std::size_t i, double offset) {
    const SurfaceRecord& r = deep.records()[i];
    return vector(r.position) + vector(r.normal) * offset;
  });
  link(volume_rows, volume_rows_, even_volume_rows_,
       [&](std::size_t i, double) { return vector(deep.volume()->all().records[i].position); });
}

void LightTransport::Sums::add(std::uint32_t record, const RgbD& weight) {
  if (is_black(of[record])) touched.push_back(record);
  of[record] += weight;
}

std::vector<LightTransport::Weight> LightTransport::Sums::take() {
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  std::vector<Weight> row;
  row.reserve(touched.size());
  for (const std::uint32_t record : touched) {
    const RgbD& w = of[record];
    row.push_back(
        {record, {static_cast<float>(w.r), static_cast<float>(w.g), static_cast<float>(w.b)}});
    of[record] = RgbD();
  }
  touched.clear();
  return row;
}

LightTransport::EvenRow LightTransport::summed(const Row& row, Sums& surface, Sums& volume) const {
  std::size_t t = 0, p = 0;
  for (const Link& link : row.links) {
    const RgbD reflectance = rgb(link.reflectance) * double(link.measure);
    for (; t < link.terms_end; ++t)
      surface.add(row.terms[t].record, reflectance * double(row.terms[t].weight));
    for (; p < link.points_end; ++p) {
      const RgbD scattered = rgb(row.points[p].weight) * (double(link.measure) * 0.25 * kInvPi);
      for (; t < row.points[p].terms_end; ++t)
        volume.add(row.terms[t].record, scattered * double(row.terms[t].weight));
    }
  }
  return {surface.take(), volume.take()};
}

RgbD LightTransport::shade(const std::vector<Weight>& row, const std::vector<RgbD>& light) {
  RgbD sum;
  for (const Weight& w : row) sum += light[w.record] * rgb(w.rgb);
  return sum;
}

LightTransport::Row LightTransport::linked(const World& world, const Vec3d& receiver,
                                           const DeepRow& of, const IrradianceCache& deep,
                                           const VolumeLookup& medium) const {
  const Strata& strata = of.strata;
  Row row;
  row.links.reserve(strata.strata.size());
  std::vector<VolumePart> parts;
  std::size_t p = 0;
  for (const Stratum& s : strata.strata) {
    Link link{};
    std::copy_n(s.direction, 3, link.direction);
    link.measure = s.measure;
    if (s.reflects()) {
      std::copy_n(s.reflectance, 3, link.reflectance);
      const std::vector<RecordWeight> covering =
          deep.explain(hit_query(world, kDeepLayer, receiver + s.way() * double(s.distance),
                                 vector(s.normal), of.footprint_at(s)));
      double sum = 0;
      for (const RecordWeight& w : covering) sum += w.weight;
      for (const RecordWeight& w : covering)
        row.terms.push_back({static_cast<std::uint32_t>(w.record - deep.records().data()),
                             static_cast<float>(w.weight / sum)});
    }
    link.terms_end = static_cast<std::uint32_t>(row.terms.size());
    for (; p < s.points_end; ++p) {
      const MediumPoint& point = strata.points[p];
      medium.find(receiver + s.way() * double(point.distance), parts);
      if (parts.empty()) continue;
      for (const VolumePart& part : parts) row.terms.push_back({part.record, part.weight});
      Point& linked = row.points.emplace_back();
      std::copy_n(point.weight, 3, linked.weight);
      linked.volume = point.volume;
      linked.terms_end = static_cast<std::uint32_t>(row.terms.size());
    }
    link.points_end = static_cast<std::uint32_t>(row.points.size());
    row.links.push_back(link);
  }
  row.links.shrink_to_fit();
  row.points.shrink_to_fit();
  row.terms.shrink_to_fit();
  return row;
}

// Calls add(measure, harmonics of the direction, radiance) for each stratum.
template <typename Add>
void LightTransport::shade(const Row& row, const std::vector<RgbD>* surface,
                           const std::vector<RgbD>* volume, const Add& add) const {
  std::size_t t = 0, p = 0;
  Harmonics y{}, weights{};
  std::array<RgbD, kMaxHarmonics> between;
  for (const Link& link : row.links) {
    RgbD radiance;
    if (surface) {
      RgbD irradiance;
      for (; t < link.terms_end; ++t)
        irradiance += (*surface)[row.terms[t].record] * double(row.terms[t].weight);
      radiance = irradiance * rgb(link.reflectance);
    }
    t = link.terms_end;
    evaluate_harmonics(order_, vector(link.direction), y);
    for (; p < link.points_end; ++p) {
      const Point& point = row.points[p];
      if (volume) {
        // Interpolated first, then weighted by the phase function: one dot product a point.
        std::fill(between.begin(), between.begin() + moments_, RgbD());
        for (; t < point.terms_end; ++t) {
          const RgbD* moments = &(*volume)[row.terms[t].record * moments_];
          const double weight = row.terms[t].weight;
          for (std::size_t k = 0; k < moments_; ++k) between[k] += moments[k] * weight;
        }
        phase_weights(anisotropies_[point.volume], order_, y, weights);
        RgbD scattered;
        for (std::size_t k = 0; k < moments_; ++k) scattered += between[k] * weights[k];
        radiance += scattered * rgb(point.weight);
      }
      t = point.terms_end;
    }
    add(double(link.measure), y, radiance);
  }
}

std::vector<RgbD> LightTransport::at_surfaces(const std::vector<RgbD>* surface,
                                              const std::vector<RgbD>* volume) const {
  std::vector<RgbD> irradiance(surface_count_);
  parallel_for(threads_, surface_count_, 64, [&](std::size_t i) {
    RgbD sum;
    if (order_ == 0) {
      sum = surface ? shade(even_surface_rows_[i].surface, *surface)
                    : shade(even_surface_rows_[i].volume, *volume);
    } else {
      shade(surface_rows_[i], surface, volume,
            [&](double measure, const Harmonics&, const RgbD& radiance) {
              sum += radiance * measure;
            });
    }
    irradiance[i] = sum;
  });
  return irradiance;
}

std::vector<RgbD> LightTransport::in_medium(const std::vector<RgbD>* surface,
                                            const std::vector<RgbD>* volume) const {
  std::vector<RgbD> moments(volume_count_ * moments_);
  parallel_for(threads_, volume_count_, 16, [&](std::size_t i) {
    RgbD* sum = &moments[i * moments_];
    if (order_ == 0) {
      *sum = surface ? shade(even_volume_rows_[i].surface, *surface)
                     : shade(even_volume_rows_[i].volume, *volume);
      return;
    }
    shade(volume_rows_[i], surface, volume,
          [&](double measure, const Harmonics& y, const RgbD& radiance) {
            for (std::size_t k = 0; k < moments_; ++k) sum[k] += radiance * (measure * y[k]);
          });
  });
  return moments;
}

DeepLight LightTransport::reflect(const std::vector<RgbD>& irradiance) const {
  ++applications_;
  return {at_surfaces(&irradiance, nullptr), in_medium(&irradiance, nullptr)};
}

std::vector<RgbD> LightTransport::scatter(const std::vector<RgbD>& moments) const {
  ++applications_;
  return in_medium(nullptr, &moments);
}

std::vector<RgbD> LightTransport::scatter_to_surfaces(const std::vector<RgbD>& moments) const {
  ++applications_;
  return at_surfaces(nullptr, &moments);
}

}  // namespace brume
