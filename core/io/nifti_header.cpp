#include "core/io/nifti_header.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/byte_source.hpp"

namespace isowave::core {

namespace {

constexpr std::size_t kNiftiHeaderBytes = 348;

/// The bytes of the header, and their numbers by where they stand.
class NiftiHeader {
 public:
  NiftiHeader(const std::shared_ptr<const InputFile> &file, bool is_gzipped) : what_(file->what()) {
    std::unique_ptr<ByteSource> source;
    if (is_gzipped) {
      source = std::make_unique<InflateSource>(FileSource(file, 0), Packing::kGzip);
    } else {
      source = std::make_unique<FileSource>(file, 0);
    }
    if (source->read(bytes_) != kNiftiHeaderBytes) fail("shorter than a NIfTI header");
    constexpr std::int32_t kNifti1 = kNiftiHeaderBytes,
                           kNifti2 = 540;  // each begins with its header's size
    const auto has_size = [&] {
      return get<std::int32_t>(0) == kNifti1 || get<std::int32_t>(0) == kNifti2;
    };
    is_swapped_ = !has_size();
    if (!has_size()) fail("not a NIfTI-1 file");
    if (get<std::int32_t>(0) == kNifti2)
      fail("NIfTI-2: isowave's Python package reads it: pip install 'isowave[files]'");
  }

  bool is_big_endian() const { return is_swapped_; }
  bool has_at(std::size_t at, std::string_view text) const {
    return std::memcmp(bytes_.data() + at, text.data(), text.size()) == 0;
  }

  template <class T>
  T get(std::size_t at) const {
    std::array<std::byte, sizeof(T)> bytes;
    std::memcpy(bytes.data(), bytes_.data() + at, sizeof(T));
    if (is_swapped_) std::reverse(bytes.begin(), bytes.end());
    T value;
    std::memcpy(&value, bytes.data(), sizeof(T));
    return value;
  }
  double get_finite(std::size_t at, std::string_view name) const {
    const float value = get<float>(at);
    if (!std::isfinite(value)) fail("broken header: {} is {}", name, value);
    return value;
  }

  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> reason, Args &&...args) const {
    throw Error("{}: {}", what_, fmt::format(reason, std::forward<Args>(args)...));
  }

 private:
  std::string what_;
  std::array<std::byte, kNiftiHeaderBytes> bytes_{};
  bool is_swapped_ = false;
};

VoxelType nifti_voxel_type(const NiftiHeader &header) {
  struct Code {
    std::int16_t code;
    VoxelType type;
  };
  constexpr std::array<Code, 10> kCodes{{{2, VoxelType::kUint8},
                                         {4, VoxelType::kInt16},
                                         {8, VoxelType::kInt32},
                                         {16, VoxelType::kFloat32},
                                         {64, VoxelType::kFloat64},
                                         {256, VoxelType::kInt8},
                                         {512, VoxelType::kUint16},
                                         {768, VoxelType::kUint32},
                                         {1024, VoxelType::kInt64},
                                         {1280, VoxelType::kUint64}}};
  const auto code = header.get<std::int16_t>(70);
  const auto bits = header.get<std::int16_t>(72);
  for (const Code &candidate : kCodes) {
    if (candidate.code != code) continue;
    if (bits != 8 * std::int16_t(size_of(candidate.type))) {
      header.fail("broken header: bitpix {} does not fit datatype {}", bits, code);
    }
    return candidate.type;
  }
  header.fail("NIfTI datatype {} is not supported: need one integer, float32 or float64 per voxel",
              code);
}

/// A fourth axis is time.
void read_nifti_dims(const NiftiHeader &header, VolumeHeader &result) {
  constexpr std::size_t kDimsAt = 40;
  const int num_axes = header.get<std::int16_t>(kDimsAt);
  if (num_axes < 1 || num_axes > 7) header.fail("broken header: {} axes", num_axes);
  bool is_volume = num_axes >= 3;
  for (int axis = 1; axis <= num_axes; ++axis) {
    const int count = header.get<std::int16_t>(kDimsAt + 2 * std::size_t(axis));
    if (count <= 0) header.fail("broken header: {} voxels along axis {}", count, axis);
    if (axis <= 3) {
      result.info.dims[axis - 1] = std::uint32_t(count);
    } else if (axis == 4) {
      result.voxels.num_steps = std::uint32_t(count);
    } else if (count != 1) {
      is_volume = false;
    }
  }
  if (!is_volume)
    header.fail("an image of {} {}, need a volume of 3", num_axes,
                plural(num_axes, "axis", "axes"));
  constexpr std::int16_t kMatrixIntent = 1004;
  if (header.get<std::int16_t>(68) == kMatrixIntent)
    header.fail("matrices as voxels are not supported");
}

/// The magnitudes of pixdim, as nibabel has it; 0 is unknown.
glm::dvec3 read_nifti_spacing(const NiftiHeader &header, const std::string &what,
                              std::vector<std::string> &notices) {
  glm::dvec3 spacing;
  for (int axis = 0; axis < 3; ++axis) {
    const double value = header.get_finite(80 + 4 * std::size_t(axis), "pixdim");
    if (value < 0) {
      notices.push_back(fmt::format("{}: pixdim[{}] is {}: its magnitude is taken as the spacing",
                                    what, axis + 1, value));
    }
    spacing[axis] = value == 0 ? 1.0 : std::abs(value);
  }
  return spacing;
}

/// From index space to RAS, in the file's units.
struct Placement {
  glm::dmat3 direction;  ///< column a: unit direction of index axis a
  glm::dvec3 spacing;
  glm::dvec3 origin;

  glm::dvec3 operator()(const glm::dvec3 &index) const {
    return origin + direction * (spacing * index);
  }
};

Placement read_qform(const NiftiHeader &header, const glm::dvec3 &spacing) {
  const double b = header.get_finite(256, "quatern_b"), c = header.get_finite(260, "quatern_c"),
               d = header.get_finite(264, "quatern_d");
  const double flip = header.get_finite(76, "pixdim[0]") < 0 ? -1.0 : 1.0;
  constexpr double kRounding = 1e-5;
  const double squares = b * b + c * c + d * d;
  if (squares > 1.0 + kRounding)
    header.fail("broken header: the qform's quaternion is longer than 1");
  const double a = std::sqrt(std::max(0.0, 1.0 - squares));
  const double length = std::sqrt(a * a + squares);
  const double w = a / length, x = b / length, y = c / length, z = d / length;
  Placement placement;
  placement.spacing = spacing;
  placement.direction[0] = {w * w + x * x - y * y - z * z, 2 * (x * y + w * z),
                            2 * (x * z - w * y)};
  placement.direction[1] = {2 * (x * y - w * z), w * w + y * y - x * x - z * z,
                            2 * (y * z + w * x)};
  placement.direction[2] =
      flip * glm::dvec3(2 * (x * z + w * y), 2 * (y * z - w * x), w * w + z * z - x * x - y * y);
  for (int row = 0; row < 3; ++row)
    placement.origin[row] = header.get_finite(268 + 4 * std::size_t(row), "qoffset");
  return placement;
}

/// Nothing if it is singular.
///
/// spacing  by pixdim: taken if the sform's is the same but for rounding
std::optional<Placement> read_sform(const NiftiHeader &header, const glm::dvec3 &spacing) {
  Placement placement;
  for (int row = 0; row < 3; ++row) {
    const std::size_t at = 280 + 16 * std::size_t(row);
    for (int axis = 0; axis < 3; ++axis) {
      placement.direction[axis][row] = header.get_finite(at + 4 * std::size_t(axis), "the sform");
    }
    placement.origin[row] = header.get_finite(at + 12, "the sform");
  }
  constexpr double kRounding = 1e-4;  // writers round to float32 and from other forms
  for (int axis = 0; axis < 3; ++axis) {
    const double length = glm::length(placement.direction[axis]);
    if (!(length > 0)) return std::nullopt;
    placement.direction[axis] /= length;
    const bool is_same = std::abs(length - spacing[axis]) <= kRounding * spacing[axis];
    placement.spacing[axis] = is_same ? spacing[axis] : length;
  }
  if (!(std::abs(glm::determinant(placement.direction)) > kLeastDeterminant)) return std::nullopt;
  return placement;
}

/// The largest distance between where two placements have a corner of the volume [voxels].
double distance_in_voxels(const Placement &a, const Placement &b, const glm::uvec3 &dims) {
  double largest = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 ends(corner & 1, corner >> 1 & 1, corner >> 2);
    const glm::dvec3 index = ends * glm::dvec3(dims - 1u);
    largest = std::max(largest, glm::distance(a(index), b(index)));
  }
  return largest / std::min({a.spacing.x, a.spacing.y, a.spacing.z});
}

/// The sform if there is one, else the qform, as nibabel does.
///
/// spacing  by pixdim
std::optional<Placement> read_placement(const NiftiHeader &header, const std::string &what,
                                        const glm::dvec3 &spacing, VolumeHeader &result) {
  constexpr int kLastCode = 5;
  const int qform = header.get<std::int16_t>(252), sform = header.get<std::int16_t>(254);
  for (const int code : {qform, sform}) {
    if (code < 0 || code > kLastCode)
      header.fail("broken header: code {} of a qform or sform", code);
  }
  const auto tell = [&](const std::string &text) {
    result.notices.push_back(fmt::format("{}: {}", what, text));
  };
  std::optional<Placement> by_qform, by_sform;
  if (qform > 0) by_qform = read_qform(header, spacing);
  if (sform == 0) return by_qform;
  by_sform = read_sform(header, spacing);
  if (!by_sform) {
    if (!by_qform) header.fail("its sform is singular, and there is no qform");
    tell("its sform is singular: its qform says where the volume lies");
    return by_qform;
  }
  if (by_sform->spacing != spacing) {
    const auto text = [](const glm::dvec3 &v) {
      return fmt::format("{:.6g} {:.6g} {:.6g}", v.x, v.y, v.z);
    };
    tell(fmt::format("spacing {} of its sform is taken; its pixdim says {}",
                     text(by_sform->spacing), text(spacing)));
  }
  constexpr double kSame = 0.1;  // voxels
  if (by_qform && distance_in_voxels(*by_sform, *by_qform, result.info.dims) > kSame)
    tell("its sform says where the volume lies; its qform says otherwise");
  return by_sform;
}

/// Millimetres in the unit of lengths.
double length_unit(const NiftiHeader &header) {
  constexpr int kSpaceBits = 7;
  switch (header.get<std::uint8_t>(123) & kSpaceBits) {
    case 0:  // unknown
    case 2:
      return 1.0;
    case 1:
      return 1e3;
    case 3:
      return 1e-3;
    default:
      header.fail("broken header: unknown unit of lengths in xyzt_units");
  }
}

void set_nifti_geometry(const NiftiHeader &header, const std::string &what, VolumeHeader &result) {
  VolumeInfo &info = result.info;
  const glm::dvec3 spacing = read_nifti_spacing(header, what, result.notices);
  const double millimetres = length_unit(header);
  if (millimetres != 1) {
    result.notices.push_back(fmt::format("{}: lengths are converted to millimetres; xyzt_units: {}",
                                         what, millimetres > 1 ? "metres" : "micrometres"));
  }
  info.spacing = spacing * millimetres;
  const std::optional<Placement> placement = read_placement(header, what, spacing, result);
  if (!placement) return;
  info.is_anatomical = true;
  info.spacing = placement->spacing * millimetres;
  const glm::dvec3 to_lps(-1, -1, 1);
  for (int axis = 0; axis < 3; ++axis)
    info.direction[axis] = placement->direction[axis] * to_lps + 0.0;
  info.origin = placement->origin * to_lps * millimetres + 0.0;
}

void set_nifti_scale(const NiftiHeader &header, VoxelLayout &voxels) {
  const float slope = header.get<float>(112), intercept = header.get<float>(116);
  if (std::isinf(slope)) header.fail("broken header: scl_slope is infinite");
  if (slope == 0 || std::isnan(slope)) {
    if (intercept == 0 || std::isnan(intercept)) return;  // voxels are not scaled
    header.fail(
        "scl_inter {} without a scl_slope, which readers understand differently: set scl_slope to "
        "1",
        intercept);
  }
  voxels.slope = slope;
  voxels.intercept = header.get_finite(116, "scl_inter");
}

}  // namespace

VolumeHeader read_nifti_header(const std::shared_ptr<const InputFile> &file, bool is_gzipped) {
  const NiftiHeader bytes(file, is_gzipped);
  constexpr std::size_t kMagicAt = 344;
  if (bytes.has_at(kMagicAt, std::string_view("ni1\0", 4)))
    bytes.fail("its voxels lie in an .img file: convert it to one file");
  if (!bytes.has_at(kMagicAt, std::string_view("n+1\0", 4))) bytes.fail("not a NIfTI-1 file");

  VolumeHeader header;
  read_nifti_dims(bytes, header);
  VoxelLayout &voxels = header.voxels;
  voxels.file = file;
  voxels.encoding = is_gzipped ? VoxelEncoding::kGzip : VoxelEncoding::kRaw;
  voxels.type = nifti_voxel_type(bytes);
  voxels.big_endian = bytes.is_big_endian();
  set_nifti_scale(bytes, voxels);
  // Scaled values may be any that float64 has.
  header.info.type = voxels.is_scaled() ? VoxelType::kFloat64 : voxels.type;
  set_nifti_geometry(bytes, file->what(), header);

  const double offset = bytes.get_finite(108, "vox_offset");
  constexpr double kLeastOffset = 352, kMostOffset = 1e9;
  if (offset < kLeastOffset || offset > kMostOffset || offset != std::floor(offset)) {
    bytes.fail("broken header: voxels at byte {}", offset);
  }
  voxels.bytes_to_skip = std::uint64_t(offset);
  return header;
}

}  // namespace isowave::core
