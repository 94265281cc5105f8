#pragma once
// A side of any storage. A storage has
//
//   Voxels   what kernels get: a Reader made of it has enter(), corners() and value(x, y, z), see
//            walk.h
//   voxels() bytes() build_ms() max_voxel_error()

#include <chrono>
#include <memory>
#include <utility>

#include "bench/gpu_peer/picture.h"
#include "bench/gpu_peer/place.cuh"

namespace isowave::core::bench {

/// A view of a volume at an isovalue.
template <class Voxels>
struct Drawing {
  Voxels voxels;
  Skips skips;
  View view;
  float isovalue;
};

template <bool kMasks, bool kSmooth, class Voxels>
PEER_BOTH GridHit hit_of(const Drawing<Voxels> &drawing, const WalkRay &ray) {
  return first_hit<kMasks, kSmooth>(drawing.skips, ray, typename Voxels::Reader(drawing.voxels),
                                    drawing.isovalue, drawing.view.t_scale);
}

/// Where the pixel of a kernel goes: hits, or a picture.
struct StoreHit {
  static constexpr bool kSmooth = false;
  GridHit *hits;

  PEER_BOTH void operator()(const View &, const WalkRay &, std::uint32_t pixel,
                            const GridHit &hit) const {
    hits[pixel] = hit;
  }
};
/// kSmooth: of smooth gradients, else of the cells' own.
template <bool kSmoothGradients>
struct StoreColor {
  static constexpr bool kSmooth = kSmoothGradients;
  ShadeParams shading;
  std::uint8_t *rgb;

  PEER_BOTH void operator()(const View &view, const WalkRay &ray, std::uint32_t pixel,
                            const GridHit &hit) const {
    shade_hit(view, shading, ray, hit, rgb + 3 * std::size_t{pixel});
  }
};

template <bool kMasks, class Voxels, class Store>
PEER_BOTH void draw_pixel(const Drawing<Voxels> &drawing, const Store &store, std::uint32_t column,
                          std::uint32_t row) {
  const WalkRay ray = ray_of(drawing.view, column, row);
  store(drawing.view, ray, column + drawing.view.width * row,
        hit_of<kMasks, Store::kSmooth>(drawing, ray));
}

constexpr std::uint32_t kTile = 8;  ///< pixels along an edge of a group's tile

/// A warp draws 8 x 4 pixels, whose rays go through the same bricks.
template <bool kMasks, class Voxels, class Store>
__global__ void __launch_bounds__(kTile *kTile) draw_tile(Drawing<Voxels> drawing, Store store) {
  const std::uint32_t column = kTile * blockIdx.x + threadIdx.x;
  const std::uint32_t row = kTile * blockIdx.y + threadIdx.y;
  if (column < drawing.view.width && row < drawing.view.height)
    draw_pixel<kMasks>(drawing, store, column, row);
}

/// Draws on a place; a device goes on meanwhile.
template <bool kMasks, class Voxels, class Store>
void draw_on(Place place, const Drawing<Voxels> &drawing, const Store &store) {
  const std::uint32_t width = drawing.view.width, height = drawing.view.height;
  if (place == Place::kHost) {
    for (std::uint32_t pixel = 0; pixel < width * height; ++pixel)
      draw_pixel<kMasks>(drawing, store, pixel % width, pixel / width);
    return;
  }
  const dim3 tiles((width + kTile - 1) / kTile, (height + kTile - 1) / kTile);
  draw_tile<kMasks><<<tiles, dim3(kTile, kTile)>>>(drawing, store);
}

/// kMasks: with a bit for each cell of the bricks that change; else with value ranges alone.
template <class Storage, bool kMasks>
class WalkedSide : public GridSide {
  using Voxels = typename Storage::Voxels;

 public:
  WalkedSide(Place place, std::shared_ptr<const Storage> storage, const GridVolume &volume,
             std::uint64_t max_pixels)
      : place_(place),
        storage_(std::move(storage)),
        skips_(grid_of(volume)),
        brick_ranges_(place, skips_.bricks.all()),
        macro_ranges_(place, skips_.macros.all()),
        brick_bits_(place, words_of(skips_.bricks)),
        macro_bits_(place, words_of(skips_.macros)),
        slots_(place, kMasks ? skips_.bricks.all() : 1),
        slot_bricks_(place, slots_.size()),
        slot_count_(place, 1),
        hits_(place, max_pixels),
        rgb_(place, 3 * max_pixels),
        host_rgb_(place, 3 * max_pixels),
        timer_(place) {
    skips_.brick_bits = brick_bits_.data();
    skips_.macro_bits = macro_bits_.data();
    skips_.slots = slots_.data();
    find_ranges(1);  // loads the kernels
    ranges_ms_ = timer_.ms_of([&] { find_ranges(skips_.bricks.all()); });
  }

  GridCosts costs() const override {
    std::uint64_t bytes = storage_->bytes() + brick_ranges_.bytes() + macro_ranges_.bytes() +
                          brick_bits_.bytes() + macro_bits_.bytes();
    if (kMasks) bytes += slots_.bytes() + slot_bricks_.bytes() + (masks_ ? masks_->bytes() : 0);
    return {bytes, storage_->build_ms() + ranges_ms_, storage_->max_voxel_error()};
  }

  double set_isovalue(float isovalue) override {
    isovalue_ = isovalue;
    return timer_.ms_of([&] {
      const std::uint32_t none = 0;
      if (kMasks) slot_count_.write(&none, 1);
      for_each(place_, words_of(skips_.macros),
               MarkBoxes{macro_ranges_.data(), skips_.macros.all(), isovalue, macro_bits_.data(),
                         nullptr, nullptr, nullptr});
      for_each(
          place_, words_of(skips_.bricks),
          MarkBoxes{brick_ranges_.data(), skips_.bricks.all(), isovalue, brick_bits_.data(),
                    kMasks ? slots_.data() : nullptr, slot_bricks_.data(), slot_count_.data()});
      if (kMasks) mark_cells();
    });
  }

  double draw(const View &view) override {
    last_pixels_ = std::size_t{view.width} * view.height;
    return timer_.ms_of([&] { draw_on<kMasks>(place_, drawing(view), StoreHit{hits_.data()}); });
  }
  std::vector<GridHit> hits() const override {
    std::vector<GridHit> hits(last_pixels_);
    hits_.read(hits.data(), hits.size());
    return hits;
  }
  std::span<const std::uint8_t> picture(const View &view, const ShadeParams &shading,
                                        Normals normals) override {
    const std::size_t bytes = 3 * std::size_t{view.width} * view.height;
    if (normals == Normals::kSmooth) {
      draw_on<kMasks>(place_, drawing(view), StoreColor<true>{shading, rgb_.data()});
    } else {
      draw_on<kMasks>(place_, drawing(view), StoreColor<false>{shading, rgb_.data()});
    }
    rgb_.read(host_rgb_.data(), bytes);
    return {host_rgb_.data(), bytes};
  }

 private:
  static std::uint32_t words_of(const Counts3 &boxes) { return (boxes.all() + 31) / 32; }
  static Skips grid_of(const GridVolume &volume) {
    Skips skips{};
    for (int a = 0; a < 3; ++a) skips.dims[a] = static_cast<int>(volume.dims[a]);
    skips.bricks = boxes_of(skips.dims, kBrickLog);
    skips.macros = boxes_of(skips.dims, kMacroLog);
    return skips;
  }
  void find_ranges(std::uint32_t num_bricks) {
    for_each(place_, num_bricks,
             FindBrickRange<Voxels>{storage_->voxels(), skips_, brick_ranges_.data()});
    for_each(place_, skips_.macros.all(),
             FindMacroRange{skips_, brick_ranges_.data(), macro_ranges_.data()});
  }
  void mark_cells() {
    std::uint32_t count = 0;
    slot_count_.read(&count, 1);
    if (!masks_ || masks_->size() < std::size_t{count} * kMaskWords) {
      masks_.reset();
      masks_ = std::make_unique<PlacedBuffer<std::uint32_t>>(place_, count * kMaskWords);
      skips_.masks = masks_->data();
    }
    for_each(place_, count * kMaskWords,
             MarkCells<Voxels>{storage_->voxels(), skips_, isovalue_, slot_bricks_.data(),
                               masks_->data()});
  }
  Drawing<Voxels> drawing(const View &view) const {
    return {storage_->voxels(), skips_, view, isovalue_};
  }

  Place place_;
  std::shared_ptr<const Storage> storage_;
  Skips skips_;
  PlacedBuffer<ValueRange> brick_ranges_, macro_ranges_;
  PlacedBuffer<std::uint32_t> brick_bits_, macro_bits_, slots_, slot_bricks_, slot_count_;
  std::unique_ptr<PlacedBuffer<std::uint32_t>> masks_;  ///< grows with the bricks that change
  PlacedBuffer<GridHit> hits_;
  PlacedBuffer<std::uint8_t> rgb_;
  PinnedBytes host_rgb_;
  PlaceTimer timer_;
  double ranges_ms_ = 0;
  float isovalue_ = 0;
  std::size_t last_pixels_ = 0;
};

}  // namespace isowave::core::bench
