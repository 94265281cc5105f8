#pragma once
// Small volume files for tests: 3 x 4 x 5 voxels with the values 1, 2, 3, ...

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/open_volume.hpp"
#include "core/volume/volume.hpp"
#include "tests/run_program.hpp"

namespace isowave::core::test {

/// The voxels as T, in the byte order that is asked for.
template <class T = std::uint8_t>
std::string ramp(bool big_endian = false, std::size_t count = 60) {
  std::string bytes;
  for (std::size_t i = 1; i <= count; ++i) {
    const T value = T(i);
    std::array<char, sizeof(T)> voxel;
    std::memcpy(voxel.data(), &value, sizeof(T));
    if (big_endian) std::reverse(voxel.begin(), voxel.end());
    bytes.append(voxel.data(), voxel.size());
  }
  return bytes;
}

inline std::string deflate(std::string_view bytes, int window_bits) {
  z_stream stream{};
  EXPECT_EQ(::deflateInit2(&stream, 9, Z_DEFLATED, window_bits, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(::deflateBound(&stream, uLong(bytes.size())) + 32, '\0');
  stream.next_in = reinterpret_cast<Bytef *>(const_cast<char *>(bytes.data()));
  stream.avail_in = uInt(bytes.size());
  stream.next_out = reinterpret_cast<Bytef *>(packed.data());
  stream.avail_out = uInt(packed.size());
  EXPECT_EQ(::deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  ::deflateEnd(&stream);
  return packed;
}
inline std::string gzip(std::string_view bytes) {
  return deflate(bytes, 15 + 16);
}
inline std::string zlib(std::string_view bytes) {
  return deflate(bytes, 15);
}

/// What a NIfTI-1 file says; the defaults are valid.
struct NiftiFields {
  std::array<std::int16_t, 8> dim{3, 3, 4, 5, 1, 1, 1, 1};
  std::int16_t intent = 0, datatype = 2, bitpix = 8, qform_code = 0, sform_code = 1;
  std::array<float, 4> pixdim{1, 0.5f, 2, 3};
  float vox_offset = 352, scl_slope = 0, scl_inter = 0;
  char xyzt_units = 2;  ///< millimetres
  std::array<float, 3> quatern{}, qoffset{1, 2, 3};
  /// RAS: x spacing 0.5, y flipped spacing 2, z spacing 3; voxel 0 at (10, 20, 30).
  std::array<std::array<float, 4>, 3> sform{{{0.5f, 0, 0, 10}, {0, -2, 0, 20}, {0, 0, 3, 30}}};
  std::string magic{"n+1\0", 4};
  std::int32_t sizeof_hdr = 348;
  bool big_endian = false;

  std::string bytes() const {
    const bool is_further = vox_offset > 352 && vox_offset <= 4096;
    std::string header(is_further ? std::size_t(vox_offset) : 352, '\0');
    const auto put = [&](std::size_t at, auto value) {
      std::array<char, sizeof(value)> text;
      std::memcpy(text.data(), &value, sizeof(value));
      if (big_endian) std::reverse(text.begin(), text.end());
      std::memcpy(header.data() + at, text.data(), text.size());
    };
    const auto put_all = [&](std::size_t at, const auto &values) {
      for (const auto value : values) {
        put(at, value);
        at += sizeof(value);
      }
    };
    put(0, sizeof_hdr);
    put_all(40, dim);
    put_all(68, std::array{intent, datatype, bitpix});
    put_all(76, pixdim);
    put_all(108, std::array{vox_offset, scl_slope, scl_inter});
    put(123, xyzt_units);
    put_all(252, std::array{qform_code, sform_code});
    put_all(256, quatern);
    put_all(268, qoffset);
    for (std::size_t row = 0; row < 3; ++row) put_all(280 + 16 * row, sform[row]);
    header.replace(344, magic.size(), magic);
    return header;
  }
};

inline std::vector<float> read_all(VolumeReader &reader) {
  std::vector<float> voxels(reader.info().num_voxels());
  reader.read_layers(0, reader.info().dims.z, voxels);
  return voxels;
}

/// The message of the Error, in one line, with which opening or reading the file ends; "" where it
/// is read to its end.
inline std::string error_of(const std::filesystem::path &path) {
  try {
    read_all(*open_volume(path));
  } catch (const Error &error) {
    const std::string message = error.what();
    EXPECT_TRUE(message.starts_with(path.string() + ": ")) << message;
    for (const char c : message) EXPECT_GE(static_cast<unsigned char>(c), ' ') << message;
    return message;
  }
  return "";
}
inline std::string error_of(const std::filesystem::path &path, const std::string &bytes) {
  write_file(path, bytes);
  return error_of(path);
}

}  // namespace isowave::core::test
