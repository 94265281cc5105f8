#pragma once
// How far a drawn surface may be from the true one: the isosurface of the volume before
// compression, trilinear between its voxels.
//
// If the decoded field is known to within a bound, the true surface lies between the surfaces of
// the lower and of the upper bound (FrameRequest::bound). Take a ray that begins outside of both,
// or inside of both: the first crossing of the true field is not before the first crossing of one
// of them, and not behind that of the other. A pixel is not certified if its ray begins between the
// two surfaces, meets only one of them, or meets one outside of the volume (coarse levels reach a
// little out of it): any error there could make or end a surface. Behind voxels without data a ray
// begins anew: its new begin must be outside of both or inside of both, and no gap may lie between
// the two hits.

#include <cstdint>
#include <span>
#include <vector>

#include "core/frame/renderer.hpp"
#include "core/zfp/zfp_stream.hpp"

namespace isowave::core {

struct Certificate {
  /// [ray] Largest possible distance between the drawn and the true hit along the ray [pixels: what
  /// a pixel covers at the drawn hit's distance]; 0 if both miss for certain; infinity if nothing
  /// is certain.
  std::vector<float> bounds;
  double total_ms = 0;  ///< wall clock, of both bounds' frames and what the host makes of them
  std::uint64_t decoded_blocks = 0;  ///< for them, by all ranks
};

/// Bounds the error of a frame.
///
/// renderer made with_bounds, or a team of such renderers; its last frame is then another one
/// volume   the volume that this process's renderer was made for
/// request  the frame's request
/// drawn    depth of the frame's rays; only at rank 0
/// Returns  at rank 0 the certificate; at other ranks one without bounds
/// Throws   Error, at all ranks: the volume's error is not known; the solver may miss crossings;
///          depths are not as many as the rays; coarser levels draw a volume with voxels without
///          data
Certificate certify(Renderer &renderer, const CompressedVolume &volume, const FrameRequest &request,
                    std::span<const float> drawn);
/// The same from a frame's hits.
Certificate certify(Renderer &renderer, const CompressedVolume &volume, const FrameRequest &request,
                    std::span<const HitRecord> drawn);

/// Summary of a certificate, over the pixels that are not certain to miss.
struct CertificateSummary {
  std::uint64_t num_pixels = 0;     ///< of those
  std::uint64_t num_certified = 0;  ///< with a bound of at most the limit
  std::uint64_t num_uncertain = 0;  ///< without a bound
  double median = 0, p99 = 0,
         max = 0;  ///< bounds of those that have one; 0 if there are none [pixels]
};
/// bounds  Certificate::bounds
/// limit   [pixels]
CertificateSummary summarize(std::span<const float> bounds, double limit);
inline CertificateSummary summarize(const Certificate &certificate, double limit) {
  return summarize(certificate.bounds, limit);
}

}  // namespace isowave::core
