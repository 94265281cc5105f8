#pragma once
// DeviceRenderer's pictures while waves of layers are at work.

#include "core/render/device_renderer.hpp"

namespace isowave::core {

class DeviceRenderer::PictureSoFar {
 public:
  /// While first hits are found, the picture is blended from those that there are. Waits then.
  explicit PictureSoFar(DeviceRenderer &of) : of_(of) {
    swap();
    if (!of_.finds_first_of_) return;
    of_.layers_->choose(of_.rays_, *of_.finds_first_of_ + 1, true);
    of_.layers_->blend(of_.rays_, true);
  }
  ~PictureSoFar() {
    if (of_.finds_first_of_) of_.layers_->clear(of_.rays_);
    swap();
  }
  PictureSoFar(const PictureSoFar &) = delete;
  PictureSoFar &operator=(const PictureSoFar &) = delete;

 private:
  void swap() {
    if (of_.finds_first_of_) of_.layers_->swap_hits(of_.rays_, *of_.finds_first_of_);
    if (of_.finds_behind_of_) of_.layers_->swap_hits(of_.rays_, *of_.finds_behind_of_);
    if (of_.is_in_further_layer_) of_.layers_->swap_layer(of_.rays_);
  }

  DeviceRenderer &of_;
};

}  // namespace isowave::core
