#pragma once
// Annotations over a picture, drawn by Cairo if the program was built with it.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "core/io/png.hpp"
#include "isowave/annotations.hpp"

namespace isowave::core::tools {

/// Options as typed; read_annotations() checks them.
struct AnnotationOptions {
  std::string wanted;  ///< names with commas, or "all"; empty: none
  std::string units;   ///< of the world; empty: not said
};

void add_annotation_options(CLI::App &command, AnnotationOptions &options);

/// appearance  of the pictures; "all" has a colour bar if it has a colour map
/// title       of the caption
/// Throws      Error in one line: what there is not, or this program cannot draw
std::optional<isowave::Annotations> read_annotations(const AnnotationOptions &options,
                                                     const isowave::Appearance &appearance,
                                                     const std::string &title);

/// Draws over an RGB or RGBA picture; RGBA becomes opaque there. Pixels without annotations keep
/// their values.
///
/// Throws  Error: Cairo cannot draw it, or there is none
void draw_annotations(Image8 &image, const std::vector<isowave::AnnotationGroup> &groups);

}  // namespace isowave::core::tools
