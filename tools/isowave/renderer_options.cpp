#include "tools/isowave/renderer_options.hpp"

#include "core/base/error.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

void add_renderer_options(CLI::App &app, RendererFlags &flags) {
  app.add_option(
         "--memory-budget", flags.values.memory_budget,
         "bound on the buffers that are made on the device, e.g. 600MB (1000^2) or 1GiB (1024^3); "
         "what the driver takes for itself comes on top [3/4 of the device's memory]; on the host, "
         "on value ranges and decoded blocks [1/4 of its memory]")
      ->transform(byte_count())
      ->type_name("BYTES");
  app.add_option(
         "--cache-slots", flags.values.cache_slots,
         "number of decoded blocks kept on the device, 8 to 2^26 [with a budget as many as it "
         "allows, without one as many as frames need, growing to 2^22]")
      ->check(CLI::Range(8u, 1u << 26));
  app.add_option("--stream", flags.stream,
                 "place of the compressed volume: device, host (blocks are uploaded on request), "
                 "or auto (the device, if that leaves room for a useful cache)")
      ->check(CLI::IsMember({"auto", "device", "host"}))
      ->capture_default_str();
  app.add_option("--voxel-pixels", flags.voxel_pixels,
                 "largest distance between voxels of a coarser level of detail [pixels], which "
                 "then draws far parts; 0: the finest level draws all")
      ->capture_default_str();
  app.add_option("--pipeline", flags.pipeline,
                 "arrangement of the passes: blocks (the paper's), rays, or auto (rays, which was "
                 "faster in nearly all measurements)")
      ->check(CLI::IsMember({"auto", "blocks", "rays"}))
      ->capture_default_str();
  app.add_option(
         "--speculation", flags.speculation,
         "blocks a ray looks ahead: off (1), global (W*H / active rays), per-ray (twice as many "
         "after every miss; in pipeline blocks no more than global), scanned (pipeline blocks: "
         "global, and places that rays leave empty go to others), or auto (per-ray in pipeline "
         "rays, global in blocks)")
      ->check(CLI::IsMember({"auto", "off", "global", "per-ray", "scanned"}))
      ->capture_default_str();
  app.add_option("--max-speculation", flags.values.max_speculation,
                 "most blocks that a ray looks ahead, 1..64")
      ->capture_default_str();
  app.add_option("--solver", flags.solver, "root finder: linear, marmitt, analytic or bernstein")
      ->capture_default_str();
  app.add_option("--grouping", flags.grouping,
                 "way in which pipeline blocks groups rays by block: radix or counting")
      ->capture_default_str();
  app.add_option("--closest", flags.closest,
                 "way in which pipeline blocks finds a ray's closest result: scan or atomic-min")
      ->capture_default_str();
  app.add_option("--group-size", flags.values.group_size, "work-items per work-group, 8..256")
      ->capture_default_str();
}

void add_normals_option(CLI::App &app, std::string &normals) {
  app.add_option("--normals", normals,
                 "normals that light surfaces: smooth (central differences of voxels) or cell (the "
                 "gradient of each trilinear cell, which shows as facets)")
      ->check(CLI::IsMember({"smooth", "cell"}))
      ->capture_default_str();
}

void add_ambient_option(CLI::App &app, std::uint32_t &num_rays) {
  app.add_option("--ambient", num_rays,
                 "rays from each hit, up to 255, that find out how much of the sky it sees, which "
                 "shows depth; each takes about as long as a frame without any; 16 and more look "
                 "smooth")
      ->type_name("N")
      ->capture_default_str();
}

void check_renderer_options(const CLI::App &app, const RendererFlags &flags) {
  if (flags.speculation == "off")
    refuse_options(app, {"--max-speculation"}, "--speculation off is 1");
  solver_from_string(flags.solver);
  grouping_from_string(flags.grouping);
  closest_hit_from_string(flags.closest);
  if (flags.pipeline != "blocks" && flags.speculation == "scanned")
    throw Error("--speculation scanned: give --pipeline blocks, which alone has it");
  if (flags.pipeline != "blocks")
    refuse_options(app, {"--grouping", "--closest"}, "give --pipeline blocks, which alone has it");
}

RendererOptions to_renderer_options(const RendererFlags &flags, ImageSize size) {
  RendererOptions options = flags.values;
  options.size = size;
  options.with_levels |= flags.voxel_pixels > 0;
  const bool is_blocks = flags.pipeline == "blocks";
  const BlocksOptions of_blocks{.grouping = grouping_from_string(flags.grouping),
                                .closest = closest_hit_from_string(flags.closest),
                                .scanned_pairs = flags.speculation == "scanned"};
  if (is_blocks) options.pipeline = blocks_pipeline(of_blocks);
  if (flags.speculation == "off") options.max_speculation = 1;
  // Pipeline blocks needs twice the passes with per-ray speculation, and is no faster although it
  // decodes less (bench/h100.md).
  options.per_ray_speculation =
      flags.speculation == "per-ray" || (flags.speculation == "auto" && !is_blocks);
  options.solver = solver_from_string(flags.solver);
  options.stream = stream_place_from_string(flags.stream);
  return options;
}

nlohmann::ordered_json renderer_options_json(const RendererOptions &options) {
  const BlocksOptions *blocks = blocks_options(*options.pipeline);
  const BlocksOptions of_blocks = blocks != nullptr ? *blocks : BlocksOptions{};
  const char *speculation = options.max_speculation == 1  ? "off"
                            : of_blocks.scanned_pairs     ? "scanned"
                            : options.per_ray_speculation ? "per-ray"
                                                          : "global";
  return {{"pipeline", options.pipeline->name()},       {"speculation", speculation},
          {"max_speculation", options.max_speculation}, {"cache_slots", options.cache_slots},
          {"solver", to_string(options.solver)},        {"grouping", to_string(of_blocks.grouping)},
          {"closest", to_string(of_blocks.closest)},    {"group_size", options.group_size},
          {"stream", to_string(options.stream)}};
}

}  // namespace isowave::core::tools
