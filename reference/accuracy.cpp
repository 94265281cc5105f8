#include "reference/accuracy.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

namespace isowave {

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
bool stable(const RootOracle &oracle, const OracleRay &ray, const OracleHit &first, double offset) {
  const double speed = length(ray.direction);
  const auto [a, b] = sideways(ray.direction);
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.7853981633974483 * i;
    OracleRay beside = ray;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      beside.origin[axis] += offset * (std::cos(angle) * a[axis] + std::sin(angle) * b[axis]);
    }
    const OracleHit moved = oracle.first_hit(beside);
    if (moved.hit != first.hit) return false;
    if (first.hit && std::abs(moved.t - first.t) * speed > kSameHit) return false;
  }
  return true;
}

}  // namespace

Quantiles quantiles(std::vector<double> values) {
  if (values.empty()) return {};
  const auto at = [&](double q) {
    const auto i = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + i, values.end());
    return values[static_cast<std::size_t>(i)];
  };
  return {at(0.5), at(0.99), at(1.0)};
}

void judge(const RootOracle &oracle, const FrameParams &frame, const Ray &ray, const HitRecord &record,
           Accuracy &tally) {
  const OracleRay exact{{ray.x.o, ray.y.o, ray.z.o}, {ray.x.d, ray.y.d, ray.z.d}};
  const OracleHit truth = oracle.first_hit(exact);
  const Vec &d = exact.direction;
  const double speed = length(d);  // voxels per unit of t
  const bool hit = std::isfinite(record.t);
  ++tally.rays;
  tally.hits += truth.hit;
  // From cell and local position, not from t: a float32 t of 3,000 is only good to 2e-4.
  Vec point{};
  double along = 0;
  if (hit) {
    const std::uint32_t block[3] = {record.block_id % frame.blocks_x,
                                    record.block_id / frame.blocks_x % frame.blocks_y,
                                    record.block_id / frame.blocks_x / frame.blocks_y};
    const float local[3] = {record.x, record.y, record.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      point[axis] = 4.0 * block[axis] + (record.cell >> (2 * axis) & 3u) + double(local[axis]);
      along += (point[axis] - exact.origin[axis]) * d[axis];
    }
    along /= speed * speed;
  }
  const bool missed = truth.hit && (!hit || (along - truth.t) * speed > kSameHit);
  const bool false_hit = hit && (!truth.hit || (truth.t - along) * speed > kSameHit);
  if (missed || false_hit) {
    const Vec from_centre{exact.origin[0] - 0.5 * (frame.dims_x - 1),
                          exact.origin[1] - 0.5 * (frame.dims_y - 1),
                          exact.origin[2] - 0.5 * (frame.dims_z - 1)};
    if (!stable(oracle, exact, truth, length(from_centre) >= 3000 ? 5e-5 : 1e-5)) {
      ++tally.unstable;
    } else {
      ++(missed ? tally.missed : tally.false_hits);
    }
    return;
  }
  if (!hit) return;
  tally.distance.push_back(std::abs(along - truth.t) * speed);
  const double slope = length(oracle.gradient(point));
  if (slope > 0) tally.residual.push_back(std::abs(oracle.field(point) - double(frame.isovalue)) / slope);
}

void merge(Accuracy &into, const Accuracy &from) {
  into.rays += from.rays;
  into.hits += from.hits;
  into.missed += from.missed;
  into.false_hits += from.false_hits;
  into.unstable += from.unstable;
  into.distance.insert(into.distance.end(), from.distance.begin(), from.distance.end());
  into.residual.insert(into.residual.end(), from.residual.begin(), from.residual.end());
}

Accuracy judge_frame(const RootOracle &oracle, const FrameParams &frame, std::span<const HitRecord> hits) {
  std::atomic<std::uint32_t> next_row{0};
  std::vector<Accuracy> tallies(std::max(1u, std::thread::hardware_concurrency()));
  {
    std::vector<std::jthread> pool;
    for (Accuracy &tally : tallies) {
      pool.emplace_back([&] {
        for (std::uint32_t row = next_row++; row < frame.height; row = next_row++) {
          for (std::uint32_t pixel = row * frame.width; pixel < (row + 1) * frame.width; ++pixel) {
            judge(oracle, frame, make_ray(&frame, pixel), hits[pixel], tally);
          }
        }
      });
    }
  }
  Accuracy sum;
  for (const Accuracy &tally : tallies) merge(sum, tally);
  return sum;
}

}  // namespace isowave
