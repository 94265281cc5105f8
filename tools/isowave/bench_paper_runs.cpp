#include "tools/isowave/bench_paper_runs.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>

#include "core/base/error.hpp"
#include "core/base/ms_since.hpp"
#include "core/paper/blocks_pipeline.hpp"
#include "core/paper/mesh_renderer.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

double mean_of(const std::vector<double> &values) {
  return values.empty()
             ? 0.0
             : std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

/// Null if there are no values.
ordered_json summary(const std::vector<double> &values) {
  if (values.empty()) return nullptr;
  const auto [least, most] = std::ranges::minmax_element(values);
  return {{"mean", mean_of(values)},
          {"median", median_of(values)},
          {"min", *least},
          {"max", *most},
          {"count", values.size()}};
}

/// Values by number of the pass, of frames of different numbers of passes.
class ByPass {
 public:
  /// after: what a frame that was through counts in passes that it did not have.
  explicit ByPass(double after) : after_(after) {}
  void add(std::vector<double> of_frame) { frames_.push_back(std::move(of_frame)); }
  /// Means over all frames.
  ordered_json means() const {
    std::size_t most = 0;
    for (const std::vector<double> &frame : frames_) most = std::max(most, frame.size());
    ordered_json result = ordered_json::array();
    for (std::size_t pass = 0; pass < std::min<std::size_t>(most, 64); ++pass) {
      double sum = 0;
      for (const std::vector<double> &frame : frames_)
        sum += pass < frame.size() ? frame[pass] : after_;
      result.push_back(sum / double(frames_.size()));
    }
    return result;
  }

 private:
  double after_;
  std::vector<std::vector<double>> frames_;
};

std::uint64_t decoded_blocks(const FrameStats &frame) {
  std::uint64_t sum = 0;
  for (const PassStats &pass : frame.passes) sum += pass.counts.decoded_count;
  return sum;
}

/// Adds up frames of rays.
struct RayTally {
  std::vector<double> new_ms, next_ms, passes, ms_per_pass, visible, n_spec, utilization, hits,
      decoded_new, decoded_next;
  ByPass completed{100}, completed_active{100}, utilization_by_pass{0};

  void add(const FrameStats &frame, bool is_new, double num_rays) {
    (is_new ? new_ms : next_ms).push_back(frame.total_ms);
    (is_new ? decoded_new : decoded_next).push_back(double(decoded_blocks(frame)));
    const double count = double(frame.passes.size());
    passes.push_back(count);
    ms_per_pass.push_back(frame.total_ms / count);
    hits.push_back(100 * double(frame.rays_hit) / num_rays);
    const double at_work = frame.passes.front().counts.active_count;
    std::vector<double> all, active, used;
    for (const PassStats &pass : frame.passes) {
      if (pass.visible_blocks) visible.push_back(*pass.visible_blocks);
      if (pass.n_spec > 0) n_spec.push_back(pass.n_spec);
      utilization.push_back(pass.utilization_percent);
      used.push_back(pass.utilization_percent);
      all.push_back(pass.completed_percent);
      active.push_back(at_work == 0 ? 100.0
                                    : 100.0 * (1 - pass.counts.next_active_count / at_work));
    }
    completed.add(std::move(all));
    completed_active.add(std::move(active));
    utilization_by_pass.add(std::move(used));
  }
};

FrameRequest request_of(const PaperRun &run, std::size_t isovalue, std::size_t view) {
  return {
      .camera = run.cameras[view], .isovalue = run.isovalues[isovalue], .normals = Normals::kCell};
}

/// Calls visit(isovalue, view) for all isovalues, from all cameras.
void each_frame(const PaperRun &run, const auto &visit) {
  for (std::size_t i = 0; i < run.isovalues.size(); ++i) {
    for (std::size_t view = 0; view < run.cameras.size(); ++view) visit(i, view);
  }
}

RendererOptions options_of(const PaperRun &run, const RayMethod &method) {
  RendererOptions options{.size = run.size, .pipeline = method.pipeline};
  if (method.look_ahead == LookAhead::kOff) options.max_speculation = 1;
  options.per_ray_speculation =
      blocks_options(*method.pipeline) == nullptr && method.look_ahead != LookAhead::kOff;
  if (method.look_ahead == LookAhead::kScanned)
    options.pipeline = blocks_pipeline({.scanned_pairs = true});
  options.cache_slots = method.cache_slots;
  options.with_shading = false;
  return options;
}

const char *name_of(const RayMethod &method) {
  if (method.look_ahead == LookAhead::kOff) return "off";
  if (method.look_ahead == LookAhead::kScanned) return "scanned";
  return blocks_options(*method.pipeline) == nullptr ? "per-ray" : "global";
}

/// Milliseconds and completed rays after each pass, of first views from an empty cache. touched:
/// gets the blocks that each of these passes looked at.
ordered_json measure_progress(DeviceRenderer &renderer, const PaperRun &run, std::size_t count,
                              std::vector<double> &touched) {
  ByPass ms(0), completed(100);
  std::vector<std::vector<double>> times;
  for (std::size_t i = 0; i < count; ++i) {
    renderer.clear_cache();
    std::vector<double> of_frame, part;
    FrameRequest request = request_of(run, i, 0);
    const auto begin = std::chrono::steady_clock::now();
    request.on_pass = [&](const PassStats &pass) {
      of_frame.push_back(ms_since(begin));
      part.push_back(pass.completed_percent);
      return true;
    };
    for (const PassStats &pass : renderer.render(request).passes)
      touched.push_back(pass.touched_blocks.value_or(0));
    times.push_back(std::move(of_frame));
    completed.add(std::move(part));
  }
  std::size_t most = 0;
  for (const auto &frame : times) most = std::max(most, frame.size());
  for (std::vector<double> &frame : times) {  // a frame that is through stays at its end
    frame.resize(most, frame.empty() ? 0.0 : frame.back());
    ms.add(frame);
  }
  return {{"ms", ms.means()}, {"completed_percent", completed.means()}};
}

}  // namespace

ordered_json measure_rays(const ocl::DeviceInfo &device_info, const PaperRun &run,
                          const RayMethod &method, const PaperParts &parts) {
  ocl::Device device(device_info);
  DeviceRenderer renderer(device, run.volume, options_of(run, method));
  renderer.render(request_of(run, 0, 0));  // the first frame of all does more
  renderer.clear_cache();
  RayTally tally;
  each_frame(run, [&](std::size_t i, std::size_t view) {
    tally.add(renderer.render(request_of(run, i, view)), view == 0, double(run.size.num_rays()));
  });
  std::vector<double> cold_ms, active;
  for (std::size_t i = 0; i < std::min<std::size_t>(parts.cold, run.isovalues.size()); ++i) {
    for (std::size_t view = 0; view < run.cameras.size(); ++view) {
      renderer.clear_cache();
      const FrameStats frame = renderer.render(request_of(run, i, view));
      cold_ms.push_back(frame.total_ms);
      active.push_back(double(decoded_blocks(frame)));
    }
  }
  const std::uint32_t slots = renderer.memory_plan().cache_slots;
  std::vector<double> touched;
  const ordered_json progress = measure_progress(
      renderer, run, std::min<std::size_t>(parts.progress, run.isovalues.size()), touched);
  ordered_json json = {
      {"method", method.pipeline->name()},
      {"speculation", method.look_ahead != LookAhead::kOff},
      {"look_ahead", name_of(method)},
      {"cache", method.cache_slots == 0 ? "default" : "one frame"},
      {"size", {run.size.width, run.size.height}},
      {"isovalues", run.isovalues.size()},
      {"views", run.cameras.size()},
      {"new_ms", summary(tally.new_ms)},
      {"next_ms", summary(tally.next_ms)},
      {"cold_ms", summary(cold_ms)},
      {"passes", summary(tally.passes)},
      {"ms_per_pass", summary(tally.ms_per_pass)},
      {"visible_blocks", summary(tally.visible)},
      {"n_spec", summary(tally.n_spec)},
      {"utilization_percent", summary(tally.utilization)},
      {"hits_percent", summary(tally.hits)},
      {"active_blocks", summary(active)},
      {"decoded_new", summary(tally.decoded_new)},
      {"decoded_next", summary(tally.decoded_next)},
      {"completed_percent", tally.completed.means()},
      {"completed_of_active_percent", tally.completed_active.means()},
      {"utilization_by_pass", tally.utilization_by_pass.means()},
      {"touched_blocks", summary(touched)},
      {"progress", progress},
      {"cache_slots", slots},
      {"cache_bytes", BlockCache::sizes(renderer.memory_plan().limits.cache).bytes()},
      {"device_bytes", device.ledger().peak()}};
  return json;
}

ordered_json measure_limits(const ocl::DeviceInfo &device_info, const PaperRun &run,
                            const RayMethod &method, const std::vector<std::uint32_t> &limits) {
  ocl::Device device(device_info);
  ordered_json by_limit = ordered_json::array();
  for (const std::uint32_t limit : limits) {
    RendererOptions options = options_of(run, method);
    options.max_speculation = limit;
    options.on_demand = DecodeOnDemand::kOff;  // on PoCL, rays would have nothing to look ahead for
    DeviceRenderer renderer(device, run.volume, options);
    renderer.render(request_of(run, 0, 0));
    std::vector<double> ms, passes, decoded;
    each_frame(run, [&](std::size_t i, std::size_t view) {
      renderer.clear_cache();
      const FrameStats frame = renderer.render(request_of(run, i, view));
      ms.push_back(frame.total_ms);
      passes.push_back(double(frame.passes.size()));
      decoded.push_back(double(decoded_blocks(frame)));
    });
    by_limit.push_back({{"limit", limit},
                        {"cold_ms", summary(ms)},
                        {"passes", summary(passes)},
                        {"active_blocks", summary(decoded)}});
  }
  return {{"method", method.pipeline->name()},
          {"look_ahead", name_of(method)},
          {"size", {run.size.width, run.size.height}},
          {"by_limit", by_limit}};
}

ordered_json measure_bcmc(const ocl::DeviceInfo &device_info, const PaperRun &run,
                          std::uint64_t memory_budget, const PaperParts &parts) {
  ordered_json json = {{"method", "bcmc"},
                       {"memory_budget", memory_budget},
                       {"size", {run.size.width, run.size.height}},
                       {"isovalues", run.isovalues.size()},
                       {"views", run.cameras.size()},
                       {"refused", nullptr}};
  ocl::Device device(device_info);
  try {
    MeshRenderer renderer(device, run.volume,
                          {.size = run.size,
                           .memory_budget = memory_budget,
                           .stream = StreamPlace::kDevice});  // where rays have it, too
    renderer.render(request_of(run, 0, 0));
    renderer.clear_cache();
    std::vector<double> new_ms, next_ms, cold_ms, surface_ms, listed, needed, triangles, decoded,
        slots, parts_drawn;
    std::uint64_t num_kept = 0, num_frames = 0;
    each_frame(run, [&](std::size_t i, std::size_t view) {
      const double ms = renderer.render(request_of(run, i, view)).total_ms;
      const MeshFrameStats &frame = renderer.last_frame();
      (view == 0 ? new_ms : next_ms).push_back(ms);
      num_kept += frame.is_kept ? 1 : 0;
      ++num_frames;
      parts_drawn.push_back(frame.num_parts);
      if (view != 0) return;
      surface_ms.push_back(frame.surface_ms);
      listed.push_back(double(frame.listed_blocks));
      needed.push_back(double(frame.needed_blocks));
      triangles.push_back(double(frame.num_triangles));
      decoded.push_back(double(frame.decoded_blocks));
      slots.push_back(frame.cache_slots);
    });
    for (std::size_t i = 0; i < std::min<std::size_t>(parts.cold, run.isovalues.size()); ++i) {
      renderer.clear_cache();
      cold_ms.push_back(renderer.render(request_of(run, i, 0)).total_ms);
    }
    json.update({{"new_ms", summary(new_ms)},
                 {"next_ms", summary(next_ms)},
                 {"cold_ms", summary(cold_ms)},
                 {"surface_ms", summary(surface_ms)},
                 {"listed_blocks", summary(listed)},
                 {"active_blocks", summary(needed)},
                 {"decoded_new", summary(decoded)},
                 {"triangles", summary(triangles)},
                 {"parts", summary(parts_drawn)},
                 {"kept_percent", 100.0 * double(num_kept) / double(num_frames)},
                 {"cache_slots", slots.empty() ? 0.0 : *std::ranges::max_element(slots)}});
  } catch (const Error &error) {
    device.finish();  // throws if the device itself has failed, which is no refusal
    json["refused"] = error.what();
  }
  std::uint64_t cache_bytes = 0;
  for (const ocl::BufferSize &size : BlockCache::sizes({}))
    if (const auto entry = device.ledger().by_name().find(size.name);
        entry != device.ledger().by_name().end())
      cache_bytes += entry->second.peak;
  json["cache_bytes"] = cache_bytes;
  json["device_bytes"] = device.ledger().peak();
  return json;
}

ordered_json compare_methods(const ocl::DeviceInfo &device_info, const PaperRun &run,
                             const std::string &pictures) {
  std::vector<HitRecord> of_rays, of_mesh;
  {
    ocl::Device device(device_info);
    DeviceRenderer renderer(device, run.volume, options_of(run, {}));
    renderer.render(request_of(run, 0, 0));
    of_rays = renderer.hits();
    if (!pictures.empty()) write_png(renderer.shade(), pictures + "_rays.png");
  }
  ocl::Device device(device_info);
  try {
    MeshRenderer renderer(device, run.volume, {.size = run.size});
    renderer.render(request_of(run, 0, 0));
    of_mesh = renderer.hits();
    if (!pictures.empty()) write_png(renderer.shade(), pictures + "_bcmc.png");
  } catch (const Error &) {  // too large: measure_bcmc() says so
    device.finish();
    return nullptr;
  }
  const double diagonal = glm::length(run.volume.info.index_to_world() * glm::dvec3(1));
  std::uint64_t num_near = 0, num_hits = 0;
  for (std::size_t i = 0; i < of_rays.size(); ++i) {
    const float a = of_rays[i].t, b = of_mesh[i].t;
    num_near += (a == b || std::abs(a - b) <= diagonal) ? 1 : 0;
    num_hits += std::isfinite(a) ? 1 : 0;
  }
  const double all = double(of_rays.size());
  return {{"percent", 100 * double(num_near) / all},
          {"hits_percent", 100 * double(num_hits) / all}};
}

}  // namespace isowave::core::tools
