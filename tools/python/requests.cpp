// Requests, scenes and options of renderers as Python's dicts, by the names of their fields.

#include "requests.hpp"

#include <type_traits>

namespace isowave_python {

isowave::Normals normals_of(const std::string &name) {
  if (name != "smooth" && name != "cell") throw Error("normals '" + name + "': smooth or cell");
  return name == "smooth" ? isowave::Normals::kSmooth : isowave::Normals::kCell;
}

namespace {

/// "proof", "sample".
isowave::Evidence evidence_of(const std::string &name) {
  if (name != "proof" && name != "sample") throw Error("by '" + name + "': proof or sample");
  return name == "proof" ? isowave::Evidence::kProof : isowave::Evidence::kSample;
}

/// visit(name, field): reads a field of a request or a scene that is there and not None.
auto field_reader_of(const nb::dict &options) {
  return [&options](const char *name, auto &field) {
    using Field = std::decay_t<decltype(field)>;
    const auto get = reader_of(options);
    if constexpr (std::is_same_v<Field, isowave::Normals>) {
      std::string text = "smooth";
      get(name, text);
      field = normals_of(text);
    } else if constexpr (std::is_same_v<Field, isowave::Evidence>) {
      std::string text = "proof";
      get(name, text);
      field = evidence_of(text);
    } else if constexpr (std::is_same_v<Field, std::vector<isowave::Camera>>) {
      std::vector<nb::dict> cameras;
      get(name, cameras);
      for (const nb::dict &camera : cameras)
        for_each_camera_field(field.emplace_back(), reader_of(camera));
    } else if constexpr (std::is_same_v<Field, std::vector<isowave::ClipPlane>>) {
      std::vector<nb::dict> planes;
      get(name, planes);
      for (const nb::dict &plane : planes)
        for_each_plane_field(field.emplace_back(), reader_of(plane));
    } else if constexpr (std::is_same_v<Field, std::vector<isowave::Surface>>) {
      std::vector<nb::dict> surfaces;
      get(name, surfaces);
      for (const nb::dict &surface : surfaces)
        for_each_surface_field(field.emplace_back(), reader_of(surface));
    } else if constexpr (std::is_same_v<Field, std::vector<isowave::Slice>>) {
      std::vector<nb::dict> slices;
      get(name, slices);
      for (const nb::dict &slice : slices)
        for_each_slice_field(field.emplace_back(), reader_of(slice));
    } else if constexpr (std::is_same_v<Field, std::optional<isowave::Camera>>) {
      std::optional<nb::dict> camera;
      get(name, camera);
      if (camera) for_each_camera_field(field.emplace(), reader_of(*camera));
    } else if constexpr (std::is_same_v<Field, std::optional<isowave::Annotations>>) {
      std::optional<nb::dict> annotations;
      get(name, annotations);
      if (annotations) field = annotations_of(*annotations);
    } else if constexpr (!std::is_enum_v<Field>) {
      get(name, field);
    }
  };
}

/// visit(name, field): puts a field into a dict.
auto field_writer_to(nb::dict &result) {
  return [&result](const char *name, const auto &field) { result[name] = nb::cast(field); };
}

}  // namespace

isowave::Annotations annotations_of(const nb::dict &fields) {
  isowave::Annotations annotations;
  isowave::for_each_annotations_field(annotations, reader_of(fields));
  return annotations;
}

isowave::FrameRequest request_of(const nb::dict &options) {
  isowave::FrameRequest request;
  isowave::for_each_field(request, field_reader_of(options));
  return request;
}

isowave::Scene scene_of(const nb::dict &fields) {
  isowave::Scene scene;
  isowave::for_each_scene_field(scene, field_reader_of(fields));
  return scene;
}

nb::dict dict_of(const isowave::Scene &scene) {
  nb::dict result;
  isowave::for_each_scene_field(scene, [&]<class Field>(const char *name, const Field &field) {
    if constexpr (std::is_same_v<Field, std::optional<isowave::Camera>>) {
      result[name] = nb::none();
      if (!field) return;
      nb::dict camera;
      for_each_camera_field(*field, field_writer_to(camera));
      result[name] = camera;
    } else if constexpr (std::is_same_v<Field, std::optional<isowave::Annotations>>) {
      result[name] = nb::none();
      if (!field) return;
      nb::dict annotations;
      for_each_annotations_field(*field, field_writer_to(annotations));
      result[name] = annotations;
    } else if constexpr (std::is_same_v<Field, std::vector<isowave::ClipPlane>>) {
      nb::list planes;
      for (const isowave::ClipPlane &plane : field) {
        nb::dict fields;
        for_each_plane_field(plane, field_writer_to(fields));
        planes.append(fields);
      }
      result[name] = planes;
    } else if constexpr (std::is_same_v<Field, std::vector<isowave::Surface>>) {
      nb::list surfaces;
      for (const isowave::Surface &surface : field) {
        nb::dict fields;
        for_each_surface_field(surface, field_writer_to(fields));
        if (surface.labels.empty()) nb::del(fields["labels"]);
        surfaces.append(fields);
      }
      result[name] = surfaces;
    } else if constexpr (std::is_same_v<Field, std::vector<isowave::Slice>>) {
      nb::list slices;
      for (const isowave::Slice &slice : field) {
        nb::dict fields;
        for_each_slice_field(slice, field_writer_to(fields));
        slices.append(fields);
      }
      result[name] = slices;
    } else if constexpr (std::is_same_v<Field, std::filesystem::path>) {
      result[name] = field.string();
    } else {
      field_writer_to(result)(name, field);
    }
  });
  return result;
}

isowave::RendererOptions renderer_options_of(const nb::dict &options) {
  isowave::RendererOptions result;
  const auto get = reader_of(options);
  get("width", result.largest.width);
  get("height", result.largest.height);
  get("samples", result.largest.samples);
  get("memory_budget", result.memory_budget);
  get("cache_blocks", result.cache_blocks);
  get("with_levels", result.with_levels);
  get("with_bounds", result.with_bounds);
  get("with_time_budget", result.with_time_budget);
  get("with_rays", result.with_rays);
  get("with_bounce", result.with_bounce);
  get("with_surfaces", result.with_surfaces);
  get("with_labels", result.with_labels);
  return result;
}

}  // namespace isowave_python
