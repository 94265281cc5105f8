#pragma once
// Isosurfaces as triangle meshes, made by a device.

#include <filesystem>
#include <memory>
#include <string>

#include "isowave/device.hpp"
#include "isowave/mesh.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// Extracts the isosurface by marching cubes on the device, and waits for it. The bits of the mesh
/// are the same on every device that divides exactly, and on the host.
///
/// Throws  Error: as the host's extract()
Mesh extract(const std::shared_ptr<Device> &device, const std::shared_ptr<const Volume> &volume,
             double isovalue, const ExtractOptions &options = {});

/// Extracts the isosurface to a file, as the host's extract_to_file().
std::string extract_to_file(const std::shared_ptr<Device> &device,
                            const std::shared_ptr<const Volume> &volume, double isovalue,
                            const std::filesystem::path &path, const ExtractOptions &options = {});

}  // namespace isowave
