#pragma once
// Options of a device's renderer that chooses the detail of frames.

#include "core/render/renderer_options.hpp"

namespace isowave::core {

/// Options with what choose_detail() needs: bounds, and all levels of detail of the volume.
inline RendererOptions with_choices(RendererOptions options, const CompressedVolume &volume) {
  options.with_bounds = true;
  options.with_levels = !volume.coarser_levels.empty();
  return options;
}

}  // namespace isowave::core
