// Words of pictures put together: of whole words and of halves, for any number of rays.

#include "core/bricks/compose.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/base/team.hpp"
#include "core/io/png.hpp"

namespace isowave::core {
namespace {

TEST(Compose, TheSmallestWordsAndHalves) {
  const std::vector<std::uint64_t> a{0x0000000500000009, 0xFFFFFFFF00000000, 3};
  const std::vector<std::uint64_t> b{0x0000000700000001, 0x00000001FFFFFFFF, 12};
  const auto reduced = [&](Reduction how) {
    std::vector<std::uint64_t> words = a;
    reduce_into(words, b, how);
    return words;
  };
  EXPECT_EQ(reduced(Reduction::kMin),
            (std::vector<std::uint64_t>{0x0000000500000009, 0x00000001FFFFFFFF, 3}));
  EXPECT_EQ(reduced(Reduction::kMinOfHalves),
            (std::vector<std::uint64_t>{0x0000000500000001, 0x0000000100000000, 3}));
  EXPECT_EQ(reduced(Reduction::kOr),
            (std::vector<std::uint64_t>{0x0000000700000009, 0xFFFFFFFFFFFFFFFF, 15}));
}

/// Processes leave out words that give nothing: one that gives something among them is enough.
TEST(Compose, WordsThatMayChangeTheOutcome) {
  struct Case {
    Reduction how;
    std::uint64_t nothing, something;
  };
  for (const Case &each : {Case{Reduction::kMin, 0xFFFFFFFF7F800000, 0xFFFFFFFE7F800000},
                           Case{Reduction::kMinOfHalves, 0xFF123456FF654321, 0xFF123456FE654321},
                           Case{Reduction::kMinOfHalves, 0xFFFFFFFFFFFFFFFF, 0x00FFFFFFFFFFFFFF},
                           Case{Reduction::kOr, 0, 0x8000000000000000}}) {
    std::vector<std::uint64_t> words(9, each.nothing);
    EXPECT_FALSE(may_change(words, each.how)) << each.nothing;
    for (const std::size_t at : {0u, 4u, 8u}) {
      words[at] = each.something;
      EXPECT_TRUE(may_change(words, each.how)) << each.something << " at " << at;
      words[at] = each.nothing;
    }
  }
}

/// A brick's picture as DeviceRenderer::shade_packed() has it.
std::vector<std::uint32_t> random_colors(std::size_t num_rays, std::mt19937 &rng) {
  constexpr std::uint32_t kBackground = 0x123456;
  std::vector<std::uint32_t> colors(num_rays);
  for (std::uint32_t &color : colors)
    color = rng() % 2 == 0 ? kBackground : 1u << 24 | (rng() & 0xFFFFFF);
  return colors;
}

/// Rays' colours by the definition: of the first brick in order that has a hit.
struct Expected {
  std::vector<std::uint8_t> pixels;
  std::size_t num_hits = 0;
};
Expected compose_one_by_one(const std::vector<std::vector<std::uint32_t>> &by_place,
                            std::size_t channels) {
  Expected expected;
  for (std::size_t ray = 0; ray < by_place.front().size(); ++ray) {
    const auto first =
        std::ranges::find_if(by_place, [&](const auto &colors) { return colors[ray] >> 24 != 0; });
    expected.num_hits += first != by_place.end();
    const std::uint32_t color = (first == by_place.end() ? by_place.front() : *first)[ray];
    for (const int shift : {0, 8, 16})
      expected.pixels.push_back(static_cast<std::uint8_t>(color >> shift));
    if (channels == 4) expected.pixels.push_back(first == by_place.end() ? 0 : 255);
  }
  return expected;
}

TEST(Compose, ColoursOfTheFirstBrickThatIsHit) {
  std::mt19937 rng(1);
  for (const std::size_t num_rays : {1u, 2u, 3u, 4u, 5u, 7u, 64u, 65u, 66u, 67u, 1001u}) {
    SCOPED_TRACE(num_rays);
    std::vector<std::vector<std::uint32_t>> by_place;
    for (int brick = 0; brick < 3; ++brick) by_place.push_back(random_colors(num_rays, rng));

    const auto composed = [&](Reduction how, std::size_t rays_per_word, std::uint32_t channels,
                              const auto &make, const auto &take) {
      const Expected expected = compose_one_by_one(by_place, channels);
      const std::size_t num_words = (num_rays + rays_per_word - 1) / rays_per_word;
      std::vector<std::uint64_t> words(num_words, ~std::uint64_t{0}), own(num_words);
      const std::uint32_t places[] = {0, 100, 254};
      for (const std::size_t brick : {1u, 2u, 0u}) {
        make(by_place[brick], places[brick], own);
        reduce_into(words, own, how);
      }
      // In two parts, as threads take them.
      Image8 image{std::uint32_t(num_rays), 1, channels,
                   std::vector<std::uint8_t>(channels * num_rays)};
      const std::span all = words;
      const std::size_t part = num_words / 2;
      const std::size_t num_hits =
          take(all.first(part), 0, channels, image.pixels) +
          take(all.subspan(part), rays_per_word * part, channels, image.pixels);
      EXPECT_EQ(image.pixels, expected.pixels);
      EXPECT_EQ(num_hits, expected.num_hits);
    };
    for (const std::uint32_t channels : {3u, 4u}) {
      composed(Reduction::kMin, 1, channels, color_words, set_colors);
      composed(Reduction::kMinOfHalves, 2, channels, color_halves, set_half_colors);
    }
  }
}

}  // namespace
}  // namespace isowave::core
