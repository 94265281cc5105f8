#include "core/frame/colors.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cstdint>

#include "core/base/error.hpp"

namespace isowave::core {

namespace {

struct NamedColor {
  const char *name;
  std::uint32_t rgb;
};

/// Tissues, and twelve of CSS.
constexpr NamedColor kNamed[] = {
    {"bone", 0xE3DAC9},   {"skin", 0xDFA98C},   {"muscle", 0xA5473F},  {"blood", 0xB01020},
    {"white", 0xFFFFFF},  {"black", 0x000000},  {"gray", 0x808080},    {"red", 0xFF0000},
    {"orange", 0xFFA500}, {"yellow", 0xFFFF00}, {"green", 0x008000},   {"cyan", 0x00FFFF},
    {"blue", 0x0000FF},   {"purple", 0x800080}, {"magenta", 0xFF00FF}, {"brown", 0xA52A2A}};

/// Appearance::surface, then M. Okabe and K. Ito, Color Universal Design, 2008: sky blue,
/// vermilion, bluish green, reddish purple, blue, yellow, orange.
constexpr std::array<std::uint32_t, 8> kOfSurfaces = {0xDBBD87, 0x56B4E9, 0xD55E00, 0x009E73,
                                                      0xCC79A7, 0x0072B2, 0xF0E442, 0xE69F00};

glm::vec3 color_of(std::uint32_t rgb) {
  return {float(rgb >> 16) / 255.0f, float(rgb >> 8 & 255u) / 255.0f, float(rgb & 255u) / 255.0f};
}

}  // namespace

std::string color_names() {
  std::string names;
  for (const NamedColor &color : kNamed)
    names += fmt::format("{}{}", names.empty() ? "" : ", ", color.name);
  return names;
}

glm::vec3 parse_color(std::string_view text) {
  std::uint32_t rgb = 0;
  const char *end = text.data() + text.size();
  if (text.size() == 7 && text[0] == '#') {
    const auto parsed = std::from_chars(text.data() + 1, end, rgb, 16);
    if (parsed.ec == std::errc{} && parsed.ptr == end) return color_of(rgb);
  }
  for (const auto &[name, value] : kNamed) {
    if (text == name) return color_of(value);
  }
  throw Error("there is no colour '{}': give #RRGGBB, or one of {}", text, color_names());
}

glm::vec3 surface_color(std::size_t index) {
  return color_of(kOfSurfaces[index % kOfSurfaces.size()]);
}

}  // namespace isowave::core
