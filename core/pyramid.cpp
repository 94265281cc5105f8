#include "core/pyramid.hpp"

#include <algorithm>
#include <utility>

#include "core/parallel_for.hpp"

namespace isowave {

namespace {

constexpr std::uint32_t kShortestAxis = 8;  ///< that is halved once more

/// 1/4, 1/2, 1/4; products first, which are exact, so that no sum of large voxels overflows.
float mean_of(float before, float at, float behind) {
  return (0.25f * before + 0.25f * behind) + 0.5f * at;
}

/// Where coarse voxel k of an axis of n fine ones takes its three values.
struct Neighbours {
  std::uint32_t before, at, behind;
};
Neighbours neighbours(std::uint32_t k, std::uint32_t n) {
  const std::uint32_t at = 2 * k, last = n - 1;
  return {at == 0 ? 0 : std::min(at - 1, last), std::min(at, last), std::min(at + 1, last)};
}

}  // namespace

VolumeInfo coarser_level(const VolumeInfo &fine) {
  VolumeInfo coarse = fine;
  coarse.dims = fine.dims / 2u + 1u;
  coarse.spacing = 2.0 * fine.spacing;
  coarse.type = VoxelType::kFloat32;
  return coarse;
}

std::uint32_t max_levels(const glm::uvec3 &dims) {
  std::uint32_t levels = 1;
  for (std::uint32_t n = std::min({dims.x, dims.y, dims.z}); n >= kShortestAxis && levels < kMaxLevels;
       n = n / 2 + 1) {
    ++levels;
  }
  return levels;
}

Downsampler::Downsampler(const glm::uvec3 &fine_dims, std::uint32_t num_threads, Sink sink)
    : fine_(fine_dims), coarse_(fine_dims / 2u + 1u), num_threads_(num_threads), sink_(std::move(sink)) {}

void Downsampler::add(std::span<const float> layers) {
  const std::size_t fine_layer = std::size_t{fine_.x} * fine_.y, plane = std::size_t{coarse_.x} * coarse_.y;
  const std::size_t num_layers = layers.size() / fine_layer;
  planes_.resize(plane * num_layers);
  parallel_for(num_layers * coarse_.y, num_threads_, [&](std::uint64_t row, std::uint32_t) {
    const float *layer = layers.data() + row / coarse_.y * fine_layer;
    const Neighbours y = neighbours(static_cast<std::uint32_t>(row % coarse_.y), fine_.y);
    const float *before = layer + std::size_t{y.before} * fine_.x, *at = layer + std::size_t{y.at} * fine_.x,
                *behind = layer + std::size_t{y.behind} * fine_.x;
    std::vector<float> mean(fine_.x);
    for (std::uint32_t x = 0; x < fine_.x; ++x) mean[x] = mean_of(before[x], at[x], behind[x]);
    float *out = planes_.data() + row * coarse_.x;
    for (std::uint32_t k = 0; k < coarse_.x; ++k) {
      const Neighbours x = neighbours(k, fine_.x);
      out[k] = mean_of(mean[x.before], mean[x.at], mean[x.behind]);
    }
  });
  for (std::size_t i = 0; i < num_layers; ++i) add_plane(z_++, std::span(planes_).subspan(i * plane, plane));
}

void Downsampler::add_plane(std::uint32_t z, std::span<const float> plane) {
  const bool last = z + 1 == fine_.z;
  if (z % 2 == 0) {
    even_.assign(plane.begin(), plane.end());
    if (last) emit(before_, even_, even_);
    return;
  }
  emit(z == 1 ? even_ : before_, even_, plane);
  before_.assign(plane.begin(), plane.end());
  if (last) emit(plane, plane, plane);
}

void Downsampler::emit(std::span<const float> before, std::span<const float> at,
                       std::span<const float> behind) {
  const std::size_t begin = chunk_.size();
  chunk_.resize(begin + at.size());
  for (std::size_t i = 0; i < at.size(); ++i) chunk_[begin + i] = mean_of(before[i], at[i], behind[i]);
  ++num_emitted_;
  const std::uint32_t num_layers = num_emitted_ - chunk_begin_;
  if (num_layers < layers_per_chunk(coarse_) && num_emitted_ < coarse_.z) return;
  sink_(make_chunk(coarse_, chunk_begin_, chunk_));
  chunk_begin_ = num_emitted_;
  chunk_.clear();
}

std::vector<float> downsample(const glm::uvec3 &dims, std::span<const float> voxels) {
  std::vector<float> coarse;
  Downsampler downsampler(dims, 0, [&coarse](const Chunk &chunk) {
    coarse.insert(coarse.end(), chunk.voxels.begin(), chunk.voxels.end());
  });
  downsampler.add(voxels);
  return coarse;
}

}  // namespace isowave
