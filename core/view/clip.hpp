#pragma once
// Clipping planes: the part of a volume that is drawn.

#include <array>
#include <glm/glm.hpp>
#include <string_view>
#include <vector>

#include "core/view/camera.hpp"
#include "core/volume/volume.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// The half space of the points p with dot(normal, p) >= offset, in world space.
struct ClipPlane {
  glm::dvec3 normal{1.0, 0.0, 0.0};  ///< of any length above 0, towards what stays
  double offset = 0;                 ///< [world units times the normal's length]

  friend bool operator==(const ClipPlane &, const ClipPlane &) = default;
};

/// What stays of a volume: what is in all half spaces.
struct Clip {
  std::vector<ClipPlane> planes{};  ///< none: everything
  /// Draws flat caps where planes cut what is inside the surface. Otherwise cuts are open, and show
  /// the surface from within.
  bool caps = true;

  friend bool operator==(const Clip &, const Clip &) = default;
};

/// The planes of a box that stays, with edges along the world's axes.
///
/// Throws  Error: the box has no inside
std::array<ClipPlane, 6> box_planes(const glm::dvec3 &begin, const glm::dvec3 &end);

/// Throws  Error about `what`: the plane has no direction, or no place
void check_plane(const ClipPlane &plane, std::string_view what);

/// Throws  Error: too many planes, or a degenerate one
void check_clip(const Clip &clip);

/// The planes for kernels and twin. A plane more than 2^40 voxels away stays there.
///
/// finest  the finest level of detail that the frame's volume has
/// view    make_view() of it
/// Throws  Error: as check_clip()
ClipParams make_clip_params(const VolumeInfo &finest, const View &view, const Camera &camera,
                            const Clip &clip);

}  // namespace isowave::core
