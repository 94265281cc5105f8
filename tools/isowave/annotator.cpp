#include "tools/isowave/annotator.hpp"

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "core/base/error.hpp"

namespace isowave::core::tools {

namespace {

using nlohmann::ordered_json;

std::string annotator_pipes() {
  const char *const names = std::getenv("ISOWAVE_ANNOTATOR");
  return names != nullptr ? names : "";
}

ordered_json json_of_group(const isowave::AnnotationGroup &group) {
  ordered_json boxes = ordered_json::array(), strokes = boxes, texts = boxes;
  for (const auto &[begin, end, color] : group.boxes) boxes.push_back({begin, end, color});
  for (const auto &[points, width, color] : group.strokes)
    strokes.push_back({points, width, color});
  for (const auto &[place, anchor, size, text, color] : group.texts)
    texts.push_back({place, anchor, size, text, color});
  return {{"begin", group.begin},
          {"end", group.end},
          {"boxes", boxes},
          {"strokes", strokes},
          {"texts", texts},
          {"halo", group.halo},
          {"halo_color", group.halo_color}};
}

}  // namespace

bool has_annotator() {
  return annotator_pipes().find(':') != std::string::npos;
}

void ask_annotator(Image8 &image, const std::vector<isowave::AnnotationGroup> &groups) {
  const std::string names = annotator_pipes();
  const std::size_t colon = names.find(':');
  std::ofstream to(names.substr(0, colon), std::ios::binary);
  ordered_json question{{"size", {image.width, image.height, image.channels}},
                        {"groups", ordered_json::array()}};
  for (const isowave::AnnotationGroup &group : groups)
    question["groups"].push_back(json_of_group(group));
  const auto size = static_cast<std::streamsize>(image.pixels.size());
  char *const pixels = reinterpret_cast<char *>(image.pixels.data());
  to << question.dump(-1, ' ', false, ordered_json::error_handler_t::replace) << '\n';
  to.write(pixels, size).flush();
  std::ifstream from(names.substr(colon + 1), std::ios::binary);
  std::string failure;
  std::getline(from, failure);
  if (!failure.empty()) throw Error("{}", failure);
  if (!from.read(pixels, size) && size > 0)
    throw Error("annotations cannot be drawn: Python does not answer");
}

}  // namespace isowave::core::tools
