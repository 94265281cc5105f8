// Camera files. Input: the file. One that is accepted has cameras that can be drawn, and reads the
// same when written again.

#include <fmt/format.h>

#include "core/view/camera.hpp"
#include "tests/fuzz/fuzz_target.hpp"

using namespace isowave::core;

namespace {

std::string json_of(const glm::dvec3 &v) {
  return fmt::format("[{:.17e},{:.17e},{:.17e}]", v.x, v.y,
                     v.z);  // JSON takes "-0" for the integer 0
}

std::string json_of(const CameraFile &file) {
  std::string text = fmt::format("{{\"fovy_deg\":{},\"cameras\":[", file.cameras.at(0).fovy_deg);
  for (const Camera &camera : file.cameras) {
    text +=
        fmt::format("{}{{\"eye\":{},\"at\":{},\"up\":{}}}", &camera == &file.cameras[0] ? "" : ",",
                    json_of(camera.eye), json_of(camera.at), json_of(camera.up));
  }
  text += ']';
  if (file.dims)
    text += fmt::format(",\"dims\":[{},{},{}]", file.dims->x, file.dims->y, file.dims->z);
  if (file.spacing) text += ",\"spacing\":" + json_of(*file.spacing);
  if (file.width) text += fmt::format(",\"width\":{}", *file.width);
  if (file.height) text += fmt::format(",\"height\":{}", *file.height);
  return text + '}';
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  const std::filesystem::path path = fuzz::put("cameras.json", fuzz::text_of(data, size));
  CameraFile file;
  if (!fuzz::accepts([&] { file = read_camera_file(path); })) return 0;
  fuzz::demand(!file.cameras.empty(), "no cameras");
  for (const Camera &camera : file.cameras) check_camera(camera, "camera");
  const std::string text = json_of(file);
  fuzz::demand(json_of(read_camera_file(fuzz::put("cameras.json", text))) == text,
               "cameras are not those that were written");
  return 0;
}
