#pragma once
// Private to core/api: what is behind isowave::Volume, and what opening one asks for.

#include <string>
#include <vector>

#include "core/sources/load_volume.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "isowave/volume.hpp"

namespace isowave {

struct Volume::Implementation {
  Implementation(core::CompressedVolume compressed, std::vector<std::string> of_header);

  core::CompressedVolume volume;
  Grid grid;
  std::vector<std::string> notices;
};

Grid public_grid(const core::VolumeInfo &info);
/// Unchecked, and without a type of voxels.
core::VolumeInfo core_grid(const Grid &grid);
core::RawOverrides to_overrides(const RawFile &raw);
/// Throws  core::Error: a `.zfp` file cannot be compressed; several ways to compress
core::Storage storage_for(const std::string &path, const Compression &compression);

}  // namespace isowave
