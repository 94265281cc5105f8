#include "tools/isowave/render_report.hpp"

#include <fmt/format.h>

#include <vector>

#include "core/accuracy/image_error.hpp"
#include "core/accuracy/ray_sample.hpp"
#include "core/base/text.hpp"
#include "core/io/npy.hpp"
#include "core/zfp/describe_compression.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"

namespace isowave::core::tools {

namespace {

nlohmann::ordered_json detail_json(const Detail &detail) {
  return {{"voxel_pixels", detail.voxel_pixels}, {"voxel_error", detail.voxel_error}};
}

/// share: the name of a share of the pixels that keep the error
nlohmann::ordered_json tries_json(const DetailChoice &choice, const char *share) {
  nlohmann::ordered_json tries = nlohmann::ordered_json::array();
  for (const DetailChoice::Try &each : choice.tries) {
    tries.push_back(detail_json(each.detail));
    tries.back()[share] = each.kept;
  }
  return tries;
}

nlohmann::ordered_json clip_json(const Clip &clip) {
  nlohmann::ordered_json planes = nlohmann::ordered_json::array();
  for (const auto &[normal, offset] : clip.planes)
    planes.push_back({{"normal", {normal.x, normal.y, normal.z}}, {"offset", offset}});
  return {{"planes", planes}, {"caps", clip.caps}};
}

/// The source of the errors of a volume's voxels and levels, on which bounds rest.
std::string_view errors_of(const CompressedVolume &volume) {
  return volume.errors_are_stated ? "stated" : "measured";
}

}  // namespace

nlohmann::ordered_json report_layers(const LayerStats &layers) {
  if (layers.rays_cut != 0)
    warn(fmt::format("{} {} more than {} hits; what lies behind is left out",
                     with_commas(layers.rays_cut), plural(layers.rays_cut, "ray has", "rays have"),
                     ISO_MAX_LAYERS));
  return {{"layers", layers.layers}, {"hits", layers.hits}, {"rays_cut", layers.rays_cut}};
}

nlohmann::ordered_json report_steps(const FrameStats &stats, double budget_ms) {
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  for (const TimedStep &step : stats.steps) {
    fmt::print("  {}x{}, {}: {:.2f} ms, {}\n", step.size.width, step.size.height,
               step.voxel_pixels == 0
                   ? "finest level"
                   : fmt::format("voxels up to {} of its pixels apart", step.voxel_pixels),
               step.ms,
               step.cancelled ? fmt::format("{:.1f} % of it", step.completed_percent) : "whole");
    steps.push_back({{"size", {step.size.width, step.size.height}},
                     {"voxel_pixels", step.voxel_pixels},
                     {"ms", step.ms},
                     {"completed_percent", step.completed_percent},
                     {"cancelled", step.cancelled}});
  }
  return {{"budget_ms", budget_ms}, {"complete", stats.complete}, {"steps", steps}};
}

/// When the detail was chosen, for the report.
std::string chosen_in(const DetailChoice &choice) {
  return choice.total_ms == 0 ? "chosen for all views"
                              : fmt::format("chosen in {:.0f} ms", choice.total_ms);
}

/// "with voxels up to 2 pixels apart and values up to 0.5 off", "at full detail"
std::string text_of_detail(const Detail &detail) {
  if (detail == Detail{}) return "at full detail";
  return fmt::format("with voxels up to {:.3g} pixels apart and values up to {} off",
                     detail.voxel_pixels, detail.voxel_error);
}

nlohmann::ordered_json report_sample(double max_surface_error, const DetailChoice &choice) {
  const SampledShare &sample = choice.sample.value();
  if (choice.detail == Detail{}) {
    fmt::print(
        "  full detail: the sample does not show that less would keep {} pixels and save many "
        "blocks; {}\n",
        max_surface_error, chosen_in(choice));
  } else {
    fmt::print(
        "  within {} pixels of the surface at full detail: {:.2f} % of {} hits of {} sampled rays\n"
        "  at least {:.2f} % of all hits, with {:.0f} % confidence (Clopper-Pearson)\n"
        "  {}; {}\n",
        max_surface_error, 100 * sample.share(), with_commas(sample.num_hits),
        with_commas(sample.num_rays), 100 * sample.lowest, 100 * kConfidence,
        text_of_detail(choice.detail), chosen_in(choice));
  }
  return {{"max_surface_error", max_surface_error}, {"by", "sample"},
          {"chosen", detail_json(choice.detail)},   {"tries", tries_json(choice, "within")},
          {"choice_ms", choice.total_ms},           {"sampled_rays", sample.num_rays},
          {"sampled_hits", sample.num_hits},        {"within", sample.num_within},
          {"lowest_share", sample.lowest},          {"confidence", kConfidence}};
}

nlohmann::ordered_json report_image_error(double max_image_error, const DetailChoice &choice) {
  const ImageError &image = choice.image.value();
  fmt::print(
      "  FLIP {:.2g} of {} tiles, up to {:.2g} with 95 % confidence (Student's t), against {} rays "
      "a pixel at full detail\n"
      "  with {} x {} rays a pixel and voxels up to {:.3g} pixels apart; {}\n",
      image.mean, image.num_tiles, image.highest, kReferenceSamples * kReferenceSamples,
      image.samples, image.samples, choice.detail.voxel_pixels, chosen_in(choice));
  if (!choice.reachable)
    warn(fmt::format("the picture's error cannot be kept at {}: {}", max_image_error,
                     choice.advice));
  nlohmann::ordered_json tries = nlohmann::ordered_json::array();
  for (const ImageError::Try &each : image.tries) {
    tries.push_back(
        {{"samples", each.samples}, {"voxel_pixels", each.voxel_pixels}, {"flip", each.error}});
  }
  return {{"max_image_error", max_image_error}, {"reachable", choice.reachable},
          {"samples", image.samples},           {"voxel_pixels", choice.detail.voxel_pixels},
          {"tiles", image.num_tiles},           {"flip", image.mean},
          {"highest_flip", image.highest},      {"tries", tries},
          {"choice_ms", choice.total_ms}};
}

nlohmann::ordered_json report_error(double max_surface_error, const CompressedVolume &volume,
                                    const LastFrame &last, const Frame &frame,
                                    const std::filesystem::path &error_map) {
  const DetailChoice &choice = last.stats.detail.value();
  const Certificate &certificate = last.certificate;
  const CertificateSummary summary = summarize(frame.bounds, max_surface_error);
  const double certified = summary.num_pixels == 0
                               ? 100.0
                               : 100.0 * double(summary.num_certified) / double(summary.num_pixels);
  fmt::print(
      "  within {} {} of the true surface{}: {:.2f} % of {} {} (bound: median {:.3g}, p99 "
      "{:.3g}); {} uncertain\n"
      "  {}; {}, bounded in {:.0f} ms\n",
      max_surface_error, plural(max_surface_error, "pixel", "pixels"),
      volume.errors_are_stated ? ", if the errors are right that the file states" : "", certified,
      with_commas(summary.num_pixels), plural(summary.num_pixels, "ray", "rays"), summary.median,
      summary.p99, with_commas(summary.num_uncertain), text_of_detail(choice.detail),
      chosen_in(choice), certificate.total_ms);
  if (!choice.reachable) {
    warn(fmt::format("most pixels cannot be kept within {} pixels: {}", max_surface_error,
                     choice.advice));
  }
  if (!error_map.empty()) write_npy({frame.columns, frame.rows, frame.bounds}, error_map);
  return {{"max_surface_error", max_surface_error},
          {"by", "proof"},
          {"errors", errors_of(volume)},
          {"reachable", choice.reachable},
          {"chosen", detail_json(choice.detail)},
          {"tries", tries_json(choice, "certified")},
          {"choice_ms", choice.total_ms},
          {"pixels", summary.num_pixels},
          {"certified", summary.num_certified},
          {"uncertain", summary.num_uncertain},
          {"median", summary.median},
          {"p99", summary.p99},
          {"max", summary.max},
          {"bound_ms", certificate.total_ms},
          {"decoded_blocks", certificate.decoded_blocks}};
}

void print_plan(const MemoryPlan &plan, const CompressedVolume &volume) {
  fmt::print("the compressed volume of {} bytes stays on the {}: {}\n",
             with_commas(volume.word_count() * sizeof(std::uint32_t)), to_string(plan.stream),
             plan.reason);
  if (plan.stream == StreamPlace::kHost) {
    fmt::print("its blocks are uploaded through a window, {} at a time\n",
               with_commas(plan.window_blocks));
  }
  for (const ocl::BufferSize &buffer : plan.buffers) {
    fmt::print("  {:>16} bytes  {}\n", with_commas(buffer.bytes()), buffer.name);
  }
  fmt::print("  {:>16} bytes  in all, with {} cache slots; at most {} during setup\n",
             with_commas(plan.total()), with_commas(plan.cache_slots),
             with_commas(plan.setup_bytes));
  if (plan.can_grow()) {
    fmt::print("  {:>16} bytes  at most, should frames need more slots: with {}\n",
               with_commas(resized(plan, plan.most_slots).total()), with_commas(plan.most_slots));
  }
}

nlohmann::ordered_json options_json(const RenderArgs &options, ImageSize size,
                                    std::size_t num_views, bool on_host) {
  nlohmann::ordered_json json = {{"size", {size.width, size.height}},
                                 {"samples", size.samples},
                                 {"views", num_views},
                                 {"isovalues", all_isovalues(options)},
                                 {"isovalue_suggested", options.isovalue_suggested},
                                 {"voxel_error", options.frame.voxel_error},
                                 {"reference", options.reference}};
  if (!on_host) json.update(renderer_options_json(options.renderer));
  json["voxel_pixels"] = options.voxel_pixels;
  json["normals"] = options.normals;
  json["ambient"] = options.ambient_rays;
  json["transparent"] = options.transparent;
  if (!options.light.direction.empty())
    json["light"] = {{"direction", options.light.direction},
                     {"shadow_rays", options.light.shadow_rays},
                     {"bounce_rays", options.light.bounce_rays},
                     {"angle", options.light.angle}};
  if (!options.scene.file.empty()) json["scene"] = options.scene.file;
  if (!options.color_map.by.empty())
    json["color_by"] = {{"axis", options.color_map.by}, {"map", options.color_map.map}};
  json["clip"] = clip_json(options.clip);
  if (!options.surfaces.empty()) json["surfaces"] = surfaces_json(options.surfaces);
  if (!options.slices.empty()) json["slices"] = slices_json(options.slices);
  return json;
}

nlohmann::ordered_json volume_json(const RenderArgs &options, const CompressedVolume &volume) {
  const VolumeInfo &info = volume.info;
  return {
      {"file", options.input},
      {"dims", {info.dims.x, info.dims.y, info.dims.z}},
      {"spacing", {info.spacing.x, info.spacing.y, info.spacing.z}},
      {"type", to_string(info.type)},
      {"compression", compression_mode(volume)},
      {"rate", volume.rate()},
      {"max_voxel_error", volume.max_voxel_error ? nlohmann::ordered_json(*volume.max_voxel_error)
                                                 : nlohmann::ordered_json()},
      {"errors", errors_of(volume)},
      {"blocks", volume.block_count()},
      {"stream_bytes", volume.word_count() * sizeof(std::uint32_t)}};
}

}  // namespace isowave::core::tools
