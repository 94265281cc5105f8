#pragma once
// The kinds of gradients that hits can have. Normals follow from them.

#include <string_view>

namespace isowave::core {

enum class Normals {
  kSmooth,  ///< central differences, trilinear between voxels (portable/smooth_gradient.h)
  kCell     ///< gradients of the trilinear field itself, which jump from cell to cell
};

/// The name: "smooth", "cell".
std::string_view to_string(Normals normals);
/// Throws  Error naming both
Normals normals_from_string(std::string_view name);

}  // namespace isowave::core
