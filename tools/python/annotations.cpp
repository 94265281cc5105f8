// Annotations of pictures, as dicts.

#include <array>
#include <optional>

#include "module.hpp"
#include "requests.hpp"

namespace isowave_python {

namespace {

nb::dict dict_of(const isowave::AnnotationGroup &group) {
  nb::list boxes, strokes, texts;
  for (const auto &[begin, end, color] : group.boxes)
    boxes.append(nb::make_tuple(begin, end, color));
  for (const auto &[points, width, color] : group.strokes)
    strokes.append(nb::make_tuple(points, width, color));
  for (const auto &[place, anchor, size, text, color] : group.texts)
    texts.append(nb::make_tuple(place, anchor, size, text, color));
  nb::dict result;
  result["begin"] = group.begin;
  result["end"] = group.end;
  result["boxes"] = boxes;
  result["strokes"] = strokes;
  result["texts"] = texts;
  result["halo"] = group.halo;
  result["halo_color"] = group.halo_color;
  return result;
}

}  // namespace

nb::list list_of(const std::vector<isowave::AnnotationGroup> &groups) {
  nb::list result;
  for (const isowave::AnnotationGroup &group : groups) result.append(dict_of(group));
  return result;
}

namespace {

nb::list annotation_layout(const nb::dict &wanted, const nb::dict &request,
                           const std::optional<std::array<double, 2>> &color_range,
                           const std::optional<std::array<double, 2>> &slice_range) {
  return list_of(isowave::annotation_layout(annotations_of(wanted), request_of(request),
                                            color_range, slice_range));
}

}  // namespace

void add_annotations(nb::module_ &m) {
  m.def("annotation_layout", &annotation_layout, "wanted"_a, "request"_a, "color_range"_a.none(),
        "slice_range"_a.none());
}

}  // namespace isowave_python
