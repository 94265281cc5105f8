#pragma once
// Headers of NRRD (.nrrd, .nhdr): http://teem.sourceforge.net/nrrd/format.html
//
// Comments and key/value pairs may be anything. All other lines must be fields of the format, each
// at most once, with values that are understood to their end. Refused, besides what is broken:
// bzip2, blocks, more than one value per voxel, spaces of other than 3 dimensions.

#include <memory>

#include "core/io/volume_header.hpp"

namespace isowave::core {

/// Reads and judges the header, not the voxels.
///
/// Throws  Error
VolumeHeader read_nrrd_header(const std::shared_ptr<const InputFile> &file);

}  // namespace isowave::core
