#pragma once
// libzfp, wrapped for this project: owning handles, and the 96-bit header of a float32 volume.

#include <zfp.h>

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <new>

namespace isowave::core {

/// Returns an object that libzfp has made; throws std::bad_alloc if libzfp had no memory for it.
template <class T>
T *or_bad_alloc(T *made) {
  if (made == nullptr) throw std::bad_alloc();
  return made;
}

using ZfpField = std::unique_ptr<zfp_field, decltype(&zfp_field_free)>;
using ZfpStream = std::unique_ptr<zfp_stream, decltype(&zfp_stream_close)>;
using ZfpBits = std::unique_ptr<bitstream, decltype(&stream_close)>;

/// zfp's full header in its short form, for up to 2048 bits per block or a fixed accuracy.
inline constexpr std::uint32_t kZfpHeaderWords = 3;
using ZfpHeader = std::array<std::uint32_t, kZfpHeaderWords>;
ZfpHeader make_zfp_header(const glm::uvec3 &dims, std::uint32_t bits_per_block,
                          std::int32_t min_exponent = ZFP_MIN_EXP);

/// A stream at a fixed number of bits per block; 0: each block has its own number. It has as many
/// bit planes as an error of 2^min_exponent needs. The caller sets its bit stream.
ZfpStream make_zfp_stream(std::uint32_t bits_per_block, std::int32_t min_exponent = ZFP_MIN_EXP);

}  // namespace isowave::core
