#include "bench/budget_sweep.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "bench/run_info.hpp"
#include "core/base/error.hpp"
#include "tools/isowave/render_stats.hpp"

namespace isowave::core::bench {

namespace {

using nlohmann::ordered_json;

using Pictures = std::vector<std::vector<HitRecord>>;

/// Draws every view and the next one of each; whether no frame took more than max_passes. The first
/// call fills `expected`; the pictures of all others must equal it.
bool check_pictures(DeviceRenderer &renderer, const FrameReport &common,
                    const std::vector<Camera> &cameras, std::uint32_t max_passes,
                    Pictures &expected) {
  const bool first = expected.empty();
  std::size_t index = 0;
  for (const Camera &camera : cameras) {
    for (const Camera &view : {camera, turned(camera)}) {
      std::uint32_t passes = 0;
      FrameRequest request = seen_from(view, common.request());
      request.on_pass = [&](const PassStats &) { return ++passes <= max_passes; };
      if (renderer.render(request).cancelled) return false;
      if (first) {
        expected.push_back(renderer.hits());
      } else if (!same_hits(renderer.hits(), expected[index])) {
        throw Error("with {} cache slots, view {} is not the picture that a larger budget drew",
                    renderer.options().cache_slots, index / 2);
      }
      ++index;
    }
  }
  return true;
}

double median_of_frames(const BudgetTimes &budget, double (*value)(const FrameStats &frame)) {
  std::vector<double> values;
  for (const ViewTimes &view : budget.views) {
    for (const FrameStats &frame : view.cold) values.push_back(value(frame));
  }
  return median(std::move(values));
}

double num_decoded(const FrameStats &frame) {
  double sum = 0;
  for (const PassStats &pass : frame.passes) sum += pass.counts.decoded_count;
  return sum;
}

ordered_json budget_json(const BudgetTimes &budget) {
  ordered_json json = {{"bytes", budget.bytes},
                       {"cache_slots", budget.cache_slots},
                       {"peak_bytes", budget.peak_bytes}};
  for (const auto &[kind, member] : kKinds) {
    json[fmt::format("{}_ms", kind)] =
        budget.views.empty() ? ordered_json()
                             : spread_json(spread_of(all_times(budget.views, member, arrays_ms)));
  }
  json["passes"] =
      budget.views.empty() ? ordered_json() : ordered_json(median_of_frames(budget, num_passes));
  json["decoded_blocks"] =
      budget.views.empty() ? ordered_json() : ordered_json(median_of_frames(budget, num_decoded));
  return json;
}

}  // namespace

std::vector<std::uint64_t> geometric_budgets(const ocl::DeviceInfo &device_info,
                                             const CompressedVolume &volume,
                                             const RendererOptions &options, std::uint32_t count) {
  ocl::Device device(device_info);
  const DeviceRenderer ample(device, volume, options);
  const RendererOptions &chosen = ample.options();
  MemoryRequest request{chosen.size.num_rays(), chosen.pipeline, chosen.group_size};
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  for (const StreamPlace place : {StreamPlace::kDevice, StreamPlace::kHost}) {
    if (options.stream != StreamPlace::kAuto && options.stream != place) continue;
    request.stream = place;
    least = std::min(least, plan_memory(volume, request, kMinCacheSlots).peak());
  }
  // In equal ratios of what lies above the least: the same at every budget, that would hide the
  // rest.
  constexpr double kSmallest = 0.01;
  const MemoryPlan &plan = ample.memory_plan();
  const auto above = static_cast<double>(resized(plan, plan.most_slots).peak() - least);
  std::vector<std::uint64_t> budgets;
  for (std::uint32_t i = 0; i < count; ++i) {
    budgets.push_back(
        least + static_cast<std::uint64_t>(above * std::pow(kSmallest, double(i) / (count - 1))));
  }
  budgets.erase(std::unique(budgets.begin(), budgets.end()), budgets.end());
  return budgets;
}

BudgetSweep sweep_budgets(const ocl::DeviceInfo &device_info, const CompressedVolume &volume,
                          FrameReport common, std::vector<std::uint64_t> budgets,
                          std::uint32_t max_passes, bool with_floor) {
  std::sort(budgets.begin(), budgets.end(), std::greater<>());
  budgets.erase(std::unique(budgets.begin(), budgets.end()), budgets.end());
  const std::vector<Camera> cameras = orbit_cameras(volume.info, common.num_views);
  BudgetSweep sweep;
  sweep.max_passes = max_passes;
  Pictures pictures;
  RendererOptions options = common.options;
  for (const std::uint64_t bytes : budgets) {
    options.memory_budget = bytes;
    ocl::Device device(device_info);
    DeviceRenderer renderer(device, volume, options);
    BudgetTimes budget;
    budget.bytes = bytes;
    budget.cache_slots = renderer.options().cache_slots;
    if (sweep.budgets.empty()) {
      common.run_info = run_info(device);
      common.options = renderer.options();
    }
    if (check_pictures(renderer, common, cameras, max_passes, pictures)) {
      budget.views =
          measure_views(renderer, cameras, common.request(), common.wanted, common.rounds);
    } else if (sweep.budgets.empty()) {
      throw Error(
          "the largest budget, {} bytes, takes more than {} passes a frame: allow more by "
          "--max-passes",
          bytes, max_passes);
    }
    budget.peak_bytes = device.ledger().peak();
    sweep.budgets.push_back(std::move(budget));
  }
  if (with_floor) {
    common.floor = measure_floor(device_info, volume, common.options, cameras, common.isovalue,
                                 common.rounds, pictures.front());
  }
  sweep.common = std::move(common);
  return sweep;
}

void print_sweep(const BudgetSweep &sweep) {
  print_run(sweep.common);
  fmt::print("\n{:>14} {:>12} {:>14}", "budget, bytes", "cache slots", "peak, bytes");
  for (const auto &[kind, member] : kKinds) fmt::print(" {:>27}", fmt::format("{} ms", kind));
  fmt::print(" {:>8}\n", "passes");
  for (const BudgetTimes &budget : sweep.budgets) {
    fmt::print("{:>14} {:>12} {:>14}", budget.bytes, budget.cache_slots, budget.peak_bytes);
    if (budget.views.empty()) {
      fmt::print("  more than {} passes a frame\n", sweep.max_passes);
      continue;
    }
    for (const auto &[kind, member] : kKinds) {
      fmt::print(" {:>27}", spread_text(spread_of(all_times(budget.views, member, arrays_ms))));
    }
    fmt::print(" {:>8.0f}\n", median_of_frames(budget, num_passes));
  }
  print_floor(sweep.common, sweep.budgets.front().views);
  fmt::print("The pictures are the same bit for bit at every budget that has times.\n");
}

ordered_json to_json(const BudgetSweep &sweep) {
  ordered_json json = {{"benchmark", "budgets"},
                       {"schema", tools::kChartsSchema},
                       {"command", sweep.common.command},
                       {"date", utc_now()},
                       {"max_passes", sweep.max_passes}};
  for (const auto &[name, value] : sweep.common.run_info) json["context"][name] = value;
  json["options"] = options_json(sweep.common);
  json["options"].erase("cache_slots");  // each budget's own
  for (const BudgetTimes &budget : sweep.budgets) json["budgets"].push_back(budget_json(budget));
  json["resident_floor"] = floor_json(sweep.common, sweep.budgets.front().views);
  return json;
}

}  // namespace isowave::core::bench
