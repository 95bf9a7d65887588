#include "vdb_reader.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <utility>

#include "block_field.h"
#include "core/error.h"

namespace brume {
namespace {

[[noreturn]] void refuse(const std::string& place, const std::string& what) {
  throw Error(ErrorKind::InvalidInput, place + ": " + what);
}

Vec3i to_vec3i(const openvdb::Coord& c) { return {c.x(), c.y(), c.z()}; }
Vec3d to_vec3d(const openvdb::Vec3d& v) { return {v.x(), v.y(), v.z()}; }
IndexBox to_box(const openvdb::CoordBBox& b) { return {to_vec3i(b.min()), to_vec3i(b.max())}; }

// Casting a double that no float holds is undefined; such values are absurd in any case.
float to_float(double v) {
  constexpr double kMax = std::numeric_limits<float>::max();
  if (v > kMax) return std::numeric_limits<float>::infinity();
  if (v < -kMax) return -std::numeric_limits<float>::infinity();
  return static_cast<float>(v);
}

// How a value type is read: as one channel or three.
template <typename T>
struct Value {
  static constexpr int kChannels = 1;
  static float channel(const T& v, int) {
    if constexpr (std::is_same_v<T, double>) return to_float(v);
    return static_cast<float>(v);
  }
  static double magnitude(const T& v) { return static_cast<double>(v); }
};
template <typename T>
struct Value<openvdb::math::Vec3<T>> {
  static constexpr int kChannels = 3;
  static float channel(const openvdb::math::Vec3<T>& v, int c) {
    return Value<T>::channel(v[c], 0);
  }
  static double magnitude(const openvdb::math::Vec3<T>& v) {
    return std::hypot(double(v[0]), double(v[1]), double(v[2]));
  }
};

template <typename T>
bool same(const T& a, const T& b) {
  return a == b || (!(a == a) && !(b == b));
}

template <typename T>
std::array<float, 3> channels_of(const T& v) {
  std::array<float, 3> out{};
  for (int c = 0; c < Value<T>::kChannels; ++c) out[std::size_t(c)] = Value<T>::channel(v, c);
  return out;
}

// Calls visit(const Tree&) with the tree's own type; false for types that hold no field.
template <typename F>
bool with_tree(const openvdb::GridBase& grid, F visit) {
  return grid.apply<openvdb::TypeList<openvdb::FloatGrid, openvdb::DoubleGrid, openvdb::Int32Grid,
                                      openvdb::Int64Grid, openvdb::BoolGrid, openvdb::MaskGrid,
                                      openvdb::Vec3SGrid, openvdb::Vec3DGrid, openvdb::Vec3IGrid>>(
      [&](const auto& typed) { visit(typed.constTree()); });
}

bool is_supported_type(const std::string& type) {
  static const std::vector<std::string> kTypes{"float", "double", "int32", "int64", "bool",
                                               "mask",  "vec3s",  "vec3d", "vec3i"};
  return std::find(kTypes.begin(), kTypes.end(), type) != kTypes.end();
}
bool is_vector_type(const std::string& type) { return type.starts_with("vec"); }

// Calls visit(origin, edge in voxels, value, is_active) for every tile of a tree, background or
// not.
template <typename Tree, typename F>
void visit_tiles(const Tree& tree, F visit) {
  auto it = tree.cbeginValueAll();
  it.setMaxDepth(Tree::ValueAllCIter::LEAF_DEPTH - 1);
  for (; it; ++it) {
    const openvdb::CoordBBox box = it.getBoundingBox();
    visit(box.min(), box.dim().x(), *it, it.isValueOn());
  }
}

// The tree's values as accessors give them; background as the policy has it.
template <typename Tree>
BlockField collect(const Tree& tree, BackgroundPolicy policy) {
  using T = typename Tree::ValueType;
  constexpr int kChannels = Value<T>::kChannels;
  const T background = tree.background(), zero = openvdb::zeroVal<T>();
  const bool has_background = !same(background, zero);
  const bool drop_background = has_background && policy != BackgroundPolicy::Keep;

  BlockField field(kChannels);
  field.reserve_blocks(tree.leafCount());
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
    const openvdb::Coord origin = leaf->origin();
    float* to = field.add_block(to_vec3i(origin >> 3));
    openvdb::Index n = 0;  // OpenVDB's order: z fastest.
    for (int x = 0; x < 8; ++x)
      for (int y = 0; y < 8; ++y)
        for (int z = 0; z < 8; ++z, ++n) {
          const T v = leaf->getValue(n);
          if (drop_background && !leaf->isValueOn(n) && same(v, background)) continue;
          for (int c = 0; c < kChannels; ++c)
            to[c * BlockField::kBlockVoxels + (z * 8 + y) * 8 + x] = Value<T>::channel(v, c);
        }
  }
  visit_tiles(tree, [&](const openvdb::Coord& origin, int edge, const T& v, bool active) {
    const bool is_background = !active && same(v, background);
    if (is_background || (!has_background && same(v, zero))) return;
    field.add_tile({to_vec3i(origin >> 3), edge / 8, channels_of(v)});
  });
  if (has_background && policy == BackgroundPolicy::Keep) {
    openvdb::CoordBBox box;
    if (tree.evalActiveVoxelBoundingBox(box))
      field.set_fill({to_box(box), channels_of(background)});
  }
  return field;
}

struct Statistics {
  double min = kInfinity, max = -kInfinity, sum = 0;
  std::uint64_t finite = 0, nan = 0, infinite = 0, negative = 0, tiles = 0;

  template <typename T>
  void add(const T& value, std::uint64_t count) {
    const double v = Value<T>::magnitude(value);
    if (std::isnan(v)) {
      nan += count;
    } else if (std::isinf(v)) {
      infinite += count;
    } else {
      min = std::min(min, v);
      max = std::max(max, v);
      sum += v * static_cast<double>(count);
      finite += count;
      if (v < 0) negative += count;
    }
  }
};

template <typename Tree>
Statistics statistics(const Tree& tree) {
  Statistics s;
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
    for (auto v = leaf->cbeginValueOn(); v; ++v) s.add(*v, 1);
  visit_tiles(tree, [&](const openvdb::Coord&, int edge, const auto& v, bool active) {
    if (!active) return;
    ++s.tiles;
    s.add(v, std::uint64_t(edge) * std::uint64_t(edge) * std::uint64_t(edge));
  });
  return s;
}

std::string number(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", v);
  return text;
}

// OpenVDB's matrices act on row vectors.
Affine3d to_affine(const openvdb::math::Mat4d& m) {
  Affine3d a;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) a.m[std::size_t(i)][std::size_t(j)] = m(j, i);
  return a;
}

Vec3d column(const Affine3d& a, int j) {
  const auto c = static_cast<std::size_t>(j);
  return {a.m[0][c], a.m[1][c], a.m[2][c]};
}

// Throws unless the map can be marched through (HARD_CASES N05, N06, N13).
void check_affine(const std::string& place, const Affine3d& a) {
  double volume = 1;
  for (int j = 0; j < 3; ++j) {
    const double edge = column(a, j).length();
    if (!std::isfinite(edge)) refuse(place, "the transform is not finite: repair it");
    if (edge == 0) refuse(place, "the transform is singular: repair it");
    if (edge < 1e-5 || edge > 1e9)
      refuse(place, "a voxel of size " + number(edge) +
                        " is outside 1e-5..1e9 world units: scale the grid");
    volume *= edge;
  }
  const double det = a.determinant();
  if (!(std::abs(det) > 1e-9 * volume) || !a.inverse())
    refuse(place, "the transform is singular: repair it");
  if (!is_finite(a.translation())) refuse(place, "the transform is not finite: repair it");
}

// Past this a double no longer tells where in its voxel a point lies to a thousandth.
void check_distance(const std::string& place, const Affine3d& a, const IndexBox& voxels) {
  if (voxels.is_empty()) return;
  const Box3d box = a.box({Vec3d(voxels.min), Vec3d(voxels.max)});
  double edge = kInfinity, far = 0;
  for (int j = 0; j < 3; ++j) {
    edge = std::min(edge, column(a, j).length());
    far = std::max({far, std::abs(box.min[j]), std::abs(box.max[j])});
  }
  if (!(far * std::numeric_limits<double>::epsilon() < 1e-3 * edge))
    refuse(place, "lies " + number(far) + " from the origin, too far for voxels of " +
                      number(edge) + ": move it nearer");
}

double sample(const BlockIndex& index, const openvdb::Vec3d& p, int channel) {
  const Vec3i base(int(std::floor(p.x())), int(std::floor(p.y())), int(std::floor(p.z())));
  const Vec3d f(p.x() - base.x, p.y() - base.y, p.z() - base.z);
  double sum = 0;
  for (int i = 0; i < 8; ++i) {
    const Vec3i d(i & 1, i >> 1 & 1, i >> 2);
    sum += (d.x ? f.x : 1 - f.x) * (d.y ? f.y : 1 - f.y) * (d.z ? f.z : 1 - f.z) *
           double(index.value(base + d, channel));
  }
  return sum;
}

struct Resampled {
  BlockField field;
  Affine3d index_to_world;
};

// A frustum's voxels grow along its axis; marchers want them all alike. Samples a lattice as fine
// as the smallest voxels, or as kMaxNodes allows.
Resampled resample_frustum(const BlockField& field, const openvdb::math::Transform& transform,
                           const std::string& place, std::vector<std::string>* warnings) {
  constexpr double kMaxNodes = 1 << 24;
  const BlockIndex index(field, place);
  Resampled out{BlockField(field.channels()), {}};
  if (index.is_empty()) return out;

  // The interpolant reaches one voxel past those that are stored.
  const Vec3d lo(index.extent().min * 8 - Vec3i(1)), hi(index.extent().max * 8 + Vec3i(8));
  Box3d world;
  double spacing = kInfinity;
  for (int i = 0; i < 8; ++i) {
    const openvdb::Vec3d corner(i & 1 ? hi.x : lo.x, i & 2 ? hi.y : lo.y, i & 4 ? hi.z : lo.z);
    world.extendBy(to_vec3d(transform.indexToWorld(corner)));
    const openvdb::Vec3d size = transform.voxelSize(corner);
    for (int a = 0; a < 3; ++a) spacing = std::min(spacing, std::abs(size[a]));
  }
  const Vec3d extent = world.size();
  if (!is_finite(extent) || !is_finite(world.min) || !(spacing > 0))
    refuse(place, "the frustum transform is singular or not finite: repair it");
  const auto nodes = [&](double h) {
    return (extent.x / h + 2) * (extent.y / h + 2) * (extent.z / h + 2);
  };
  while (nodes(spacing) > kMaxNodes) spacing *= 1.02;

  for (int a = 0; a < 3; ++a) {
    out.index_to_world.m[std::size_t(a)][std::size_t(a)] = spacing;
    out.index_to_world.m[std::size_t(a)][3] = world.min[a];
  }
  check_affine(place, out.index_to_world);
  Vec3i blocks;
  for (int a = 0; a < 3; ++a) blocks[a] = int(extent[a] / spacing + 2) / 8 + 1;
  std::vector<float> values(std::size_t(field.channels()) * BlockField::kBlockVoxels);
  for (int bz = 0; bz < blocks.z; ++bz)
    for (int by = 0; by < blocks.y; ++by)
      for (int bx = 0; bx < blocks.x; ++bx) {
        std::fill(values.begin(), values.end(), 0.0f);
        bool any = false;
        for (int i = 0; i < BlockField::kBlockVoxels; ++i) {
          const Vec3d node(bx * 8 + i % 8, by * 8 + i / 8 % 8, bz * 8 + i / 64);
          const Vec3d w = out.index_to_world.point(node);
          const openvdb::Vec3d p = transform.worldToIndex({w.x, w.y, w.z});
          // Written so that NaN is outside.
          bool inside = true;
          for (int a = 0; a < 3; ++a) inside = inside && p[a] >= lo[a] && p[a] <= hi[a];
          for (int c = 0; inside && c < field.channels(); ++c) {
            const auto v = static_cast<float>(sample(index, p, c));
            values[std::size_t(c * BlockField::kBlockVoxels + i)] = v;
            any |= v != 0;
          }
        }
        if (any) std::copy(values.begin(), values.end(), out.field.add_block({bx, by, bz}));
      }
  warnings->push_back(place + ": its frustum transform is not linear: resampled at points " +
                      number(spacing) + " apart");
  return out;
}

std::string class_name(const openvdb::GridBase& grid) {
  return openvdb::GridBase::gridClassToString(grid.getGridClass());
}

// What an optical depth of 3 across takes: 3 / (mean value * edge of a cube of the active volume),
// to two digits.
double propose_density_scale(double mean, double active_volume) {
  const double depth = mean * std::cbrt(active_volume);
  if (!(depth > 0) || !std::isfinite(depth)) return 0;
  const double scale = 3 / depth, unit = std::pow(10, std::floor(std::log10(scale)) - 1);
  const double rounded = std::round(scale / unit) * unit;
  return std::isfinite(rounded) ? rounded : 0;
}

// Runs `parse`, turning OpenVDB's exceptions into ours with their text kept.
template <typename F>
auto guarded(const std::string& place, const std::string& path, F parse) {
  try {
    return parse();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    std::string reason = printable(e.what());
    if (const std::size_t at = reason.find(path); at != std::string::npos)
      reason.replace(at, path.size(), "it");
    refuse(place, "damaged: " + reason + ": export the file again");
  }
}

}  // namespace

struct VdbReader::Impl {
  std::string path, shown_as;
  GridFileOptions options;
  Trail trail;
  openvdb::io::File file;
  std::vector<GridEntry> entries;
  std::vector<std::string> unique_names;  // What OpenVDB calls the entries.

  Impl(const std::string& path_, const std::string& shown_as_, const GridFileOptions& options_,
       Trail trail_)
      : path(path_),
        shown_as(shown_as_),
        options(options_),
        trail(std::move(trail_)),
        file(path_) {}

  void open();
  std::string place(std::size_t entry) const {
    return shown_as + ": grid " + display_name(entries, entry);
  }
  openvdb::GridBase::Ptr read(std::size_t entry) const;
  void check_advertised_size(const openvdb::GridBase& metadata, const std::string& at) const;
  void check_use(std::size_t entry, const openvdb::GridBase& grid, GridRole role) const;

  // OpenVDB's reading functions are not const.
  openvdb::io::File& archive() const { return const_cast<openvdb::io::File&>(file); }
};

void VdbReader::Impl::open() {
  guarded(shown_as, path, [&] {
    // Eager: with delayed loading damage would show up later, elsewhere, and the file would be
    // mapped.
    file.open(false);
    for (auto name = file.beginName(); name != file.endName(); ++name)
      unique_names.push_back(name.gridName());
  });
  // OpenVDB tells grids of one name apart by numbers in file order: name[0], name[1], ... Sorted as
  // text, [10] would come before [2].
  const auto split = [](const std::string& unique) {
    const std::size_t open = unique.rfind('[');
    if (open == std::string::npos || unique.back() != ']') return std::pair(unique, -1L);
    return std::pair(unique.substr(0, open), std::strtol(unique.c_str() + open + 1, nullptr, 10));
  };
  std::stable_sort(unique_names.begin(), unique_names.end(),
                   [&](const auto& a, const auto& b) { return split(a) < split(b); });
  for (const std::string& unique : unique_names) {
    GridEntry entry{split(unique).first, "unknown", false};
    try {
      const auto metadata = file.readGridMetadata(unique);
      if (metadata) {
        entry.name = metadata->getName();
        entry.type = metadata->valueType();
        entry.is_level_set = metadata->getGridClass() == openvdb::GRID_LEVEL_SET;
      }
    } catch (const openvdb::Exception&) {
      // A grid that nobody asks for may be damaged; if asked for, read() says what is wrong.
    }
    entries.push_back(std::move(entry));
  }
}

void VdbReader::Impl::check_advertised_size(const openvdb::GridBase& metadata,
                                            const std::string& at) const {
  // Written by whoever wrote the file, so only good for refusing early.
  const auto count =
      metadata.getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT);
  if (count && count->value() > 0 && std::uint64_t(count->value()) > options.max_voxels)
    refuse(at, "has " + std::to_string(count->value()) + " active voxels, over the limit of " +
                   std::to_string(options.max_voxels) + ": raise --max-voxels");
  for (const char* key :
       {openvdb::GridBase::META_FILE_BBOX_MIN, openvdb::GridBase::META_FILE_BBOX_MAX}) {
    const auto corner = metadata.getMetadata<openvdb::Vec3IMetadata>(key);
    if (!corner ||
        metadata.getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT) ==
            nullptr ||
        count->value() == 0)
      continue;  // The box of nothing is made of extreme numbers.
    for (int a = 0; a < 3; ++a)
      if (std::abs(std::int64_t(corner->value()[a])) > (std::int64_t(1) << 30))
        refuse(at,
               "voxel indices reach beyond +-2^30: move the grid to the origin of its index "
               "space");
  }
}

openvdb::GridBase::Ptr VdbReader::Impl::read(std::size_t entry) const {
  const std::string at = place(entry);
  trail(at);
  return guarded(at, path, [&] {
    const auto metadata = archive().readGridMetadata(unique_names[entry]);
    check_advertised_size(*metadata, at);
    auto grid = archive().readGrid(unique_names[entry]);
    if (!grid) refuse(at, "damaged: it cannot be read: export the file again");
    const std::uint64_t active = grid->activeVoxelCount();
    if (active > options.max_voxels)
      refuse(at, "has " + std::to_string(active) + " active voxels, over the limit of " +
                     std::to_string(options.max_voxels) + ": raise --max-voxels");
    return grid;
  });
}

void VdbReader::Impl::check_use(std::size_t entry, const openvdb::GridBase& grid,
                                GridRole role) const {
  const std::string at = place(entry), type = grid.valueType();
  if (type.starts_with("ptdata") || type.starts_with("ptidx"))
    refuse(at,
           "points are not supported: rasterise them to a fog volume first (Houdini: VDB "
           "Rasterize Points)");
  if (!is_supported_type(type))
    refuse(at, "values of type " + printable(type) +
                   " are not supported: store float, double, int, bool or vec3");
  if (is_vector_type(type) && role != GridRole::Color && role != GridRole::Emission)
    refuse(at, std::string("is a vector grid (") + type + "), and " + grid_role_name(role) +
                   " takes one number a voxel: store one component or the length");
  if (grid.getGridClass() == openvdb::GRID_LEVEL_SET)
    refuse(at,
           "is a level set, a surface rather than fog: convert it to a fog volume (Houdini: "
           "Convert VDB; OpenVDB: sdfToFogVolume)");
  if (grid.getGridClass() == openvdb::GRID_STAGGERED)
    refuse(at, "is a staggered velocity grid: name a fog volume");
}

VdbReader::VdbReader(const std::string& path, const std::string& shown_as,
                     const GridFileOptions& options, Trail trail) {
  openvdb::initialize();
  impl_ = std::make_unique<Impl>(path, shown_as, options, std::move(trail));
  impl_->open();
}

VdbReader::~VdbReader() = default;

const std::vector<GridEntry>& VdbReader::entries() const { return impl_->entries; }

LoadedArrays VdbReader::load(std::size_t entry, GridRole role) const {
  const std::string at = impl_->place(entry);
  impl_->trail(at);
  LoadedArrays loaded;
  loaded.name = display_name(impl_->entries, entry);

  // What is wrong with the use of a grid shows before its voxels are read.
  const auto metadata = guarded(at, impl_->path, [&] {
    return impl_->archive().readGridMetadata(impl_->unique_names[entry]);
  });
  impl_->check_use(entry, *metadata, role);
  auto grid = impl_->read(entry);

  const openvdb::math::Transform transform = grid->transform();
  Affine3d index_to_world;
  const bool linear = transform.isLinear();
  if (linear) {
    index_to_world = to_affine(transform.baseMap()->getAffineMap()->getMat4());
    check_affine(at, index_to_world);
    check_distance(at, index_to_world, to_box(grid->evalActiveVoxelBoundingBox()));
  } else if (transform.mapType() != openvdb::math::NonlinearFrustumMap::mapType()) {
    refuse(at, "its transform (" + printable(transform.mapType()) +
                   ") is not linear: resample it to a linear one");
  }

  BlockField field(1);
  const std::uint64_t active = grid->activeVoxelCount();
  const BackgroundPolicy policy = impl_->options.background;
  with_tree(*grid, [&](const auto& tree) {
    using T = typename std::decay_t<decltype(tree)>::ValueType;
    if (!same(tree.background(), openvdb::zeroVal<T>())) {
      const std::string value = number(Value<T>::magnitude(tree.background()));
      if (policy == BackgroundPolicy::Error)
        refuse(at, "its background is " + value +
                       ", not 0, so it would fill all space: use --background zero, or keep to "
                       "fill the box of its active voxels");
      loaded.warnings.push_back(at + ": its background " + value +
                                (policy == BackgroundPolicy::Zero
                                     ? " is taken as 0"
                                     : " fills the box of its active voxels, 0 outside"));
    }
    field = collect(tree, policy);
  });
  grid.reset();  // Its memory is wanted for the bricks.

  loaded.bad_voxels = field.sanitize(impl_->options.on_bad_voxels, at, &loaded.warnings);
  if (!linear) {
    Resampled resampled = resample_frustum(field, transform, at, &loaded.warnings);
    field = std::move(resampled.field);
    index_to_world = resampled.index_to_world;
  }
  loaded.channels = field.build_bricks(index_to_world, at);
  if (std::all_of(loaded.channels.begin(), loaded.channels.end(),
                  [](const BrickArrays& a) { return a.top.empty(); }))
    loaded.warnings.push_back(at + (active == 0 ? ": has no active voxel" : ": is 0 everywhere") +
                              ": taken as vacuum");
  return loaded;
}

GridInfo VdbReader::inspect(std::size_t entry) const {
  const std::string at = impl_->place(entry);
  const auto grid = impl_->read(entry);
  const GridEntry& e = impl_->entries[entry];
  return guarded(at, impl_->path, [&] {
    GridInfo info;
    info.name = display_name(impl_->entries, entry);
    info.type = printable(grid->valueType());
    info.grid_class = class_name(*grid);
    info.transform = printable(grid->transform().mapType());
    info.saved_as_half = grid->saveFloatAsHalf();
    const auto compression =
        grid->getMetadata<openvdb::StringMetadata>(openvdb::GridBase::META_FILE_COMPRESSION);
    info.compression = compression ? printable(compression->value()) : "unknown";
    info.active_voxels = grid->activeVoxelCount();
    info.voxel_size = to_vec3d(grid->voxelSize());
    const openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
    if (info.active_voxels > 0) {
      info.index_min = to_vec3i(box.min());
      info.index_max = to_vec3i(box.max());
      for (int i = 0; i < 8; ++i) {
        const openvdb::Vec3d corner(i & 1 ? box.max().x() + 0.5 : box.min().x() - 0.5,
                                    i & 2 ? box.max().y() + 0.5 : box.min().y() - 0.5,
                                    i & 4 ? box.max().z() + 0.5 : box.min().z() - 0.5);
        info.world_bounds.extendBy(to_vec3d(grid->transform().indexToWorld(corner)));
      }
    }
    with_tree(*grid, [&](const auto& tree) {
      using T = typename std::decay_t<decltype(tree)>::ValueType;
      const Statistics s = statistics(tree);
      info.background = Value<T>::magnitude(tree.background());
      info.active_tiles = s.tiles;
      info.nan_voxels = s.nan;
      info.infinite_voxels = s.infinite;
      info.negative_voxels = s.negative;
      if (s.finite > 0) {
        info.min = s.min;
        info.max = s.max;
        info.mean = s.sum / static_cast<double>(s.finite);
      }
    });
    const bool fog = is_supported_type(info.type) && !e.is_level_set && !is_velocity(e);
    if (fog) info.role = usual_role(e.name);
    const bool density = fog && !is_vector_type(info.type) &&
                         info.role.value_or(GridRole::Density) == GridRole::Density;
    if (density && grid->transform().isLinear()) {
      const Affine3d a = to_affine(grid->transform().baseMap()->getAffineMap()->getMat4());
      info.proposed_density_scale = propose_density_scale(
          info.mean, std::abs(a.determinant()) * static_cast<double>(info.active_voxels));
    }
    return info;
  });
}

}  // namespace brume
