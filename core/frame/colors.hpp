#pragma once
// Colours as users name them.

#include <cstddef>
#include <glm/glm.hpp>
#include <string>
#include <string_view>

namespace isowave::core {

/// The names that parse_color() knows: "bone, skin, ...".
std::string color_names();
/// The colour of "#RRGGBB", or of a name. Display values, [0,1].
///
/// Throws  Error, which lists the names
glm::vec3 parse_color(std::string_view text);

/// The colour of a surface of a frame that has none of its own. The first is Appearance's; seven
/// further ones, of Okabe and Ito, can be told apart with any colour vision. Then they repeat.
glm::vec3 surface_color(std::size_t index);

}  // namespace isowave::core
