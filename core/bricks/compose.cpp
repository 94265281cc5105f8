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

/// As kNoPlace, in half a word.
constexpr std::uint32_t kNoHalfPlace = 0xFF;
constexpr std::uint32_t kColor = 0xFFFFFF;

std::uint8_t *write_color(std::uint32_t color, bool is_hit, std::size_t channels,
                          std::uint8_t *to) {
  for (int channel = 0; channel < 3; ++channel)
    *to++ = static_cast<std::uint8_t>(color >> (8 * channel));
  if (channels == 4) *to++ = is_hit ? 255 : 0;
  return to;
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

void field_words(std::span<const HitRecord> hits, HitField field,
                 std::span<const std::uint32_t> places, std::span<std::uint64_t> words) {
  for (std::size_t ray = 0; ray < hits.size(); ++ray)
    field_words(hits.subspan(ray, 1), field, places[ray], words.subspan(ray, 1));
}

void number_words(std::span<const HitRecord> hits, std::span<const float> numbers,
                  std::uint32_t place, std::span<std::uint64_t> words) {
  for (std::size_t ray = 0; ray < hits.size(); ++ray)
    words[ray] = make_word(hits[ray], place, std::bit_cast<std::uint32_t>(numbers[ray]));
}

void set_numbers(std::span<const std::uint64_t> words, std::span<float> numbers) {
  for (std::size_t ray = 0; ray < words.size(); ++ray) {
    if (words[ray] >> 32 != kNoPlace)
      numbers[ray] = std::bit_cast<float>(static_cast<std::uint32_t>(words[ray]));
  }
}

void color_words(std::span<const std::uint32_t> colors, std::uint32_t place,
                 std::span<std::uint64_t> words) {
  std::ranges::transform(colors, words.begin(), [place](std::uint32_t color) {
    return std::uint64_t{color >> 24 == 0 ? kNoPlace : place} << 32 | (color & 0xFFFFFFu);
  });
}

std::size_t set_colors(std::span<const std::uint64_t> words, std::size_t begin,
                       std::size_t channels, std::span<std::uint8_t> picture) {
  std::uint8_t *to = picture.data() + channels * begin;
  std::size_t num_hits = 0;
  for (const std::uint64_t word : words) {
    const bool is_hit = word >> 32 != kNoPlace;
    num_hits += is_hit;
    to = write_color(static_cast<std::uint32_t>(word), is_hit, channels, to);
  }
  return num_hits;
}

void color_halves(std::span<const std::uint32_t> colors, std::uint32_t place,
                  std::span<std::uint64_t> words) {
  const auto half = [place](std::uint32_t color) {
    return (color >> 24 == 0 ? kNoHalfPlace : place) << 24 | (color & kColor);
  };
  for (std::size_t i = 0; i < colors.size() / 2; ++i)
    words[i] = half(colors[2 * i]) | std::uint64_t{half(colors[2 * i + 1])} << 32;
  if (colors.size() % 2 != 0) words[colors.size() / 2] = half(colors.back());
}

std::size_t set_half_colors(std::span<const std::uint64_t> words, std::size_t begin,
                            std::size_t channels, std::span<std::uint8_t> picture) {
  static_assert(std::endian::native == std::endian::little);
  const auto hits_of = [](std::uint64_t word) {
    return std::size_t{word >> 56 != kNoHalfPlace} + ((word >> 24 & 0xFF) != kNoHalfPlace);
  };
  std::uint8_t *to = picture.data() + channels * begin;
  std::size_t num_hits = 0;
  // Compilers write four pixels of RGB, 12 bytes, by two stores.
  const std::uint8_t *end = picture.data() + picture.size();
  for (; channels == 3 && words.size() >= 2 && end - to >= 12; words = words.subspan(2), to += 12) {
    const std::uint64_t head =
        (words[0] & kColor) | (words[0] >> 32 & kColor) << 24 | (words[1] & 0xFFFF) << 48;
    const auto tail = static_cast<std::uint32_t>((words[1] & kColor) >> 16 | words[1] >> 32 << 8);
    std::memcpy(to, &head, sizeof(head));
    std::memcpy(to + sizeof(head), &tail, sizeof(tail));
    num_hits += hits_of(words[0]) + hits_of(words[1]);
  }
  for (const std::uint64_t word : words) {
    for (const auto half :
         {static_cast<std::uint32_t>(word), static_cast<std::uint32_t>(word >> 32)}) {
      if (to == end) break;
      const bool is_hit = half >> 24 != kNoHalfPlace;
      num_hits += is_hit;
      to = write_color(half, is_hit, channels, to);
    }
  }
  return num_hits;
}

}  // namespace isowave::core
