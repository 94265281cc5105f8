#include "isowave/annotations.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>
#include <utility>

#include "core/api/convert.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/base/error.hpp"
#include "core/base/utf8.hpp"
#include "core/view/camera.hpp"
#include "core/view/nice_numbers.hpp"

namespace isowave {

namespace {

using Color = std::array<float, 3>;
constexpr std::uint32_t kLeastWidth = 200, kLeastHeight = 150;
constexpr Color kBlack{0, 0, 0}, kWhite{1, 1, 1};
/// x, y, z.
constexpr std::array<Color, 3> kAxisColors{Color{0.83f, 0.18f, 0.18f}, Color{0.15f, 0.58f, 0.2f},
                                           Color{0.16f, 0.4f, 0.9f}};

// Parts of a font's size, of common sans-serif fonts.
constexpr double kUsualLetter = 0.6, kWidestLetter = 1.0;  ///< their widths
constexpr double kHalfCapital = 0.36, kAscent = 0.95, kDescent = 0.3;
constexpr double kLineHeight = 1.4;

/// A picture's sizes, and the group that is being laid out.
class Sheet {
 public:
  explicit Sheet(const FrameRequest &request)
      : width_(request.size.width), height_(request.size.height), light_(request.appearance) {}

  double width() const { return width_; }
  double height() const { return height_; }
  double font() const { return std::max(10.0, 0.028 * std::min(width_, height_)); }
  double line() const { return std::max(1.0, font() / 8); }
  double margin() const { return font(); }

  /// Begins a group whose texts are about that far from the upper edge.
  AnnotationGroup group_at(double y) const {
    return {.halo = std::max(1.0, font() / 12),
            .halo_color = ink_at(y) == kBlack ? kWhite : kBlack};
  }
  /// Black or white, whichever contrasts more with the background (WCAG 2).
  Color ink_at(double y) const {
    const Color bottom = light_.transparent ? kWhite : light_.background;
    const Color top = light_.transparent ? kWhite : light_.background_top.value_or(bottom);
    const double up = 1 - y / height_;
    double luminance = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double value = std::lerp(double{bottom[i]}, double{top[i]}, up);
      const double linear =
          value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
      luminance += std::array{0.2126, 0.7152, 0.0722}[i] * linear;
    }
    return (luminance + 0.05) / 0.05 >= 1.05 / (luminance + 0.05) ? kBlack : kWhite;
  }
  AnnotationText text(std::string_view text, const PicturePlace &place, double anchor,
                      const Color &color) const {
    return {place, anchor, font(), core::printable_utf8(text), color};
  }
  double usual_width(std::string_view text) const {
    return kUsualLetter * font() * double(core::count_letters(text));
  }

  /// Sets the rows and columns that a group's things can reach.
  void finish(AnnotationGroup &group) const {
    double left = width_, top = height_, right = 0, bottom = 0;
    const auto add = [&](double x, double y, double reach) {
      left = std::min(left, x - reach);
      right = std::max(right, x + reach);
      top = std::min(top, y - reach);
      bottom = std::max(bottom, y + reach);
    };
    for (const AnnotationBox &box : group.boxes) {
      add(box.begin[0], box.begin[1], 0);
      add(box.end[0], box.end[1], 0);
    }
    const double more = group.halo + 1;
    for (const AnnotationStroke &stroke : group.strokes) {
      for (const auto &[x, y] : stroke.points) add(x, y, stroke.width / 2 + more);
    }
    for (const AnnotationText &text : group.texts) {
      const double widest = kWidestLetter * text.size * double(core::count_letters(text.text));
      const auto &[x, y] = text.place;
      add(x - text.anchor * widest, y - kAscent * text.size, more);
      add(x + (1 - text.anchor) * widest, y + kDescent * text.size, more);
    }
    const auto whole = [](double value, double most) {
      return static_cast<std::uint32_t>(std::clamp(value, 0.0, most));
    };
    group.begin = {whole(std::floor(left), width_), whole(std::floor(top), height_)};
    group.end = {whole(std::ceil(right), width_), whole(std::ceil(bottom), height_)};
  }

 private:
  double width_, height_;
  const Appearance &light_;
};

std::string with_units(std::string text, const std::string &units) {
  return units.empty() ? text : fmt::format("{} {}", text, units);
}

AnnotationGroup scale_bar(const Sheet &sheet, const Annotations &wanted,
                          const core::Camera &camera) {
  const double pixel = core::pixel_size_at(camera, std::uint32_t(sheet.height()),
                                           glm::distance(camera.eye, camera.at));
  const double length = core::round_length(0.25 * sheet.width() * pixel);
  const double font = sheet.font(), right = sheet.width() - sheet.margin(),
               left = right - length / pixel, bottom = sheet.height() - sheet.margin(),
               tick = bottom - 0.4 * font;
  const Color ink = sheet.ink_at(bottom);
  AnnotationGroup group = sheet.group_at(bottom);
  group.strokes.push_back(
      {{{left, tick}, {left, bottom}, {right, bottom}, {right, tick}}, sheet.line(), ink});
  std::string text = with_units(fmt::format("{:g}", length), wanted.units);
  if (!camera.parallel_height) text += " at the focal point";
  // A long text ends with the bar.
  const bool is_long = sheet.usual_width(text) > right - left;
  group.texts.push_back(sheet.text(text, {is_long ? right : (left + right) / 2, tick - 0.4 * font},
                                   is_long ? 1 : 0.5, ink));
  return group;
}

AnnotationGroup orientation_axes(const Sheet &sheet, const core::Camera &camera) {
  const double font = sheet.font(), arm = 2.4 * font;
  const PicturePlace middle{sheet.margin() + arm + 0.5 * font,
                            sheet.height() - sheet.margin() - arm - 0.5 * font};
  AnnotationGroup group = sheet.group_at(middle[1]);
  const core::CameraAxes axes = core::axes_of(camera);
  const glm::dmat3 world(1.0);
  std::array<int, 3> order{0, 1, 2};  // those that point away come first
  std::ranges::stable_sort(order, std::greater<>(),
                           [&](int axis) { return glm::dot(world[axis], axes.forward); });
  for (const int axis : order) {
    const double x = glm::dot(world[axis], axes.right), y = -glm::dot(world[axis], axes.up);
    const Color &color = kAxisColors[std::size_t(axis)];
    group.strokes.push_back(
        {{middle, {middle[0] + arm * x, middle[1] + arm * y}}, 1.4 * sheet.line(), color});
    // The letter of an axis towards the viewer stays near its end.
    const double aside = 0.6 * font / std::max(0.25, std::hypot(x, y));
    group.texts.push_back(sheet.text(
        std::string(1, char('x' + axis)),
        {middle[0] + (arm + aside) * x, middle[1] + (arm + aside) * y + 0.27 * font}, 0.5, color));
  }
  return group;
}

bool has_map(const Appearance &appearance) {
  return !appearance.color_map.empty() || !appearance.color_table.empty();
}

std::string bar_title(const Appearance &appearance, const std::string &units) {
  if (appearance.color_by_field) return "value";
  if (appearance.color_by_depth) return units.empty() ? "depth" : fmt::format("depth [{}]", units);
  const Vector3 &axis = appearance.color_axis;
  std::string text = fmt::format("along ({:.3g}, {:.3g}, {:.3g})", axis[0], axis[1], axis[2]);
  for (std::size_t i = 0; i < 3; ++i) {
    if (axis[i] > 0 && axis[(i + 1) % 3] == 0 && axis[(i + 2) % 3] == 0)
      text = std::string(1, char('x' + i));
  }
  return units.empty() ? text : fmt::format("{} [{}]", text, units);
}

/// One box for each run of rows of one colour.
void add_bar_colors(AnnotationGroup &group, const core::ColorTable &colors, double left,
                    double right, double top, double bottom) {
  const double rows = bottom - top;
  for (double row = 0; row < rows; ++row) {
    const double at = 1 - (row + 0.5) / rows;
    const std::uint32_t word =
        colors[static_cast<std::size_t>(std::lround(at * double(colors.size() - 1)))];
    Color color{};
    for (std::size_t i = 0; i < 3; ++i) color[i] = float(word >> 8 * i & 255u) / 255.0f;
    if (!group.boxes.empty() && group.boxes.back().color == color) {
      group.boxes.back().end[1] = top + row + 1;
    } else {
      group.boxes.push_back({{left, top + row}, {right, top + row + 1}, color});
    }
  }
}

/// A colour bar.
struct Bar {
  core::ColorTable colors{};
  std::array<double, 2> range{};  ///< values of the first and the last colour
  std::string title{};
};

/// Bars stand at the picture's right edge, one above the other.
///
/// begin, end  parts of the picture's height
AnnotationGroup color_bar(const Sheet &sheet, const Bar &bar, double begin, double end) {
  const std::array<double, 2> &range = bar.range;
  const double font = sheet.font(), line = sheet.line() / 2;
  const core::Ticks ticks = core::ticks_between(range[0], range[1]);
  double labels = 0;
  for (const std::string &label : ticks.labels) labels = std::max(labels, sheet.usual_width(label));
  const double right = std::floor(sheet.width() - sheet.margin() - labels - 0.6 * font),
               left = right - std::round(font), top = std::round(begin * sheet.height()),
               bottom = std::round(end * sheet.height());
  const Color ink = sheet.ink_at((top + bottom) / 2);
  AnnotationGroup group = sheet.group_at((top + bottom) / 2);
  add_bar_colors(group, bar.colors, left, right, top, bottom);
  group.strokes.push_back(
      {{{left, top}, {right, top}, {right, bottom}, {left, bottom}, {left, top}}, line, ink});
  for (std::size_t i = 0; i < ticks.values.size(); ++i) {
    const double span = range[1] - range[0];
    const double at = span == 0 ? 0.5 : (ticks.values[i] - range[0]) / span;
    const double y = std::lerp(bottom, top, at);
    group.strokes.push_back({{{right, y}, {right + 0.3 * font, y}}, line, ink});
    group.texts.push_back(
        sheet.text(ticks.labels[i], {right + 0.6 * font, y + kHalfCapital * font}, 0, ink));
  }
  group.texts.push_back(
      sheet.text(bar.title, {sheet.width() - sheet.margin(), top - 0.8 * font}, 1, ink));
  return group;
}

/// Adds the bars of surfaces and slices, as far as they have ranges.
void add_color_bars(const Sheet &sheet, const Annotations &wanted, const Appearance &appearance,
                    const std::optional<std::array<double, 2>> &color_range,
                    const std::optional<std::array<double, 2>> &slice_range,
                    std::vector<AnnotationGroup> &groups) {
  std::vector<Bar> bars;
  if (color_range && has_map(appearance)) {
    bars.push_back({color_table_of(appearance.color_map, appearance.color_table), *color_range,
                    bar_title(appearance, wanted.units)});
  }
  if (slice_range)
    bars.push_back(
        {color_table_of(appearance.slice_map, appearance.slice_table), *slice_range, "slices"});
  if (bars.size() == 1) {
    groups.push_back(color_bar(sheet, bars[0], 0.28, 0.7));
  } else if (bars.size() == 2) {
    groups.push_back(color_bar(sheet, bars[0], 0.18, 0.42));
    groups.push_back(color_bar(sheet, bars[1], 0.57, 0.81));
  }
}

/// A title that is too long keeps its two ends.
std::string fitting(const Sheet &sheet, std::string_view title) {
  std::string text = core::printable_utf8(title);
  const std::size_t letters = core::count_letters(text);
  const auto most = static_cast<std::size_t>((sheet.width() - 2 * sheet.margin()) /
                                             (kUsualLetter * sheet.font()));
  if (letters <= most) return text;
  const std::size_t first = (most - 1) / 2, last = most - 1 - first;
  return core::letters_of(text, 0, first) + "…" + core::letters_of(text, letters - last, last);
}

AnnotationGroup caption(const Sheet &sheet, const Annotations &wanted,
                        const FrameRequest &request) {
  const double font = sheet.font(), left = sheet.margin();
  const Color ink = sheet.ink_at(left);
  AnnotationGroup group = sheet.group_at(left);
  double y = sheet.margin() + 2 * kHalfCapital * font;
  if (!wanted.title.empty()) {
    group.texts.push_back(sheet.text(fitting(sheet, wanted.title), {left, y}, 0, ink));
    y += kLineHeight * font;
  }
  const Appearance &appearance = request.appearance;
  const bool has_own_colors = !has_map(appearance) || appearance.color_caps_alone;
  std::vector<Surface> surfaces = request.surfaces;
  if (surfaces.empty()) surfaces = {{request.isovalue, appearance.surface, 1}};
  for (const Surface &surface : surfaces) {
    const double top = y - 0.78 * font, side = 0.84 * font;
    if (has_own_colors) {
      group.boxes.push_back({{left, top}, {left + side, top + side}, surface.color});
      group.strokes.push_back({{{left, top},
                                {left + side, top},
                                {left + side, top + side},
                                {left, top + side},
                                {left, top}},
                               sheet.line() / 2,
                               ink});
    }
    constexpr std::size_t kMostOfLabels = 40;  // letters
    std::string text = surface.labels.empty()
                           ? fmt::format("isovalue {:.8g}", surface.isovalue)
                           : fmt::format("label{} {:.{}}", surface.labels.size() == 1 ? "" : "s",
                                         text_of_labels(surface), kMostOfLabels);
    if (surface.opacity < 1) text += fmt::format(", opacity {:.3g}", surface.opacity);
    group.texts.push_back(sheet.text(text, {left + (has_own_colors ? 1.35 * font : 0), y}, 0, ink));
    y += kLineHeight * font;
  }
  return group;
}

std::vector<AnnotationGroup> layout(const Annotations &wanted, const FrameRequest &request,
                                    const std::optional<std::array<double, 2>> &color_range,
                                    const std::optional<std::array<double, 2>> &slice_range) {
  const ImageSize &size = request.size;
  if (!has_room_for_annotations(size))
    throw core::Error("{} x {} pixels are too few for annotations: draw at least {} x {}",
                      size.width, size.height, kLeastWidth, kLeastHeight);
  const Appearance &appearance = request.appearance;
  if (wanted.color_bar && !has_map(appearance) && request.slices.empty())
    throw core::Error(
        "a colour bar needs a colour map, and the surfaces have colours of their own");
  const Sheet sheet(request);
  const core::Camera camera = core_camera(request.camera);
  core::check_camera(camera, "camera");
  std::vector<AnnotationGroup> groups;
  if (wanted.scale_bar) groups.push_back(scale_bar(sheet, wanted, camera));
  if (wanted.axes) groups.push_back(orientation_axes(sheet, camera));
  if (wanted.color_bar) add_color_bars(sheet, wanted, appearance, color_range, slice_range, groups);
  if (wanted.caption) groups.push_back(caption(sheet, wanted, request));
  for (AnnotationGroup &group : groups) sheet.finish(group);
  return groups;
}

}  // namespace

bool has_room_for_annotations(const ImageSize &size) {
  return size.width >= kLeastWidth && size.height >= kLeastHeight;
}

std::vector<AnnotationGroup> annotation_layout(
    const Annotations &wanted, const FrameRequest &request,
    const std::optional<std::array<double, 2>> &color_range,
    const std::optional<std::array<double, 2>> &slice_range) {
  return core::guarded("placing annotations",
                       [&] { return layout(wanted, request, color_range, slice_range); });
}

}  // namespace isowave
