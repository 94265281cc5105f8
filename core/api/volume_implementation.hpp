#pragma once
// Private to core/api: what is behind isowave::Volume.

#include "core/zfp/zfp_stream.hpp"
#include "isowave/volume.hpp"

namespace isowave {

struct Volume::Implementation {
  explicit Implementation(core::CompressedVolume compressed);

  core::CompressedVolume volume;
  Grid grid;
};

}  // namespace isowave
