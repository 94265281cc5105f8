#pragma once
// Annotations of a picture: scale bar, axes, colour bar and caption. The library says where they
// are, in pixels of the picture; `isowave render --annotate` draws them by Cairo, and
// Image.annotated() of the Python package by Pillow.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "isowave/frame.hpp"

namespace isowave {

/// What is wanted.
struct Annotations {
  /// 1, 2 or 5 times a power of ten world units, 10 to 25 % of the picture's width: at the depth of
  /// the point that the camera looks at, which the label of a perspective picture says.
  bool scale_bar = false;
  bool axes = false;  ///< directions of x, y and z in world space
  /// Bars of Appearance::color_map, and of slice_map if there are slices; left out without a range.
  bool color_bar = false;
  bool caption = false;  ///< the title, and the isovalues beside their colours
  std::string units{};   ///< of the world, such as "mm"; empty: lengths have none
  std::string title{};   ///< such as the name of the volume's file; empty: none
};

/// Most letters of units in scene files and in the options of programs.
inline constexpr std::size_t kMostUnits = 16;

/// Calls visit(name, field) for each field.
///
/// annotations  Annotations, or const ones
template <class AnyAnnotations, class Visit>
void for_each_annotations_field(AnyAnnotations &annotations, const Visit &visit) {
  visit("scale_bar", annotations.scale_bar);
  visit("axes", annotations.axes);
  visit("color_bar", annotations.color_bar);
  visit("caption", annotations.caption);
  visit("units", annotations.units);
  visit("title", annotations.title);
}

/// Pixels from the picture's upper left corner, to the right and down.
using PicturePlace = std::array<double, 2>;

/// A filled rectangle.
struct AnnotationBox {
  PicturePlace begin{}, end{};
  std::array<float, 3> color{};
};
/// A line through points, with round ends and corners.
struct AnnotationStroke {
  std::vector<PicturePlace> points{};
  double width = 1;  ///< pixels
  std::array<float, 3> color{};
};
struct AnnotationText {
  PicturePlace place{};  ///< on the baseline
  double anchor = 0;     ///< the part of the text that is to the left of `place`, 0 to 1
  double size = 0;       ///< of the font [pixels]
  std::string text{};    ///< UTF-8, without control characters
  std::array<float, 3> color{};
};

/// Draw the halos of strokes and texts first, then boxes, then strokes, then texts.
struct AnnotationGroup {
  /// The picture changes only between these columns and rows; clip to them.
  std::array<std::uint32_t, 2> begin{}, end{};
  std::vector<AnnotationBox> boxes{};
  std::vector<AnnotationStroke> strokes{};
  std::vector<AnnotationText> texts{};
  double halo = 0;  ///< width of the halos, on each side [pixels]
  std::array<float, 3> halo_color{};
};

/// Whether annotation_layout() takes pictures of that size: from 200 x 150 pixels on.
bool has_room_for_annotations(const ImageSize &size);
/// The annotations of a picture: scale bar, axes, colour bar, caption, as far as they are wanted.
///
/// request      its camera, size, isovalues, colours and background
/// color_range  FrameStatistics::color_range of the frame
/// slice_range  FrameStatistics::slice_range of the frame
/// Throws       Error: the picture is too small; a colour bar is wanted without a colour map and
///              slices
std::vector<AnnotationGroup> annotation_layout(
    const Annotations &wanted, const FrameRequest &request,
    const std::optional<std::array<double, 2>> &color_range,
    const std::optional<std::array<double, 2>> &slice_range = {});

}  // namespace isowave
