#include "core/bricks/compose.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace isowave::core {

namespace {

using HitWords = std::array<std::uint32_t, sizeof(HitRecord) / sizeof(std::uint32_t)>;

std::uint64_t make_word(const HitRecord &hit, std::uint32_t place, std::uint32_t what) {
  return std::uint64_t{hit.block_id == ISO_INVALID_ID ? kNoPlace : place} << 32 | what;
}

}  // namespace

void field_words(std::span<const HitRecord> hits, HitField field, std::uint32_t place,
                 std::span<std::uint64_t> words) {
  std::ranges::transform(hits, words.begin(), [&](const HitRecord &hit) {
    return make_word(hit, place, std::bit_cast<HitWords>(hit)[static_cast<std::size_t>(field)]);
  });
}

void set_field(std::span<const std::uint64_t> words, HitField field, std::span<HitRecord> hits) {
  for (std::size_t ray = 0; ray < hits.size(); ++ray) {
    auto fields = std::bit_cast<HitWords>(hits[ray]);
    fields[static_cast<std::size_t>(field)] = static_cast<std::uint32_t>(words[ray]);
    hits[ray] = std::bit_cast<HitRecord>(fields);
  }
}

void color_words(std::span<const std::uint32_t> colors, std::uint32_t place,
                 std::span<std::uint64_t> words) {
  std::ranges::transform(colors, words.begin(), [place](std::uint32_t color) {
    return std::uint64_t{color >> 24 == 0 ? kNoPlace : place} << 32 | (color & 0xFFFFFFu);
  });
}

void set_colors(std::span<const std::uint64_t> words, std::size_t begin, Image8 &image) {
  static_assert(std::endian::native == std::endian::little);
  std::uint8_t *to = image.pixels.data() + 3 * begin;
  // Four pixels at once are 12 bytes, of which compilers make two stores.
  for (; words.size() >= 4; words = words.subspan(4), to += 12) {
    constexpr std::uint64_t kColor = 0xFFFFFF;
    const std::uint64_t head =
        (words[0] & kColor) | (words[1] & kColor) << 24 | (words[2] & 0xFFFF) << 48;
    const auto tail = static_cast<std::uint32_t>((words[2] & kColor) >> 16 | words[3] << 8);
    std::memcpy(to, &head, sizeof(head));
    std::memcpy(to + sizeof(head), &tail, sizeof(tail));
  }
  for (const std::uint64_t word : words) {
    for (int channel = 0; channel < 3; ++channel)
      *to++ = static_cast<std::uint8_t>(word >> (8 * channel));
  }
}

}  // namespace isowave::core
