#pragma once
// The same orbit at several memory budgets: time against memory, and the same picture at each.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/frame_report.hpp"

namespace isowave::core::bench {

struct BudgetTimes {
  std::uint64_t bytes = 0;
  std::uint32_t cache_slots = 0;
  std::uint64_t peak_bytes = 0;  ///< device memory, from the ledger
  std::vector<ViewTimes> views;  ///< empty where the first frame took more passes than were allowed
};

struct BudgetSweep {
  FrameReport common;                ///< what all budgets share; no views
  std::vector<BudgetTimes> budgets;  ///< by bytes, descending
  std::uint32_t max_passes = 0;
};

/// `count` budgets, at least 2, from what drawing takes without a budget down to near the smallest
/// that is accepted, in equal ratios of what lies above that. Descending, each once.
std::vector<std::uint64_t> geometric_budgets(const ocl::DeviceInfo &device_info,
                                             const CompressedVolume &volume,
                                             const RendererOptions &options, std::uint32_t count);

/// `common` says volume, isovalue, options and rounds; budgets [bytes] in any order. Every view,
/// and the next one of each, must be the same bit for bit at every budget: throws Error if not. A
/// budget at which a frame takes more than max_passes gets no times.
BudgetSweep sweep_budgets(const ocl::DeviceInfo &device_info, const CompressedVolume &volume,
                          FrameReport common, std::vector<std::uint64_t> budgets,
                          std::uint32_t max_passes, bool with_floor);

void print_sweep(const BudgetSweep &sweep);

/// JSON that tools/charts reads.
nlohmann::ordered_json to_json(const BudgetSweep &sweep);

}  // namespace isowave::core::bench
