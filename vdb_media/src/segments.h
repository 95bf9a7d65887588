// Segments: the stretches of a ray between two crossings of cells, and what a grid holds along
// them.
//
// A march runs in two passes over plain arrays, which is what vector units want. collect() cuts
// spans of bricks at every cell's planes; evaluate() reads each segment's eight nodes once. Both
// give the same bits on every instruction set (a test).
//
// In a cell the field is V(m + s d), s in [-1/2, 1/2], around the middle m of a segment that spans
// d: a cubic in s. Two Gauss points would integrate it exactly (gradients.md 8); its own
// coefficients do so too, from one set of nodes and with fewer roundings:
//   mean       = V + (dx dy Vxy + dx dz Vxz + dy dz Vyz) / 12
//   mean of Vx = Vx + dy dz Vxyz / 12,    mean of s Vx = (dy Vxy + dz Vxz) / 12,    and so on,
// all derivatives at m. Integrals are these means times the segment's length. Nodes, fractions and
// these means are floats, crossings and sums doubles: the integral is good to about 1e-7 of its
// size, and exact to 1e-15 where the field is constant.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "brick_walk.h"

namespace brume {

// One brick's or tile's share of a ray.
struct Span {
  double begin, end;
  std::array<double, 3> corner;  // The brick's first node in index space.
  std::int64_t offset = 0;       // Of the brick's first float from the grid's first brick.
  float tile = -1;               // The constant value, where >= 0.
  std::int32_t first_cut = 0, cut_count = 0;  // Further places to cut, strictly inside, ascending.
};

inline constexpr int kMaxCuts = 8;  // In one span.
// 3 x 7 planes and the cuts make 30 segments at most; coarse steps come to less than 2 x (14 + 9).
inline constexpr int kMaxSegmentsPerSpan = 48;
inline constexpr int kLanes = 16;

// Arrays of `capacity` entries, aligned for vectors; lengths are padded to whole lanes.
struct Segments {
  explicit Segments(std::size_t capacity_in_spans) { reserve(capacity_in_spans); }
  void reserve(std::size_t capacity_in_spans);

  int count = 0;
  // Made by collect(). `middle` is where the field is looked at: the middle, or a Gauss point.
  double *begin, *middle, *length;
  std::int64_t* offset;            // Of the cell's first node.
  std::array<float*, 3> fraction;  // Of `middle` within its cell.
  // Made by evaluate(): over the segment, the mean of the field and its change from end to end; the
  // integrals of its index-space gradient and of t times that, t the ray's parameter.
  float *mean, *change;
  std::array<float*, 3> gradient, moment;
  // Segments that lie in tiles, with the tiles' values; collect() makes them read some node or
  // other.
  std::vector<std::pair<int, float>> tiles;

 private:
  std::size_t capacity_ = 0;
  std::vector<std::byte> memory_;
};

// What all segments of one march share.
struct Field {
  const float* nodes;  // The grid's first brick.
  IndexRay ray;
  // Steps in voxels, at most; 0 means cell by cell.
  double step_voxels = 0;
};

enum class Want { MeanAndChange, Gradients };

// The two passes, by whatever instruction set the CPU has.
// Replaces the contents of `segments` by those of the spans, in order, `cuts` applied; steps of
// Field::step_voxels where they are wanted.
void collect(const Field& field, const Span* spans, int span_count, const double* cuts,
             Segments& segments);
// Tiles' segments come out wrong; set_tiles() puts them right.
void evaluate(const Field& field, Want want, Segments& segments);
void set_tiles(Segments& segments);
// The integral of the field, without tiles: the means of evaluate() times lengths, summed by lanes.
double integrate(const Field& field, const Segments& segments);

// Parts of collect().
void collect_cells(const Field& field, const Span* spans, int span_count, const double* cuts,
                   Segments& segments);
// Pieces of a tile's span, whatever the step.
void collect_tile(const Span& span, const double* cuts, Segments& segments);
// Sets `offset` and `fraction` of the segments from `first` on, which lie in one span, by `middle`.
void locate(const Field& field, const Span& span, int first, Segments& segments);
void pad_to_lanes(Segments& segments);
double sum_lanes(const std::array<double, kLanes>& lanes);

}  // namespace brume
