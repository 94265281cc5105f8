#include "core/zfp/libzfp.hpp"

#include <bit>
#include <cstring>
#include <stdexcept>

#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

static_assert(std::endian::native == std::endian::little,
              "zfp streams are read as little-endian words");

static_assert(ISO_ALL_PLANES == ZFP_MIN_EXP);  // NOLINT(misc-redundant-expression): of two sources
static_assert(ISO_REVERSIBLE == ZFP_MIN_EXP - 1);  // as zfp_stream_set_reversible() has it

ZfpStream make_zfp_stream(std::uint32_t bits_per_block, std::int32_t min_exponent) {
  ZfpStream stream(or_bad_alloc(zfp_stream_open(nullptr)), &zfp_stream_close);
  const bool accuracy = bits_per_block == 0;
  if (!zfp_stream_set_params(stream.get(), accuracy ? ZFP_MIN_BITS : bits_per_block,
                             accuracy ? ZFP_MAX_BITS : bits_per_block, ZFP_MAX_PREC,
                             min_exponent)) {
    throw std::invalid_argument(
        "make_zfp_stream: libzfp refuses this number of bits per block, or this exponent");
  }
  return stream;
}

ZfpHeader make_zfp_header(const glm::uvec3 &dims, std::uint32_t bits_per_block,
                          std::int32_t min_exponent) {
  std::array<std::uint64_t, 4> buffer{};
  const ZfpBits bits(or_bad_alloc(stream_open(buffer.data(), sizeof(buffer))), &stream_close);
  const ZfpStream stream = make_zfp_stream(bits_per_block, min_exponent);
  zfp_stream_set_bit_stream(stream.get(), bits.get());
  const ZfpField field(or_bad_alloc(zfp_field_3d(nullptr, zfp_type_float, dims.x, dims.y, dims.z)),
                       &zfp_field_free);
  if (zfp_write_header(stream.get(), field.get(), ZFP_HEADER_FULL) != 32 * kZfpHeaderWords) {
    throw std::invalid_argument("make_zfp_header: no short header for these dims and rate");
  }
  stream_flush(bits.get());
  ZfpHeader header;
  std::memcpy(header.data(), buffer.data(), sizeof(header));
  return header;
}

}  // namespace isowave::core
