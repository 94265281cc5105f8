// Pages and sites, whose pictures Python annotates.

#include <algorithm>

#include "module.hpp"
#include "requests.hpp"

namespace isowave_python {

namespace {

using Picture =
    nb::ndarray<std::uint8_t, nb::ro, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;

/// What Python gives for a page.
struct PageArguments {
  std::filesystem::path engine;
  std::string title;
  nb::callable annotate;  ///< annotate(picture, groups) returns the picture with these over it
};

isowave::PageOptions options_of(const PageArguments &given, Callbacks &callbacks) {
  isowave::PageOptions options{.engine = given.engine, .title = given.title};
  options.annotate = [&](isowave::Frame &frame,
                         const std::vector<isowave::AnnotationGroup> &groups) {
    const std::size_t height = frame.size.height, width = frame.size.width;
    const bool goes_on = callbacks.run([&] {
      const std::size_t channels = frame.picture.size() / (height * width);
      isowave::Array<std::uint8_t> plain = frame.picture;
      const auto drawn = nb::cast<Picture>(
          call(given.annotate, to_numpy<std::uint8_t>(std::move(plain), {height, width, channels}),
               list_of(groups)));
      if (drawn.size() != frame.picture.size())
        throw Error("annotations: a picture of another size");
      std::copy_n(drawn.data(), drawn.size(), frame.picture.begin());
    });
    if (!goes_on) throw Stopped();
  };
  return options;
}

void save_page(const PyVolume &volume, const nb::dict &fields, const std::filesystem::path &path,
               const std::filesystem::path &engine, const std::string &title, const PyVolume *field,
               const nb::callable &annotate) {
  Callbacks callbacks;
  const PageArguments given{engine, title, annotate};
  isowave::PageOptions options = options_of(given, callbacks);
  if (field != nullptr) options.field = field->volume;
  const isowave::Scene scene = scene_of(fields);
  callbacks.without_gil([&] { isowave::save_page(volume.volume, scene, path, options); });
}

void save_site(const PyVolume &volume, const nb::dict &fields, const std::filesystem::path &folder,
               const std::filesystem::path &engine, const std::string &title,
               const nb::callable &annotate) {
  Callbacks callbacks;
  const PageArguments given{engine, title, annotate};
  const isowave::PageOptions options = options_of(given, callbacks);
  const isowave::Scene scene = scene_of(fields);
  callbacks.without_gil([&] { isowave::save_site(volume.volume, scene, folder, options); });
}

}  // namespace

void add_pages(nb::module_ &m) {
  m.def("save_page", &save_page, "volume"_a, "scene"_a, "path"_a, "engine"_a, "title"_a,
        "field"_a.none(), "annotate"_a);
  m.def("save_site", &save_site, "volume"_a, "scene"_a, "folder"_a, "engine"_a, "title"_a,
        "annotate"_a);
}

}  // namespace isowave_python
