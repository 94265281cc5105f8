#include "isowave/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <type_traits>

#include "core/api/convert.hpp"
#include "core/api/frame_parts.hpp"
#include "core/api/guarded.hpp"
#include "core/base/error.hpp"
#include "core/base/utf8.hpp"
#include "core/frame/ambient_rays.hpp"
#include "core/frame/colors.hpp"
#include "core/frame/surfaces.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/file_name.hpp"
#include "core/io/json_file.hpp"
#include "core/io/raw_reader.hpp"
#include "core/sources/load_volume.hpp"

namespace isowave {

namespace {

using nlohmann::json;
using nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr const char *kVersionKey = "isowave_scene";
constexpr int kVersion = 1;
constexpr std::uint64_t kMostBytes = 1u << 20;
constexpr const char *kDrawnVolume = "volume";  ///< Scene::field

// Reading. where: the value's place in the text, "surfaces[1].opacity".

const char *place_or_scene(const std::string &where) {
  return where.empty() ? "the scene" : where.c_str();
}

std::string member_place(const std::string &where, const char *key) {
  return where.empty() ? key : fmt::format("{}.{}", where, key);
}

template <class Number>
void read_number(const json &value, const std::string &where, Number &out) {
  if (!value.is_number()) throw core::Error("{} must be a number", where);
  out = static_cast<Number>(value.get<double>());
  if (!std::isfinite(out)) throw core::Error("{} is out of range", where);
}

void read_value(const json &value, const std::string &where, float &out) {
  read_number(value, where, out);
}
void read_value(const json &value, const std::string &where, double &out) {
  read_number(value, where, out);
}
void read_value(const json &value, const std::string &where, std::uint32_t &out) {
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > 0xFFFFFFFFu)
    throw core::Error("{} must be a whole number from 0 on", where);
  out = value.get<std::uint32_t>();
}
void read_value(const json &value, const std::string &where, bool &out) {
  if (!value.is_boolean()) throw core::Error("{} must be true or false", where);
  out = value.get<bool>();
}
void read_value(const json &value, const std::string &where, std::string &out) {
  if (!value.is_string()) throw core::Error("{} must be a text", where);
  out = value.get<std::string>();
}
void read_value(const json &value, const std::string &where, fs::path &out) {
  std::string text;
  read_value(value, where, text);
  out = text;
}

template <class Number>
void read_three(const json &value, const std::string &where, std::array<Number, 3> &out,
                const char *form) {
  if (!value.is_array() || value.size() != 3) throw core::Error("{} must be {}", where, form);
  for (std::size_t i = 0; i < 3; ++i) read_number(value[i], where, out[i]);
}
void read_value(const json &value, const std::string &where, Vector3 &out) {
  read_three(value, where, out, "[x, y, z]");
}
void read_value(const json &value, const std::string &where, std::array<float, 3> &color) {
  if (!value.is_string()) {
    read_three(value, where, color, "a colour: \"#RRGGBB\", a name, or [red, green, blue]");
    for (const float part : color) {
      if (!(part >= 0 && part <= 1))
        throw core::Error("{}: a colour of {} is out of range: give 0 to 1", where, part);
    }
    return;
  }
  try {
    color = from_glm(core::parse_color(value.get<std::string>()));
  } catch (const core::Error &error) {
    throw core::Error("{}: {}", where, error.what());
  }
}

template <class T>
concept HasFields =
    std::is_same_v<T, Annotations> || std::is_same_v<T, Camera> || std::is_same_v<T, ClipPlane> ||
    std::is_same_v<T, Slice> || std::is_same_v<T, Surface> || std::is_same_v<T, Scene>;

/// Calls visit(key, field) for each field.
template <class Object, class Visit>
void visit_fields(Object &object, const Visit &visit) {
  using Fields = std::remove_const_t<Object>;
  if constexpr (std::is_same_v<Fields, Annotations>) for_each_annotations_field(object, visit);
  if constexpr (std::is_same_v<Fields, Camera>) for_each_camera_field(object, visit);
  if constexpr (std::is_same_v<Fields, ClipPlane>) for_each_plane_field(object, visit);
  if constexpr (std::is_same_v<Fields, Surface>) for_each_surface_field(object, visit);
  if constexpr (std::is_same_v<Fields, Slice>) for_each_slice_field(object, visit);
  if constexpr (std::is_same_v<Fields, Scene>) for_each_scene_field(object, visit);
}

/// Fields without a default.
template <class Object>
bool is_needed(std::string_view key) {
  if constexpr (std::is_same_v<Object, Annotations>) return false;
  if constexpr (std::is_same_v<Object, Camera>) return key == "eye" || key == "at";
  if constexpr (std::is_same_v<Object, ClipPlane>) return key == "normal";
  if constexpr (std::is_same_v<Object, Slice>) return key == "normal";
  if constexpr (std::is_same_v<Object, Surface>) return key == "isovalue";
  if constexpr (std::is_same_v<Object, Scene>) return key == "surfaces";
}
/// Whether it is a surface of labels, which needs no isovalue.
template <class Object>
bool has_labels(const json &value) {
  if (!std::is_same_v<Object, Surface>) return false;
  const auto labels = value.find("labels");
  return labels != value.end() && !labels->empty();
}

template <HasFields Object>
void read_value(const json &value, const std::string &where, Object &object);

template <class T>
void read_value(const json &value, const std::string &where, std::optional<T> &out) {
  read_value(value, where, out.emplace());
}

template <class T>
void read_value(const json &value, const std::string &where, std::vector<T> &list) {
  if (!value.is_array()) throw core::Error("{} must be a list", where);
  list.resize(value.size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    if constexpr (std::is_same_v<T, Surface>) list[i].color = surface_color(i);
    read_value(value[i], fmt::format("{}[{}]", where, i), list[i]);
  }
}

template <HasFields Object>
void read_value(const json &value, const std::string &where, Object &object) {
  if (!value.is_object()) throw core::Error("{} must be an object {{...}}", place_or_scene(where));
  std::set<std::string> known;
  if constexpr (std::is_same_v<Object, Scene>) known.insert(kVersionKey);
  visit_fields(object, [&](const char *key, auto &field) {
    known.insert(key);
    const std::string place = member_place(where, key);
    if (const auto found = value.find(key); found != value.end()) {
      read_value(*found, place, field);
    } else if (is_needed<Object>(key) && !has_labels<Object>(value)) {
      throw core::Error("{} is missing", place);
    }
  });
  for (const auto &[key, unused] : value.items()) {
    if (!known.contains(key)) throw core::Error("{} has no \"{}\"", place_or_scene(where), key);
  }
}

// Writing.

ordered_json value_of(double value) {
  if (!std::isfinite(value)) throw core::Error("a scene of {} cannot be written", value);
  return value;
}
ordered_json value_of(float value) {  // in as few digits as float needs
  return value_of(std::stod(fmt::format("{}", value)));
}
ordered_json value_of(std::uint32_t value) {
  return value;
}
ordered_json value_of(bool value) {
  return value;
}
ordered_json value_of(const std::string &text) {
  return text;
}
ordered_json value_of(const fs::path &path) {
  return path.generic_string();
}
ordered_json value_of(const Vector3 &v) {
  return {value_of(v[0]), value_of(v[1]), value_of(v[2])};
}
ordered_json value_of(const std::array<float, 3> &color) {
  std::array<int, 3> bytes{};
  bool is_exact = true;
  for (std::size_t i = 0; i < 3; ++i) {
    bytes[i] = static_cast<int>(std::lround(255 * color[i]));
    is_exact &= color[i] == static_cast<float>(bytes[i]) / 255.0f;
  }
  if (is_exact) return fmt::format("#{:02x}{:02x}{:02x}", bytes[0], bytes[1], bytes[2]);
  return {value_of(color[0]), value_of(color[1]), value_of(color[2])};
}

template <HasFields Object>
ordered_json value_of(const Object &object);

template <class T>
ordered_json value_of(const std::optional<T> &value) {
  return value ? value_of(*value) : ordered_json();
}
template <class T>
ordered_json value_of(const std::vector<T> &list) {
  ordered_json result = ordered_json::array();
  for (const T &value : list) result.push_back(value_of(value));
  return result;
}

/// All fields, or null for those that there are not.
template <class Object>
ordered_json all_fields(const Object &object) {
  ordered_json result = ordered_json::object();
  visit_fields(object, [&](const char *key, const auto &field) { result[key] = value_of(field); });
  return result;
}

template <HasFields Object>
ordered_json value_of(const Object &object) {
  const ordered_json defaults = all_fields(Object{});
  ordered_json result = ordered_json::object();
  const ordered_json all = all_fields(object);
  for (const auto &[key, value] : all.items()) {
    // A surface's default colour depends on its place. If it has labels, it has no isovalue.
    const bool is_always =
        key == "isovalue" ? all["labels"].empty() : is_needed<Object>(key) || key == "color";
    if (is_always || value != defaults[key]) result[key] = value;
  }
  return result;
}

/// A text with a line for each field, but lists of numbers in one.
std::string text_of_json(const ordered_json &value, const std::string &indent) {
  const auto is_nested = [](const ordered_json &element) { return element.is_structured(); };
  if (!value.is_object() && !std::ranges::any_of(value, is_nested)) return value.dump();
  std::string text;
  for (const auto &[key, element] : value.items()) {
    text += text.empty() ? "" : ",";
    text += "\n  " + indent + (value.is_object() ? fmt::format("\"{}\": ", key) : "");
    text += text_of_json(element, indent + "  ");
  }
  text += "\n" + indent;
  return value.is_object() ? "{" + text + "}" : "[" + text + "]";
}

/// Throws  core::Error: what the scene's annotations cannot be
void check_annotations(const Scene &scene) {
  if (!scene.annotations) return;
  const Appearance &appearance = scene.appearance;
  if (scene.annotations->color_bar && appearance.color_map.empty() &&
      appearance.color_table.empty() && scene.slices.empty())
    throw core::Error("annotations.color_bar: there is no colour map, and no slice");
  const std::size_t letters = core::count_letters(core::printable_utf8(scene.annotations->units));
  if (letters > kMostUnits)
    throw core::Error("annotations.units: {} letters are too many: give at most {}", letters,
                      kMostUnits);
}

/// Throws  core::Error: a part of a file that is not named
void check_parts(const Scene &scene) {
  const auto refuse = [](const char *name, const char *file, const std::string &part) {
    if (!part.empty()) throw core::Error("{}: the scene names no file of the {}", name, file);
  };
  if (scene.volume.empty()) {
    refuse("dataset", "volume", scene.dataset);
    refuse("index", "volume", scene.index);
  }
  if (scene.field.empty() || scene.field == kDrawnVolume) {
    refuse("field_dataset", "field", scene.field_dataset);
    refuse("field_index", "field", scene.field_index);
  }
}

/// Throws  core::Error: what files, surfaces, planes, camera and annotations cannot be
void check(const Scene &scene) {
  if (scene.surfaces.empty()) throw core::Error("surfaces: give at least one");
  check_parts(scene);
  std::vector<core::SurfaceStyle> styles;
  for (const Surface &surface : scene.surfaces) {
    styles.push_back(core_style(surface));
    styles.back().isovalue = static_cast<float>(surface.isovalue);
  }
  core::check_surfaces(styles, core_slices(scene.slices, scene.appearance, {0, 1}));
  core::check_clip(core_clip(scene.clip, scene.caps));
  if (scene.appearance.color_low.has_value() != scene.appearance.color_high.has_value())
    throw core::Error("color_low and color_high: give both, or none");
  if (scene.appearance.slice_low.has_value() != scene.appearance.slice_high.has_value())
    throw core::Error("slice_low and slice_high: give both, or none");
  core::VolumeInfo any_volume;
  any_volume.dims = {2, 2, 2};
  core::FrameRequest request;
  request.light = core_appearance(scene.appearance, any_volume);  // or throws
  request.shadow_rays = scene.appearance.shadow_rays;
  request.bounce_rays = scene.appearance.bounce_rays;
  request.light_angle = scene.appearance.light_angle;
  core::check_shadow_rays(request);
  if (scene.camera) core::check_camera(core_camera(*scene.camera), "camera");
  check_annotations(scene);
}

Scene scene_from(const json &value) {
  if (!value.is_object()) throw core::Error("no scene: it must be an object {{...}}");
  const auto version = value.find(kVersionKey);
  if (version == value.end()) throw core::Error("no scene: \"{}\" is missing", kVersionKey);
  if (*version != kVersion)
    throw core::Error("a scene of version {} cannot be read: this isowave reads {}",
                      version->dump().substr(0, 60), kVersion);
  Scene scene;
  read_value(value, "", scene);
  check(scene);
  return scene;
}

std::string text_of_scene(const Scene &scene) {
  check(scene);
  ordered_json document = {{kVersionKey, kVersion}};
  document.update(value_of(scene));
  return text_of_json(document, "") + "\n";
}

/// prefix: of the names of Scene's fields
RawFile part_of_file(const std::string &prefix, const std::string &dataset,
                     const std::string &index) {
  if (!dataset.empty())
    throw core::Error(
        "{}dataset {}: isowave's Python package reads files of several arrays: pip install "
        "'isowave[files]'",
        prefix, dataset);
  return {.step = core::parse_index(prefix + "index", index)};
}

bool is_relative_file(const fs::path &volume) {
  return !volume.empty() && volume.is_relative() && !volume.string().starts_with(core::kGenerate);
}

/// Replaces relative paths of files by change(path).
template <class Change>
void change_relative_files(Scene &scene, const Change &change) {
  if (is_relative_file(scene.volume)) scene.volume = change(scene.volume);
  if (is_relative_file(scene.field) && scene.field != kDrawnVolume) {
    scene.field = change(scene.field);
    if (scene.field == kDrawnVolume) scene.field = "." / scene.field;  // a file of that name
  }
}

}  // namespace

Scene parse_scene(std::string_view text) {
  return core::guarded("reading a scene",
                       [&] { return scene_from(core::parse_json(text, "the scene", "scene")); });
}

std::string scene_text(const Scene &scene) {
  return core::guarded("writing a scene", [&] { return text_of_scene(scene); });
}

Scene read_scene(const fs::path &path) {
  return core::guarded("reading a scene", [&] {
    const json value = core::read_json(path, "scene file", kMostBytes);
    try {
      Scene scene = scene_from(value);
      change_relative_files(scene, [&](const fs::path &file) {
        return path.has_parent_path() ? (path.parent_path() / file).lexically_normal() : file;
      });
      return scene;
    } catch (const core::Error &error) {
      throw core::Error("{}: {}", path.string(), error.what());
    }
  });
}

void write_scene(const Scene &scene, const fs::path &path) {
  core::guarded("writing a scene", [&] {
    core::check_json_name(path);
    Scene moved = scene;
    change_relative_files(moved, [&](const fs::path &file) {
      return fs::proximate(fs::absolute(file), fs::absolute(path).parent_path());
    });
    core::AtomicFile file(path);
    file.write(text_of_scene(moved));
    file.commit();
  });
}

RawFile scene_volume(const Scene &scene) {
  return core::guarded("reading a scene",
                       [&] { return part_of_file("", scene.dataset, scene.index); });
}

RawFile scene_field(const Scene &scene) {
  return core::guarded("reading a scene", [&] {
    return part_of_file("field_", scene.field_dataset, scene.field_index);
  });
}

FrameRequest scene_request(const Scene &scene) {
  FrameRequest request;
  if (scene.camera) request.camera = *scene.camera;
  request.appearance = scene.appearance;
  request.clip = scene.clip;
  request.caps = scene.caps;
  request.slices = scene.slices;
  if (scene.surfaces.empty()) return request;
  request.isovalue = scene.surfaces.front().isovalue;
  const Surface &first = scene.surfaces.front();
  if (scene.surfaces.size() == 1 && first.opacity == 1 && first.clipped && first.mapped &&
      first.labels.empty()) {
    request.appearance.surface = first.color;
  } else {
    request.surfaces = scene.surfaces;
  }
  return request;
}

Scene scene_of(const FrameRequest &request) {
  Scene scene;
  scene.camera = request.camera;
  scene.surfaces = request.surfaces;
  if (scene.surfaces.empty())
    scene.surfaces = {{.isovalue = request.isovalue, .color = request.appearance.surface}};
  scene.slices = request.slices;
  scene.clip = request.clip;
  scene.caps = request.caps;
  scene.appearance = request.appearance;
  scene.appearance.surface = Appearance{}.surface;
  return scene;
}

}  // namespace isowave
