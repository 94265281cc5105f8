#pragma once
// The option --surface: several surfaces in one picture, also translucent ones.

#include <CLI/CLI.hpp>
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "isowave/frame.hpp"

namespace isowave::core::tools {

/// The colour of an option, see core/frame/colors.hpp.
///
/// Throws  Error in one line, which names the option
std::array<float, 3> parse_color(const char *option, std::string_view text);

/// Sets the background of an appearance. text: --background as typed, COLOR[,COLOR].
///
/// Throws  Error in one line: what are no colours
void read_background(const std::string &text, isowave::Appearance &appearance);

/// Options as typed; read_light() checks them.
struct LightOptions {
  std::string direction;  ///< X,Y,Z; empty: none
  std::uint32_t shadow_rays = 0, bounce_rays = 0;
  double angle = 3;  ///< degrees
};

void add_light_options(CLI::App &command, LightOptions &options);
/// Throws  Error: what is no direction
void read_light(const LightOptions &options, isowave::Appearance &appearance);

/// --color-by and --color-map as typed; read_color_map() checks them. A scene file sets the fields
/// that read_color_map() would.
struct ColorMapOptions {
  /// X, Y, Z, NX,NY,NZ, depth, `volume` or a file, and [,LOW,HIGH]; or `labels`, or FILE,labels
  std::string by;
  std::string index{};    ///< t=N, of a field's file with a fourth axis
  std::string dataset{};  ///< of a field's file, kept for scenes: no option
  std::string field{};    ///< set by read_color_map(): `volume`, a file, or none
  bool by_field = false;  ///< set by read_color_map(): colours are by it
  std::string map{};      ///< see core/view/color_maps.hpp; empty: viridis, or by labels, labels
};

void add_color_map_options(CLI::App &command, ColorMapOptions &options);

/// Sets the colour map of an appearance, if one is asked for.
///
/// Throws  Error in one line: what the options cannot mean, for any volume
void read_color_map(ColorMapOptions &options, isowave::Appearance &appearance);

/// Sets colour, opacity, `clipped` and `mapped` of a surface.
///
/// option  --surface or --labels
/// text    its value as typed: WHAT[,COLOR[,OPACITY[,WORD]...]], of words `whole` and `own`
/// what    what the first field is, for errors
/// Returns the first field
/// Throws  Error in one line: what the others cannot mean
std::string_view read_surface_fields(const char *option, const std::string &text, const char *what,
                                     isowave::Surface &surface);

/// texts: VALUE[,COLOR[,OPACITY[,whole][,own]]] each, as typed; read_surfaces() checks them.
void add_surface_option(CLI::App &command, std::vector<std::string> &texts);

/// Surfaces without a colour get surface_color().
///
/// Throws  Error in one line: what the options cannot mean, for any volume
std::vector<isowave::Surface> read_surfaces(const std::vector<std::string> &texts);

/// [{isovalue, color, opacity, clipped, mapped}], or labels for isovalue. color: red, green, blue,
/// 0 to 1.
nlohmann::ordered_json surfaces_json(const std::vector<isowave::Surface> &surfaces);

}  // namespace isowave::core::tools
