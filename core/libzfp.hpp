#pragma once
// libzfp, wrapped for this project: owning handles, and the 96-bit header of a fixed-rate float32 volume.

#include <zfp.h>

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>

namespace isowave {

using ZfpField = std::unique_ptr<zfp_field, decltype(&zfp_field_free)>;
using ZfpStream = std::unique_ptr<zfp_stream, decltype(&zfp_stream_close)>;
using ZfpBits = std::unique_ptr<bitstream, decltype(&stream_close)>;

/// zfp's full header in its short form, for 64 * rate <= 2048 bits per block.
inline constexpr std::uint32_t kZfpHeaderWords = 3;
using ZfpHeader = std::array<std::uint32_t, kZfpHeaderWords>;
ZfpHeader make_zfp_header(const glm::uvec3 &dims, std::uint32_t bits_per_block);

/// A stream at a fixed number of bits per block. The caller sets its bit stream.
ZfpStream make_zfp_stream(std::uint32_t bits_per_block);

}  // namespace isowave
