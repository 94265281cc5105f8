#include "bench/gpu_peer/pictures.hpp"

#include <fmt/format.h>

#include "bench/frame_measure.hpp"
#include "core/base/ms_since.hpp"
#include "core/frame/appearance.hpp"
#include "core/io/png.hpp"

namespace isowave::core::bench {

namespace {

/// "nanovdb_fpn_bits" -> "NanoVDB FpN, bits".
std::string name_for_people(const std::string &side) {
  static const std::map<std::string, std::string> kNames = {
      {"isowave_exact", "isowave, lossless"},
      {"texture_uint8", "texture of 8 bits, ranges"},
      {"texture_float", "texture of floats, ranges"},
      {"nanovdb_float_bits", "NanoVDB float, bits"},
      {"nanovdb_float_ranges", "NanoVDB float, ranges"},
      {"nanovdb_fpn_bits", "NanoVDB FpN, bits"},
      {"nanovdb_fpn_ranges", "NanoVDB FpN, ranges"},
      {"nanovdb_fp8_bits", "NanoVDB Fp8, bits"},
      {"nanovdb_fp8_ranges", "NanoVDB Fp8, ranges"},
      {"nanovdb_uint8_bits", "NanoVDB 8 bits, bits"},
      {"nanovdb_uint8_ranges", "NanoVDB 8 bits, ranges"}};
  const std::string rate = "isowave_rate_";
  if (side.starts_with(rate)) return fmt::format("isowave, rate {}", side.substr(rate.size()));
  return kNames.at(side);
}

/// Frames of one view.
struct ViewTurn {
  const VolumeInfo &info;
  const Views &views;
  const Camera &camera;
};

/// Times each frame. Returns the view's picture.
Image8 draw_view(IsowaveSide &side, const ViewTurn &turn, PeerPictures &result) {
  DeviceRenderer &renderer = side.renderer();
  const FrameRequest request{
      .camera = turn.camera, .isovalue = turn.views.isovalue, .size = turn.views.size};
  const FrameRequest next = seen_from(turned(turn.camera), request);
  FrameRequest other = request;
  other.isovalue = turn.views.other_isovalue;
  renderer.render(other);  // also takes the GPU from the side before, whose context is another one
  renderer.clear_cache();
  Image8 image;
  const std::pair<const char *, const FrameRequest *> frames[] = {
      {"cold", &request}, {"warm", &request}, {"next", &next}};
  for (const auto &[kind, frame] : frames) {
    const auto begin = std::chrono::steady_clock::now();
    renderer.render(*frame);
    const FrameArrays arrays = renderer.fetch({.picture = true}, {});
    result.ms[kind].push_back(ms_since(begin));
    if (frame == &request) image = image_of(turn.views.size, arrays.picture);
  }
  return image;
}

Image8 draw_view(GridSide &side, const ViewTurn &turn, PeerPictures &result) {
  const ImageSize size = turn.views.size;
  const View view = make_view(turn.info, turn.camera, size);
  const View next = make_view(turn.info, turned(turn.camera), size);
  const ShadeParams shading = make_shade_params(turn.info, Appearance{});
  side.set_isovalue(turn.views.other_isovalue);
  side.picture(view, shading, Normals::kSmooth);  // as above
  std::span<const std::uint8_t> picture;
  auto begin = std::chrono::steady_clock::now();
  side.set_isovalue(turn.views.isovalue);
  side.picture(view, shading, Normals::kSmooth);
  result.ms["new"].push_back(ms_since(begin));
  begin = std::chrono::steady_clock::now();
  picture = side.picture(view, shading, Normals::kSmooth);
  result.ms["warm"].push_back(ms_since(begin));
  Image8 image{size.width, size.height, 3, {picture.begin(), picture.end()}};
  begin = std::chrono::steady_clock::now();
  side.picture(next, shading, Normals::kSmooth);
  result.ms["next"].push_back(ms_since(begin));
  return image;
}

}  // namespace

std::vector<PeerPictures> draw_pictures(std::vector<std::unique_ptr<IsowaveSide>> &isowave,
                                        std::vector<NamedSide> &peers, const VolumeInfo &info,
                                        const Views &views, const PictureWork &work) {
  std::vector<PeerPictures> results;
  results.reserve(isowave.size() + peers.size());
  for (const auto &side : isowave) results.push_back({.side = side->name()});
  for (const NamedSide &peer : peers) results.push_back({.side = peer.name});
  const std::size_t count = results.size();
  for (std::uint32_t round = 0; round <= views.rounds; ++round) {
    for (std::size_t view = 0; view < views.cameras.size(); ++view) {
      const ViewTurn turn{info, views, views.cameras[view]};
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t side = (round + view + i) % count;
        PeerPictures not_counted;
        PeerPictures &result = round == 0 ? not_counted : results[side];
        const Image8 image = side < isowave.size()
                                 ? draw_view(*isowave[side], turn, result)
                                 : draw_view(*peers[side - isowave.size()].side, turn, result);
        if (round == 0) write_png(image, picture_path(work.folder, results[side].side, view));
      }
    }
  }
  for (std::size_t side = 0; side < count; ++side) {
    results[side].name = name_for_people(results[side].side);
    results[side].bytes = side < isowave.size() ? isowave[side]->costs().bytes
                                                : peers[side - isowave.size()].side->costs().bytes;
  }
  return results;
}

}  // namespace isowave::core::bench
