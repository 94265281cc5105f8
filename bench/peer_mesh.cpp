// The peer: VTK's Flying Edges on the decoded volume, Embree on its triangles.

#include <SMP/Common/vtkSMPToolsAPI.h>
#include <embree3/rtcore.h>
#include <malloc.h>
#include <tbb/blocked_range.h>
#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "bench/frame_measure.hpp"
#include "bench/gpu_peer/picture.h"
#include "bench/peer_sides.hpp"
#include "core/base/error.hpp"
#include "core/frame/appearance.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core::bench {

namespace {

/// The pixel's ray (core/view/README.md).
struct PixelRays {
  PixelRays(const Camera &camera, ImageSize size) : eye(camera.eye) {
    const glm::dvec3 fwd = glm::normalize(camera.at - camera.eye);
    const glm::dvec3 side = glm::normalize(glm::cross(fwd, camera.up));
    const double scale = std::tan(glm::radians(camera.fovy_deg) / 2) / size.height;
    const glm::dvec3 top = top_of(camera);
    right = side * (2 * scale);
    down = top * (-2 * scale);
    first = fwd + side * ((1.0 - size.width) * scale) + top * ((size.height - 1.0) * scale);
  }
  /// Towards the picture's upper edge, of length 1.
  static glm::dvec3 top_of(const Camera &camera) {
    const glm::dvec3 fwd = glm::normalize(camera.at - camera.eye);
    return glm::cross(glm::normalize(glm::cross(fwd, camera.up)), fwd);
  }
  glm::vec3 direction(std::uint32_t x, std::uint32_t y) const {
    return glm::normalize(first + right * float(x) + down * float(y));
  }
  glm::vec3 eye, first, right, down;
};

/// Packets of Embree: their type, shape and call.
struct Packet8 {
  using RayHit = RTCRayHit8;
  static constexpr std::uint32_t kWidth = 4, kHeight = 2;
  static void intersect(const int *valid, RTCScene scene, RTCIntersectContext *context,
                        RayHit *rays) {
    rtcIntersect8(valid, scene, context, rays);
  }
};
struct Packet16 {
  using RayHit = RTCRayHit16;
  static constexpr std::uint32_t kWidth = 4, kHeight = 4;
  static void intersect(const int *valid, RTCScene scene, RTCIntersectContext *context,
                        RayHit *rays) {
    rtcIntersect16(valid, scene, context, rays);
  }
};

/// Device and scene of one mesh.
class MeshTree {
 public:
  /// Copies points and indices (VTK's are of 64 bits, Embree's of 32) and builds: all of it is
  /// build time.
  MeshTree(RTCDevice device, vtkPolyData *mesh, RTCBuildQuality quality)
      : scene_(rtcNewScene(device)) {
    rtcSetSceneBuildQuality(scene_, quality);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetGeometryBuildQuality(geometry, quality);
    const auto *points = vtkFloatArray::SafeDownCast(mesh->GetPoints()->GetData());
    vtkCellArray *triangles = mesh->GetPolys();
    if (points == nullptr || !triangles->IsStorage64Bit())
      throw Error("VTK gives a mesh of other types");
    const auto num_points = static_cast<std::size_t>(points->GetNumberOfTuples());
    const auto num_triangles = static_cast<std::size_t>(triangles->GetNumberOfCells());
    auto *vertices = static_cast<float *>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), num_points));
    auto *indices = static_cast<std::uint32_t *>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(std::uint32_t), num_triangles));
    copy(const_cast<vtkFloatArray *>(points)->GetPointer(0), 3 * num_points, vertices);
    copy(triangles->GetConnectivityArray64()->GetPointer(0), 3 * num_triangles, indices);
    if (vtkDataArray *normals = mesh->GetPointData()->GetNormals(); normals != nullptr) {
      normals_ = vtkFloatArray::SafeDownCast(normals)->GetPointer(0);
      indices_ = indices;
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) throw Error("Embree could not build its tree");
  }
  ~MeshTree() {
    if (scene_ != nullptr) rtcReleaseScene(scene_);
  }
  MeshTree(MeshTree &&other) noexcept
      : scene_(std::exchange(other.scene_, nullptr)),
        normals_(other.normals_),
        indices_(other.indices_) {}
  MeshTree(const MeshTree &) = delete;
  MeshTree &operator=(const MeshTree &) = delete;

  RTCScene scene() const { return scene_; }
  /// The normals of a triangle's vertices, interpolated; not of length 1. The mesh must have
  /// normals.
  glm::vec3 normal_at(std::uint32_t triangle, float u, float v) const {
    const std::uint32_t *vertices = indices_ + 3 * std::size_t{triangle};
    return (1 - u - v) * normal_of(vertices[0]) + u * normal_of(vertices[1]) +
           v * normal_of(vertices[2]);
  }

 private:
  template <class From, class To>
  static void copy(const From *from, std::size_t count, To *to) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1u << 16), [=](const auto &range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) to[i] = static_cast<To>(from[i]);
    });
  }

  glm::vec3 normal_of(std::uint32_t vertex) const {
    const float *normal = normals_ + 3 * std::size_t{vertex};
    return {normal[0], normal[1], normal[2]};
  }

  RTCScene scene_;
  const float *normals_ = nullptr;          ///< of vertices: the mesh's own
  const std::uint32_t *indices_ = nullptr;  ///< of triangles: the scene's
};

template <class RayHit>
glm::vec3 direction_of(const RayHit &rays, std::uint32_t i) {
  return {rays.ray.dir_x[i], rays.ray.dir_y[i], rays.ray.dir_z[i]};
}

/// A picture [height][width][3] of the isosurface.
struct Picture {
  ImageSize size;
  std::vector<std::uint8_t> rgb = std::vector<std::uint8_t>(3 * size.num_pixels());

  std::uint8_t *pixel(std::uint32_t x, std::uint32_t y) {
    return rgb.data() + 3 * (std::size_t{size.width} * y + x);
  }
};

/// Lights triangles from the eye.
struct FlatShading {
  FlatShading(const MeshTree &, const Camera &) {}

  template <class RayHit>
  void shade(const RayHit &rays, std::uint32_t i, std::uint8_t *rgb) const {
    constexpr std::array<float, 3> kSurface = {240, 210, 160}, kBackground = {26, 26, 33};
    float light = 1;
    const bool is_hit = rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    if (is_hit) {
      const glm::vec3 normal(rays.hit.Ng_x[i], rays.hit.Ng_y[i], rays.hit.Ng_z[i]);
      light = std::abs(glm::dot(glm::normalize(normal), direction_of(rays, i)));
    }
    for (std::size_t c = 0; c < 3; ++c)
      rgb[c] = static_cast<std::uint8_t>(is_hit ? light * kSurface[c] : kBackground[c]);
  }
};

/// Shades as isowave does, by the normals of a triangle's vertices, interpolated at the hit.
class SmoothShading {
 public:
  SmoothShading(const MeshTree &tree, const Camera &camera)
      : tree_(tree), params_(make_shade_params({}, Appearance{})) {
    const glm::vec3 up = PixelRays::top_of(camera);  // all in world space: make_shade_params({})
    view_.up_x = up.x;
    view_.up_y = up.y;
    view_.up_z = up.z;
  }

  template <class RayHit>
  void shade(const RayHit &rays, std::uint32_t i, std::uint8_t *rgb) const {
    const glm::vec3 direction = direction_of(rays, i);
    const WalkRay ray{{0, 0, 0}, {direction.x, direction.y, direction.z}};
    GridHit hit{std::numeric_limits<float>::infinity(), 0, 0, 0};
    if (rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
      const glm::vec3 normal = tree_.normal_at(rays.hit.primID[i], rays.hit.u[i], rays.hit.v[i]);
      hit = {rays.ray.tfar[i], normal.x, normal.y, normal.z};
    }
    shade_hit(view_, params_, ray, hit, rgb);
  }

 private:
  const MeshTree &tree_;
  ShadeParams params_;
  View view_{};
};

/// Traces one packet whose first pixel is (x0,y0), and shades it; returns its hits.
template <class Packet, class Shading>
std::uint64_t trace_packet(const MeshTree &tree, const PixelRays &pixels, const Shading &shading,
                           Picture &picture, std::uint32_t x0, std::uint32_t y0) {
  const ImageSize size = picture.size;
  constexpr std::uint32_t kSize = Packet::kWidth * Packet::kHeight;
  alignas(64) std::array<int, kSize> valid;
  alignas(64) typename Packet::RayHit rays;
  for (std::uint32_t i = 0; i < kSize; ++i) {
    const std::uint32_t x = x0 + i % Packet::kWidth, y = y0 + i / Packet::kWidth;
    valid[i] = x < size.width && y < size.height ? -1 : 0;
    const glm::vec3 direction = pixels.direction(x, y);
    rays.ray.org_x[i] = pixels.eye.x;
    rays.ray.org_y[i] = pixels.eye.y;
    rays.ray.org_z[i] = pixels.eye.z;
    rays.ray.dir_x[i] = direction.x;
    rays.ray.dir_y[i] = direction.y;
    rays.ray.dir_z[i] = direction.z;
    rays.ray.tnear[i] = rays.ray.time[i] = 0.0f;
    rays.ray.tfar[i] = std::numeric_limits<float>::infinity();
    rays.ray.mask[i] = ~0u;
    rays.ray.flags[i] = 0;
    rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  Packet::intersect(valid.data(), tree.scene(), &context, &rays);
  std::uint64_t hits = 0;
  for (std::uint32_t i = 0; i < kSize; ++i) {
    if (!valid[i]) continue;
    hits += rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    shading.shade(rays, i, picture.pixel(x0 + i % Packet::kWidth, y0 + i / Packet::kWidth));
  }
  return hits;
}

/// Every pixel's ray, tiles of them on all processors. Returns the hits.
template <class Packet, class Shading>
std::uint64_t trace_packets(const MeshTree &tree, const Camera &camera, Picture &picture) {
  const ImageSize size = picture.size;
  const PixelRays pixels(camera, size);
  const Shading shading(tree, camera);
  const std::uint32_t rows = (size.height + Packet::kHeight - 1) / Packet::kHeight;
  const std::uint32_t columns = (size.width + Packet::kWidth - 1) / Packet::kWidth;
  using Range = tbb::blocked_range2d<std::uint32_t>;
  return tbb::parallel_reduce(
      Range(0, rows, 8, 0, columns, 8), std::uint64_t{0},
      [&](const Range &range, std::uint64_t hits) {
        for (std::uint32_t row = range.rows().begin(); row < range.rows().end(); ++row) {
          for (std::uint32_t column = range.cols().begin(); column < range.cols().end(); ++column) {
            hits += trace_packet<Packet>(tree, pixels, shading, picture, column * Packet::kWidth,
                                         row * Packet::kHeight);
          }
        }
        return hits;
      },
      std::plus<>());
}

class MeshSide : public PeerSide {
 public:
  MeshSide(CompressedVolume volume, const PeerFrames &frames, RTCBuildQuality quality)
      : is_smooth_(frames.normals == Normals::kSmooth),
        picture_{frames.size},
        quality_(quality),
        device_(rtcNewDevice(nullptr)) {
    // Memory that was freed stays ours: to fetch it from the system again costs as much as the work
    // itself.
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_TRIM_THRESHOLD, -1);
    if (device_ == nullptr) throw Error("Embree cannot be opened");
    const glm::ivec3 dims(volume.info.dims);
    image_->SetDimensions(dims.x, dims.y, dims.z);
    image_->SetOrigin(volume.info.origin.x, volume.info.origin.y, volume.info.origin.z);
    image_->SetSpacing(volume.info.spacing.x, volume.info.spacing.y, volume.info.spacing.z);
    const glm::dmat3 &direction = volume.info.direction;  // GLM's columns; VTK takes rows
    image_->SetDirectionMatrix(direction[0][0], direction[1][0], direction[2][0], direction[0][1],
                               direction[1][1], direction[2][1], direction[0][2], direction[1][2],
                               direction[2][2]);
    voxels_ = decode_with_libzfp(volume);
    vtkNew<vtkFloatArray> scalars;
    scalars->SetArray(voxels_.data(), static_cast<vtkIdType>(voxels_.size()), 1);
    image_->GetPointData()->SetScalars(scalars);
    vtk::detail::smp::vtkSMPToolsAPI::GetInstance().SetBackend("TBB");
    contour_->SetInputData(image_);
    contour_->SetComputeNormals(is_smooth_);
    contour_->ComputeGradientsOff();
    contour_->ComputeScalarsOff();
  }
  ~MeshSide() override { rtcReleaseDevice(device_); }
  MeshSide(const MeshSide &) = delete;
  MeshSide &operator=(const MeshSide &) = delete;

  Measured draw(float isovalue, const Camera &camera, Image8 *picture) override {
    Measured measured;
    const MeshTree tree = make_tree(isovalue, camera, measured);
    Stopwatch watch;
    measured["hit_count"] = double(trace(tree, camera));
    watch.lap(measured, "trace");
    trace(tree, camera);
    watch.lap(measured, "warm");
    if (picture != nullptr) *picture = {picture_.size.width, picture_.size.height, 3, picture_.rgb};
    watch = {};
    trace(tree, turned(camera));
    watch.lap(measured, "next");
    for (const std::string unit : {"_ms", "_cpu_ms"}) {
      measured["new" + unit] =
          measured["extract" + unit] + measured["build" + unit] + measured["trace" + unit];
    }
    measured["triangle_count"] = static_cast<double>(contour_->GetOutput()->GetNumberOfPolys());
    measured["packet_count"] = packets_of_16_ ? 16 : 8;
    return measured;
  }

  std::vector<double> draw_views(float isovalue, const std::vector<Camera> &cameras) override {
    Measured measured;
    const MeshTree tree = make_tree(isovalue, cameras.at(0), measured);
    std::vector<double> times;
    for (const Camera &camera : cameras) {
      Stopwatch watch;
      trace(tree, camera);
      watch.lap(measured, "view");
      times.push_back(measured.at("view_ms"));
    }
    times.at(0) += measured.at("extract_ms") + measured.at("build_ms");
    return times;
  }

 private:
  /// The tree over the triangles of an isovalue: extract_ms and build_ms.
  MeshTree make_tree(float isovalue, const Camera &camera, Measured &measured) {
    Stopwatch watch;
    contour_->SetValue(0, isovalue);
    contour_->Modified();  // extracts again even if the isovalue is the last one's
    contour_->Update();
    watch.lap(measured, "extract");
    // Built twice, and the second counts. Embree takes the tree's memory from the system each time;
    // where that is a virtual machine which gave it back to its host between two frames, to fetch
    // it costs more than the build.
    { const MeshTree first(device_, contour_->GetOutput(), quality_); }
    watch = {};
    MeshTree tree(device_, contour_->GetOutput(), quality_);
    watch.lap(measured, "build");
    if (!packets_chosen_) choose_packets(tree, camera);
    return tree;
  }

  std::uint64_t trace(const MeshTree &tree, const Camera &camera) {
    return is_smooth_ ? trace_by<SmoothShading>(tree, camera) : trace_by<FlatShading>(tree, camera);
  }
  template <class Shading>
  std::uint64_t trace_by(const MeshTree &tree, const Camera &camera) {
    return packets_of_16_ ? trace_packets<Packet16, Shading>(tree, camera, picture_)
                          : trace_packets<Packet8, Shading>(tree, camera, picture_);
  }

  /// Chooses the packets that are faster here, by the best of three traces of the first mesh, which
  /// is not measured.
  void choose_packets(const MeshTree &tree, const Camera &camera) {
    std::array<double, 2> best;
    best.fill(std::numeric_limits<double>::infinity());
    for (int i = 0; i < 6; ++i) {
      Measured measured;
      packets_of_16_ = i % 2 == 1;
      Stopwatch watch;
      trace(tree, camera);
      watch.lap(measured, "trace");
      best[i % 2] = std::min(best[i % 2], measured.at("trace_ms"));
    }
    packets_of_16_ = best[1] < best[0];
    packets_chosen_ = true;
  }

  bool is_smooth_;
  Picture picture_;
  RTCBuildQuality quality_;
  RTCDevice device_;
  std::vector<float> voxels_;
  vtkNew<vtkImageData> image_;
  vtkNew<vtkFlyingEdges3D> contour_;
  bool packets_chosen_ = false, packets_of_16_ = false;
};

}  // namespace

std::unique_ptr<PeerSide> make_mesh_side(CompressedVolume volume, const PeerFrames &frames,
                                         bool medium_quality) {
  return std::make_unique<MeshSide>(
      std::move(volume), frames, medium_quality ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_LOW);
}

}  // namespace isowave::core::bench
