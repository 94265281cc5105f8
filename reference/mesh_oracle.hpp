#pragma once
// The second oracle of whole frames: triangles of the isosurface, traced by Embree.
//
// Extraction: marching tetrahedra. Each dual cell is cut into 24 tetrahedra: (cell centre, face
// centre, two neighbouring corners of that face). The values at the centres are the trilinear
// field's there, and it is interpolated linearly between. Both cells at a face cut it in the same
// four triangles with the same values, so the surface has no holes whatever the signs (Marching
// Cubes is ambiguous there), and it passes through exactly the cells that have corners on both
// sides: those that the trilinear surface can pass through.
//
// Rule of judging: the triangles are not the trilinear surface, but both lie in the same cells.
//   - renderer and mesh agree if both miss, or both hit within a cell's diagonal, sqrt(3)
//     voxels, along the ray;
//   - else either may be right: at silhouettes, and in cells whose corners are inside and outside
//     in turns, where a ray may pass between sheets that the triangles join. So the field around
//     the first of the two hits is sampled four times as finely, which leaves the trilinear
//     surface what it is and brings the triangles nearer to it. In that box the rule is asked
//     again, with a tolerance of sqrt(3) voxels at first and a quarter of it each further time, to
//     1/256 voxel. For the finest triangles it is enough that a ray moved sideways by up to 1/256
//     voxel in one of eight directions gives the renderer's answer. If finer triangles agree with
//     the renderer, the pixel is counted as unstable, and the ray goes on behind that box;
//   - the rest are failures: missed if the mesh's hit comes first, false if the renderer's does.
// So it finds holes, leaks and surfaces in wrong places, of single pixels too, but knows the right
// place only to a cell's diagonal; the other oracles judge what is within.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "reference/accuracy.hpp"

namespace isowave::core {

/// Triangles that share vertices by index. Index space. The outside is on the side from which they
/// are counter-clockwise.
struct IsoMesh {
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// More triangles are refused: Embree's tree would not fit into a workstation's memory.
inline constexpr std::uint64_t kMaxTriangles = 120'000'000;

/// voxels [nz][ny][nx], x fastest, finite. inside := field >= isovalue. Throws
/// std::invalid_argument (dims), Error (more than kMaxTriangles).
IsoMesh extract_isosurface(std::span<const float> voxels, std::array<std::uint32_t, 3> dims,
                           float isovalue);

/// Edges that are not used exactly once in each direction: 0 for a closed surface, that is, one
/// which does not leave the volume.
std::uint64_t num_open_edges(const IsoMesh &mesh);

class TracedMesh;
struct FineGrid;

class MeshOracle {
 public:
  /// voxels as in extract_isosurface(); they must outlive the oracle. Extracts the surface and
  /// builds Embree's tree. Throws as extract_isosurface(), and Error (memory).
  MeshOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims, float isovalue);
  ~MeshOracle();
  MeshOracle(const MeshOracle &) = delete;
  MeshOracle &operator=(const MeshOracle &) = delete;

  /// t of the first triangle along the ray behind t = `from`, infinity for none; float32 accuracy.
  /// Thread-safe.
  ///
  /// Throws  std::invalid_argument for an origin out of Embree's reach (embree_reach.hpp)
  double first_hit(const OracleRay &ray, double from = 0) const;

  /// Samples the field around the ray's point at t = `at` ever more finely, until triangles agree
  /// with the renderer. Looks at nothing before t = `from` <= at. Returns the t, beyond `from`, up
  /// to which they do, or none.
  std::optional<double> agrees_refined(const OracleRay &ray, const RendererHit &got, double from,
                                       double at) const;

  std::uint64_t num_triangles() const;

 private:
  double value(const std::array<double, 3> &point) const;
  TracedMesh refined(const FineGrid &grid) const;

  std::span<const float> voxels_;
  std::array<std::uint32_t, 3> dims_;
  double isovalue_;
  std::unique_ptr<TracedMesh> mesh_;
};

/// Adds one ray by the rule above; frame: blocks and t_scale are used.
void judge(const MeshOracle &oracle, const FrameParams &frame, const Ray &ray, const HitRecord &hit,
           Accuracy &tally);
/// A whole frame, as judge_frame() of a HitOracle. No residuals, no cells.
Accuracy judge_frame(const MeshOracle &oracle, const FrameParams &frame,
                     std::span<const HitRecord> hits);

}  // namespace isowave::core
