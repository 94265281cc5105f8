#pragma once
// Annotations over a picture, drawn by Cairo if the program was built with it,
// otherwise by the Python package that started it.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "core/io/png.hpp"
#include "isowave/annotations.hpp"

namespace isowave::core::tools {

/// Options as typed; read_annotations() checks them. Empty: as the scene has it.
struct AnnotationOptions {
  std::string wanted;  ///< names with commas, "all", or "none"
  std::string units;   ///< of the world
  std::string title;   ///< of the caption
};

void add_annotation_options(CLI::App &command, AnnotationOptions &options);

/// of_scene    annotations of the scene file, which the options change; none: it has none
/// appearance  of the pictures; "all" has a colour bar if it has a colour map
/// has_slices  "all" then has a colour bar, too
/// Throws      Error in one line: what there is not
std::optional<isowave::Annotations> read_annotations(
    const AnnotationOptions &options, const std::optional<isowave::Annotations> &of_scene,
    const isowave::Appearance &appearance, bool has_slices);

/// Throws  Error: this program cannot draw annotations
void check_annotations();
/// Whether this program can.
bool can_annotate();

/// Draws over an RGB or RGBA picture; RGBA becomes opaque there. Pixels without annotations keep
/// their values.
///
/// Throws  Error: they cannot be drawn
void draw_annotations(Image8 &image, const std::vector<isowave::AnnotationGroup> &groups);
/// The same over a frame's picture.
void draw_annotations(isowave::Frame &frame, const std::vector<isowave::AnnotationGroup> &groups);

}  // namespace isowave::core::tools
