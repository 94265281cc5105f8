// isowave._core: volumes and meshes.

#include <nanobind/stl/tuple.h>
#include <algorithm>
#include <array>
#include <tuple>

#include "module.hpp"

namespace isowave_python {

namespace {

/// In the order of isowave::VoxelType.
constexpr std::array kTypeNames = {"uint8", "int8",    "uint16",  "int16",  "uint32",
                                   "int32", "float32", "float64", "uint64", "int64"};

isowave::VoxelType voxel_type(const std::string &name) {
  const auto found = std::ranges::find(kTypeNames, name);
  if (found == kTypeNames.end()) throw Error("voxels of type " + name + " are not supported");
  return static_cast<isowave::VoxelType>(found - kTypeNames.begin());
}

std::string type_name(isowave::VoxelType type) {
  return kTypeNames.at(static_cast<std::size_t>(type));
}

/// The type of an array's voxels, and their places: dims, spacing, origin, direction, is_anatomical
/// as isowave::Grid.
using PyGrid = std::tuple<std::string, Index3, Vector3, Vector3, std::array<Vector3, 3>, bool>;

isowave::Grid grid_of(const PyGrid &grid) {
  const auto &[type, dims, spacing, origin, direction, is_anatomical] = grid;
  return {dims, spacing, origin, direction, is_anatomical};
}

/// Views of the box of a grid.
std::vector<nb::tuple> box_turntable(const PyGrid &grid, std::uint32_t num_views, int side,
                                     const std::optional<Vector3> &up, double zoom,
                                     const std::array<std::uint32_t, 2> &size) {
  std::vector<nb::tuple> result;
  const isowave::Viewpoint from{static_cast<isowave::Side>(side), up, zoom};
  for (const isowave::Camera &camera :
       isowave::box_turntable(grid_of(grid), num_views, from, {size[0], size[1]}))
    result.push_back(camera_tuple(camera));
  return result;
}

nb::tuple fitted(const nb::dict &camera, const PyGrid &grid,
                 const std::array<std::uint32_t, 2> &size) {
  isowave::Camera from;
  isowave::for_each_camera_field(from, reader_of(camera));
  return camera_tuple(isowave::fitted(from, grid_of(grid), {size[0], size[1]}));
}

/// Reports to `progress`, if there is one, and looks for signals.
void report_to(Callbacks &callbacks, const std::optional<nb::callable> &progress,
               isowave::Compression &compression) {
  compression.progress = [&callbacks, &progress](std::string_view what, double done) {
    const bool goes_on = callbacks.run([&] {
      if (progress) call(*progress, std::string(what), done);
    });
    if (!goes_on) throw Stopped();
  };
}

PyVolume compress(const nb::callable &read, const PyGrid &voxels, const nb::dict &options,
                  bool keep, const std::optional<std::filesystem::path> &path,
                  const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::Compression compression = compression_of(options);
  report_to(callbacks, progress, compression);
  const auto read_layers = [&](std::uint32_t z, std::uint32_t num_layers,
                               std::span<std::byte> out) {
    const bool goes_on = callbacks.run([&] {
      const auto layers = nb::cast<nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu>>(
          call(read, z, z + num_layers));
      if (layers.nbytes() != out.size()) {
        throw Error("a source gave " + std::to_string(layers.nbytes()) + " bytes for layers of " +
                    std::to_string(out.size()));
      }
      std::memcpy(out.data(), layers.data(), out.size());
    });
    if (!goes_on) throw Stopped();
  };
  return callbacks.without_gil([&] {
    const isowave::Grid grid = grid_of(voxels);
    const isowave::ReadLayers read_all = read_layers;
    const isowave::VoxelType type = voxel_type(std::get<0>(voxels));
    return PyVolume{path ? isowave::compress_to_file(read_all, type, grid, *path, compression, keep)
                         : isowave::compress(read_all, type, grid, compression, keep)};
  });
}

PyVolume compress_array(const nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu> &array,
                        const PyGrid &voxels, const nb::dict &options,
                        const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::Compression compression = compression_of(options);
  report_to(callbacks, progress, compression);
  const isowave::Grid grid = grid_of(voxels);
  isowave::check_num_voxels(array.size(), grid);
  return callbacks.without_gil([&] {
    return PyVolume{
        isowave::compress(array.data(), voxel_type(std::get<0>(voxels)), grid, compression)};
  });
}

PyVolume open_volume(const std::filesystem::path &path, const nb::dict &options,
                     const std::optional<Index3> &dims, const std::optional<std::string> &type,
                     const std::optional<Vector3> &spacing,
                     const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::Compression compression = compression_of(options);
  report_to(callbacks, progress, compression);
  isowave::RawFile raw{dims, {}, spacing};
  if (type) raw.type = voxel_type(*type);
  return callbacks.without_gil(
      [&] { return PyVolume{isowave::open_volume(path, compression, raw)}; });
}

/// Holds an isowave::Series, which is not thread-safe: the package's calls take turns.
struct PySeries {
  std::shared_ptr<isowave::Series> series;
};

PySeries open_series(const std::vector<std::filesystem::path> &paths, const nb::dict &options,
                     const std::optional<Index3> &dims, const std::optional<std::string> &type,
                     const std::optional<Vector3> &spacing) {
  const isowave::Compression compression = compression_of(options);
  isowave::RawFile raw{dims, {}, spacing};
  if (type) raw.type = voxel_type(*type);
  const WithoutGil no_gil;
  return {std::make_shared<isowave::Series>(paths, compression, raw)};
}

PyVolume open_step(const PySeries &self, std::size_t step) {
  const WithoutGil no_gil;
  return {self.series->open(step)};
}

nb::object decode(const PyVolume &self, std::uint32_t level, const Index3 &begin, const Index3 &end,
                  const Index3 &step) {
  std::vector<float> voxels;
  {
    const WithoutGil no_gil;
    voxels = self.volume->decode(level, {begin, end, step});
  }
  const auto count = [&](std::size_t axis) -> std::size_t {
    return (end.at(axis) - begin.at(axis) - 1) / step.at(axis) + 1;
  };
  return to_numpy<float>(std::move(voxels), {count(2), count(1), count(0)});
}

nb::object sample(const PyVolume &self, std::uint64_t max_voxels) {
  std::vector<float> voxels;
  {
    const WithoutGil no_gil;
    voxels = self.volume->sample(max_voxels);
  }
  const std::size_t count = voxels.size();
  return to_numpy<float>(std::move(voxels), {count});
}

nb::dict extract(const PyVolume &self, const std::string &device, double isovalue,
                 std::uint32_t level, bool normals, bool exact_vertices, bool closed,
                 std::uint64_t largest, double simplify, std::uint64_t memory_budget,
                 const std::optional<nb::callable> &progress) {
  Callbacks callbacks;
  isowave::ExtractOptions options{
      .level = level,
      .with_normals = normals,
      .vertices = exact_vertices ? isowave::VertexPlaces::kExact : isowave::VertexPlaces::kApart,
      .closed = closed,
      .largest = largest,
      .simplify = simplify,
      .memory_budget = memory_budget};
  options.progress = [&](std::string_view what, double done) {
    const bool goes_on = callbacks.run([&] {
      if (progress) call(*progress, std::string(what), done);
    });
    if (!goes_on) throw Stopped();
  };
  isowave::Mesh mesh = callbacks.without_gil([&] {
    if (isowave::draws_on_host(device)) return isowave::extract(self.volume, isovalue, options);
    return isowave::extract(isowave::open_device(device), self.volume, isovalue, options);
  });
  nb::dict result;
  const std::size_t num_vertices = mesh.vertices.size(), num_faces = mesh.triangles.size();
  result["vertices"] = to_numpy<double>(std::move(mesh.vertices), {num_vertices, 3});
  result["faces"] = to_numpy<std::uint32_t>(std::move(mesh.triangles), {num_faces, 3});
  if (normals) result["normals"] = to_numpy<float>(std::move(mesh.normals), {num_vertices, 3});
  result["simplify_error"] = mesh.simplify_error;
  return result;
}

/// values [count][3]
template <class T>
using Rows = nb::ndarray<T, nb::ro, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

template <class T>
std::vector<std::array<T, 3>> to_vector(const Rows<T> &rows) {
  std::vector<std::array<T, 3>> result(rows.shape(0));
  if (!result.empty()) std::memcpy(result.data(), rows.data(), rows.nbytes());
  return result;
}

std::string save_mesh(const Rows<double> &vertices, const Rows<std::uint32_t> &faces,
                      const std::optional<Rows<float>> &normals,
                      const std::filesystem::path &path) {
  const isowave::Mesh mesh{
      .vertices = to_vector(vertices),
      .normals = normals ? to_vector(*normals) : std::vector<std::array<float, 3>>{},
      .triangles = to_vector(faces)};
  const WithoutGil no_gil;
  return isowave::save_mesh(mesh, path);
}

}  // namespace

isowave::Compression compression_of(const nb::dict &options) {
  isowave::Compression result;
  const auto get = reader_of(options);
  get("rate", result.rate);
  get("tolerance", result.tolerance);
  get("tolerance_relative", result.tolerance_relative);
  get("exact", result.exact);
  get("measure_error", result.measure_error);
  get("levels", result.levels);
  get("map_nan", result.map_nan);
  get("no_data", result.no_data);
  get("num_threads", result.num_threads);
  return result;
}

void add_volumes(nb::module_ &m) {
  nb::class_<PyVolume>(m, "Volume")
      .def_prop_ro("dims", [](const PyVolume &v) { return v.volume->grid().dims; })
      .def_prop_ro("spacing", [](const PyVolume &v) { return v.volume->grid().spacing; })
      .def_prop_ro("origin", [](const PyVolume &v) { return v.volume->grid().origin; })
      .def_prop_ro("direction", [](const PyVolume &v) { return v.volume->grid().direction; })
      .def_prop_ro("is_anatomical",
                   [](const PyVolume &v) { return v.volume->grid().is_anatomical; })
      .def_prop_ro("source_type",
                   [](const PyVolume &v) { return type_name(v.volume->source_type()); })
      .def_prop_ro("value_range", [](const PyVolume &v) { return v.volume->value_range(); })
      .def_prop_ro("float32_positions",
                   [](const PyVolume &v) { return v.volume->float32_positions(); })
      .def_prop_ro("notices", [](const PyVolume &v) { return v.volume->notices(); })
      .def(
          "isovalue_notice",
          [](const PyVolume &v, double isovalue) { return v.volume->isovalue_notice(isovalue); },
          "isovalue"_a)
      .def_prop_ro("compression",
                   [](const PyVolume &v) { return std::string(v.volume->compression()); })
      .def_prop_ro("bits_per_voxel", [](const PyVolume &v) { return v.volume->bits_per_voxel(); })
      .def_prop_ro("compressed_bytes",
                   [](const PyVolume &v) { return v.volume->compressed_bytes(); })
      .def_prop_ro("max_voxel_error", [](const PyVolume &v) { return v.volume->max_voxel_error(); })
      .def_prop_ro("errors_are_stated",
                   [](const PyVolume &v) { return v.volume->errors_are_stated(); })
      .def_prop_ro("num_levels", [](const PyVolume &v) { return v.volume->num_levels(); })
      .def(
          "level_dims",
          [](const PyVolume &v, std::uint32_t level) { return v.volume->level_grid(level).dims; },
          "level"_a)
      .def("decode", &decode, "level"_a, "begin"_a, "end"_a, "step"_a)
      .def("sample", &sample, "max_voxels"_a)
      .def(
          "suggested_isovalues", [](const PyVolume &v) { return v.volume->suggested_isovalues(); },
          nb::call_guard<WithoutGil>())
      .def(
          "save",
          [](const PyVolume &v, const std::filesystem::path &path) { v.volume->save(path); },
          "path"_a, nb::call_guard<WithoutGil>())
      .def("extract", &extract, "device"_a, "isovalue"_a, "level"_a, "normals"_a,
           "exact_vertices"_a, "closed"_a, "largest"_a, "simplify"_a, "memory_budget"_a,
           "progress"_a.none());
  m.def("box_turntable", &box_turntable, "grid"_a, "num_views"_a, "side"_a, "up"_a.none(), "zoom"_a,
        "size"_a);
  m.def("fitted", &fitted, "camera"_a, "grid"_a, "size"_a);
  m.def("save_mesh", &save_mesh, "vertices"_a, "faces"_a, "normals"_a.none(), "path"_a);
  m.def("compress", &compress, "read"_a, "voxels"_a, "options"_a, "keep"_a, "path"_a.none(),
        "progress"_a.none());
  m.def("compress_array", &compress_array, "array"_a, "voxels"_a, "options"_a, "progress"_a.none());
  nb::class_<PySeries>(m, "Series")
      .def_prop_ro("size", [](const PySeries &s) { return s.series->size(); })
      .def_prop_ro("notices", [](const PySeries &s) { return s.series->notices(); })
      .def(
          "name", [](const PySeries &s, std::size_t step) { return s.series->name(step); },
          "step"_a)
      .def("open", &open_step, "step"_a);
  m.def("open_series", &open_series, "paths"_a, "options"_a, "dims"_a.none(), "type"_a.none(),
        "spacing"_a.none());
  m.def("open", &open_volume, "path"_a, "options"_a, "dims"_a.none(), "type"_a.none(),
        "spacing"_a.none(), "progress"_a.none());
}

}  // namespace isowave_python
