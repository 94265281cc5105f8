// isowave._core: the library of core/api as a Python module. Axes are x, y, z here, as in C++; the
// Python files beside this one turn them into z, y, x and have the documentation.

#include "module.hpp"

namespace isowave_python {

namespace {

/// [height][width][3, or 4 with alpha]
using Picture =
    nb::ndarray<std::uint8_t, nb::ro, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;

/// camera: None, or as fields of isowave::Camera
isowave::Frame frame_of(const Picture &picture, const std::optional<nb::dict> &camera) {
  isowave::Frame frame;
  if (camera) isowave::for_each_camera_field(frame.camera.emplace(), reader_of(*camera));
  frame.size = {static_cast<std::uint32_t>(picture.shape(1)),
                static_cast<std::uint32_t>(picture.shape(0)), 1};
  frame.picture = isowave::Array<std::uint8_t>(std::span(picture.data(), picture.size()));
  return frame;
}

nb::bytes encode_png(const Picture &picture, const std::optional<nb::dict> &camera) {
  const isowave::Frame frame = frame_of(picture, camera);
  std::vector<std::uint8_t> bytes;
  {
    const WithoutGil no_gil;
    bytes = isowave::encode_png(frame);
  }
  return nb::bytes(bytes.data(), bytes.size());
}

void save_png(const Picture &picture, const std::filesystem::path &path,
              const std::optional<nb::dict> &camera) {
  const isowave::Frame frame = frame_of(picture, camera);
  const WithoutGil no_gil;
  isowave::save_png(frame, path);
}

}  // namespace

NB_MODULE(_core, m) {
  nb::exception<Error>(m, "Error", PyExc_RuntimeError);
  // Threads that are still at work when Python ends keep their objects: that is no leak to tell of.
  nb::set_leak_warnings(false);
  nb::module_::import_("atexit").attr("register")(
      nb::cpp_function([] { PythonsEnd::instance().come(); }));
  m.def("is_ending", [] { return PythonsEnd::instance().is_near(); });
  m.attr("__version__") = std::string(isowave::version());
  m.def("encode_png", &encode_png, "picture"_a, "camera"_a.none());
  m.def("save_png", &save_png, "picture"_a, "path"_a, "camera"_a.none());

  add_volumes(m);
  add_renderers(m);
  add_annotations(m);
  add_pages(m);
}

}  // namespace isowave_python
