#pragma once
// Headers of NIfTI-1 in one file (.nii, .nii.gz): https://nifti.nimh.nih.gov/nifti-1
//
// The grid lies where the sform puts it, if there is one, and otherwise where the qform does, as
// nibabel has it. (ITK takes the qform if both are there and the sform is not the scanner's.) An
// sform may have shear, and spacings that are not those of pixdim. Refused, besides what is broken:
// NIfTI-2, Analyze, headers whose voxels lie in an .img file, 64-bit integers, more than one value
// per voxel.

#include <memory>

#include "core/io/volume_header.hpp"

namespace isowave::core {

/// Reads and judges the header, not the voxels.
///
/// Throws  Error
VolumeHeader read_nifti_header(const std::shared_ptr<const InputFile> &file, bool is_gzipped);

}  // namespace isowave::core
