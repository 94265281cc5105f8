#include "core/volume/pyramid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/base/parallel_for.hpp"

namespace isowave::core {

namespace {

constexpr std::uint32_t kShortestAxis = 8;  ///< that is halved once more

constexpr std::uint32_t kNumTaps = 5;

/// Gives values to taps without data, which are NaN: the middle one gets the mean of its
/// neighbours, each other one a copy of the next towards the middle. The middle one stays NaN if a
/// neighbour has no data either.
std::array<float, kNumTaps> with_copies(std::array<float, kNumTaps> v) {
  if (std::isnan(v[2])) v[2] = 0.5f * v[1] + 0.5f * v[3];
  if (std::isnan(v[1])) v[1] = v[2];
  if (std::isnan(v[3])) v[3] = v[2];
  if (std::isnan(v[0])) v[0] = v[1];
  if (std::isnan(v[4])) v[4] = v[3];
  return v;
}

/// -1/16, 1/4, 5/8, 1/4, -1/16, but never beyond the values themselves, so that a step does not
/// ring and no sum overflows. NaN if the coarse voxel has no data.
float low_pass(std::array<float, kNumTaps> v) {
  if (std::isnan(v[0] + v[1] + v[2] + v[3] + v[4])) v = with_copies(v);
  if (std::isnan(v[2])) return v[2];
  const auto [least, largest] = std::minmax({v[0], v[1], v[2], v[3], v[4]});
  const float inner = 0.625f * v[2] + (0.25f * v[1] + 0.25f * v[3]);
  return std::clamp(inner - (0.0625f * v[0] + 0.0625f * v[4]), least, largest);
}

/// The voxels that coarse voxel k of an axis of n fine ones takes its values from.
std::array<std::uint32_t, kNumTaps> taps(std::uint32_t k, std::uint32_t n) {
  std::array<std::uint32_t, kNumTaps> at{};
  for (std::uint32_t i = 0; i < kNumTaps; ++i)
    at[i] = std::min(2 * k + i - std::min(2 * k + i, 2u), n - 1);
  return at;
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
  for (std::uint32_t n = std::min({dims.x, dims.y, dims.z});
       n >= kShortestAxis && levels < kMaxLevels; n = n / 2 + 1) {
    ++levels;
  }
  return levels;
}

Downsampler::Downsampler(const glm::uvec3 &fine_dims, std::uint32_t num_threads, Sink sink)
    : fine_(fine_dims),
      coarse_(fine_dims / 2u + 1u),
      num_threads_(num_threads),
      sink_(std::move(sink)) {}

void Downsampler::add(std::span<const float> layers) {
  const std::size_t fine_layer = std::size_t{fine_.x} * fine_.y,
                    plane = std::size_t{coarse_.x} * coarse_.y;
  const std::size_t num_layers = layers.size() / fine_layer;
  planes_.resize(plane * num_layers);
  parallel_for(num_layers * coarse_.y, num_threads_, [&](std::uint64_t row, std::uint32_t) {
    const float *layer = layers.data() + row / coarse_.y * fine_layer;
    const auto y = taps(static_cast<std::uint32_t>(row % coarse_.y), fine_.y);
    const auto along_y = [&](std::uint32_t x) {
      const auto value = [&](std::size_t i) { return layer[x + std::size_t{fine_.x} * y[i]]; };
      return low_pass({value(0), value(1), value(2), value(3), value(4)});
    };
    std::vector<float> rows(fine_.x);
    for (std::uint32_t x = 0; x < fine_.x; ++x) rows[x] = along_y(x);
    float *out = planes_.data() + row * coarse_.x;
    for (std::uint32_t k = 0; k < coarse_.x; ++k) {
      const auto x = taps(k, fine_.x);
      out[k] = low_pass({rows[x[0]], rows[x[1]], rows[x[2]], rows[x[3]], rows[x[4]]});
    }
  });
  for (std::size_t i = 0; i < num_layers; ++i)
    add_plane(z_++, std::span(planes_).subspan(i * plane, plane));
}

void Downsampler::add_plane(std::uint32_t z, std::span<const float> plane) {
  recent_.emplace_back(plane.begin(), plane.end());
  if (recent_.size() > kNumTaps) recent_.pop_front();
  const bool last = z + 1 == fine_.z;
  while (num_emitted_ < coarse_.z && (last || 2 * num_emitted_ + 2 <= z)) emit(z);
}

/// last: the fine layer that recent_ ends with.
void Downsampler::emit(std::uint32_t last) {
  std::array<const float *, kNumTaps> planes{};
  std::ranges::transform(taps(num_emitted_, fine_.z), planes.begin(), [&](std::uint32_t z) {
    return recent_[recent_.size() - 1 - (last - z)].data();
  });
  const std::size_t begin = chunk_.size(), size = std::size_t{coarse_.x} * coarse_.y;
  chunk_.resize(begin + size);
  for (std::size_t i = 0; i < size; ++i) {
    const auto value = [&](std::size_t tap) { return planes[tap][i]; };
    chunk_[begin + i] = low_pass({value(0), value(1), value(2), value(3), value(4)});
  }
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

}  // namespace isowave::core
