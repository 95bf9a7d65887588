#include "exchange/record_columns.h"

namespace brume {

std::span<const RecordColumn> surface_columns() {
#define BRUME_COLUMN(name, ...)                           \
  RecordColumn {                                          \
#name, offsetof(SurfaceRecord, name), { __VA_ARGS__ } \
  }
  static const std::vector<RecordColumn> columns{
      BRUME_COLUMN(position, "x", "y", "z"),
      BRUME_COLUMN(normal, "x", "y", "z"),
      BRUME_COLUMN(irradiance, "r", "g", "b"),
      BRUME_COLUMN(gradient, "r.x", "r.y", "r.z", "g.x", "g.y", "g.z", "b.x", "b.y", "b.z"),
      BRUME_COLUMN(rotational, "r.u", "r.v", "g.u", "g.v", "b.u", "b.v"),
      BRUME_COLUMN(axis, ""),
      BRUME_COLUMN(radius, "1", "2"),
      BRUME_COLUMN(error, ""),
      BRUME_COLUMN(media_share, ""),
  };
#undef BRUME_COLUMN
  return columns;
}

}  // namespace brume
