#include "core/zfp/level_bounds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/volume/block_errors.hpp"
#include "kernels_cl/portable/block_bound.h"

namespace isowave::core {

namespace {

/// Fine voxels of an axis that cells touching a coarse block's voxels have: [begin, end).
struct Reach {
  std::uint32_t begin, end;
};
Reach reach_of(std::uint32_t block, std::uint32_t fine_dim) {
  const std::uint32_t first = 8 * block;
  return {first - std::min(first, 2u), std::min(first + 9, fine_dim)};
}

/// Roundings by which float32 may lose between voxels and the field at a hit: of values, when they
/// are raised or lowered; of their differences from the isovalue, when these are taken (1), where
/// lerps of three axes (6), positions on two (2), sums and thirds (4) make a cubic of them
/// (segment_cubic()), and where three more (6) evaluate that. 19, and some for what is left out
/// here.
constexpr double kValueRounding = 2 * 0x1p-24, kDifferenceRounding = 24 * 0x1p-24;

}  // namespace

LevelBounds::LevelBounds(const glm::uvec3 &fine_dims, const glm::uvec3 &coarse_dims,
                         std::uint32_t num_threads)
    : fine_(fine_dims),
      coarse_(coarse_dims),
      blocks_((coarse_dims + 3u) / 4u),
      num_threads_(num_threads) {
  off_.made.resize(std::size_t{blocks_.x} * blocks_.y * blocks_.z);
  off_.decoded.resize(off_.made.size());
}

void LevelBounds::add_fine(std::span<const float> layers) {
  const std::size_t size = std::size_t{fine_.x} * fine_.y;
  for (; !layers.empty(); layers = layers.subspan(size))
    fine_layers_.emplace_back(layers.begin(), layers.begin() + std::ptrdiff_t(size));
  compare_ready_layers();
}

void LevelBounds::add_coarse(std::span<const float> layers, std::span<const float> decoded) {
  const std::size_t size = std::size_t{coarse_.x} * coarse_.y;
  const auto layer = [size](std::span<const float> from) {
    return std::vector<float>(from.begin(), from.begin() + std::ptrdiff_t(size));
  };
  for (; !layers.empty(); layers = layers.subspan(size), decoded = decoded.subspan(size)) {
    CoarseLayer &both = coarse_layers_.emplace_back(CoarseLayer{layer(layers), layer(decoded)});
    for (std::size_t i = 0; i < size; ++i) {
      if (std::isnan(both.made[i])) both.decoded[i] = both.made[i];
    }
  }
  compare_ready_layers();
}

void LevelBounds::compare_ready_layers() {
  while (!fine_layers_.empty()) {
    for (; !coarse_layers_.empty() && coarse_z_ < fine_z_ / 2; ++coarse_z_)
      coarse_layers_.pop_front();
    if (coarse_layers_.size() < 1 + fine_z_ % 2) return;
    compare_layer(fine_z_, fine_layers_.front());
    fine_layers_.pop_front();
    ++fine_z_;
  }
}

void LevelBounds::compare_layer(std::uint32_t z, const std::vector<float> &layer) {
  const CoarseLayer &below = coarse_layers_[0], &above = coarse_layers_[z % 2];
  parallel_for(blocks_.y, num_threads_, [&](std::uint64_t by, std::uint32_t) {
    compare_rows(z, by, layer, below.made, above.made, off_.made);
    compare_rows(z, by, layer, below.decoded, above.decoded, off_.decoded);
  });
}

void LevelBounds::compare_rows(std::uint32_t z, std::uint64_t by, const std::vector<float> &layer,
                               const std::vector<float> &below, const std::vector<float> &above,
                               std::vector<float> &off) {
  const Reach ys = reach_of(static_cast<std::uint32_t>(by), fine_.y);
  // In double precision: where values are large and their differences are not, those would be lost
  // in float32.
  std::vector<double> coarse(coarse_.x), largest(fine_.x);
  for (std::uint32_t y = ys.begin; y < ys.end; ++y) {
    const std::size_t row = std::size_t{y / 2} * coarse_.x, next = row + (y % 2) * coarse_.x;
    for (std::uint32_t x = 0; x < coarse_.x; ++x) {
      coarse[x] = 0.25 * ((double{below[row + x]} + double{above[row + x]}) +
                          (double{below[next + x]} + double{above[next + x]}));
    }
    const float *fine = layer.data() + std::size_t{y} * fine_.x;
    for (std::uint32_t x = 0; x < fine_.x; ++x) {
      const double at = 0.5 * (coarse[x / 2] + coarse[(x + 1) / 2]);
      largest[x] = std::max(largest[x], std::abs(at - double{fine[x]}));  // NaN: stays as it is
    }
  }
  for (std::uint32_t bx = 0; bx < blocks_.x; ++bx) {
    const Reach xs = reach_of(bx, fine_.x);
    const float most =
        rounded_up(*std::max_element(largest.begin() + xs.begin, largest.begin() + xs.end));
    for (std::uint32_t bz = 0; bz < blocks_.z; ++bz) {
      const Reach zs = reach_of(bz, fine_.z);
      if (z < zs.begin || z >= zs.end) continue;
      float &bound = off[bx + blocks_.x * (by + std::size_t{blocks_.y} * bz)];
      bound = std::max(bound, most);
    }
  }
}

LevelBounds::Off LevelBounds::finish(std::span<const float> finer) const {
  Off off = off_;
  if (finer.empty()) return off;
  const glm::uvec3 finer_blocks = (fine_ + 3u) / 4u;
  for (std::uint32_t z = 0; z < blocks_.z; ++z) {
    for (std::uint32_t y = 0; y < blocks_.y; ++y) {
      for (std::uint32_t x = 0; x < blocks_.x; ++x) {
        // The cells compared above belong to these blocks of the finer level.
        const glm::uvec3 at(x, y, z), begin = 2u * at - glm::min(2u * at, glm::uvec3(1));
        const glm::uvec3 end = glm::min(2u * at + 2u, finer_blocks);
        float most = 0;
        for (std::uint32_t fz = begin.z; fz < end.z; ++fz) {
          for (std::uint32_t fy = begin.y; fy < end.y; ++fy) {
            for (std::uint32_t fx = begin.x; fx < end.x; ++fx)
              most = std::max(most,
                              finer[fx + finer_blocks.x * (fy + std::size_t{finer_blocks.y} * fz)]);
          }
        }
        const std::size_t block = x + blocks_.x * (y + std::size_t{blocks_.y} * z);
        for (std::vector<float> *of : {&off.made, &off.decoded})
          (*of)[block] = rounded_up(double{(*of)[block]} + double{most});
      }
    }
  }
  return off;
}

BlockBounds encode_bounds(std::span<const float> bounds) {
  return encode_bounds(bounds, bounds.empty() ? 0.0f : std::ranges::max(bounds));
}

BlockBounds encode_bounds(std::span<const float> bounds, float largest) {
  BlockBounds result;
  if (largest > 0) {
    result.exponent = std::clamp(std::ilogb(double{largest} / double{ISO_BOUND_MAX}) + 1,
                                 kMinBoundExponent, kMaxBoundExponent);
  }
  std::array<double, ISO_BOUND_CODES> values{};
  for (std::uint32_t code = 0; code < values.size(); ++code)
    values[code] = std::ldexp(double{block_bound(code)}, result.exponent);
  result.codes.reserve(bounds.size());
  for (const float bound : bounds) {
    const auto code = std::ranges::lower_bound(values, double{bound}) - values.begin();
    result.codes.push_back(static_cast<std::uint8_t>(code));
  }
  return result;
}

std::optional<double> known_voxel_error(const CompressedVolume &volume) {
  if (volume.max_voxel_error) return volume.max_voxel_error;
  // zfp's promise is for the float32 that it was given.
  if (volume.precision.min_exponent == ISO_ALL_PLANES || !fits_float32(volume.info.type)) return {};
  if (volume.precision.is_reversible()) return 0;
  return std::ldexp(1.0, volume.precision.min_exponent);
}

LevelError::LevelError(const CompressedVolume &level, bool finest) {
  const BlockBounds &bounds = level.bounds;
  if (!bounds.codes.empty()) {
    uniform = 0;
    unit = std::ldexp(1.0f, bounds.exponent);
    largest = double{largest_bound(bounds)};
  } else if (finest) {
    uniform = known_voxel_error(level);
    largest = uniform.value_or(0);
  }
}

float largest_bound(const BlockBounds &bounds) {
  if (bounds.codes.empty()) return 0;
  const std::uint8_t largest = std::max(std::ranges::max(bounds.codes), bounds.largest_of_whole);
  return std::ldexp(block_bound(largest), bounds.exponent);
}

double plane_error(const BlockPrecision &bound, double voxel_error) {
  const BlockPrecision fewer = with_fewer_planes(bound, voxel_error);
  if (fewer.min_exponent == bound.min_exponent) return 0;
  // Both are rounded. If the values of all planes are not the source's, each may be off by a half.
  const bool is_rounded = bound.whole_numbers && bound.max_voxel_error != 0.0;
  return std::ldexp(1.0, fewer.min_exponent) + (is_rounded ? 1.0 : 0.0);
}

ValueOffset value_offset(const LevelError &error, FieldBound bound, double plane_error,
                         const std::array<float, 2> &value_range) {
  if (bound == FieldBound::kNone) return {};
  const double lowest = double{value_range[0]}, highest = double{value_range[1]};
  if (!std::isfinite(lowest) || !std::isfinite(highest))
    throw Error("the volume's range of values is not known: convert it again");
  if (!error.uniform) {
    throw Error(
        "the volume's error is not known, or not that of its levels of detail: compress it again, "
        "with its levels, and measure the error");
  }
  const double beyond =
      2 * (error.largest + plane_error);  // the range, as decoded, raised and lowered
  const double magnitude = std::max(std::abs(lowest), std::abs(highest)) + beyond,
               difference = highest - lowest + 2 * beyond;
  const double rounding = kValueRounding * magnitude + kDifferenceRounding * difference;
  const float uniform = std::nextafter(static_cast<float>(*error.uniform + plane_error + rounding),
                                       std::numeric_limits<float>::infinity());
  return bound == FieldBound::kUpper ? ValueOffset{uniform, error.unit}
                                     : ValueOffset{-uniform, -error.unit};
}

float offset_of_voxel(const ValueOffset &offset, const BlockBounds &bounds, std::size_t block,
                      std::uint32_t voxel) {
  if (offset.unit == 0) return offset.uniform;
  const float share = bounds.by_place ? bound_share(bound_place(voxel)) : 1.0f;
  return offset.uniform + offset.unit * block_bound(bounds.codes[block]) * share;
}

}  // namespace isowave::core
