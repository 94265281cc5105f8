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
#include "bench/peer_sides.hpp"
#include "core/base/error.hpp"
#include "core/volume/volume.hpp"

namespace isowave::core::bench {

namespace {

/// The pixel's ray (core/view/README.md).
struct PixelRays {
  PixelRays(const Camera &camera, ImageSize size) : eye(camera.eye) {
    const glm::dvec3 fwd = glm::normalize(camera.at - camera.eye);
    const glm::dvec3 side = glm::normalize(glm::cross(fwd, camera.up));
    const double scale = std::tan(glm::radians(camera.fovy_deg) / 2) / size.height;
    const glm::dvec3 top = glm::cross(side, fwd);
    right = side * (2 * scale);
    down = top * (-2 * scale);
    first = fwd + side * ((1.0 - size.width) * scale) + top * ((size.height - 1.0) * scale);
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

/// A picture [height][width][3] of the isosurface's color, lit from the eye.
struct Picture {
  ImageSize size;
  std::vector<std::uint8_t> rgb = std::vector<std::uint8_t>(3 * size.num_pixels());

  /// light: 0 to 1; negative: the background.
  void set(std::uint32_t x, std::uint32_t y, float light) {
    constexpr std::array<float, 3> kSurface = {240, 210, 160}, kBackground = {26, 26, 33};
    std::uint8_t *pixel = rgb.data() + 3 * (std::size_t{size.width} * y + x);
    for (std::size_t c = 0; c < 3; ++c)
      pixel[c] = static_cast<std::uint8_t>(light < 0 ? kBackground[c] : light * kSurface[c]);
  }
};

/// Traces one packet whose first pixel is (x0,y0), and shades it; returns its hits.
template <class Packet>
std::uint64_t trace_packet(RTCScene scene, const PixelRays &pixels, Picture &picture,
                           std::uint32_t x0, std::uint32_t y0) {
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
  Packet::intersect(valid.data(), scene, &context, &rays);
  std::uint64_t hits = 0;
  for (std::uint32_t i = 0; i < kSize; ++i) {
    if (!valid[i]) continue;
    const bool is_hit = rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    hits += is_hit;
    float light = -1;
    if (is_hit) {
      const glm::vec3 normal(rays.hit.Ng_x[i], rays.hit.Ng_y[i], rays.hit.Ng_z[i]);
      const glm::vec3 direction(rays.ray.dir_x[i], rays.ray.dir_y[i], rays.ray.dir_z[i]);
      light = std::abs(glm::dot(glm::normalize(normal), direction));
    }
    picture.set(x0 + i % Packet::kWidth, y0 + i / Packet::kWidth, light);
  }
  return hits;
}

/// Every pixel's ray, tiles of them on all processors. Returns the hits.
template <class Packet>
std::uint64_t trace_packets(RTCScene scene, const Camera &camera, Picture &picture) {
  const ImageSize size = picture.size;
  const PixelRays pixels(camera, size);
  const std::uint32_t rows = (size.height + Packet::kHeight - 1) / Packet::kHeight;
  const std::uint32_t columns = (size.width + Packet::kWidth - 1) / Packet::kWidth;
  using Range = tbb::blocked_range2d<std::uint32_t>;
  return tbb::parallel_reduce(
      Range(0, rows, 8, 0, columns, 8), std::uint64_t{0},
      [&](const Range &range, std::uint64_t hits) {
        for (std::uint32_t row = range.rows().begin(); row < range.rows().end(); ++row) {
          for (std::uint32_t column = range.cols().begin(); column < range.cols().end(); ++column) {
            hits += trace_packet<Packet>(scene, pixels, picture, column * Packet::kWidth,
                                         row * Packet::kHeight);
          }
        }
        return hits;
      },
      std::plus<>());
}

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
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) throw Error("Embree could not build its tree");
  }
  ~MeshTree() {
    if (scene_ != nullptr) rtcReleaseScene(scene_);
  }
  MeshTree(MeshTree &&other) noexcept : scene_(std::exchange(other.scene_, nullptr)) {}
  MeshTree(const MeshTree &) = delete;
  MeshTree &operator=(const MeshTree &) = delete;

  RTCScene scene() const { return scene_; }

 private:
  template <class From, class To>
  static void copy(const From *from, std::size_t count, To *to) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1u << 16), [=](const auto &range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) to[i] = static_cast<To>(from[i]);
    });
  }

  RTCScene scene_;
};

class MeshSide : public PeerSide {
 public:
  MeshSide(CompressedVolume volume, const Camera &camera, ImageSize size, RTCBuildQuality quality)
      : camera_(camera), picture_{size}, quality_(quality), device_(rtcNewDevice(nullptr)) {
    // Memory that was freed stays ours: to fetch it from the system again costs as much as the work
    // itself.
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_TRIM_THRESHOLD, -1);
    if (device_ == nullptr) throw Error("Embree cannot be opened");
    const glm::ivec3 dims(volume.info.dims);
    image_->SetDimensions(dims.x, dims.y, dims.z);
    image_->SetOrigin(volume.info.origin.x, volume.info.origin.y, volume.info.origin.z);
    image_->SetSpacing(volume.info.spacing.x, volume.info.spacing.y, volume.info.spacing.z);
    voxels_ = decode_with_libzfp(volume);
    vtkNew<vtkFloatArray> scalars;
    scalars->SetArray(voxels_.data(), static_cast<vtkIdType>(voxels_.size()), 1);
    image_->GetPointData()->SetScalars(scalars);
    vtk::detail::smp::vtkSMPToolsAPI::GetInstance().SetBackend("TBB");
    contour_->SetInputData(image_);
    contour_->ComputeNormalsOff();
    contour_->ComputeGradientsOff();
    contour_->ComputeScalarsOff();
  }
  ~MeshSide() override { rtcReleaseDevice(device_); }
  MeshSide(const MeshSide &) = delete;
  MeshSide &operator=(const MeshSide &) = delete;

  Measured draw(float isovalue) override {
    Measured measured;
    const MeshTree tree = make_tree(isovalue, measured);
    Stopwatch watch;
    measured["hit_count"] = double(trace(tree, camera_));
    watch.lap(measured, "trace");
    trace(tree, camera_);
    watch.lap(measured, "warm");
    trace(tree, turned(camera_));
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
    const MeshTree tree = make_tree(isovalue, measured);
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
  MeshTree make_tree(float isovalue, Measured &measured) {
    Stopwatch watch;
    contour_->SetValue(0, isovalue);
    contour_->Update();
    watch.lap(measured, "extract");
    // Built twice, and the second counts. Embree takes the tree's memory from the system each time;
    // where that is a virtual machine which gave it back to its host between two frames, to fetch
    // it costs more than the build.
    { const MeshTree first(device_, contour_->GetOutput(), quality_); }
    watch = {};
    MeshTree tree(device_, contour_->GetOutput(), quality_);
    watch.lap(measured, "build");
    if (!packets_chosen_) choose_packets(tree);
    return tree;
  }

  std::uint64_t trace(const MeshTree &tree, const Camera &camera) {
    return packets_of_16_ ? trace_packets<Packet16>(tree.scene(), camera, picture_)
                          : trace_packets<Packet8>(tree.scene(), camera, picture_);
  }

  /// Chooses the packets that are faster here, by the best of three traces of the first mesh, which
  /// is not measured.
  void choose_packets(const MeshTree &tree) {
    std::array<double, 2> best;
    best.fill(std::numeric_limits<double>::infinity());
    for (int i = 0; i < 6; ++i) {
      Measured measured;
      packets_of_16_ = i % 2 == 1;
      Stopwatch watch;
      trace(tree, camera_);
      watch.lap(measured, "trace");
      best[i % 2] = std::min(best[i % 2], measured.at("trace_ms"));
    }
    packets_of_16_ = best[1] < best[0];
    packets_chosen_ = true;
  }

  Camera camera_;
  Picture picture_;
  RTCBuildQuality quality_;
  RTCDevice device_;
  std::vector<float> voxels_;
  vtkNew<vtkImageData> image_;
  vtkNew<vtkFlyingEdges3D> contour_;
  bool packets_chosen_ = false, packets_of_16_ = false;
};

}  // namespace

std::unique_ptr<PeerSide> make_mesh_side(CompressedVolume volume, const Camera &camera,
                                         ImageSize size, bool medium_quality) {
  return std::make_unique<MeshSide>(
      std::move(volume), camera, size,
      medium_quality ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_LOW);
}

}  // namespace isowave::core::bench
