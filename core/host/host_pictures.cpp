// HostRenderer's pictures of the last frame, and the one that is kept.

#include <algorithm>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/frame/field_values.hpp"
#include "core/host/host_renderer.hpp"
#include "kernels_cl/portable/kept_pixel.h"

namespace isowave::core {

void HostRenderer::keep_picture() {
  check_has_picture();
  kept_ = hits_;
  kept_size_ = size_;
}

void HostRenderer::enlarge_kept(const FrameRequest &request) {
  core::check(request, abilities());
  const ImageSize size = size_of(request, abilities());
  frame_ = make_frame_params(info_, request.camera, size, request.isovalue);
  size_ = size;
  open_ = {};
  field_values_.clear();
  hits_.resize(size.num_rays());
  show_kept(true);
}

/// Fills the picture from the kept one, enlarged: rays without a hit, or all.
void HostRenderer::show_kept(bool everywhere) {
  check_has_picture();
  if (kept_.empty()) throw Error("there is no picture: none was kept");
  colors_ = {};
  parallel_for(frame_.view.height, num_threads_, [&](std::uint64_t row, std::uint32_t) {
    const auto first = static_cast<uint>(row * frame_.view.width);
    for (uint ray = first; ray < first + frame_.view.width; ++ray) {
      if (!everywhere && hits_[ray].t < INFINITY) continue;
      hits_[ray] =
          kept_[kept_pixel(&frame_.view, kept_size_.ray_columns(), kept_size_.ray_rows(), ray)];
    }
  });
}

void HostRenderer::check_has_picture() const {
  if (hits_.empty()) throw Error("there is no picture: no frame has been drawn");
}

std::vector<HitRecord> HostRenderer::hits() {
  check_has_picture();
  return hits_;
}

std::optional<std::array<float, 2>> HostRenderer::field_range() {
  check_has_picture();
  if (!colors_.empty() && field_) return field_->volume_range();
  return range_of_values(field_values_);
}

FrameArrays HostRenderer::fetch(const WantedArrays &wanted, const Appearance &appearance) {
  check_has_picture();
  check_arrays(wanted, size_);
  const Shading shading = shading_of(info_, appearance);
  const ShadeParams &params = shading.params;
  FrameArrays arrays;
  if (wanted.picture) {
    const std::size_t channels = num_channels(&params);
    arrays.picture = memory_.array<std::uint8_t>(channels * size_.num_pixels());
    const std::uint32_t end = std::min(rows_[1], size_.height);
    parallel_for(size_.height, num_threads_, [&](std::uint64_t row, std::uint32_t) {
      if (row < rows_[0] || row >= end) return;
      std::uint8_t *const pixels = arrays.picture.data() + channels * size_.width * row;
      if (colors_.empty()) {
        host_loops().shade(frame_, shading, size_.samples, static_cast<uint>(row), hits_.data(),
                           open_.of_hits(), field_values_.data(), pixels);
      } else {
        host_loops().shade_layers(frame_, params, size_.samples, static_cast<uint>(row),
                                  colors_.data(), pixels);
      }
    });
  }
  const HitMap map = make_hit_map(levels());
  add_hit_arrays(wanted, hits_, params, &map, memory_, arrays);
  if (wanted.field_values) {
    arrays.field_values = memory_.array<float>(field_values_.size());
    std::ranges::copy(field_values_, arrays.field_values.begin());
  }
  return arrays;
}

}  // namespace isowave::core
