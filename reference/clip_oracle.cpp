#include "reference/clip_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_access.hpp>
#include <stdexcept>
#include <utility>

#include "core/base/parallel_for.hpp"
#include "reference/voxel_field.hpp"

namespace isowave::core {

namespace {

/// Roundings of float32 in a direction, or a start, along one axis: three numbers are rounded; two
/// sums, a division and t itself follow. At most 8 * 2^-24 of the sum of the numbers' magnitudes.
constexpr double kRounding = 0x1p-21;
/// Roundings of float64 in a point's distance from a plane, beside the magnitudes of its terms.
constexpr double kFinerRounding = 0x1p-49;
/// Smaller components of float32 directions are 0.
constexpr double kNoDirection = 0x1p-40;
/// Distance of a hit from the oracle's, unless the hit lies on the surface as well [voxels].
constexpr double kSamePlace = 1e-4;
/// Rounding of the field at a place of float32, in parts of the largest difference to the isovalue.
constexpr double kSameValue = 0x1p-19;
/// Distance of rays beside one; of rays from 3,000 voxels away, which float32 moves further.
constexpr double kSideways = 1e-5, kSidewaysFromAfar = 5e-5;

/// Shortens the part to where a + b t >= 0.
void cut(RayPart &part, double a, double b) {
  if (b > 0) part.begin = std::max(part.begin, -a / b);
  if (b < 0) part.end = std::min(part.end, -a / b);
  if (b == 0 && a < 0) part.end = -kInfinity;
}

glm::dvec3 vec(const std::array<double, 3> &v) {
  return {v[0], v[1], v[2]};
}

glm::dvec3 first_voxel(const FrameParams &frame) {
  return {frame.brick.origin_x, frame.brick.origin_y, frame.brick.origin_z};
}

/// The ray in the index space of the frame's brick.
OracleRay in_brick(const FrameParams &frame, OracleRay ray) {
  for (int axis = 0; axis < 3; ++axis) ray.origin[std::size_t(axis)] -= first_voxel(frame)[axis];
  return ray;
}

std::array<std::uint32_t, 3> dims_of(const FrameParams &frame) {
  return {frame.grid.dims_x, frame.grid.dims_y, frame.grid.dims_z};
}

/// The rays of a pixel at all levels.
std::vector<OracleRay> rays_of(std::span<const FrameParams> frames, std::uint32_t pixel) {
  std::vector<OracleRay> rays;
  for (const FrameParams &frame : frames) rays.push_back(exact_ray(make_ray(&frame, pixel)));
  return rays;
}

}  // namespace

bool is_on_surface(const RootOracle &surface, const glm::dvec3 &point, const glm::ivec3 &cell,
                   double isovalue) {
  const auto difference = [&](const glm::dvec3 &at) {
    return std::abs(surface.field({at.x, at.y, at.z}) - isovalue);
  };
  double largest = 0;
  for (int corner = 0; corner < 8; ++corner)
    largest =
        std::max(largest, difference(cell + glm::ivec3(corner & 1, corner >> 1 & 1, corner >> 2)));
  return difference(point) <= kSameValue * largest;
}

bool is_cap_gradient(const ClipOracle &oracle, const HitRecord &record, std::uint32_t begun_by) {
  for (std::size_t plane = 0; plane < oracle.planes().size(); ++plane) {
    const glm::dvec3 right = vec(oracle.cap_gradient(plane)),
                     got(record.grad_x, record.grad_y, record.grad_z);
    if ((begun_by >> plane & 1u) != 0 && glm::length(got - right) <= 0x1p-22 * glm::length(right))
      return true;
  }
  return false;
}

ClipOracle::ClipOracle(const VolumeInfo &finest, const Camera &camera, const Clip &clip,
                       std::span<const FrameParams> frames,
                       std::span<const std::vector<float>> voxels)
    : finest_(finest), eye_(camera.eye), caps_(clip.caps), frames_(frames) {
  for (const ClipPlane &plane : clip.planes) {
    const double length = glm::length(plane.normal);
    planes_.push_back({plane.normal / length, plane.offset / length});
  }
  for (std::size_t level = 0; level < frames.size(); ++level)
    surfaces_.emplace_back(voxels[level], dims_of(frames[level]), frames[level].surface.isovalue);
}

std::array<double, 3> ClipOracle::cap_gradient(std::size_t plane) const {
  const glm::dvec3 growth = planes_[plane].normal * finest_.index_to_world();  // row times matrix
  const double t_scale = frames_[0].view.t_scale;
  return {growth.x / t_scale, growth.y / t_scale, growth.z / t_scale};
}

KeptPart ClipOracle::kept(const OracleRay &ray, double t_scale) const {
  const glm::dmat3 to_world = finest_.index_to_world(), to_index = glm::inverse(to_world);
  const glm::dvec3 eye = to_index * (eye_ - finest_.origin);
  const glm::dvec3 start = to_world * vec(ray.origin), step = to_world * vec(ray.direction);
  const double beside = std::sqrt(2.0) * glm::length(start - to_world * eye);  // parallel rays
  KeptPart result;
  std::vector<RayPart> begins;  // of each plane: from possibly to surely
  for (const auto &[normal, offset] : planes_) {
    // Both the ray and the plane's distance along it are made of float32 numbers: of the eye, and
    // of the camera's axes, by which a voxel's coordinates grow by up to `slope`.
    double at_start = std::abs(glm::dot(normal, eye_) - offset) + beside, growth = 1;
    double smallest = 1;
    for (int axis = 0; axis < 3; ++axis) {
      const double voxel = std::abs(glm::dot(normal, to_world[axis]));
      const double slope = glm::length(glm::row(to_index, axis));
      at_start += voxel * (std::abs(eye[axis]) + slope * beside + 0x1p-30);
      growth += voxel * slope;
      smallest += voxel / t_scale;
    }
    const double far = glm::length(eye_) + glm::length(finest_.origin) + std::abs(offset);
    const double error = kRounding * at_start + kFinerRounding * far,
                 error_growth = kRounding * growth + kNoDirection * smallest;
    const double a = glm::dot(normal, finest_.origin + start) - offset,
                 b = glm::dot(normal, step) / t_scale;
    RayPart surely, possibly;
    cut(surely, a - error, b - error_growth);
    cut(possibly, a + error, b + error_growth);
    const bool never_begins = a >= error || b + error_growth <= 0;
    begins.push_back({possibly.begin, never_begins       ? 0
                                      : b > error_growth ? surely.begin
                                                         : kInfinity});
    cut(result.surely, a - error, b - error_growth);
    cut(result.possibly, a + error, b + error_growth);
  }
  for (std::size_t i = 0; i < begins.size(); ++i) {
    const bool may_begin = begins[i].end > 0 && begins[i].end >= result.possibly.begin;
    if (may_begin && begins[i].begin <= result.possibly.end) result.begun_by |= 1u << i;
  }
  return result;
}

ClipTruth ClipOracle::first_hit(std::span<const OracleRay> rays) const {
  const KeptPart kept = this->kept(rays[0], frames_[0].view.t_scale);
  if (kept.possibly.begin > kept.possibly.end) return {};
  std::optional<bool> side;  // of the ray, where the level before ends
  for (std::size_t level = 0; level < frames_.size(); ++level) {
    const FrameParams &frame = frames_[level];
    const double scale = frame.view.t_scale, border = frame.band.begin_t,
                 next_border = frame.band.end_t;
    if (!(border < next_border)) continue;
    const OracleRay ray = in_brick(frame, rays[level]);
    const RootOracle &surface = surfaces_[level];
    const auto answer = [&](ClipTruth::Kind kind, double begin, double end) {
      return ClipTruth{kind, begin * scale, end * scale, level, kept.begun_by};
    };
    const ClipTruth undecided = answer(ClipTruth::kUndecided, 0, 0);
    const RayPart begin{kept.possibly.begin / scale, kept.surely.begin / scale},
        end{kept.surely.end / scale, kept.possibly.end / scale};
    const std::optional<bool> side_before = std::exchange(side, std::nullopt);

    const glm::ivec3 domain_end(frame.grid.dims_x - 1, frame.grid.dims_y - 1,
                                frame.grid.dims_z - 1);
    const auto domain = core::clip(ray, {0, 0, 0}, {domain_end.x, domain_end.y, domain_end.z});
    if (!domain || domain->t_enter >= domain->t_exit) continue;
    const double first = std::max(border, domain->t_enter),
                 last = std::min(next_border, domain->t_exit);
    if (first >= last || begin.begin > last || end.end < first) continue;

    double start = first;
    if (begin.end > first) {  // a plane cuts the ray, or may do so
      start = std::max(first, begin.begin);
      const double surely_begun = std::min(begin.end, last);
      if (begin.end > next_border) return undecided;
      const OracleHit change = surface.first_hit(ray, start);
      if (change.hit && change.t <= surely_begun) return undecided;
      const auto inside = surface.inside(ray, start);
      if (inside != surface.inside(ray, surely_begun)) return undecided;
      const glm::dvec3 point = vec(ray.origin) + start * vec(ray.direction),
                       last_cell = glm::dvec3(domain_end) - 1.0;
      const glm::ivec3 cell(glm::clamp(glm::floor(point), glm::dvec3(0), last_cell));
      if (caps_ && is_on_surface(surface, point, cell, frame.surface.isovalue)) return undecided;
      if (caps_ && inside.value_or(false)) {
        if (begin.begin <= first || begin.end > std::min(end.begin, last)) return undecided;
        return answer(ClipTruth::kCap, begin.begin, begin.end);
      }
      // A ray whose cut is so near a border may have crossed it before.
      if (begin.begin <= first && side_before && inside != side_before) return undecided;
    } else if (side_before && first == border) {
      const auto inside = surface.inside(ray, border);
      if (inside && inside != side_before) {
        if (end.begin <= border) return undecided;
        return answer(ClipTruth::kHit, border, border);
      }
    }

    const OracleHit change = surface.first_hit(ray, start);
    if (change.hit && change.t <= next_border) {
      if (change.t < end.begin) return answer(ClipTruth::kHit, change.t, change.t);
      return change.t <= end.end ? undecided : ClipTruth{};
    }
    if (end.end <= next_border) return {};
    if (next_border < domain->t_exit) side = surface.inside(ray, next_border);
  }
  return {};
}

namespace {

/// What is wrong with a renderer's answer; the count that it belongs to.
using Fault = std::uint64_t ClipAccuracy::*;

/// A hit of a renderer, and the level of detail that it is in.
struct PlacedHit {
  std::size_t level = 0;
  HitRecord record{};  ///< its block counts in the level's own grid
  RendererHit hit;
};

PlacedHit place(std::span<const FrameParams> frames, std::span<const OracleRay> rays,
                HitRecord record) {
  if (!std::isfinite(record.t)) return {};
  const std::uint32_t x = record.block_id % frames[0].grid.blocks_x,
                      y = record.block_id / frames[0].grid.blocks_x % frames[0].grid.blocks_y;
  std::uint32_t z = record.block_id / frames[0].grid.blocks_x / frames[0].grid.blocks_y;
  std::size_t level = 0;
  for (; level + 1 < frames.size() && z >= frames[level].grid.blocks_z; ++level)
    z -= frames[level].grid.blocks_z;
  const FrameParams &frame = frames[level];
  record.block_id = x + frame.grid.blocks_x * (y + frame.grid.blocks_y * z);
  return {level, record, renderer_hit(frame, in_brick(frame, rays[level]), record)};
}

/// None: the renderer is right.
Fault fault_of(const ClipOracle &oracle, std::span<const OracleRay> rays, const ClipTruth &truth,
               const PlacedHit &got) {
  const FrameParams &frame = oracle.frames()[got.level];
  const double t = got.hit.t * frame.view.t_scale;
  const double speed = speed_of(rays[truth.level]) / oracle.frames()[truth.level].view.t_scale;
  const bool hits = truth.kind != ClipTruth::kNone;
  if (hits && (!got.hit.hit || (t - truth.end) * speed > kSameHit)) return &ClipAccuracy::missed;
  if (!got.hit.hit) return nullptr;
  if (!hits || (truth.begin - t) * speed > kSameHit) return &ClipAccuracy::false_hits;
  const bool is_cap = (got.record.cell & ISO_CAP) != 0;
  if (is_cap != (truth.kind == ClipTruth::kCap)) return &ClipAccuracy::wrong_kinds;
  const auto [least, most] = std::minmax({got.record.x, got.record.y, got.record.z});
  if (!(least >= 0 && most <= 1) ||
      !place_fits(frame, in_brick(frame, rays[got.level]), got.record, got.hit))
    return &ClipAccuracy::wrong_places;
  if (is_cap) {
    if (got.record.t < truth.begin || got.record.t > truth.end) return &ClipAccuracy::wrong_places;
    return is_cap_gradient(oracle, got.record, truth.begun_by) ? nullptr
                                                               : &ClipAccuracy::wrong_gradients;
  }
  const bool right =
      std::abs(t - truth.begin) * speed <= kSamePlace ||
      is_on_surface(oracle.surface(got.level), vec(got.hit.point),
                    {got.hit.cell[0], got.hit.cell[1], got.hit.cell[2]}, frame.surface.isovalue);
  return right ? nullptr : &ClipAccuracy::wrong_places;
}

/// Does the oracle give another answer for a ray beside this one, or the renderer's?
bool is_unstable(const ClipOracle &oracle, std::span<const OracleRay> rays, const ClipTruth &truth,
                 const PlacedHit &got) {
  const BlockGrid &grid = oracle.frames()[0].grid;
  const glm::dvec3 middle = 0.5 * glm::dvec3(grid.dims_x, grid.dims_y, grid.dims_z);
  const double offset =
      glm::length(vec(rays[0].origin) - middle) < 3000 ? kSideways : kSidewaysFromAfar;
  for (int direction = 0; direction < 8; ++direction) {
    std::vector<OracleRay> beside;
    for (std::size_t level = 0; level < rays.size(); ++level) {
      const double voxel = oracle.frames()[level].view.t_scale / oracle.frames()[0].view.t_scale;
      beside.push_back(moved_sideways(rays[level], offset / voxel, direction));
    }
    const ClipTruth moved = oracle.first_hit(beside);
    const double speed = speed_of(rays[moved.level]) / oracle.frames()[moved.level].view.t_scale;
    if (moved.kind != truth.kind || std::abs(moved.begin - truth.begin) * speed > kSameHit)
      return true;
    if (fault_of(oracle, rays, moved, got) == nullptr) return true;
  }
  return false;
}

void judge(const ClipOracle &oracle, std::uint32_t pixel, const HitRecord &record,
           ClipAccuracy &tally) {
  const std::vector<OracleRay> rays = rays_of(oracle.frames(), pixel);
  const ClipTruth truth = oracle.first_hit(rays);
  ++tally.rays;
  tally.hits += truth.kind == ClipTruth::kHit;
  tally.caps += truth.kind == ClipTruth::kCap;
  if (truth.kind == ClipTruth::kUndecided) {
    ++tally.undecided;
    return;
  }
  const PlacedHit got = place(oracle.frames(), rays, record);
  const Fault fault = fault_of(oracle, rays, truth, got);
  if (fault == nullptr) return;
  const bool is_other_hit = fault == &ClipAccuracy::missed || fault == &ClipAccuracy::false_hits;
  if (is_other_hit && is_unstable(oracle, rays, truth, got)) {
    ++tally.undecided;
    return;
  }
  ++(tally.*fault);
  tally.failed.push_back(pixel);
}

}  // namespace

void merge(ClipAccuracy &into, const ClipAccuracy &from) {
  for (const auto count :
       {&ClipAccuracy::rays, &ClipAccuracy::hits, &ClipAccuracy::caps, &ClipAccuracy::missed,
        &ClipAccuracy::false_hits, &ClipAccuracy::wrong_kinds, &ClipAccuracy::wrong_places,
        &ClipAccuracy::wrong_gradients, &ClipAccuracy::undecided})
    into.*count += from.*count;
  into.failed.insert(into.failed.end(), from.failed.begin(), from.failed.end());
}

ClipAccuracy judge_clipped(const ClipOracle &oracle, std::span<const HitRecord> hits) {
  const View &view = oracle.frames()[0].view;
  if (hits.size() != std::size_t{view.width} * view.height)
    throw std::invalid_argument("judge_clipped: the hits do not fit the frame");
  std::vector<ClipAccuracy> tallies(thread_count(0));
  parallel_for(view.height, 0, [&](std::uint64_t row, std::uint32_t thread) {
    for (std::uint32_t column = 0; column < view.width; ++column) {
      const auto pixel = static_cast<std::uint32_t>(row * view.width + column);
      judge(oracle, pixel, hits[pixel], tallies[thread]);
    }
  });
  ClipAccuracy sum;
  for (const ClipAccuracy &tally : tallies) merge(sum, tally);
  std::ranges::sort(sum.failed);
  return sum;
}

}  // namespace isowave::core
