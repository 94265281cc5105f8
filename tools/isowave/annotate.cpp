#include "tools/isowave/annotate.hpp"

#ifdef ISOWAVE_HAS_CAIRO
#include <cairo.h>
#endif

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string_view>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/utf8.hpp"
#include "tools/isowave/annotator.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

void add_annotation_options(CLI::App &command, AnnotationOptions &options) {
  command
      .add_option("--annotate", options.wanted,
                  "draws over --output and --refined, separated by commas: scale-bar, axes, "
                  "color-bar, caption (the volume's name, isovalues); or all, or none [those of "
                  "--scene]")
      ->type_name("LIST");
  command
      .add_option("--units", options.units,
                  "units of the world for the scale bar and colours along an axis, such as mm "
                  "[those of --scene]")
      ->type_name("TEXT");
  command
      .add_option("--title", options.title,
                  "first line of the caption [that of --scene, or the name of the volume's file]")
      ->type_name("TEXT");
}

namespace {

/// Sets which annotations are drawn.
///
/// list  names with commas, or "all"
void choose_annotations(const std::string &list, const isowave::Appearance &appearance,
                        bool has_slices, isowave::Annotations &wanted) {
  wanted.scale_bar = wanted.axes = wanted.color_bar = wanted.caption = false;
  const bool has_map = !appearance.color_map.empty() || !appearance.color_table.empty(),
             has_bar = (has_map && !appearance.color_by_label) || has_slices;
  for (const std::string_view name : split_at_commas(list)) {
    const bool is_all = name == "all";
    if (name == "color-bar" && appearance.color_by_label && !has_bar)
      throw Error("--annotate color-bar: colours of labels have no order: leave it out");
    if (name == "color-bar" && !has_bar)
      throw Error("--annotate color-bar: no colour map is drawn: give --color-by");
    if (!is_all && name != "scale-bar" && name != "axes" && name != "color-bar" &&
        name != "caption")
      throw Error(
          "--annotate {}: there are scale-bar, axes, color-bar, caption, and all; or give none "
          "alone",
          name);
    wanted.scale_bar |= is_all || name == "scale-bar";
    wanted.axes |= is_all || name == "axes";
    wanted.color_bar |= name == "color-bar" || (is_all && has_bar);
    wanted.caption |= is_all || name == "caption";
  }
}

}  // namespace

std::optional<isowave::Annotations> read_annotations(
    const AnnotationOptions &options, const std::optional<isowave::Annotations> &of_scene,
    const isowave::Appearance &appearance, bool has_slices) {
  std::optional<isowave::Annotations> wanted = of_scene;
  if (options.wanted == "none") {
    wanted.reset();
  } else if (!options.wanted.empty()) {
    if (!wanted) wanted.emplace();
    choose_annotations(options.wanted, appearance, has_slices, *wanted);
  }
  for (const auto &[name, text] :
       {std::pair("--units", options.units), std::pair("--title", options.title)}) {
    if (!text.empty() && !wanted)
      throw Error("{} {}: nothing is annotated: give --annotate", name, text);
  }
  if (!options.title.empty()) wanted->title = options.title;
  if (options.units.empty()) return wanted;
  if (count_letters(printable_utf8(options.units)) > isowave::kMostUnits)
    throw Error("--units {}: give at most {} letters", options.units, isowave::kMostUnits);
  wanted->units = options.units;
  return wanted;
}

void draw_annotations(isowave::Frame &frame, const std::vector<isowave::AnnotationGroup> &groups) {
  const std::size_t num_pixels = std::size_t{frame.size.width} * frame.size.height;
  Image8 image{frame.size.width, frame.size.height,
               static_cast<std::uint32_t>(frame.picture.size() / num_pixels),
               frame.picture.to_vector()};
  draw_annotations(image, groups);
  std::ranges::copy(image.pixels, frame.picture.begin());
}

#ifndef ISOWAVE_HAS_CAIRO

bool can_annotate() {
  return has_annotator();
}
void check_annotations() {
  if (!has_annotator())
    throw Error(
        "annotations: this isowave was built without Cairo: leave out --annotate, or give "
        "--annotate none");
  Image8 nothing{};
  ask_annotator(nothing, {});
}
void draw_annotations(Image8 &image, const std::vector<isowave::AnnotationGroup> &groups) {
  ask_annotator(image, groups);
}

#else

bool can_annotate() {
  return true;
}
void check_annotations() {}

namespace {

struct CairoEnd {
  void operator()(cairo_surface_t *surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t *context) const { cairo_destroy(context); }
};

void check(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw Error("annotations cannot be drawn: Cairo says: {}", cairo_status_to_string(status));
}

/// One group's rows and columns of a picture, empty at first.
class Canvas {
 public:
  explicit Canvas(const isowave::AnnotationGroup &group)
      : group_(group),
        width_(group.end[0] - group.begin[0]),
        height_(group.end[1] - group.begin[1]),
        surface_(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, int(width_), int(height_))),
        context_(cairo_create(surface_.get())) {
    check(cairo_surface_status(surface_.get()));
    cairo_translate(context(), -double(group.begin[0]), -double(group.begin[1]));
    cairo_set_line_join(context(), CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_cap(context(), CAIRO_LINE_CAP_ROUND);
    cairo_select_font_face(context(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_NORMAL);
  }

  void draw() {
    set_color(group_.halo_color);
    for (const isowave::AnnotationStroke &line : group_.strokes)
      stroke(line, line.width + 2 * group_.halo);
    for (const isowave::AnnotationText &text : group_.texts) {
      add_path(text);
      cairo_set_line_width(context(), 2 * group_.halo);
      cairo_stroke(context());
    }
    for (const isowave::AnnotationBox &box : group_.boxes) {
      cairo_rectangle(context(), box.begin[0], box.begin[1], box.end[0] - box.begin[0],
                      box.end[1] - box.begin[1]);
      set_color(box.color);
      cairo_fill(context());
    }
    for (const isowave::AnnotationStroke &line : group_.strokes) {
      set_color(line.color);
      stroke(line, line.width);
    }
    for (const isowave::AnnotationText &text : group_.texts) {
      add_path(text);
      set_color(text.color);
      cairo_fill(context());
    }
    check(cairo_status(context()));
    cairo_surface_flush(surface_.get());
  }

  /// Lays what was drawn over the picture.
  void blend_into(Image8 &image) const {
    const unsigned char *const pixels = cairo_image_surface_get_data(surface_.get());
    const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(surface_.get()));
    for (std::size_t row = 0; row < height_; ++row) {
      for (std::size_t column = 0; column < width_; ++column) {
        std::uint32_t word = 0;
        std::copy_n(pixels + row * stride + 4 * column, 4,
                    reinterpret_cast<unsigned char *>(&word));
        const std::size_t pixel = (group_.begin[1] + row) * image.width + group_.begin[0] + column;
        if (word != 0) blend(word, &image.pixels[pixel * image.channels], image.channels == 4);
      }
    }
  }

 private:
  cairo_t *context() const { return context_.get(); }
  void set_color(const std::array<float, 3> &color) {
    const auto [r, g, b] = color;
    cairo_set_source_rgb(context(), double{r}, double{g}, double{b});
  }
  void stroke(const isowave::AnnotationStroke &line, double width) {
    for (const auto &[x, y] : line.points) cairo_line_to(context(), x, y);
    cairo_set_line_width(context(), width);
    cairo_stroke(context());
  }
  void add_path(const isowave::AnnotationText &text) {
    cairo_set_font_size(context(), text.size);
    cairo_text_extents_t extents;
    cairo_text_extents(context(), text.text.c_str(), &extents);
    cairo_move_to(context(), text.place[0] - text.anchor * extents.x_advance, text.place[1]);
    cairo_text_path(context(), text.text.c_str());
  }

  /// word  alpha in bits 24..31, and red, green, blue times alpha
  static void blend(std::uint32_t word, std::uint8_t *pixel, bool has_alpha) {
    const double over = double(word >> 24) / 255, below = has_alpha ? pixel[3] / 255.0 : 1,
                 alpha = over + (1 - over) * below;
    for (int channel = 0; channel < 3; ++channel) {
      const double color = double(word >> (16 - 8 * channel) & 255u);
      const double mixed = (color + (1 - over) * below * pixel[channel]) / alpha;
      pixel[channel] = static_cast<std::uint8_t>(std::min(255L, std::lround(mixed)));
    }
    if (has_alpha) pixel[3] = static_cast<std::uint8_t>(std::lround(255 * alpha));
  }

  const isowave::AnnotationGroup &group_;
  std::size_t width_, height_;
  std::unique_ptr<cairo_surface_t, CairoEnd> surface_;
  std::unique_ptr<cairo_t, CairoEnd> context_;
};

}  // namespace

void draw_annotations(Image8 &image, const std::vector<isowave::AnnotationGroup> &groups) {
  for (const isowave::AnnotationGroup &group : groups) {
    Canvas canvas(group);
    canvas.draw();
    canvas.blend_into(image);
  }
}

#endif

}  // namespace isowave::core::tools
