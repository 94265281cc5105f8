#include "isowave/mesh.hpp"

#include "core/api/convert.hpp"
#include "core/api/guarded.hpp"
#include "core/api/mesh_parts.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/mesh/host_extractor.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

using core::guarded;

// The two enumerations have the same values.
static_assert(static_cast<int>(VertexPlaces::kExact) ==
              static_cast<int>(core::VertexPlaces::kExact));

core::SimplifiedMesh extract_to(const std::shared_ptr<const Volume> &volume, double isovalue,
                                const ExtractOptions &options, core::MeshSink &sink) {
  if (!volume) throw core::Error("extracting needs a volume");
  if (options.cache_blocks != 0)
    throw core::Error("a number of cached blocks is for devices alone: leave out cache_blocks");
  const core::CompressedVolume &level = level_to_extract(*volume, options);
  const float drawn = core::drawn_isovalue(volume->implementation().volume, isovalue);
  const auto places = static_cast<core::VertexPlaces>(options.vertices);
  return core::give_changed(level, drawn, places, changes_of(options), sink,
                            [&](core::MeshSink &to) {
                              core::extract_on_host(level, drawn,
                                                    {.with_normals = options.with_normals,
                                                     .vertices = places,
                                                     .memory_limit = options.memory_budget},
                                                    to, progress_of(options, "extracting"));
                            });
}

}  // namespace

const core::CompressedVolume &level_to_extract(const Volume &volume,
                                               const ExtractOptions &options) {
  const std::vector<const core::CompressedVolume *> levels =
      core::levels_of(volume.implementation().volume, true);
  if (options.level >= levels.size())
    throw core::Error("level {} of a volume that has {}: count from 0", options.level,
                      levels.size());
  return *levels[options.level];
}

core::Progress progress_of(const ExtractOptions &options, std::string_view what) {
  if (!options.progress) return {};
  return [&options, what](std::uint32_t done, std::uint32_t total) {
    options.progress(what, double{1} * done / total);
  };
}

core::MeshChanges changes_of(const ExtractOptions &options) {
  return {options.closed, options.largest, options.simplify};
}

void MeshOfUser::begin(const core::MeshSize &size) {
  mesh.vertices.reserve(size.num_vertices);
  if (size.has_normals) mesh.normals.reserve(size.num_vertices);
  mesh.triangles.reserve(size.num_triangles);
}

void MeshOfUser::add(const core::MeshPart &part) {
  for (const glm::dvec3 &vertex : part.vertices) mesh.vertices.push_back(from_glm(vertex));
  for (const glm::vec3 &normal : part.normals)
    mesh.normals.push_back({normal.x, normal.y, normal.z});
  mesh.triangles.insert(mesh.triangles.end(), part.triangles.begin(), part.triangles.end());
}

Mesh extract(const std::shared_ptr<const Volume> &volume, double isovalue,
             const ExtractOptions &options) {
  return guarded("extracting a surface", [&] {
    return extracted(
        [&](core::MeshSink &sink) { return extract_to(volume, isovalue, options, sink); });
  });
}

std::string extract_to_file(const std::shared_ptr<const Volume> &volume, double isovalue,
                            const std::filesystem::path &path, const ExtractOptions &options) {
  return guarded("extracting a surface", [&] {
    return extracted_to_file(path, options, [&](core::MeshSink &sink) {
      return extract_to(volume, isovalue, options, sink);
    });
  });
}

std::string save_mesh(const Mesh &mesh, const std::filesystem::path &path) {
  return guarded("saving a mesh", [&] {
    if (!mesh.normals.empty() && mesh.normals.size() != mesh.vertices.size())
      throw core::Error("{}: a mesh of {} vertices and {} normals", path.string(),
                        mesh.vertices.size(), mesh.normals.size());
    for (const auto &triangle : mesh.triangles) {
      for (const std::uint32_t vertex : triangle) {
        if (vertex >= mesh.vertices.size())
          throw core::Error("{}: a triangle names vertex {} of {}", path.string(), vertex,
                            mesh.vertices.size());
      }
    }
    std::vector<glm::dvec3> vertices;
    std::vector<glm::vec3> normals;
    vertices.reserve(mesh.vertices.size());
    normals.reserve(mesh.normals.size());
    for (const Vector3 &vertex : mesh.vertices) vertices.push_back(to_glm(vertex));
    for (const auto &[x, y, z] : mesh.normals) normals.emplace_back(x, y, z);
    core::MeshFile file(path);
    file.add({vertices, normals, mesh.triangles});
    file.commit();
    return file.notice();
  });
}

}  // namespace isowave
