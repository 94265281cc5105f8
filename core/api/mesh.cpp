#include "isowave/mesh.hpp"

#include <mutex>

#include "core/api/convert.hpp"
#include "core/api/device_implementation.hpp"
#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/extract/extractor.hpp"
#include "core/extract/mesh_file.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/isovalue.hpp"

namespace isowave {

namespace {

using core::guarded;

// The two enumerations have the same values.
static_assert(static_cast<int>(VertexPlaces::kExact) ==
              static_cast<int>(core::VertexPlaces::kExact));

std::array<float, 3> from_vec3(const glm::vec3 &v) {
  return {v.x, v.y, v.z};
}

/// Fills a mesh of users.
class MeshOfUser : public core::MeshSink {
 public:
  explicit MeshOfUser(Mesh &mesh) : mesh_(mesh) {}
  void begin(const core::MeshSize &size) override {
    mesh_.vertices.reserve(size.num_vertices);
    if (size.has_normals) mesh_.normals.reserve(size.num_vertices);
    mesh_.triangles.reserve(size.num_triangles);
  }
  void add(const core::MeshPart &part) override {
    for (const glm::dvec3 &vertex : part.vertices) mesh_.vertices.push_back(from_glm(vertex));
    for (const glm::vec3 &normal : part.normals) mesh_.normals.push_back(from_vec3(normal));
    mesh_.triangles.insert(mesh_.triangles.end(), part.triangles.begin(), part.triangles.end());
  }

 private:
  Mesh &mesh_;
};

core::Progress progress_of(const ExtractOptions &options, std::string_view what) {
  if (!options.progress) return {};
  return [&options, what](std::uint32_t done, std::uint32_t total) {
    options.progress(what, double{1} * done / total);
  };
}

void extract_to(const std::shared_ptr<Device> &device, const std::shared_ptr<const Volume> &volume,
                double isovalue, const ExtractOptions &options, core::MeshSink &sink) {
  if (!device || !volume) throw core::Error("extracting needs a device and a volume");
  const std::vector<const core::CompressedVolume *> levels =
      core::levels_of(volume->implementation().volume, true);
  if (options.level >= levels.size())
    throw core::Error("level {} of a volume that has {}: count from 0", options.level,
                      levels.size());
  const std::lock_guard lock(device->implementation().mutex);
  const std::function<void()> before_kernel = [&options] {
    if (options.progress) options.progress("extracting", 0);
  };
  const KernelWatch watch(device->implementation().device, before_kernel);
  core::Extractor extractor(device->implementation().device, *levels[options.level],
                            {.with_normals = options.with_normals,
                             .vertices = static_cast<core::VertexPlaces>(options.vertices),
                             .memory_budget = options.memory_budget,
                             .cache_slots = options.cache_blocks});
  extractor.extract(core::drawn_isovalue(*levels[0], isovalue), sink,
                    progress_of(options, "extracting"));
}

}  // namespace

Mesh extract(const std::shared_ptr<Device> &device, const std::shared_ptr<const Volume> &volume,
             double isovalue, const ExtractOptions &options) {
  return guarded("extracting a surface", [&] {
    Mesh mesh;
    MeshOfUser sink(mesh);
    extract_to(device, volume, isovalue, options, sink);
    return mesh;
  });
}

std::string extract_to_file(const std::shared_ptr<Device> &device,
                            const std::shared_ptr<const Volume> &volume, double isovalue,
                            const std::filesystem::path &path, const ExtractOptions &options) {
  return guarded("extracting a surface", [&] {
    core::MeshFile file(path);
    extract_to(device, volume, isovalue, options, file);
    file.commit(progress_of(options, "writing"));
    return file.notice();
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
