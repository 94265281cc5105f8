// Headers and voxels against ITK, which shares nothing with our readers: the same type, grid and
// values, bit for bit but for what a test says.

#include <gtest/gtest.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include <limits>
#include <random>

#include "core/io/open_volume.hpp"
#include "core/io/raw_reader.hpp"
#include "tests/volume_file.hpp"

namespace isowave::core {
namespace {

namespace fs = std::filesystem;
using test::gzip;
using test::NiftiFields;
using test::ramp;
using test::TemporaryFolder;
using test::write_file;

struct Volume {
  VolumeInfo info;
  std::vector<float> voxels;
};

VoxelType itk_type(const itk::ImageIOBase &io) {
  const std::size_t size = io.GetComponentSize();
  switch (io.GetComponentType()) {
    case itk::IOComponentEnum::FLOAT:
      return VoxelType::kFloat32;
    case itk::IOComponentEnum::DOUBLE:
      return VoxelType::kFloat64;
    case itk::IOComponentEnum::UCHAR:
    case itk::IOComponentEnum::USHORT:
    case itk::IOComponentEnum::UINT:
      return size == 1 ? VoxelType::kUint8 : size == 2 ? VoxelType::kUint16 : VoxelType::kUint32;
    default:
      return size == 1 ? VoxelType::kInt8 : size == 2 ? VoxelType::kInt16 : VoxelType::kInt32;
  }
}

Volume read_with_itk(const fs::path &path) {
  itk::Object::SetGlobalWarningDisplay(false);
  itk::ImageIOBase::Pointer io = itk::NiftiImageIO::New().GetPointer();
  if (path.extension() == ".nrrd") io = itk::NrrdImageIO::New().GetPointer();
  if (path.extension() == ".mha") io = itk::MetaImageIO::New().GetPointer();
  io->SetFileName(path.string());
  io->ReadImageInformation();
  Volume volume;
  VolumeInfo &info = volume.info;
  info.type = itk_type(*io);
  itk::ImageIORegion region(io->GetNumberOfDimensions());
  for (unsigned axis = 0; axis < region.GetImageDimension(); ++axis) {
    region.SetIndex(axis, 0);
    region.SetSize(axis, io->GetDimensions(axis));
    if (axis >= 3) continue;
    info.dims[int(axis)] = unsigned(io->GetDimensions(axis));
    info.origin[int(axis)] = io->GetOrigin(axis);
    info.spacing[int(axis)] = std::abs(io->GetSpacing(axis));
    for (unsigned row = 0; row < 3; ++row) {
      const double cosine = io->GetDirection(axis).at(row);
      info.direction[int(axis)][int(row)] = io->GetSpacing(axis) < 0 ? -cosine : cosine;
    }
  }
  io->SetIORegion(region);
  std::vector<std::byte> bytes(io->GetImageSizeInBytes());
  io->Read(bytes.data());
  volume.voxels.resize(info.num_voxels());
  convert_to_float(info.type, bytes, volume.voxels);
  return volume;
}

/// tolerance: by which directions may differ; 0 is exact. type: where it is not to be ITK's.
void expect_agreement(const fs::path &path, double tolerance, std::optional<VoxelType> type) {
  SCOPED_TRACE(path.string());
  const auto reader = open_volume(path);
  const VolumeInfo &info = reader->info();
  const Volume itk = read_with_itk(path);
  EXPECT_EQ(info.type, type.value_or(itk.info.type));
  ASSERT_EQ(info.dims, itk.info.dims);
  EXPECT_EQ(info.spacing, itk.info.spacing);
  EXPECT_EQ(info.origin, itk.info.origin);
  for (int axis = 0; axis < 3; ++axis) {
    for (int row = 0; row < 3; ++row) {
      EXPECT_NEAR(info.direction[axis][row], itk.info.direction[axis][row], tolerance)
          << axis << " " << row;
    }
  }
  const std::vector<float> voxels = test::read_all(*reader);
  EXPECT_EQ(std::memcmp(voxels.data(), itk.voxels.data(), voxels.size() * sizeof(float)), 0);
}

class ItkAgreement : public testing::Test {
 protected:
  void check(const std::string &name, const std::string &bytes, double tolerance = 0,
             std::optional<VoxelType> type = {}) {
    write_file(folder_ / name, bytes);
    expect_agreement(folder_ / name, tolerance, type);
  }
  TemporaryFolder folder_;
};
using NrrdAgreement = ItkAgreement;
using MetaImageAgreement = ItkAgreement;
using NiftiAgreement = ItkAgreement;

TEST_F(NrrdAgreement, Geometry) {
  const std::string sizes = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 4 5\n";
  const std::string directions =
      "space directions: (1,0.25,0.5) (-0.5,2,0) (0,1e-3,3)\nspace origin: (1,-2.5,3e2)\n";
  for (const std::string &fields :
       {std::string(), std::string("spacings: 1 2 -3\n"), std::string("spacings: nan 2 3\n"),
        std::string("axis mins: 1 2 3\nspacings: 1 2 -3\ncenters: node cell ???\n"),
        "space: RAS\n" + directions, "space: left-posterior-superior\n" + directions,
        "space: scanner-xyz\n" + directions, "Space Dimension: 3\n" + directions,
        std::string("space: RAS\nspace origin: (1,2,3)\n")}) {
    SCOPED_TRACE(fields);
    check("a.nrrd", sizes + fields + "encoding: raw\n\n" + ramp());
  }
  const std::string four = "NRRD0004\ntype: uint8\ndimension: 4\n";
  check("a.nrrd", four + "sizes: 3 4 5 1\nencoding: raw\n\n" + ramp());
  check("a.nrrd", four + "sizes: 1 3 4 5\nkinds: scalar domain domain domain\nspace: LPS\n" +
                      "space directions: none (1,0,0) (0,2,0) (0,0,3)\nencoding: raw\n\n" + ramp());
}

TEST_F(NrrdAgreement, TypesOrdersAndEncodings) {
  const auto header = [](const std::string &type, const std::string &order,
                         const std::string &encoding) {
    return "NRRD0001\r\ntype: " + type + "\r\ndimension: 3\r\nsizes: 3 4 5\r\nendian: " + order +
           "\r\nencoding: " + encoding + "\r\n\r\n";
  };
  for (const bool big : {false, true}) {
    const std::string order = big ? "big" : "little";
    for (const auto &[type, bytes] :
         std::vector<std::pair<std::string, std::string>>{{"signed char", ramp<std::int8_t>(big)},
                                                          {"ushort", ramp<std::uint16_t>(big)},
                                                          {"short int", ramp<std::int16_t>(big)},
                                                          {"UINT32", ramp<std::uint32_t>(big)},
                                                          {"int", ramp<std::int32_t>(big)},
                                                          {"float", ramp<float>(big)},
                                                          {"double", ramp<double>(big)}}) {
      SCOPED_TRACE(type);
      check("a.nrrd", header(type, order, "raw") + bytes);
      check("a.nrrd", header(type, order, "gzip") + gzip(bytes));
      std::string hex;
      for (const char c : bytes)
        hex += fmt::format("{:02x}{}", static_cast<unsigned char>(c), c == 7 ? "\n" : "");
      check("a.nrrd", header(type, order, "hex") + hex);
    }
  }
  std::string numbers;
  for (int i = 0; i < 60; ++i)
    numbers += fmt::format("{}{}", i * 1.25 - 30, i % 7 == 0 ? "\n" : " ");
  check("a.nrrd", header("float", "little", "ascii") + numbers);
  const std::string sizes = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 4 5\n";
  check("a.nrrd", sizes + "line skip: 2\nbyte skip: 3\nencoding: raw\n\na\nb\nxyz" + ramp());
  check("a.nrrd", sizes + "byte skip: -1\nencoding: raw\n\nxyz" + ramp());
  check("a.nrrd",
        sizes + "line skip: 1\nbyte skip: 3\nencoding: gzip\n\na\n" + gzip("xyz" + ramp()));
}

TEST_F(MetaImageAgreement, Geometry) {
  const std::string head =
      "ObjectType = Image\nNDims = 3\nDimSize = 3 4 5\nElementType = MET_UCHAR\n";
  for (const char *fields :
       {"", "TransformMatrix = 0 1 0 1 0 0 0.1 0 -1\nElementSpacing = 1 -2 3\nOffset = 1 2.5 -3\n",
        "Orientation = 0 1 0 1 0 0 0 0 -1\nPosition = 1 2 3\nElementSize = 2 3 4\n",
        "Rotation = 0 0 1 0 1 0 1 0 0\nOrigin = 1 2 3\n",
        "ElementSize = 2 3 4\nElementSpacing = 3 4 5\n",
        "CenterOfRotation = 1 2 3\nAnatomicalOrientation = RAI\nDistanceUnits = mm\n",
        "0008|0060 = MR\nComment = a = b\nElementMin = 1\nColor = 1 0 0 1\n\n",
        "ImagePosition = 1 2 3\n"}) {
    SCOPED_TRACE(fields);
    check("a.mha", head + fields + "ElementDataFile = LOCAL\n" + ramp());
  }
  check("a.mha",
        "NDims = 4\r\nDimSize = 3 4 5 1\r\nTransformMatrix = 0 1 0 0 1 0 0 0 0 0 -1 0 0 0 0 1\r\n"
        "ElementType = MET_UCHAR_ARRAY\r\nElementDataFile = Local\r\n" +
            ramp());
}

TEST_F(MetaImageAgreement, TypesOrdersAndEncodings) {
  const auto header = [](const std::string &type, const std::string &fields) {
    return "NDims = 3\nDimSize = 3 4 5\nElementType = MET_" + type + "\n" + fields +
           "ElementDataFile = LOCAL\n";
  };
  for (const bool big : {false, true}) {
    const std::string order = fmt::format("{}ByteOrderMSB = {}\n", big ? "Element" : "BinaryData",
                                          big ? "True" : "False");
    for (const auto &[type, bytes] :
         std::vector<std::pair<std::string, std::string>>{{"CHAR", ramp<std::int8_t>(big)},
                                                          {"USHORT", ramp<std::uint16_t>(big)},
                                                          {"SHORT", ramp<std::int16_t>(big)},
                                                          {"UINT", ramp<std::uint32_t>(big)},
                                                          {"INT", ramp<std::int32_t>(big)},
                                                          {"LONG", ramp<std::int32_t>(big)},
                                                          {"ULONG", ramp<std::uint32_t>(big)},
                                                          {"FLOAT", ramp<float>(big)},
                                                          {"DOUBLE", ramp<double>(big)}}) {
      SCOPED_TRACE(type);
      check("a.mha", header(type, order) + bytes);
      const std::string packed = test::zlib(bytes);
      check("a.mha",
            header(type, order + fmt::format("CompressedData = True\nCompressedDataSize = {}\n",
                                             packed.size())) +
                packed);
    }
  }
  std::string numbers;
  for (int i = 0; i < 60; ++i)
    numbers += fmt::format("{}{}", i * 1e3 - 500, i % 7 == 0 ? "\n" : " ");
  check("a.mha", header("INT", "BinaryData = False\n") + numbers);
  check("a.mha", header("UCHAR", "HeaderSize = -1\n") + "xyz" + ramp());
  const std::string far = header("UCHAR", "HeaderSize = 300\n");
  check("a.mha", far + std::string(300 - far.size(), '#') + ramp());
}

/// ITK computes the qform's matrix in float32: at most a few roundings of numbers up to 1.
constexpr double kFloatMatrix = 4 * std::numeric_limits<float>::epsilon();

TEST_F(NiftiAgreement, Geometry) {
  check("a.nii", NiftiFields().bytes() + ramp());
  check("a.nii.gz", gzip(NiftiFields().bytes() + ramp()));
  check("a.nii", NiftiFields{.sform_code = 0}.bytes() + ramp());
  check("a.nii", NiftiFields{.sform_code = 0, .pixdim = {1, 0, 2, 3}}.bytes() + ramp());
  check("a.nii", NiftiFields{.dim = {5, 3, 4, 5, 1, 1, 1, 1}, .vox_offset = 400}.bytes() + ramp());
  check("a.nii",
        NiftiFields{.qform_code = 2, .sform_code = 1, .quatern = {0.1f, 0.2f, 0.3f}}.bytes() +
            ramp());
  check("a.nii",
        NiftiFields{.qform_code = 1, .sform_code = 0, .quatern = {1, 0, 0}}.bytes() + ramp(),
        kFloatMatrix);
  NiftiFields metres{.xyzt_units = 1};
  for (auto &row : metres.sform) row[3] = 0;
  check("a.nii", metres.bytes() + ramp());
  std::mt19937 random(11);
  for (int i = 0; i < 40; ++i) {
    NiftiFields fields{
        .qform_code = 1, .sform_code = 0, .pixdim = {i % 2 == 0 ? -1.0f : 1.0f, 0.5f, 2, 3}};
    std::uniform_real_distribution<float> component(-0.57f,
                                                    0.57f);  // three of them are no longer than 1
    for (float &value : fields.quatern) value = component(random);
    check("a.nii", fields.bytes() + ramp(), kFloatMatrix);
  }
}

TEST_F(NiftiAgreement, TypesOrdersAndScales) {
  for (const bool big : {false, true}) {
    for (const auto &[datatype, bits, bytes] :
         std::vector<std::tuple<std::int16_t, std::int16_t, std::string>>{
             {2, 8, ramp()},
             {256, 8, ramp<std::int8_t>(big)},
             {4, 16, ramp<std::int16_t>(big)},
             {512, 16, ramp<std::uint16_t>(big)},
             {8, 32, ramp<std::int32_t>(big)},
             {768, 32, ramp<std::uint32_t>(big)},
             {16, 32, ramp<float>(big)},
             {64, 64, ramp<double>(big)}}) {
      for (const auto &[slope, inter] : {std::pair(0.0f, 0.0f),
                                         {1.0f, 0.0f},
                                         {0.1f, -3.3f},
                                         {-7e5f, 0.7f},
                                         {1.0f, 1e-3f},
                                         {std::nanf(""), std::nanf("")}}) {
        SCOPED_TRACE(fmt::format("datatype {} slope {} inter {}", datatype, slope, inter));
        NiftiFields fields{.datatype = datatype,
                           .bitpix = bits,
                           .scl_slope = slope,
                           .scl_inter = inter,
                           .big_endian = big};
        // ITK has scaled voxels in float32, which would lose what the bounds of errors must count.
        const bool is_scaled = slope == slope && slope != 0 && (slope != 1 || inter != 0);
        check("a.nii", fields.bytes() + bytes, 0,
              is_scaled ? std::optional(VoxelType::kFloat64) : std::nullopt);
      }
    }
  }
}

}  // namespace
}  // namespace isowave::core
