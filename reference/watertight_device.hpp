#pragma once
// The watertight test of a device: its pipelines draw small pictures of closed surfaces, from
// inside and outside.

#include <cstdint>
#include <vector>

#include "core/render/device_renderer.hpp"
#include "reference/watertight.hpp"

namespace isowave::core {

/// As run_watertight(), with rays of pictures instead of single ones, since only these go through
/// whole pipelines: traversal by macrocells, the cache, decoding. Draws views of each surface until
/// at least num_rays rays had to hit: all of a view from an inside point, and of one from outside
/// those that pass an inside point, before which they must. A third of the views stand at lattice
/// points and look along lattice directions. kLevels: with borders anywhere in the surface,
/// pipeline `rays` alone.
std::vector<WatertightResult> run_watertight_on(ocl::Device &device, const PipelinePtr &pipeline,
                                                std::uint64_t num_rays, std::uint32_t seed,
                                                Solver solver, RayBands bands = RayBands::kOne,
                                                RayPackets packets = RayPackets::kAuto);

}  // namespace isowave::core
