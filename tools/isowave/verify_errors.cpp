#include "tools/isowave/verify_errors.hpp"

#include <fmt/format.h>

#include "core/accuracy/choose_detail.hpp"
#include "core/accuracy/with_choices.hpp"
#include "core/base/error.hpp"
#include "core/io/json_list.hpp"
#include "core/render/device_renderer.hpp"
#include "core/zfp/isovalue.hpp"
#include "reference/accuracy.hpp"
#include "reference/bound_check.hpp"
#include "reference/cell_oracle.hpp"
#include "tools/isowave/accuracy_report.hpp"
#include "tools/isowave/compile_report.hpp"

namespace isowave::core::tools {

std::uint64_t verify_errors(const VerifyFramesOptions &options, nlohmann::ordered_json &document) {
  const double max_surface_error = *options.max_surface_error;
  check_max_surface_error(max_surface_error);
  if (is_zfp_name(options.input))
    throw Error("{}: the volume before compression is needed, to be compressed and compared with",
                options.input);
  if (!options.oracles.empty() || options.frame.voxel_error > 0)
    throw Error(
        "--max-surface-error chooses the detail, and has an oracle of its own: leave out --oracle "
        "and --voxel-error");
  FrameOptions frame_options = options.frame;
  frame_options.compression.levels = 0;
  frame_options.compression.measure_error = true;
  const ocl::DeviceInfo info = ocl::choose_device(options.device);
  fmt::print("device {}: {} ({})\n", info.index, info.name, info.platform);
  ocl::Device device(info);
  CompileReport compiling(device);
  const VolumeAndViews scene = load_volume_and_views(options.input, options.volume, frame_options,
                                                     read_views(frame_options));
  const glm::uvec3 dims = scene.volume.info.dims;
  std::vector<double> source(scene.volume.info.num_voxels());
  open_any_volume(options.input, to_overrides(options.volume))
      ->read_exact_layers(0, dims.z, source);
  DeviceRenderer renderer(device, scene.volume, with_choices({.size = scene.size}, scene.volume));
  compiling.finish();
  fmt::print("{:>9} {:>5} {:>9} {:>10} {:>10} {:>9} {:>10} {:>9} {:>10}\n", "isovalue", "view",
             "px chosen", "value", "pixels", "proven %", "uncertain", "exceeded", "slack p50");
  std::uint64_t exceeded = 0;
  for (const double given : options.frame.isovalues) {
    const float isovalue = drawn_isovalue(scene.volume, given);
    const CellOracle truth(source, {dims.x, dims.y, dims.z}, isovalue);
    for (std::size_t view = 0; view < scene.cameras.size(); ++view) {
      const Camera &camera = scene.cameras[view];
      const DetailChoice choice =
          choose_detail(renderer, scene.volume, {camera, isovalue}, max_surface_error);
      FrameRequest request = with_detail({camera, isovalue}, choice.detail);
      request.normals = Normals::kCell;
      renderer.render(request);
      const std::vector<HitRecord> drawn = renderer.hits();
      const Certificate certificate = certify(renderer, scene.volume, request, drawn);
      const CertificateSummary summary = summarize(certificate, max_surface_error);
      const BoundTally tally =
          judge_bounds(truth, make_frame_params(scene.volume.info, camera, scene.size, isovalue),
                       drawn, certificate.bounds);
      const Quantiles slack = quantiles(tally.slack);
      fmt::print("{:>9} {:>5} {:>9.3g} {:>10} {:>10} {:>9.2f} {:>10} {:>9} {:>10.2f}\n", isovalue,
                 view, choice.detail.voxel_pixels, choice.detail.voxel_error,
                 with_commas(summary.num_pixels),
                 summary.num_pixels == 0
                     ? 100.0
                     : 100.0 * double(summary.num_certified) / double(summary.num_pixels),
                 with_commas(summary.num_uncertain), tally.exceeded, slack.p50);
      add_to_list(document, "frames",
                  nlohmann::ordered_json{{"volume", options.input},
                                         {"drawn_by", info.name},
                                         {"isovalue", isovalue},
                                         {"view", view},
                                         {"max_surface_error", max_surface_error},
                                         {"voxel_pixels", choice.detail.voxel_pixels},
                                         {"voxel_error", choice.detail.voxel_error},
                                         {"reachable", choice.reachable},
                                         {"pixels", summary.num_pixels},
                                         {"certified", summary.num_certified},
                                         {"uncertain", summary.num_uncertain},
                                         {"misses", tally.misses},
                                         {"exceeded", tally.exceeded},
                                         {"slack", quantiles_json(slack)}});
      exceeded += tally.exceeded;
    }
  }
  return exceeded;
}

}  // namespace isowave::core::tools
