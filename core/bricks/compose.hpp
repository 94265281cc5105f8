#pragma once
// Pictures of bricks put together. The first brick with a hit of a ray wins, in the order of
// Cuts::order_from(). No distance is compared.
//
// Each ray has a word of 64 bits: the upper half is the place of the brick in that order, the lower
// half 32 bits of the hit. So the smallest word wins, which MPI_MIN finds. If there are few bricks,
// a colour takes half a word: 8 bits for the place, 24 for the colour.

#include <cstdint>
#include <span>
#include <vector>

#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// Stands for a brick's place if no brick has a hit of the ray.
inline constexpr std::uint32_t kNoPlace = 0xFFFFFFFF;

/// Fields of HitRecord, each of 32 bits. block_id is not among them: ids are a brick's own.
enum class HitField { kT = 0, kCell = 2, kX, kY, kZ, kGradX, kGradY, kGradZ };
inline constexpr HitField kHitFields[] = {HitField::kT,     HitField::kCell, HitField::kX,
                                          HitField::kY,     HitField::kZ,    HitField::kGradX,
                                          HitField::kGradY, HitField::kGradZ};

/// words [ray]: one field of a brick's hits.
void field_words(std::span<const HitRecord> hits, HitField field, std::uint32_t place,
                 std::span<std::uint64_t> words);
/// Gives hits [ray] the field that won.
void set_field(std::span<const std::uint64_t> words, HitField field, std::span<HitRecord> hits);

/// The same of hits whose bricks have another place for each ray.
void field_words(std::span<const HitRecord> hits, HitField field,
                 std::span<const std::uint32_t> places, std::span<std::uint64_t> words);
/// The same of a number of each hit.
void number_words(std::span<const HitRecord> hits, std::span<const float> numbers,
                  std::uint32_t place, std::span<std::uint64_t> words);
/// Gives rays [ray] that hit the number that won.
void set_numbers(std::span<const std::uint64_t> words, std::span<float> numbers);

/// words [ray]: a brick's picture, of one ray a pixel, as DeviceRenderer::shade_packed() has it.
void color_words(std::span<const std::uint32_t> colors, std::uint32_t place,
                 std::span<std::uint64_t> words);
/// Gives a picture's pixels from `begin` on the colours that won.
///
/// channels  3: RGB; 4: RGBA, A 255 where there is a hit, else 0
/// picture   [pixels][channels]
/// Returns   the number of pixels with a hit
std::size_t set_colors(std::span<const std::uint64_t> words, std::size_t begin,
                       std::size_t channels, std::span<std::uint8_t> picture);

/// Most bricks for which half a word is enough.
inline constexpr std::uint32_t kMostHalfWordBricks = 0xFF;
/// words [(rays + 1) / 2]: as color_words(), two rays in each, the first in its lower half.
void color_halves(std::span<const std::uint32_t> colors, std::uint32_t place,
                  std::span<std::uint64_t> words);
/// As set_colors(). begin: even.
std::size_t set_half_colors(std::span<const std::uint64_t> words, std::size_t begin,
                            std::size_t channels, std::span<std::uint8_t> picture);

}  // namespace isowave::core
