#pragma once
// Reports of `render` on its frames: on the terminal, and in --stats.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "core/api/renderer_implementation.hpp"
#include "core/frame/frame_stats.hpp"
#include "core/render/memory_plan.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "tools/isowave/render_options.hpp"

namespace isowave::core::tools {

/// With --surface: warns of rays that are cut. Returns the JSON of a frame's layers.
nlohmann::ordered_json report_layers(const LayerStats &layers);
/// Prints the steps of a frame within a time budget. Returns their JSON.
nlohmann::ordered_json report_steps(const FrameStats &stats, double budget_ms);
/// Prints how the detail of a frame was chosen by sample. Returns its JSON.
nlohmann::ordered_json report_sample(double max_surface_error, const DetailChoice &choice);
/// Prints how the rays and the detail of a frame were chosen for its picture's error. Returns its
/// JSON.
nlohmann::ordered_json report_image_error(double max_image_error, const DetailChoice &choice);
/// Prints how far the last frame may be off by proof, and writes its bounds to error_map, if that
/// is not empty. Returns its JSON.
nlohmann::ordered_json report_error(double max_surface_error, const CompressedVolume &volume,
                                    const LastFrame &last, const Frame &frame,
                                    const std::filesystem::path &error_map);
/// Prints the plan of the device's memory.
void print_plan(const MemoryPlan &plan, const CompressedVolume &volume);

/// on_host: without the options that only devices have.
nlohmann::ordered_json options_json(const RenderArgs &options, ImageSize size,
                                    std::size_t num_views, bool on_host);
nlohmann::ordered_json volume_json(const RenderArgs &options, const CompressedVolume &volume);

}  // namespace isowave::core::tools
