#include "core/io/open_volume.hpp"

#include <algorithm>
#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/input_file.hpp"
#include "core/io/meta_image_header.hpp"
#include "core/io/nifti_header.hpp"
#include "core/io/nrrd_header.hpp"
#include "core/io/raw_reader.hpp"

namespace isowave::core {
namespace fs = std::filesystem;

namespace {

bool has_ending(const fs::path &path, std::initializer_list<std::string_view> endings) {
  const std::string name = lower_case(path.filename().string());
  return std::any_of(endings.begin(), endings.end(),
                     [&](std::string_view ending) { return name.ends_with(ending); });
}

/// Whether the Python package reads such files, by other libraries.
bool is_of_python(const fs::path &path) {
  return has_ending(
      path, {".tif", ".tiff", ".dcm", ".dicom", ".ima", ".h5", ".hdf5", ".nc", ".nc4", ".npy",
             ".npz", ".mrc", ".map", ".rec", ".mrc.gz", ".map.gz", ".vti", ".vtk"});
}

/// Throws  Error: a folder, or a kind of file that is not read here
[[noreturn]] void refuse_kind(const fs::path &path) {
  const bool is_folder = fs::is_directory(path);
  if (is_folder || is_of_python(path))
    throw Error(
        "{}: isowave's Python package reads {}: pip install 'isowave[files]', which brings this "
        "command, too",
        path.string(), is_folder ? "folders of TIFF and DICOM files, and zarr" : "such files");
  throw Error(
      "{}: unknown kind of volume: use .raw, .raw.gz, .nrrd, .nhdr, .mha, .mhd, .nii or .nii.gz",
      path.string());
}

std::shared_ptr<const InputFile> open_volume_file(const fs::path &path) {
  if (fs::is_directory(path)) refuse_kind(path);
  return std::make_shared<const InputFile>(path);
}

/// Nothing for kinds of files that have none.
std::optional<VolumeHeader> read_header(const std::shared_ptr<const InputFile> &file) {
  const fs::path &path = file->path();
  if (has_ending(path, {".nrrd", ".nhdr"})) return read_nrrd_header(file);
  if (has_ending(path, {".mha", ".mhd"})) return read_meta_image_header(file);
  if (has_ending(path, {".nii", ".nii.gz"}))
    return read_nifti_header(file, has_ending(path, {".gz"}));
  return std::nullopt;
}

}  // namespace

void visit_voxel_files(const fs::path &path, const std::function<void(const fs::path &)> &visit) {
  const std::optional<VolumeHeader> header = read_header(open_volume_file(path));
  if (!header) return visit(path);
  visit(header->voxels.file->path());
  const VoxelFiles *files = header->voxels.files.get();
  for (std::uint64_t i = 0; files != nullptr && i < files->size(); ++i)
    visit(files->open(i)->path());
}

std::optional<std::uint32_t> num_steps(const fs::path &path) {
  const std::optional<VolumeHeader> header = read_header(open_volume_file(path));
  if (!header || header->voxels.num_steps == 1) return std::nullopt;
  return header->voxels.num_steps;
}

void check_has_step(const fs::path &path, std::optional<std::uint32_t> step) {
  if (step.value_or(0) > 0)
    throw Error("{}: index t={}: it is one volume: leave the index out", path.string(), *step);
}

std::unique_ptr<VolumeReader> open_volume(const fs::path &path, const RawOverrides &overrides,
                                          std::optional<std::uint32_t> step) {
  const std::shared_ptr<const InputFile> file = open_volume_file(path);
  if (!step) step = overrides.step;
  if (has_ending(path, {".raw", ".raw.gz"})) {
    check_has_step(path, step);
    return open_raw(file, has_ending(path, {".gz"}), overrides);
  }
  std::optional<VolumeHeader> header = read_header(file);
  if (!header) refuse_kind(path);
  if (overrides.dims || overrides.type) {
    throw Error("{}: dims and type are for raw files; this file's header gives its own",
                path.string());
  }
  if (overrides.spacing) header->info.spacing = *overrides.spacing;
  check_volume_info(header->info, path.string());
  VoxelLayout &voxels = header->voxels;
  if (!step && voxels.num_steps > 1)
    throw Error(
        "{}: an image of 4 axes, need a volume of 3: it is a series of {} steps; choose one by "
        "index, as t=0",
        path.string(), voxels.num_steps);
  voxels.step = step.value_or(0);
  if (voxels.num_steps == 1) check_has_step(path, step);
  if (voxels.step >= voxels.num_steps)
    throw Error("{}: step {} of a file that has {}: count from 0", path.string(), voxels.step,
                voxels.num_steps);
  return open_voxels(*header);
}

}  // namespace isowave::core
