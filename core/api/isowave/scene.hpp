#pragma once
// Scenes: what is drawn, apart from how precisely; as values, and as files.
//
// A scene file is JSON:
//
//   {"isowave_scene": 1,
//    "volume": "head.nrrd",
//    "camera": {"eye": [0, 0, 500], "at": [0, 0, 0], "up": [0, 1, 0], "fovy_degrees": 60},
//    "surfaces": [{"isovalue": 500, "color": "skin", "opacity": 0.3},
//                 {"isovalue": 1150, "color": "#f0e8d8"}],
//    "clip": [{"normal": [0, 0, -1], "offset": -60}],
//    "background": "black",
//    "annotations": {"scale_bar": true, "caption": true, "units": "mm"}}
//
// Its keys are the fields of Scene and of Appearance, except `surface`. A surface of labels has
// "labels": [5, 7] instead of an isovalue. isowave_scene, surfaces, each isovalue, each normal of a
// plane or slice, and eye and at of a camera are needed; for the rest there are defaults. A colour
// is "#RRGGBB", a name of parse_color(), or red, green and blue from 0 to 1. A second volume
// colours the surface by its values with
//
//    "field": "temperature.nrrd", "color_map": "magma", "color_by_field": true
//
// "dataset": "scan/ct" chooses one of several arrays of the volume's file, "index": "t=3,c=0"
// entries of its further axes; "field_dataset" and "field_index" do so in the field's file.
//
// The keys of annotations are the fields of Annotations: scale_bar, axes, color_bar, caption, units
// and title. Each annotation is left out unless it is true. A caption without a title gets the name
// of the volume's file.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "isowave/annotations.hpp"
#include "isowave/frame.hpp"
#include "isowave/volume.hpp"

namespace isowave {

/// What is drawn. A frame needs a size and a camera beside it.
struct Scene {
  std::filesystem::path volume{};  ///< file of the volume; empty: not said
  std::string dataset{};           ///< name of the array in that file; empty: the only one
  /// Entries of axes beside x, y and z in that file, from 0: "t=3,c=0"; empty: there are none.
  std::string index{};
  /// File of the second volume, for Appearance::color_by_field; empty: not said. `volume`: the
  /// drawn volume itself (./volume is a file of that name).
  std::filesystem::path field{};
  std::string field_dataset{};     ///< as dataset, of the field's file
  std::string field_index{};       ///< as index, of the field's file
  std::optional<Camera> camera{};  ///< none: a view that the volume's box fills
  /// 1 to 8. One opaque surface is drawn as FrameRequest::isovalue, several as
  /// FrameRequest::surfaces.
  std::vector<Surface> surfaces{};
  std::vector<Slice> slices{};    ///< as FrameRequest::slices
  std::vector<ClipPlane> clip{};  ///< as FrameRequest::clip
  bool caps = true;               ///< as FrameRequest::caps
  Appearance appearance{};        ///< without `surface`: surfaces have colours of their own
  /// Drawn over the picture; none: nothing is. An empty title: the name of the volume's file.
  std::optional<Annotations> annotations{};
};

/// Calls visit(name, field) for each field of a scene and its appearance, except `surface`. The
/// names are the keys of scene files.
///
/// scene  a Scene, or a const one
template <class AnyScene, class Visit>
void for_each_scene_field(AnyScene &scene, const Visit &visit) {
  visit("volume", scene.volume);
  visit("dataset", scene.dataset);
  visit("index", scene.index);
  visit("field", scene.field);
  visit("field_dataset", scene.field_dataset);
  visit("field_index", scene.field_index);
  visit("camera", scene.camera);
  visit("surfaces", scene.surfaces);
  visit("slices", scene.slices);
  visit("clip", scene.clip);
  visit("caps", scene.caps);
  for_each_appearance_field(scene.appearance, visit);
  visit("annotations", scene.annotations);
}

/// The scene of a JSON text.
///
/// Throws  Error: what is wrong, and where: "surfaces[1].opacity"
Scene parse_scene(std::string_view text);
/// The text of a scene, without what has its default.
///
/// Throws  Error: as parse_scene()
std::string scene_text(const Scene &scene);

/// Reads a scene file. Relative paths of volume and field begin at the file's folder; the scene
/// gets them as they are seen from the current folder.
Scene read_scene(const std::filesystem::path &path);
/// Writes a scene file. Relative paths of volume and field become relative to the file's folder. A
/// file that exists is replaced when the new one is complete.
void write_scene(const Scene &scene, const std::filesystem::path &path);

/// What open_volume() needs beside Scene::volume, and beside Scene::field: the step of its index.
///
/// Throws  Error: a dataset, or another axis than t, which isowave's Python package reads
RawFile scene_volume(const Scene &scene);
RawFile scene_field(const Scene &scene);

/// A request that draws the scene. It has no size, and without Scene::camera no camera.
/// annotation_layout() says where the scene's annotations are.
FrameRequest scene_request(const Scene &scene);
/// The scene that a request draws, without a volume, a field and annotations.
Scene scene_of(const FrameRequest &request);

}  // namespace isowave
