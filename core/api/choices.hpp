#pragma once
// Private to core/api: frames within an error or a time, by any renderer.

#include <memory>
#include <utility>

#include "core/accuracy/bounded_renderer.hpp"
#include "core/frame/timed_renderer.hpp"

namespace isowave {

/// The renderers that add_choices() puts around another.
struct Choices {
  bool with_time_budget = false;  ///< frames within a time: the other one keeps pictures
};

/// Adds frames within an error: by sample, and by proof if the other renderer has bounds.
///
/// volume  that this process's renderer was made for; must outlive the result
/// rate    of the whole volume [bits per voxel]
inline std::unique_ptr<core::Renderer> add_choices(std::unique_ptr<core::Renderer> renderer,
                                                   const Choices &choices,
                                                   const core::CompressedVolume &volume,
                                                   double rate) {
  renderer = std::make_unique<core::BoundedRenderer>(std::move(renderer), volume, rate);
  if (choices.with_time_budget)
    renderer = std::make_unique<core::TimedRenderer>(std::move(renderer));
  return renderer;
}

}  // namespace isowave
