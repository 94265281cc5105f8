#include "core/accuracy/ray_sample.hpp"

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <numbers>

#include "core/view/trigonometry.hpp"
#include "kernels_cl/portable/grid_dda.h"

namespace isowave::core {

namespace {

constexpr std::uint64_t kSampleRays = 1 << 13;

/// Probability that of num_hits rays at most num_beyond are beyond an error, if each is with
/// probability 1 - share.
double probability(std::uint64_t num_beyond, std::uint64_t num_hits, double share) {
  const double odds = std::log((1 - share) / share);
  double log_term = double(num_hits) * std::log(share), sum = std::exp(log_term);
  for (std::uint64_t i = 0; i < num_beyond; ++i) {
    log_term += std::log(double(num_hits - i) / double(i + 1)) + odds;
    sum += std::exp(log_term);
  }
  return sum;
}

/// Whether a ray's hit is near what frames show along the ray and beside it.
///
/// error  [world units]
bool is_near(const SeenFrame &frame, std::span<const SeenFrame> shown, std::size_t ray,
             double error) {
  const double t = double{frame.depth[ray]};
  double least = INFINITY, largest = -INFINITY;
  for (const SeenFrame &beside : shown) {
    const double seen = double{beside.depth[ray]};
    if (std::isinf(seen)) continue;
    least = std::min(least, seen);
    largest = std::max(largest, seen);
    const std::array<float, 3> &of_hit = beside.normals[ray];
    const glm::dvec3 apart = frame.positions[ray] - beside.positions[ray],
                     normal(of_hit[0], of_hit[1], of_hit[2]);
    if (glm::length(apart) <= kGrazing * error && glm::length(normal) > 0.5 &&
        std::abs(glm::dot(apart, normal)) <= error)
      return true;
  }
  return t >= least - error && t <= largest + error;
}

}  // namespace

ImageSize sample_of(ImageSize size) {
  const auto side = static_cast<std::uint32_t>(std::sqrt(size.num_rays() / kSampleRays));
  size.stride = side == 0 ? 1 : side - (side + 1) % 2;
  return size;
}

SeenFrame seen_frame(Renderer &renderer, const Camera &camera) {
  const FrameArrays arrays = renderer.fetch({.depth = true, .normals = true}, {});
  SeenFrame frame{arrays.depth.copy(), arrays.normals.copy(), {}};
  const ImageSize size = renderer.size();
  const View view = make_view(renderer.levels().front(), camera, size);
  const double pixels = 0.5 / size.samples;  // twice u and v count rays
  frame.positions.resize(frame.depth.size());
  for (std::size_t ray = 0; ray < frame.depth.size(); ++ray) {
    if (std::isinf(frame.depth[ray])) continue;
    const RayPlace place =
        place_of_ray(&view, static_cast<int>(ray % view.width), static_cast<int>(ray / view.width));
    const glm::dvec2 at(twice_u(&view, place.column), twice_v(&view, place.row));
    frame.positions[ray] = point_of_ray(camera, pixels * at, size.height, double{frame.depth[ray]});
  }
  return frame;
}

std::vector<Camera> cameras_beside(const Camera &camera, std::uint32_t height, double pixels) {
  constexpr int kDirections = 8;
  std::vector<Camera> cameras{camera};
  for (const double by : {pixels, pixels / 2}) {
    for (int i = 0; i < kDirections; ++i) {
      const double angle = 2 * std::numbers::pi / kDirections * i;
      cameras.push_back(aside(camera, by * glm::dvec2(cosine(angle), sine(angle)), height));
    }
  }
  return cameras;
}

SampledShare compare_hits(const Camera &camera, ImageSize size, std::span<const SeenFrame> finest,
                          std::span<const SeenFrame> other, double limit) {
  SampledShare sample;
  sample.num_rays = finest.front().depth.size();
  for (std::size_t ray = 0; ray < sample.num_rays; ++ray) {
    const bool hits_finest = !std::isinf(finest.front().depth[ray]),
               hits_other = !std::isinf(other.front().depth[ray]);
    const auto error_at = [&](const SeenFrame &frame) {
      return limit * pixel_size_at(camera, size.height, double{frame.depth[ray]});
    };
    sample.num_hits += hits_finest || hits_other;
    sample.num_within +=
        (hits_finest || hits_other) &&
        (!hits_finest || is_near(finest.front(), other, ray, error_at(finest.front()))) &&
        (!hits_other || is_near(other.front(), finest, ray, error_at(other.front())));
  }
  return sample;
}

double lowest_share(std::uint64_t num_within, std::uint64_t num_hits) {
  if (num_within == 0) return 0;
  double low = 0, high = 1;
  for (int i = 0; i < 50; ++i) {
    const double share = (low + high) / 2;
    (probability(num_hits - num_within, num_hits, share) <= 1 - kConfidence ? low : high) = share;
  }
  return low;
}

bool suffices(const SampledShare &sample) {
  return sample.num_within > 0 && probability(sample.num_hits - sample.num_within, sample.num_hits,
                                              kSampledShare) <= 1 - kConfidence;
}

}  // namespace isowave::core
