#pragma once
// Colour maps by name.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace isowave::core {

/// Names of the colour maps: viridis, magma, cividis, coolwarm, gray; and labels, whose
/// hues go round by the golden ratio.
std::span<const std::string_view> color_map_names();

/// Colours from low to high: words, red in bits 0..7, green 8..15, blue 16..23.
///
/// Throws  Error naming the maps there are
std::array<std::uint32_t, 256> color_map(std::string_view name);

}  // namespace isowave::core
