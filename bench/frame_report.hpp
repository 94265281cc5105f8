#pragma once
// Results of frame_bench, as a table with the paper's columns and as JSON.

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/frame_measure.hpp"
#include "bench/run_info.hpp"

namespace isowave::core::bench {

struct FrameReport {
  std::string command;
  std::vector<std::pair<std::string, std::string>> run_info;
  std::string volume;
  CompressedVolume grid;  ///< without its words
  float isovalue = 0;
  double voxel_pixels = 0;
  Normals normals = Normals::kCell;
  std::uint32_t ambient_rays = 0;
  Clip clip{};
  std::vector<SurfaceStyle> surfaces{};
  Slices slices{};
  Appearance light{};
  std::uint32_t shadow_rays = 0, bounce_rays = 0;
  double light_angle = 3;
  WantedArrays wanted{.picture = true};
  RendererOptions options;
  std::uint32_t num_views = 0, rounds = 0;
  std::vector<ViewTimes> views;
  std::optional<FloorTimes> floor;  ///< if asked for
  std::string stage_clock;
  std::vector<std::map<std::string, double>>
      stage_ms;  ///< per view: a cold frame's stages, with profiling
  double setup_ms = 0;
  std::uint64_t peak_bytes = 0;  ///< device memory
  nlohmann::ordered_json memory;

  /// The request of all frames, without the camera.
  FrameRequest request() const {
    return {.isovalue = isovalue,
            .clip = clip,
            .surfaces = surfaces,
            .slices = slices,
            .light = light,
            .voxel_pixels = voxel_pixels,
            .normals = normals,
            .field_values = light.color_by_field.has_value(),
            .field_labels = light.color_by_field && light.color_by_field->labels,
            .ambient_rays = ambient_rays,
            .shadow_rays = shadow_rays,
            .bounce_rays = bounce_rays,
            .light_angle = light_angle};
  }
};

/// Per view and as medians over the views: see the legend it prints.
void print_report(const FrameReport &report);

nlohmann::ordered_json to_json(const FrameReport &report);

// Parts of both, for other reports.
/// Command, device, volume and frames.
void print_run(const FrameReport &report);
nlohmann::ordered_json options_json(const FrameReport &report);
/// views: those to compare with the floor. null where there is no floor.
void print_floor(const FrameReport &report, const std::vector<ViewTimes> &views);
nlohmann::ordered_json floor_json(const FrameReport &report, const std::vector<ViewTimes> &views);
/// "1.23 (1.10..1.30)".
std::string spread_text(const Spread &spread);

}  // namespace isowave::core::bench
