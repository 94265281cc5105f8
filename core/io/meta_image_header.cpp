#include "core/io/meta_image_header.hpp"

#include <algorithm>
#include <array>
#include <initializer_list>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/text_header.hpp"

namespace isowave::core {

namespace {

constexpr std::string_view kLastMetaKey = "ElementDataFile";  // the voxels may follow it
constexpr std::array<std::string_view, 40> kMetaKeys{"ObjectType",
                                                     "ObjectSubType",
                                                     "Comment",
                                                     "TransformType",
                                                     "NDims",
                                                     "Name",
                                                     "ID",
                                                     "ParentID",
                                                     "AcquisitionDate",
                                                     "CompressedData",
                                                     "CompressedDataSize",
                                                     "CompressionLevel",
                                                     "BinaryData",
                                                     "BinaryDataByteOrderMSB",
                                                     "ElementByteOrderMSB",
                                                     "Color",
                                                     "Position",
                                                     "Offset",
                                                     "Origin",
                                                     "ImagePosition",
                                                     "Orientation",
                                                     "Rotation",
                                                     "TransformMatrix",
                                                     "CenterOfRotation",
                                                     "DistanceUnits",
                                                     "AnatomicalOrientation",
                                                     "ElementSpacing",
                                                     "DimSize",
                                                     "HeaderSize",
                                                     "Modality",
                                                     "SequenceID",
                                                     "ElementMin",
                                                     "ElementMax",
                                                     "ElementNBits",
                                                     "ElementNumberOfChannels",
                                                     "ElementSize",
                                                     "ElementToIntensityFunctionSlope",
                                                     "ElementToIntensityFunctionOffset",
                                                     "ElementType",
                                                     kLastMetaKey};

bool is_meta_key(std::string_view key, const std::string &what) {
  for (const std::string_view known : kMetaKeys) {
    if (key == known) return true;
    if (key.size() == known.size() && lower_case(key) == lower_case(known)) {
      throw Error("{}: broken header: {} must be written '{}'", what, quote(key), known);
    }
  }
  return false;
}

/// Returns the names of data files, if there are several.
std::optional<VoxelFileNames> read_meta_fields(HeaderLines &lines, const std::string &what,
                                               HeaderFields &fields) {
  constexpr std::size_t kLongestKey = 255;
  while (lines.next()) {
    const std::string_view line = lines.line();
    if (trim(line).empty()) continue;
    const std::size_t at = line.find('=');
    const std::string_view key = trim(line.substr(0, at));
    if (at == line.npos || key.empty() || key.size() > kLongestKey) {
      throw Error("{}: broken header: line {}, {}, is not like 'Key = Value'", what, lines.number(),
                  quote(line));
    }
    if (!is_meta_key(key, what)) continue;
    if (lines.is_cut()) throw Error("{}: broken header: '{}' is too long", what, key);
    fields.add(key, trim(line.substr(at + 1)));
    if (key == kLastMetaKey) return read_voxel_file_names(fields, key, lines);
  }
  throw Error("{}: broken header: no '{}'", what, kLastMetaKey);
}

bool is_true(const HeaderFields &fields, std::string_view key, bool otherwise) {
  if (!fields.has(key)) return otherwise;
  const std::string value = lower_case(fields[key]);
  if (value != "true" && value != "false") fields.fail(key, "must be True or False");
  return value == "true";
}

/// The numbers of whichever of the keys are there. Where several are, they must say the same.
std::optional<std::vector<double>> numbers_of(const HeaderFields &fields,
                                              std::initializer_list<std::string_view> keys,
                                              std::size_t count) {
  std::optional<std::vector<double>> result;
  for (const std::string_view key : keys) {
    if (!fields.has(key)) continue;
    std::vector<double> values = fields.numbers(key, count);
    if (result && *result != values) fields.fail(key, "another field says otherwise");
    result = std::move(values);
  }
  return result;
}

VoxelType meta_voxel_type(const HeaderFields &fields) {
  struct Name {
    std::string_view name;
    VoxelType type;
  };
  constexpr std::array<Name, 12> kNames{
      {{"MET_CHAR", VoxelType::kInt8},
       {"MET_UCHAR", VoxelType::kUint8},
       {"MET_SHORT", VoxelType::kInt16},
       {"MET_USHORT", VoxelType::kUint16},
       {"MET_INT", VoxelType::kInt32},
       {"MET_UINT", VoxelType::kUint32},
       {"MET_LONG", VoxelType::kInt32},  // 4 bytes, on all systems
       {"MET_ULONG", VoxelType::kUint32},
       {"MET_LONG_LONG", VoxelType::kInt64},
       {"MET_ULONG_LONG", VoxelType::kUint64},
       {"MET_FLOAT", VoxelType::kFloat32},
       {"MET_DOUBLE", VoxelType::kFloat64}}};
  std::string_view name = fields["ElementType"];
  constexpr std::string_view kArray = "_ARRAY";  // of one: ElementNumberOfChannels
  if (name.ends_with(kArray)) name.remove_suffix(kArray.size());
  for (const Name &candidate : kNames) {
    if (candidate.name == name) return candidate.type;
  }
  fields.fail("ElementType", "not supported: need an integer, MET_FLOAT or MET_DOUBLE");
}

/// Returns the number of axes. All beyond the third must have size 1.
std::size_t read_meta_dims(const HeaderFields &fields, const std::string &what, VolumeInfo &info) {
  constexpr std::int64_t kMaxAxes = 10;
  if (fields.has("ObjectType") && fields["ObjectType"] != "Image")
    fields.fail("ObjectType", "not supported: need Image");
  const std::int64_t num_axes = fields.integer("NDims");
  if (num_axes < 1 || num_axes > kMaxAxes) fields.fail("NDims", "must be 1 to 10");
  const std::vector<std::int64_t> sizes = fields.integers("DimSize", std::size_t(num_axes));
  for (const std::int64_t size : sizes) {
    if (size < 1 || size > kMaxDim)
      fields.fail("DimSize", fmt::format("each must be 1 to {}", kMaxDim));
  }
  if (num_axes < 3 ||
      std::any_of(sizes.begin() + 3, sizes.end(), [](std::int64_t size) { return size != 1; })) {
    throw Error("{}: an image of {} {}, need a volume of 3", what, num_axes,
                plural(num_axes, "axis", "axes"));
  }
  for (int i = 0; i < 3; ++i) info.dims[i] = std::uint32_t(sizes[std::size_t(i)]);
  return std::size_t(num_axes);
}

/// The matrix has a row for each axis of the volume.
void set_meta_geometry(const HeaderFields &fields, std::size_t num_axes, const std::string &what,
                       VolumeHeader &header) {
  VolumeInfo &info = header.info;
  // ITK's world is LPS; its files name the axes, as "RAI", or "???" if a body has no such axes.
  const std::string axes =
      fields.has("AnatomicalOrientation") ? fields["AnatomicalOrientation"] : "";
  info.is_anatomical = axes.size() == 3 && axes.find_first_not_of("RLAPIS") == std::string::npos;
  double unit = 1;
  if (fields.has("DistanceUnits"))
    unit = millimetres_in(std::array{fields["DistanceUnits"]}, "DistanceUnits", what, header)[0];
  const auto offset =
      numbers_of(fields, {"Position", "Offset", "Origin", "ImagePosition"}, num_axes);
  const auto matrix =
      numbers_of(fields, {"Orientation", "Rotation", "TransformMatrix"}, num_axes * num_axes);
  auto spacing = numbers_of(fields, {"ElementSpacing"}, num_axes);
  const auto size = numbers_of(fields, {"ElementSize"}, num_axes);
  if (!spacing) spacing = size;
  for (std::size_t i = 0; i < 3; ++i) {
    glm::dvec3 direction(0.0);
    direction[int(i)] = 1.0;
    if (matrix)
      direction = {(*matrix)[i * num_axes], (*matrix)[i * num_axes + 1],
                   (*matrix)[i * num_axes + 2]};
    set_axis(info, int(i), spacing ? (*spacing)[i] * unit : 1.0, direction);
    if (offset) info.origin[int(i)] = (*offset)[i] * unit + 0.0;
  }
}

void check_other_meta_fields(const HeaderFields &fields, std::size_t num_axes) {
  for (const std::string_view key : {"CenterOfRotation", "SequenceID"}) {
    if (fields.has(key)) fields.numbers(key, num_axes);
  }
  for (const std::string_view key :
       {"ElementMin", "ElementMax", "CompressionLevel", "ID", "ParentID"}) {
    if (fields.has(key)) fields.numbers(key, 1, HeaderFields::Nan::kUnknown);
  }
  if (fields.has("Color")) fields.numbers("Color", 4);
  if (fields.has("ElementNumberOfChannels") && fields.integer("ElementNumberOfChannels") != 1) {
    fields.fail("ElementNumberOfChannels", fmt::format("{} components per voxel, need 1",
                                                       fields.integer("ElementNumberOfChannels")));
  }
  if (fields.has("ElementToIntensityFunctionSlope") &&
      fields.number("ElementToIntensityFunctionSlope") != 1.0) {
    fields.fail("ElementToIntensityFunctionSlope", "not supported: need 1");
  }
  if (fields.has("ElementToIntensityFunctionOffset") &&
      fields.number("ElementToIntensityFunctionOffset") != 0.0) {
    fields.fail("ElementToIntensityFunctionOffset", "not supported: need 0");
  }
}

void set_meta_encoding(const HeaderFields &fields, VoxelLayout &voxels) {
  const bool is_binary = is_true(fields, "BinaryData", true);
  const bool is_compressed = is_true(fields, "CompressedData", false);
  if (is_compressed && !is_binary) fields.fail("CompressedData", "not with BinaryData = False");
  voxels.encoding = is_compressed ? VoxelEncoding::kGzipOrZlib
                    : is_binary   ? VoxelEncoding::kRaw
                                  : VoxelEncoding::kText;
  const bool has_both = fields.has("BinaryDataByteOrderMSB") && fields.has("ElementByteOrderMSB");
  voxels.big_endian =
      is_true(fields, "BinaryDataByteOrderMSB", is_true(fields, "ElementByteOrderMSB", false));
  if (has_both && voxels.big_endian != is_true(fields, "ElementByteOrderMSB", false)) {
    fields.fail("ElementByteOrderMSB", "BinaryDataByteOrderMSB says otherwise");
  }
  if (fields.has("CompressedDataSize")) {
    const std::int64_t bytes = fields.integer("CompressedDataSize");
    if (bytes < 0) fields.fail("CompressedDataSize", "must not be negative");
    if (is_compressed && bytes > 0) voxels.packed_bytes = std::uint64_t(bytes);  // 0: not known
  }
}

/// The place at which voxels begin in their file: `offset`, unless the header says otherwise.
void set_meta_offset(const HeaderFields &fields, std::uint64_t offset, VoxelLayout &voxels) {
  voxels.offset = offset;
  const std::int64_t bytes = fields.has("HeaderSize") ? fields.integer("HeaderSize") : 0;
  voxels.from_end = bytes == -1;
  if (bytes < -1 || (voxels.from_end && voxels.encoding != VoxelEncoding::kRaw)) {
    fields.fail("HeaderSize", "must be 0 or more, or with raw voxels -1");
  }
  if (bytes <= 0) return;
  if (std::uint64_t(bytes) < offset) fields.fail("HeaderSize", "less than the header itself");
  voxels.offset = std::uint64_t(bytes);
}

}  // namespace

VolumeHeader read_meta_image_header(const std::shared_ptr<const InputFile> &file) {
  const std::string &what = file->what();
  HeaderLines lines(file);
  HeaderFields fields(what);
  std::optional<VoxelFileNames> files = read_meta_fields(lines, what, fields);

  VolumeHeader header;
  VoxelLayout &voxels = header.voxels;
  const std::size_t num_axes = read_meta_dims(fields, what, header.info);
  set_meta_geometry(fields, num_axes, what, header);
  check_other_meta_fields(fields, num_axes);
  header.info.type = voxels.type = meta_voxel_type(fields);
  set_meta_encoding(fields, voxels);
  const std::string &name = fields[kLastMetaKey];
  if (lower_case(name) == "local") {
    voxels.file = file;
    set_meta_offset(fields, lines.end(), voxels);
  } else if (files) {
    voxels.file = file;
    voxels.files = std::make_shared<const VoxelFiles>(
        file, std::move(*files), fields.integers("DimSize", num_axes), kLastMetaKey);
    set_meta_offset(fields, 0, voxels);
  } else {
    if (name.empty()) fields.fail(kLastMetaKey, "need a file's name or LOCAL");
    voxels.file = open_data_file(*file, name);
    set_meta_offset(fields, 0, voxels);
  }
  return header;
}

}  // namespace isowave::core
