#include "tools/isowave/render_stats.hpp"

#include "core/io/atomic_file.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

ordered_json vec_json(const glm::dvec3 &v) {
  return {v.x, v.y, v.z};
}

ordered_json pass_json(const PassStats &pass) {
  ordered_json result = {
      {"active_rays", pass.counts.active_count},
      {"window_rays", pass.counts.window_count},
      {"n_spec", pass.n_spec},
      {"ray_block_pairs", pass.counts.pair_count},
      {"intersected_pairs", pass.counts.granted_count},
      {"visible_blocks", pass.visible_blocks ? ordered_json(*pass.visible_blocks) : ordered_json()},
      {"touched_blocks", pass.touched_blocks ? ordered_json(*pass.touched_blocks) : ordered_json()},
      {"requested_blocks", pass.counts.requested_count},
      {"decoded_blocks", pass.counts.decoded_count},
      {"recycled_blocks", pass.counts.recycled_count},
      {"rays_hit", pass.counts.hit_count},
      {"utilization_percent", pass.utilization_percent},
      {"completed_percent", pass.completed_percent}};
  if (!pass.stage_ms.empty()) result["stage_ms"] = pass.stage_ms;
  return result;
}

ordered_json later_json(const LaterPasses &later) {
  ordered_json result = {{"passes", later.passes},
                         {"decoded_blocks", later.decoded_blocks},
                         {"recycled_blocks", later.recycled_blocks},
                         {"ms", later.ms}};
  if (!later.stage_ms.empty()) result["stage_ms"] = later.stage_ms;
  return result;
}

}  // namespace

ordered_json device_json(const ocl::DeviceInfo &info) {
  const ocl::Capabilities &can = info.capabilities;
  return {{"index", info.index},
          {"type", to_string(info.type)},
          {"name", info.name},
          {"vendor", info.vendor},
          {"platform", info.platform},
          {"device_version", info.device_version},
          {"driver_version", info.driver_version},
          {"int64_atomics", can.int64_atomics},
          {"fp64", can.fp64},
          {"sub_groups", can.sub_groups},
          {"correctly_rounded_divide", can.correctly_rounded_divide},
          {"denormals", can.denormals},
          {"global_memory", can.global_memory},
          {"largest_allocation", can.largest_allocation},
          {"local_memory", can.local_memory},
          {"max_work_group_size", can.max_work_group_size},
          {"compute_units", can.compute_units}};
}

ordered_json frame_json(double isovalue, std::size_t view, const Camera &camera,
                        const FrameStats &stats, bool on_host) {
  ordered_json result = {{"isovalue", isovalue},
                         {"view", view},
                         {"camera",
                          {{"eye", vec_json(camera.eye)},
                           {"at", vec_json(camera.at)},
                           {"up", vec_json(camera.up)},
                           {"fovy_deg", camera.fovy_deg}}},
                         {"levels", {stats.first_level, stats.last_level}},
                         {"rays_hit", stats.rays_hit},
                         {"hits_ms", stats.total_ms},
                         {"cancelled", stats.cancelled}};
  if (camera.parallel_height) result["camera"]["parallel_height"] = *camera.parallel_height;
  if (on_host) {
    result["ambient_ms"] = stats.ambient.ms;
    return result;
  }
  result["passes"] = stats.passes.size();
  result["normals"] = later_json(stats.normals);
  result["ambient"] = later_json(stats.ambient);
  if (stats.field.passes != 0) result["field"] = later_json(stats.field);
  result["uploaded_blocks"] = stats.uploaded_blocks;
  result["uploaded_bytes"] = stats.uploaded_bytes;
  ordered_json passes = ordered_json::array();
  for (const PassStats &pass : stats.passes) passes.push_back(pass_json(pass));
  result["per_pass"] = std::move(passes);
  return result;
}

ordered_json memory_json(const ocl::MemoryLedger &ledger) {
  ordered_json by_name = ordered_json::object();
  for (const auto &[name, entry] : ledger.by_name()) {
    by_name[name] = {{"current", entry.current}, {"peak", entry.peak}};
  }
  return {{"current", ledger.current()}, {"peak", ledger.peak()}, {"by_name", std::move(by_name)}};
}

std::string json_text(const ordered_json &document) {
  return document.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

void write_json(const ordered_json &document, const std::string &path) {
  AtomicFile file(path);
  file.write(json_text(document));
  file.commit();
}

}  // namespace isowave::core::tools
