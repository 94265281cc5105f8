#include "reference/accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/parallel_for.hpp"

namespace isowave::core {

namespace {

using Vec = std::array<double, 3>;

double dot(const Vec &a, const Vec &b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
double length(const Vec &v) {
  return std::sqrt(dot(v, v));
}

/// Two unit vectors at right angles to d and to each other.
std::array<Vec, 2> sideways(const Vec &d) {
  std::size_t smallest = 0;
  for (std::size_t axis = 1; axis < 3; ++axis) {
    if (std::abs(d[axis]) < std::abs(d[smallest])) smallest = axis;
  }
  Vec e{};
  e[smallest] = 1;
  Vec a{d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]};
  Vec b{d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2], d[0] * a[1] - d[1] * a[0]};
  const double la = length(a), lb = length(b);
  for (double &x : a) x /= la;
  for (double &x : b) x /= lb;
  return {a, b};
}

/// Does the oracle give `first` for all of eight rays beside this one?
bool stable(const HitOracle &oracle, const OracleRay &ray, const OracleHit &first, double offset) {
  const double speed = speed_of(ray);
  for (int i = 0; i < 8; ++i) {
    const OracleHit moved = oracle.first_hit(moved_sideways(ray, offset, i));
    if (moved.hit != first.hit) return false;
    if (first.hit && std::abs(moved.t - first.t) * speed > kSameHit) return false;
  }
  return true;
}

/// Does the oracle find its hit in `cell` for any of eight rays beside this one?
bool hits_beside(const HitOracle &oracle, const OracleRay &ray, const std::array<int, 3> &cell,
                 double offset) {
  for (int i = 0; i < 8; ++i) {
    const OracleHit moved = oracle.first_hit(moved_sideways(ray, offset, i));
    if (moved.hit && moved.cell == cell) return true;
  }
  return false;
}

/// Is the ray's point at t in the cell grown by `margin`?
bool in_cell(const OracleRay &ray, double t, const std::array<int, 3> &cell, double margin) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double x = (ray.origin[axis] - cell[axis]) + t * ray.direction[axis];
    if (x < -margin || x > 1 + margin) return false;
  }
  return true;
}

}  // namespace

OracleRay exact_ray(const Ray &ray) {
  return {{ray.x.o, ray.y.o, ray.z.o}, {ray.x.d, ray.y.d, ray.z.d}};
}

double speed_of(const OracleRay &ray) {
  return length(ray.direction);
}

OracleRay moved_sideways(const OracleRay &ray, double offset, int direction) {
  const auto [a, b] = sideways(ray.direction);
  const double angle = 0.7853981633974483 * direction;
  OracleRay beside = ray;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    beside.origin[axis] += offset * (std::cos(angle) * a[axis] + std::sin(angle) * b[axis]);
  }
  return beside;
}

RendererHit renderer_hit(const FrameParams &frame, const OracleRay &ray, const HitRecord &record) {
  RendererHit result;
  result.hit = std::isfinite(record.t);
  if (!result.hit) return result;
  const std::uint32_t block[3] = {record.block_id % frame.grid.blocks_x,
                                  record.block_id / frame.grid.blocks_x % frame.grid.blocks_y,
                                  record.block_id / frame.grid.blocks_x / frame.grid.blocks_y};
  const float local[3] = {record.x, record.y, record.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.cell[axis] = static_cast<int>(4 * block[axis] + (record.cell >> (2 * axis) & 3u));
    result.point[axis] = result.cell[axis] + double(local[axis]);
    result.t += (result.point[axis] - ray.origin[axis]) * ray.direction[axis];
  }
  result.t /= dot(ray.direction, ray.direction);
  return result;
}

Quantiles quantiles(std::vector<double> values) {
  if (values.empty()) return {};
  const auto at = [&](double q) {
    const auto i = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + i, values.end());
    return values[static_cast<std::size_t>(i)];
  };
  return {at(0.5), at(0.99), at(1.0)};
}

bool place_fits(const FrameParams &frame, const OracleRay &ray, const HitRecord &record,
                const RendererHit &hit) {
  const double speed = speed_of(ray);
  const double difference = std::abs(double(record.t) / double(frame.view.t_scale) - hit.t);
  Vec beside;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    beside[axis] = hit.point[axis] - (ray.origin[axis] + hit.t * ray.direction[axis]);
  }
  return difference <= 0x1p-21 * (std::abs(hit.t) + 1 / speed) && length(beside) <= 0x1p-20;
}

void judge(const HitOracle &oracle, const FrameParams &frame, const Ray &ray,
           const HitRecord &record, Accuracy &tally) {
  const OracleRay exact = exact_ray(ray);
  const OracleHit truth = oracle.first_hit(exact);
  const RendererHit got = renderer_hit(frame, exact, record);
  const double speed = speed_of(exact);
  ++tally.rays;
  tally.hits += truth.hit;
  if (got.hit && !place_fits(frame, exact, record, got)) {
    ++tally.wrong_places;
    if (std::isnan(got.t)) return;  // no position to judge
  }
  const Vec from_centre{exact.origin[0] - 0.5 * (frame.grid.dims_x - 1),
                        exact.origin[1] - 0.5 * (frame.grid.dims_y - 1),
                        exact.origin[2] - 0.5 * (frame.grid.dims_z - 1)};
  const double offset = length(from_centre) >= 3000 ? 5e-5 : 1e-5;
  const bool missed = truth.hit && (!got.hit || (got.t - truth.t) * speed > kSameHit);
  const bool false_hit = got.hit && (!truth.hit || (truth.t - got.t) * speed > kSameHit);
  if (missed || false_hit) {
    if (!stable(oracle, exact, truth, offset)) {
      ++tally.unstable;
    } else {
      ++(missed ? tally.missed : tally.false_hits);
    }
    return;
  }
  if (!got.hit) return;
  if (got.cell != truth.cell) {
    if (in_cell(exact, truth.t, got.cell, offset)) {
      ++tally.at_faces;
    } else {
      ++(hits_beside(oracle, exact, got.cell, offset) ? tally.unstable : tally.wrong_cells);
    }
  }
  tally.distance.push_back(std::abs(got.t - truth.t) * speed);
  const double slope = length(oracle.gradient(got.point));
  if (slope > 0)
    tally.residual.push_back(std::abs(oracle.field(got.point) - double(frame.surface.isovalue)) /
                             slope);
}

void merge(Accuracy &into, const Accuracy &from) {
  into.rays += from.rays;
  into.hits += from.hits;
  into.missed += from.missed;
  into.false_hits += from.false_hits;
  into.wrong_cells += from.wrong_cells;
  into.at_faces += from.at_faces;
  into.wrong_places += from.wrong_places;
  into.unstable += from.unstable;
  into.distance.insert(into.distance.end(), from.distance.begin(), from.distance.end());
  into.residual.insert(into.residual.end(), from.residual.begin(), from.residual.end());
}

Accuracy judge_rays(const FrameParams &frame, std::span<const HitRecord> hits,
                    const JudgeRay &judge_ray) {
  if (hits.size() != std::size_t{frame.view.width} * frame.view.height) {
    throw std::invalid_argument("judge_rays: the hits do not fit the frame");
  }
  std::vector<Accuracy> tallies(thread_count(0));
  parallel_for(frame.view.height, 0, [&](std::uint64_t row, std::uint32_t thread) {
    for (std::uint32_t column = 0; column < frame.view.width; ++column) {
      const auto pixel = static_cast<std::uint32_t>(row * frame.view.width + column);
      judge_ray(make_ray(&frame, pixel), hits[pixel], tallies[thread]);
    }
  });
  Accuracy sum;
  for (const Accuracy &tally : tallies) merge(sum, tally);
  return sum;
}

Accuracy judge_frame(const HitOracle &oracle, const FrameParams &frame,
                     std::span<const HitRecord> hits) {
  return judge_rays(frame, hits, [&](const Ray &ray, const HitRecord &hit, Accuracy &tally) {
    judge(oracle, frame, ray, hit, tally);
  });
}

}  // namespace isowave::core
