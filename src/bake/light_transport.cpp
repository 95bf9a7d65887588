#include "bake/light_transport.h"

#include "core/parallel.h"
#include "core/spherical_harmonics.h"
#include "gather/incident_field.h"

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

RgbD rgb(const float* c) { return {c[0], c[1], c[2]}; }

}  // namespace

LightTransport::LightTransport(const World& world, const IrradianceCache& deep,
                               std::vector<DeepRow>& surface_rows,
                               std::vector<DeepRow>& volume_rows, double min_radius, int threads)
    : order_(deep.volume()->order()),
      moments_(harmonic_count(deep.volume()->order())),
      surface_rows_(surface_rows.size()),
      volume_rows_(volume_rows.size()),
      threads_(threads) {
  for (const Volume& v : world.medium().volumes()) anisotropies_.push_back(v.phase.g());
  const VolumeLookup medium(world, *deep.volume());
  const auto link = [&](std::vector<DeepRow>& from, std::vector<Row>& to, const auto& position) {
    parallel_for(threads, from.size(), 16, [&](std::size_t i) {
      to[i] = linked(position(i) + deep.origin(), std::move(from[i].strata), deep, medium,
                     min_radius);
      from[i].strata = {};
    });
  };
  link(surface_rows, surface_rows_, [&](std::size_t i) { return vector(deep.records()[i].position); });
  link(volume_rows, volume_rows_,
       [&](std::size_t i) { return vector(deep.volume()->all().records[i].position); });
}

LightTransport::Row LightTransport::linked(const Vec3d& receiver, Strata strata,
                                           const IrradianceCache& deep, const VolumeLookup& medium,
                                           double min_radius) const {
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
      const std::vector<RecordWeight> covering = deep.explain(
          {kDeepLayer, receiver + s.way() * double(s.distance), vector(s.normal), min_radius});
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
  y[0] = 1;
  weights[0] = 0.25 * kInvPi;
  for (const Link& link : row.links) {
    RgbD radiance;
    if (surface) {
      RgbD irradiance;
      for (; t < link.terms_end; ++t)
        irradiance += (*surface)[row.terms[t].record] * double(row.terms[t].weight);
      radiance = irradiance * rgb(link.reflectance);
    }
    t = link.terms_end;
    if (order_ > 0) evaluate_harmonics(order_, vector(link.direction), y);
    for (; p < link.points_end; ++p) {
      const Point& point = row.points[p];
      if (volume) {
        if (order_ > 0) phase_weights(anisotropies_[point.volume], order_, y, weights);
        RgbD scattered;
        for (; t < point.terms_end; ++t) {
          const RgbD* moments = &(*volume)[row.terms[t].record * moments_];
          RgbD sum;
          for (std::size_t k = 0; k < moments_; ++k) sum += moments[k] * weights[k];
          scattered += sum * double(row.terms[t].weight);
        }
        radiance += scattered * rgb(point.weight);
      }
      t = point.terms_end;
    }
    add(double(link.measure), y, radiance);
  }
}

DeepLight LightTransport::apply(const std::vector<RgbD>* surface,
                                const std::vector<RgbD>* volume) const {
  ++applications_;
  DeepLight next;
  next.surface.resize(surface_rows_.size());
  next.volume.resize(volume_rows_.size() * moments_);
  parallel_for(threads_, surface_rows_.size(), 64, [&](std::size_t i) {
    RgbD sum;
    shade(surface_rows_[i], surface, volume,
          [&](double measure, const Harmonics&, const RgbD& radiance) { sum += radiance * measure; });
    next.surface[i] = sum;
  });
  parallel_for(threads_, volume_rows_.size(), 16, [&](std::size_t i) {
    RgbD* sum = &next.volume[i * moments_];
    shade(volume_rows_[i], surface, volume,
          [&](double measure, const Harmonics& y, const RgbD& radiance) {
            for (std::size_t k = 0; k < moments_; ++k) sum[k] += radiance * (measure * y[k]);
          });
  });
  return next;
}

std::size_t LightTransport::stratum_count() const {
  std::size_t count = 0;
  for (const std::vector<Row>* rows : {&surface_rows_, &volume_rows_})
    for (const Row& row : *rows) count += row.links.size();
  return count;
}

}  // namespace brume
