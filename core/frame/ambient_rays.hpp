#pragma once
// Ambient rays of a hit, which find out how much of the sky it sees, and shadow rays, which find
// out whether it sees the light.

#include <cstdint>
#include <vector>

#include "core/frame/frame_request.hpp"
#include "core/volume/volume.hpp"
#include "kernels_cl/portable/ambient.h"

namespace isowave::core {

/// Throws  Error: more rays than ISO_MAX_AMBIENT_RAYS
void check_ambient_rays(std::uint32_t num_rays);
/// Throws  Error: too many shadow or bounce rays; a cone that is none; one of the two without a
/// light
void check_shadow_rays(const FrameRequest &request);

/// The rays of each hit: first ambient rays, then shadow rays.
struct LightRays {
  std::uint32_t num_ambient = 0, num_shadow = 0;
  glm::dvec3 light{0, 0, 1};  ///< towards it, world space
  double angle = 0;           ///< of the cone of shadow rays, from its axis [degrees]
  bool bounces = false;       ///< ambient rays bring light (kernels_cl/portable/bounce.h)

  std::uint32_t count() const { return num_ambient + num_shadow; }
  friend bool operator==(const LightRays &, const LightRays &) = default;
};
LightRays light_rays_of(const FrameRequest &request);
/// Room for the counts of such rays of hits, before the first round.
OpenCounts no_counts(const LightRays &rays, std::size_t num_hits);

/// info: the finest level of detail that draws the frame.
AmbientParams make_ambient_params(const VolumeInfo &info, std::uint32_t num_ambient);

/// Returns  [num_rays][ISO_AMBIENT_PATTERNS], distributed by their cosine with z: point k + (p +
///          1/2) / ISO_AMBIENT_PATTERNS of a spiral, turned by p / ISO_AMBIENT_PATTERNS
std::vector<AmbientDirection> make_ambient_directions(std::uint32_t num_rays);

/// Those of ambient rays, and behind them those of shadow rays.
///
/// Returns  [rays.count()][ISO_AMBIENT_PATTERNS]. A single shadow ray goes straight to the light;
///          several are spread evenly over the disk that their cone makes of the unit sphere. If
///          light bounces, and there are no shadow rays, a row more goes straight to the light
std::vector<AmbientDirection> make_light_directions(const LightRays &rays);

}  // namespace isowave::core
