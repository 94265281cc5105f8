#pragma once
// Arrays of a finished frame in host memory, and how they follow from its hits.

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/base/host_array.hpp"
#include "core/base/parallel_for.hpp"
#include "core/frame/appearance.hpp"
#include "core/view/frame.hpp"
#include "kernels_cl/portable/world_position.h"

namespace isowave::core {

/// The arrays of a frame that its caller wants.
struct WantedArrays {
  bool picture = false, depth = false, normals = false, positions = false;
  bool field_values = false;  ///< of a frame with FrameRequest::field_values
  bool hits = false;          ///< all that is known of them
};

/// Arrays of one frame; those that were not wanted are empty. Rays are [rows][columns], row 0 at
/// the top.
struct FrameArrays {
  /// RGB [height][width][3]; RGBA [height][width][4] if Appearance::transparent
  HostArray<std::uint8_t> picture;
  HostArray<float> depth;                      ///< see HitRecord::t
  HostArray<std::array<float, 3>> normals;     ///< see world_normal()
  HostArray<std::array<double, 3>> positions;  ///< see hit_position()
  HostArray<float> field_values;               ///< see field_value.h; NaN: none
  HostArray<HitRecord> hits;                   ///< as Renderer::hits()
};

/// Throws  std::logic_error: the picture of a sample of rays (ImageSize::stride) is wanted
void check_arrays(const WantedArrays &wanted, ImageSize size);

/// levels  of detail that may have hits, the finest first
HitMap make_hit_map(std::span<const VolumeInfo> levels);

/// The frame's picture with its size, for code that keeps it.
Image8 image_of(ImageSize size, const HostArray<std::uint8_t> &picture);

/// values[i] = make(hits[i]) for all hits, by all threads of the host.
template <class T, class Make>
void fill_from_hits(HostArray<T> &values, std::span<const HitRecord> hits, const Make &make) {
  constexpr std::size_t kRun = 4096;  // hits that a thread takes at a time
  parallel_for((hits.size() + kRun - 1) / kRun, 0, [&](std::uint64_t run, std::uint32_t) {
    const std::size_t begin = run * kRun, end = std::min(hits.size(), begin + kRun);
    for (std::size_t i = begin; i < end; ++i) values[i] = make(hits[i]);
  });
}

/// Computes depth, normals and positions on the host, and copies hits, by all its threads.
///
/// hits     [rows * columns]
/// shading  make_shade_params(), for normals
/// map      for positions; null: none are wanted
void add_hit_arrays(const WantedArrays &wanted, std::span<const HitRecord> hits,
                    const ShadeParams &shading, const HitMap *map, HostMemory &memory,
                    FrameArrays &arrays);

}  // namespace isowave::core
