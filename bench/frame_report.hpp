#pragma once
// What frame_bench measured, as a table with the paper's columns and as JSON.

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/renderer.hpp"

namespace isowave::bench {

/// One view, drawn once per round. Without profiling.
struct ViewTimes {
  std::vector<FrameStats> cold;  ///< nothing decoded before
  std::vector<FrameStats> warm;  ///< the same view again
  std::vector<FrameStats> next;  ///< then one degree further around the volume
};

struct FrameReport {
  std::string command;
  std::vector<std::pair<std::string, std::string>> run_info;
  std::string volume;
  CompressedVolume grid;  ///< without its words
  float isovalue = 0;
  RendererOptions options;
  std::uint32_t rounds = 0;
  std::vector<ViewTimes> views;
  std::string stage_clock;
  std::vector<std::map<std::string, double>> stage_ms;  ///< per view: a cold frame's stages, with profiling
  double setup_ms = 0;
  std::uint64_t peak_bytes = 0;  ///< device memory
  nlohmann::ordered_json memory;
};

/// Per view and as medians over the views: see the legend it prints.
void print_report(const FrameReport &report);

nlohmann::ordered_json to_json(const FrameReport &report);

}  // namespace isowave::bench
