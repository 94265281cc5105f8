#pragma once
// How far Embree's float32 can be trusted to walk through a volume.

#include <array>
#include <cstdint>
#include <string>

namespace isowave::core {

/// Bounds are grown by this much on each side [voxels]: a power of two, so that voxel +- margin is
/// exact.
inline constexpr double kBoundsMargin = 1.0 / 16;

/// The farthest plane of the volume that an eye may look at, along any axis [voxels].
///
/// Embree's slab test computes t = (plane - origin) * (1 / direction) in float32. With u = 2^-24
/// the difference is off by u relatively, the reciprocal by at most 4 u, the product by u, and an
/// origin that had to be rounded to float32 by u |origin|: along that axis, t stands for a plane at
/// most 7 u away from the bound, relative to a distance D, rounded up here to 8 u D. As long as
/// that is at most half the margin, the computed interval of the enlarged box contains the ray's
/// exact interval in the cell, so no box of a cell on the ray can be passed over: 8 * 2^-24 * D <=
/// margin / 2, D <= margin * 2^20.
inline constexpr double kEmbreeReach = kBoundsMargin * 0x1p20;

/// The distance of an eye from the farthest plane of the volume along any axis [voxels], and
/// whether Embree can be trusted that far.
double farthest_plane(const std::array<double, 3> &eye, const std::array<std::uint32_t, 3> &dims);
bool within_embree_reach(const std::array<double, 3> &eye,
                         const std::array<std::uint32_t, 3> &dims);
/// One line for such an eye: why it is left out.
std::string out_of_reach(const std::array<double, 3> &eye,
                         const std::array<std::uint32_t, 3> &dims);

}  // namespace isowave::core
