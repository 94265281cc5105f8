#pragma once
// Annotations without Cairo: the Python package, which started this program, draws them by Pillow.

#include <vector>

#include "core/io/png.hpp"
#include "isowave/annotations.hpp"

namespace isowave::core::tools {

/// Whether the Python package listens: the variable ISOWAVE_ANNOTATOR names two pipes, with a colon
/// between them. This program writes to the first and reads from the second.
bool has_annotator();

/// Has these groups drawn over an RGB or RGBA picture. Waits.
///
/// Writes  a line of JSON, {"size": [width, height, channels], "groups": [...]}, then the pixels
/// Reads   a line, which is empty or says why there is no picture, then the pixels
/// Throws  Error: that line, or there is no answer
void ask_annotator(Image8 &image, const std::vector<isowave::AnnotationGroup> &groups);

}  // namespace isowave::core::tools
