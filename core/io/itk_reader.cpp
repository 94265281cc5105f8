#include "core/io/itk_reader.hpp"

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <nifti1_io.h>

#include <algorithm>
#include <iostream>
#include <new>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "core/error.hpp"
#include "core/io/raw_reader.hpp"
#include "core/io/voxel_data_check.hpp"

namespace isowave {
namespace fs = std::filesystem;

namespace {

/// Keeps what ITK's parsers print off the terminal: a failure is told once, by our Error.
class MutedStreams {
 public:
  MutedStreams() : cout_(std::cout.rdbuf(text_.rdbuf())), cerr_(std::cerr.rdbuf(text_.rdbuf())) {
    itk::Object::SetGlobalWarningDisplay(false);
  }
  ~MutedStreams() {
    std::cout.rdbuf(cout_);
    std::cerr.rdbuf(cerr_);
  }
  MutedStreams(const MutedStreams &) = delete;
  MutedStreams &operator=(const MutedStreams &) = delete;

 private:
  std::ostringstream text_;
  std::streambuf *cout_, *cerr_;
};

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r' || c == '\t'; }, ' ');
  const auto both_spaces = [](char a, char b) { return a == ' ' && b == ' '; };
  text.erase(std::unique(text.begin(), text.end(), both_spaces), text.end());
  // "ITK ERROR: Class(address): ...": the address helps nobody; of nrrd's call stack the innermost line does.
  if (const std::size_t at = text.find("): "); at != std::string::npos) text.erase(0, at + 3);
  if (const std::size_t at = text.rfind("[nrrd] "); at != std::string::npos) text.erase(0, at + 7);
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

/// Runs `action` with ITK muted and its exceptions made one line about `path`.
template <class Action>
void with_itk(const fs::path &path, std::string_view what, const Action &action) {
  const MutedStreams muted;
  try {
    action();
  } catch (const itk::ExceptionObject &error) {
    throw Error("{}: {}: {}", path.string(), what, one_line(error.GetDescription()));
  } catch (const std::bad_alloc &) {
    throw Error("{}: {}: not enough memory", path.string(), what);
  }
}

itk::ImageIOBase::Pointer make_image_io(ItkFormat format) {
  switch (format) {
    case ItkFormat::kNrrd:
      return itk::NrrdImageIO::New().GetPointer();
    case ItkFormat::kMetaImage:
      return itk::MetaImageIO::New().GetPointer();
    case ItkFormat::kNifti:
      return itk::NiftiImageIO::New().GetPointer();
  }
  throw std::invalid_argument("make_image_io: unknown format");
}

VoxelType voxel_type(const itk::ImageIOBase &io, const fs::path &path) {
  using Component = itk::IOComponentEnum;
  const std::size_t size = io.GetComponentSize();
  const auto integer = [&](bool is_signed) {
    if (size == 1) return is_signed ? VoxelType::kInt8 : VoxelType::kUint8;
    if (size == 2) return is_signed ? VoxelType::kInt16 : VoxelType::kUint16;
    if (size == 4) return is_signed ? VoxelType::kInt32 : VoxelType::kUint32;
    throw Error("{}: {}-bit integer voxels are not supported", path.string(), size * 8);
  };
  switch (io.GetComponentType()) {
    case Component::UCHAR:
    case Component::USHORT:
    case Component::UINT:
    case Component::ULONG:
    case Component::ULONGLONG:
      return integer(false);
    case Component::CHAR:
    case Component::SHORT:
    case Component::INT:
    case Component::LONG:
    case Component::LONGLONG:
      return integer(true);
    case Component::FLOAT:
      return VoxelType::kFloat32;
    case Component::DOUBLE:
      return VoxelType::kFloat64;
    default:
      throw Error("{}: voxels of type '{}' are not supported", path.string(),
                  itk::ImageIOBase::GetComponentTypeAsString(io.GetComponentType()));
  }
}

VolumeInfo volume_info(const itk::ImageIOBase &io, const fs::path &path) {
  const unsigned num_axes = io.GetNumberOfDimensions();
  bool is_volume = num_axes >= 3;
  for (unsigned axis = 3; axis < num_axes; ++axis) is_volume = is_volume && io.GetDimensions(axis) == 1;
  if (!is_volume) throw Error("{}: an image of {} axes, need a volume of 3", path.string(), num_axes);
  if (io.GetNumberOfComponents() != 1) {
    throw Error("{}: {} components per voxel, need 1", path.string(), io.GetNumberOfComponents());
  }
  VolumeInfo info;
  info.type = voxel_type(io, path);
  for (unsigned axis = 0; axis < 3; ++axis) {
    // Clamped: a 64-bit size must not wrap into an acceptable one.
    info.dims[int(axis)] = std::uint32_t(std::min<std::uint64_t>(io.GetDimensions(axis), ~0u));
    info.origin[int(axis)] = io.GetOrigin(axis);
    const double spacing = io.GetSpacing(axis);
    const std::vector<double> direction = io.GetDirection(axis);
    for (unsigned row = 0; row < 3; ++row) {
      // + 0.0: no negative zeros in what people read.
      info.direction[int(axis)][int(row)] = (spacing < 0 ? -direction.at(row) : direction.at(row)) + 0.0;
    }
    info.spacing[int(axis)] = std::abs(spacing);
  }
  return info;
}

class ItkReader : public VolumeReader {
 public:
  ItkReader(const fs::path &path, ItkFormat format, const std::optional<glm::dvec3> &spacing)
      : path_(path), io_(make_image_io(format)) {
    check_before_itk(path_, format);
    with_itk(path_, "broken header", [&] {
      io_->SetFileName(path_.string());
      io_->ReadImageInformation();
      info_ = volume_info(*io_, path_);
    });
    if (spacing) info_.spacing = *spacing;
    check_volume_info(info_, path_.string());
    data_ = find_voxel_data(path_, format, info_);
    by_layer_ = format == ItkFormat::kMetaImage && data_.encoding == VoxelEncoding::kRaw;
  }

  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    read_as(z_begin, num_layers, out, &convert_to_float);
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<double> out) override {
    read_as(z_begin, num_layers, out, &convert_to_double);
  }

 private:
  template <class Value, class Convert>
  void read_as(std::uint32_t z_begin, std::uint32_t num_layers, std::span<Value> out,
               const Convert &convert) {
    const std::uint64_t layer_size = std::uint64_t(info_.dims.x) * info_.dims.y;
    if (z_begin < next_layer_ || num_layers > info_.dims.z || z_begin > info_.dims.z - num_layers ||
        out.size() != layer_size * num_layers) {
      throw std::invalid_argument(
          "ItkReader: layers not ascending, outside the volume, or out of a wrong size");
    }
    if (num_layers == 0) return;
    const std::uint64_t layer_bytes = layer_size * size_of(info_.type);
    if (by_layer_) {
      load(z_begin, num_layers);
      convert(info_.type, voxels_, out);
    } else {
      if (voxels_.empty()) {
        verify_deflated(data_);
        load(0, info_.dims.z);
      }
      convert(info_.type, std::span(voxels_).subspan(z_begin * layer_bytes, num_layers * layer_bytes), out);
    }
    next_layer_ = z_begin + num_layers;
    if (next_layer_ == info_.dims.z) std::vector<std::byte>().swap(voxels_);
  }

  void load(std::uint32_t z_begin, std::uint32_t num_layers) {
    with_itk(path_, "cannot read its voxels", [&] {
      voxels_.resize(std::size_t(info_.dims.x) * info_.dims.y * num_layers * size_of(info_.type));
      itk::ImageIORegion region(io_->GetNumberOfDimensions());
      for (unsigned axis = 0; axis < region.GetImageDimension(); ++axis) {
        region.SetIndex(axis, axis == 2 ? z_begin : 0);
        region.SetSize(axis, axis == 2 ? num_layers : io_->GetDimensions(axis));
      }
      io_->SetIORegion(region);
      io_->Read(voxels_.data());
    });
  }

  fs::path path_;
  itk::ImageIOBase::Pointer io_;
  VoxelData data_;
  std::vector<std::byte> voxels_;  ///< all of them, or the layers of one call
  std::uint32_t next_layer_ = 0;
  bool by_layer_ = false;
};

}  // namespace

std::unique_ptr<VolumeReader> open_with_itk(const fs::path &path, ItkFormat format,
                                            const std::optional<glm::dvec3> &spacing) {
  return std::make_unique<ItkReader>(path, format, spacing);
}

}  // namespace isowave
