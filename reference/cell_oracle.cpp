#include "reference/cell_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "reference/embree_reach.hpp"
#include "reference/embree_scene.hpp"

namespace isowave::core {

namespace {

using Cell = VoxelField::Cell;

/// A float32 not below x.
float round_up(double x) {
  const auto rounded = static_cast<float>(x);
  return rounded < x ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
}

}  // namespace

/// The data that a ray carries through Embree: the exact ray and the best hit so far. Embree's own
/// ray is a float32 copy.
struct CellQuery : RTCIntersectContext {
  const CellOracle *oracle = nullptr;
  const OracleRay *ray = nullptr;
  bool start_inside = false;
  OracleHit best;

  static void bounds(const RTCBoundsFunctionArguments *args) {
    const auto &oracle = *static_cast<const CellOracle *>(args->geometryUserPtr);
    const Cell cell = oracle.cell_of(oracle.cells_[args->primID]);
    const auto margin = static_cast<float>(kBoundsMargin);
    RTCBounds &box = *args->bounds_o;
    box.lower_x = static_cast<float>(cell[0]) - margin;
    box.lower_y = static_cast<float>(cell[1]) - margin;
    box.lower_z = static_cast<float>(cell[2]) - margin;
    box.upper_x = static_cast<float>(cell[0] + 1) + margin;
    box.upper_y = static_cast<float>(cell[1] + 1) + margin;
    box.upper_z = static_cast<float>(cell[2] + 1) + margin;
  }

  static void intersect(const RTCIntersectFunctionNArguments *args) {
    if (args->valid[0] == 0) return;
    auto &query = *static_cast<CellQuery *>(args->context);
    const CellOracle &oracle = *query.oracle;
    const Cell cell = oracle.cell_of(oracle.cells_[args->primID]);
    const auto segment = clip(*query.ray, cell, {cell[0] + 1, cell[1] + 1, cell[2] + 1});
    if (!segment || (query.best.hit && segment->t_enter > query.best.t)) return;
    const auto t = oracle.field_.first_other_side(*query.ray, cell, *segment, query.start_inside);
    // If cells have the same t, the lowest cell answers, in any order of Embree's.
    if (!t ||
        (query.best.hit && (*t > query.best.t || (*t == query.best.t && cell > query.best.cell))))
      return;
    query.best = {true, *t, cell};
    // Embree culls boxes beyond tfar. A closer cell's enlarged box begins before its exact t_enter,
    // also as computed (see kEmbreeReach), so a float32 not below t culls none.
    RTCRayN_tfar(RTCRayHitN_RayN(args->rayhit, args->N), args->N, 0) = round_up(*t);
    RTCHitN_geomID(RTCRayHitN_HitN(args->rayhit, args->N), args->N, 0) = args->geomID;
    RTCHitN_primID(RTCRayHitN_HitN(args->rayhit, args->N), args->N, 0) = args->primID;
  }
};

CellOracle::CellOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims,
                       float isovalue)
    : CellOracle(voxels, {}, dims, isovalue) {}
CellOracle::CellOracle(std::span<const double> voxels, std::array<std::uint32_t, 3> dims,
                       float isovalue)
    : CellOracle({}, voxels, dims, isovalue) {}

CellOracle::CellOracle(std::span<const float> voxels, std::span<const double> exact_voxels,
                       std::array<std::uint32_t, 3> dims, float isovalue)
    : field_(voxels, exact_voxels, dims, isovalue), scene_(std::make_unique<EmbreeScene>(false)) {
  find_cells();
  RTCGeometry geometry = rtcNewGeometry(scene_->device(), RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(cells_.size()));
  rtcSetGeometryUserData(geometry, this);
  rtcSetGeometryBoundsFunction(geometry, &CellQuery::bounds, nullptr);
  rtcSetGeometryIntersectFunction(geometry, &CellQuery::intersect);
  scene_->build(geometry);
}

CellOracle::~CellOracle() = default;

void CellOracle::find_cells() {
  const auto &dims = field_.dims();
  const std::size_t row = dims[0], layer = row * dims[1];
  const std::array<std::size_t, 8> offsets{0,     1,         row,         row + 1,
                                           layer, layer + 1, layer + row, layer + row + 1};
  for (std::size_t z = 0; z + 1 < dims[2]; ++z) {
    for (std::size_t y = 0; y + 1 < dims[1]; ++y) {
      for (std::size_t x = 0; x + 1 < dims[0]; ++x) {
        const std::size_t first = x + row * y + layer * z;
        int num_inside = 0;
        for (const std::size_t offset : offsets)
          num_inside += field_.value(first + offset) >= field_.isovalue();
        if (num_inside != 0 && num_inside != 8) cells_.push_back(first);
      }
    }
  }
  if (cells_.size() >= std::numeric_limits<std::uint32_t>::max()) {
    throw std::invalid_argument("CellOracle: more cells than Embree can number");
  }
}

CellOracle::Cell CellOracle::cell_of(std::uint64_t voxel) const {
  const auto &dims = field_.dims();
  return {static_cast<int>(voxel % dims[0]), static_cast<int>(voxel / dims[0] % dims[1]),
          static_cast<int>(voxel / dims[0] / dims[1])};
}

OracleHit CellOracle::first_hit(const OracleRay &ray) const {
  if (!within_embree_reach(ray.origin, field_.dims())) {
    throw std::invalid_argument("CellOracle: " + out_of_reach(ray.origin, field_.dims()));
  }
  CellQuery query;
  rtcInitIntersectContext(&query);
  query.oracle = this;
  query.ray = &ray;
  bool enters = false;
  query.start_inside = field_.starts_inside(ray, enters);
  if (!enters) return {};
  RTCRayHit embree = to_embree(ray);
  rtcIntersect1(scene_->scene(), &query, &embree);
  return query.best;
}

}  // namespace isowave::core
