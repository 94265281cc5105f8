#include "core/accuracy/ray_sample.hpp"

#include <cmath>

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

}  // namespace

ImageSize sample_of(ImageSize size) {
  const auto side = static_cast<std::uint32_t>(std::sqrt(size.num_rays() / kSampleRays));
  size.stride = side == 0 ? 1 : side - (side + 1) % 2;
  return size;
}

SampledShare compare_hits(const Camera &camera, ImageSize size, std::span<const float> finest,
                          std::span<const float> other, double limit) {
  SampledShare sample;
  sample.num_rays = finest.size();
  for (std::size_t ray = 0; ray < finest.size(); ++ray) {
    const double t = double{other[ray]}, true_t = double{finest[ray]};
    if (std::isinf(t) && std::isinf(true_t)) continue;
    ++sample.num_hits;
    if (std::isinf(t) || std::isinf(true_t)) continue;
    sample.num_within += std::abs(t - true_t) <= limit * pixel_size_at(camera, size.height, t);
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
