#pragma once
// Headers of NIfTI-1 in one file (.nii, .nii.gz): https://nifti.nimh.nih.gov/nifti-1
//
// The grid lies where the sform puts it if it is the only one or the scanner's, and otherwise where
// the qform does; an sform counts only without shear and with the spacings of pixdim. Refused,
// besides what is broken: NIfTI-2, Analyze, headers whose voxels lie in an .img file, 64-bit
// integers, more than one value per voxel.

#include <memory>

#include "core/io/volume_header.hpp"

namespace isowave::core {

/// Reads and judges the header, not the voxels.
///
/// Throws  Error
VolumeHeader read_nifti_header(const std::shared_ptr<const InputFile> &file, bool is_gzipped);

}  // namespace isowave::core
