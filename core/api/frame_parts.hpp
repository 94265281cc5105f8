#pragma once
// Private to core/api: requests and frames of its users and of core, whichever renderer draws.

#include <span>
#include <vector>

#include "core/accuracy/choose_detail.hpp"
#include "core/render/frame_request.hpp"
#include "core/stages/shade.hpp"
#include "core/view/given_rays.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "isowave/frame.hpp"
#include "isowave/renderer.hpp"

namespace isowave {

core::ImageSize core_size(const ImageSize &size);
Camera public_camera(const core::Camera &camera);
core::Appearance core_appearance(const Appearance &appearance);
/// What is drawn, and how precisely; without on_pass.
core::FrameRequest core_request(const FrameRequest &request);

/// Throws  core::Error: bounds, or a choice of detail, that cannot be had
void check_bounds(const FrameRequest &request, const RendererOptions &options);

DetailChoice public_choice(const core::DetailChoice &choice);

/// Fills in the frame's size and statistics.
void describe_frame(const FrameRequest &request, const core::FrameStats &stats, Frame &frame);

std::vector<core::WorldRay> world_rays(std::span<const Ray> rays);

/// One row: what rays of any origin hit.
Frame frame_of_rays(const std::vector<core::HitRecord> &hits, const core::CompressedVolume &volume,
                    bool with_levels);

/// Fills in the frame's depth, normals, positions and hits, as the request wants them.
///
/// with_levels  levels of detail may have drawn it
void fill_frame(const FrameRequest &request, const std::vector<core::HitRecord> &records,
                const core::CompressedVolume &volume, bool with_levels, Frame &frame);

}  // namespace isowave
