#include "tools/isowave/label_options.hpp"

#include <fmt/format.h>

#include <charconv>
#include <optional>
#include <string_view>

#include "core/api/frame_parts.hpp"
#include "core/base/error.hpp"
#include "core/frame/colors.hpp"
#include "core/frame/surfaces.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/surface_options.hpp"

namespace isowave::core::tools {

namespace {

std::uint32_t parse_label(const std::string &text, std::string_view field) {
  std::uint32_t label = 0;
  const char *const end = field.data() + field.size();
  const auto [stop, error] = std::from_chars(field.data(), end, label);
  if (field.empty() || error != std::errc() || stop != end || label >= ISO_NUM_LABELS)
    throw Error("--labels {}: '{}' is no label: give whole numbers, 0 to {}", text, field,
                ISO_NUM_LABELS - 1);
  return label;
}

/// 3, 5+7 or 7-9, as in 5+7-9.
std::vector<std::uint32_t> parse_labels(const std::string &text, std::string_view list) {
  std::vector<std::uint32_t> labels;
  for (std::string_view left = list;;) {
    const std::size_t plus = left.find('+');
    const std::string_view part = left.substr(0, plus);
    const std::size_t minus = part.find('-');
    const std::uint32_t first = parse_label(text, part.substr(0, minus)),
                        last =
                            minus == part.npos ? first : parse_label(text, part.substr(minus + 1));
    if (first > last) throw Error("--labels {}: {} is above {}", text, first, last);
    for (std::uint32_t label = first; label <= last; ++label) labels.push_back(label);
    if (plus == left.npos) return labels;
    left.remove_prefix(plus + 1);
  }
}

/// index: of the surface in its frame
isowave::Surface parse_group(const std::string &text, std::size_t index) {
  isowave::Surface surface{.color = isowave::surface_color(index)};
  const std::string_view labels = read_surface_fields("--labels", text, "LABELS", surface);
  surface.labels = parse_labels(text, labels);
  return surface;
}

}  // namespace

void add_labels_option(CLI::App &command, std::vector<std::string> &texts) {
  command
      .add_option("--labels", texts,
                  "labels of a segmentation, 0 to 65535, with +, and - for ranges (5+7-9), whose "
                  "surface is drawn together, and its colour and opacity as --surface has them; "
                  "repeat it for up to 8 surfaces in one picture. Voxels are integers, compressed "
                  "without a loss")
      ->type_name("LABELS[,COLOR[,OPACITY[,whole][,own]]]")
      ->allow_extra_args(false);
}

std::vector<isowave::Surface> read_labels(const std::vector<std::string> &texts) {
  std::vector<isowave::Surface> surfaces;
  std::vector<SurfaceStyle> styles;
  for (const std::string &text : texts) {
    surfaces.push_back(parse_group(text, surfaces.size()));
    styles.push_back(core_style(surfaces.back()));
  }
  check_surfaces(styles);
  return surfaces;
}

}  // namespace isowave::core::tools
