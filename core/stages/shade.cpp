#include "core/stages/shade.hpp"

#include <algorithm>
#include <span>
#include <vector>

#include "core/ocl/in_flight.hpp"
#include "core/ocl/pinned_memory.hpp"

namespace isowave::core {

namespace {

constexpr std::uint64_t kPixelsOfItem = 4;  // see shade.cl

std::uint64_t num_items(std::uint64_t num_pixels) {
  return (num_pixels + kPixelsOfItem - 1) / kPixelsOfItem;
}

}  // namespace

ocl::BufferSizes Shade::sizes(std::uint64_t max_pixels) {
  // At least one position.
  const std::uint64_t bytes = std::max<std::uint64_t>(num_items(max_pixels) * 4 * sizeof(uint), 24);
  return {ocl::buffer_size<std::byte>("framebuffer", bytes),
          ocl::buffer_size<uint>("colour map", ISO_MAP_COLORS)};
}

Shade::Shade(ocl::Device &device, std::uint64_t max_pixels)
    : device_(device),
      staging_(device, sizes(max_pixels)["framebuffer"]),
      color_map_(device, sizes(max_pixels)["colour map"]),
      shade_(device),
      shade_layers_(device, group_defines(ocl::kGroupSize)),
      depths_(device),
      normals_(device),
      positions_(device),
      memory_(ocl::pin_for(device)) {
  color_map_.write(on_device_);
}

void Shade::compile(Wavefront &rays, const ocl::Buffer<RayColor> *layers) {
  for (const std::size_t num_pixels :
       {std::size_t{1}, staging_.size() / sizeof(uint)}) {  // PoCL compiles large ones anew
    const auto range = [&](std::size_t items) {
      return ocl::Range::each(items, ocl::kGroupSize, device_);
    };
    shade_(range(num_items(num_pixels)), FrameParams{}, ShadeParams{}, color_map_, 1, rays.hits,
           rays.open_counts, 0u, 0u, rays.bounced, 0u, rays.field_values, 0u, staging_);
    if (layers != nullptr)
      shade_layers_(range(num_items(num_pixels)), FrameParams{}, ShadeParams{}, 1, *layers, 0u,
                    staging_);
    depths_(range(num_pixels), 0u, 0u, rays.hits, staging_);
    normals_(range(num_pixels / 3 + 1), ShadeParams{}, 0u, 0u, rays.hits, staging_);
  }
}

/// Enqueues the picture and its copy: RGBA if it is transparent or the image has words, else RGB.
template <class T>
void Shade::shade(const Shading &shading, Wavefront &rays, const ocl::Buffer<RayColor> *layers,
                  std::uint32_t samples, HostArray<T> &image) {
  const ShadeParams &params = shading.params;
  if (params.has_map != 0 && shading.color_map != on_device_) {
    on_device_ = shading.color_map;
    color_map_.write(on_device_);
  }
  constexpr bool kAsWords = sizeof(T) == sizeof(uint);
  const std::size_t num_pixels =
      std::size_t{rays.frame.view.width / samples} * (rays.frame.view.height / samples);
  image = memory_.array<T>(kAsWords ? num_pixels : num_channels(&params) * num_pixels);
  const ocl::Range range = ocl::Range::each(num_items(num_pixels), ocl::kGroupSize, device_);
  const uint with_alpha = kAsWords || params.transparent != 0 ? 1u : 0u;
  if (layers != nullptr) {
    shade_layers_(range, rays.frame, params, samples, *layers, with_alpha, staging_);
  } else {
    shade_(range, rays.frame, params, color_map_, samples, rays.hits, rays.open_counts,
           rays.num_ambient, rays.num_shadow, rays.bounced, rays.num_bounced, rays.field_values,
           with_alpha, staging_);
  }
  staging_.read_async(std::as_writable_bytes(std::span(image.data(), image.size())), copied_);
}

/// Enqueues launch(begin, count) for as many rays at a time as staging_ holds, each followed
/// by its copy.
template <class T, class Launch>
void Shade::copy_parts(HostArray<T> &values, std::size_t num_rays, const Launch &launch) {
  values = memory_.array<T>(num_rays);
  const std::size_t most = staging_.size() / sizeof(T);
  for (std::size_t begin = 0; begin < num_rays; begin += most) {
    const std::size_t count = std::min(most, num_rays - begin);
    launch(static_cast<uint>(begin), static_cast<uint>(count));
    staging_.read_async(std::as_writable_bytes(std::span(values.data() + begin, count)), copied_);
  }
}

FrameArrays Shade::operator()(const WantedArrays &wanted, const Shading &shading, const HitMap &map,
                              Wavefront &rays, const ocl::Buffer<RayColor> *layers,
                              std::uint32_t samples) {
  const std::size_t num_rays = std::size_t{rays.frame.view.width} * rays.frame.view.height;
  const auto range = [&](uint count) { return ocl::Range::each(count, ocl::kGroupSize, device_); };
  ocl::InFlight<FrameArrays> arrays(device_);
  if (wanted.picture) shade(shading, rays, layers, samples, arrays->picture);
  if (wanted.depth) {
    copy_parts(arrays->depth, num_rays, [&](uint begin, uint count) {
      depths_(range(count), begin, count, rays.hits, staging_);
    });
  }
  if (wanted.normals) {
    copy_parts(arrays->normals, num_rays, [&](uint begin, uint count) {
      normals_(range(count), shading.params, begin, count, rays.hits, staging_);
    });
  }
  if (wanted.field_values) {
    arrays->field_values = memory_.array<float>(num_rays);
    rays.field_values.read(std::span(arrays->field_values.data(), num_rays));
  }
  if (wanted.hits) {
    arrays->hits = memory_.array<HitRecord>(num_rays);
    rays.hits.read_async(std::span(arrays->hits.data(), num_rays), copied_);
  }
  const bool has_doubles = HitPositions::suits(device_);
  if (wanted.positions && has_doubles) {
    copy_parts(arrays->positions, num_rays,
               [&](uint begin, uint count) { positions_(map, begin, count, rays.hits, staging_); });
  }
  if (copied_() != nullptr) copied_.wait();
  if (wanted.positions && !has_doubles) {
    std::vector<HitRecord> hits(num_rays);
    rays.hits.read(hits);
    add_hit_arrays({.positions = true}, hits, shading.params, &map, memory_, *arrays);
  }
  return std::move(*arrays);
}

HostArray<uint> Shade::packed(const Shading &shading, Wavefront &rays,
                              const ocl::Buffer<RayColor> *layers, std::uint32_t samples) {
  ocl::InFlight<HostArray<uint>> image(device_);
  shade(shading, rays, layers, samples, *image);
  copied_.wait();
  return std::move(*image);
}

}  // namespace isowave::core
