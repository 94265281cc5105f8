#pragma once
// The twin: the same portable headers as the kernels in plain loops over every cell that a ray
// passes. No macrocells, no cache, no speculation, no wavefront. A device's frame must equal it bit
// for bit, so that any difference is a scheduling bug and not rounding. What it cannot find - a
// wrong formula in the shared headers - the oracles must.

#include <span>
#include <vector>

#include "core/frame/ambient_rays.hpp"
#include "core/frame/solvers.hpp"
#include "core/volume/volume.hpp"
#include "kernels_cl/portable/grid_dda.h"

namespace isowave::core {

/// Gradients are those of the cells (Normals::kCell).
///
/// voxels   [nz][ny][nx] decoded values, x fastest (decode_with_libzfp).
/// threads  0: one per core.
/// Returns the hits [height * width], row 0 at the top. Throws std::invalid_argument when voxels do
/// not fit the frame.
std::vector<HitRecord> render_scalar(const FrameParams &frame, std::span<const float> voxels,
                                     Solver solver = kDefaultSolver, unsigned threads = 0);

/// The same for a frame that several levels of detail draw, each its band: frames as
/// make_level_frames() returns them, and the voxels of each level. The side that a ray is on is
/// carried from cell to cell across borders.
///
/// clip  the part of the volume that is drawn: all of it by default
std::vector<HitRecord> render_scalar_levels(std::span<const FrameParams> frames,
                                            std::span<const std::vector<float>> voxels,
                                            Solver solver = kDefaultSolver, unsigned threads = 0,
                                            const ClipParams &clip = {});

/// Gives the hits of such frames smooth gradients (Normals::kSmooth), and changes nothing else.
void smooth_gradients(std::span<const FrameParams> frames,
                      std::span<const std::vector<float>> voxels, std::span<HitRecord> hits,
                      unsigned threads = 0);
/// The same for a frame of one level.
void smooth_gradients(const FrameParams &frame, std::span<const float> voxels,
                      std::span<HitRecord> hits);

/// How many ambient and shadow rays of each hit meet nothing (kernels_cl/portable/ambient.h), and
/// the light that bounces (bounce.h); 0 if there is no hit. What a ray meets behind a clipping
/// plane does not count. The arguments are those of render_scalar_levels(), and the levels' infos.
OpenCounts open_of(std::span<const FrameParams> frames, std::span<const VolumeInfo> levels,
                   std::span<const std::vector<float>> voxels, std::span<const HitRecord> hits,
                   const LightRays &rays, Solver solver = kDefaultSolver, unsigned threads = 0,
                   const ClipParams &clip = {});

/// Filters the sums of bounced light of a frame's rays.
///
/// places   [height * width] normal_ray()s
/// bounced  [height * width]
void filter_bounced(const FrameParams &seen, std::span<const GivenRay> places,
                    std::vector<float> &bounced);

/// One ray of the same: rays [level], which is the same ray in each level's index space, with its
/// interval there.
HitRecord trace_scalar_levels(std::span<const FrameParams> frames,
                              std::span<const std::vector<float>> voxels, Solver solver,
                              std::span<const Ray> rays, const ClipParams &clip = {});

/// The hit of such a ray behind one that it has, of the same surface, by `bernstein`; no_hit() if
/// there is none.
HitRecord trace_scalar_behind(std::span<const FrameParams> frames,
                              std::span<const std::vector<float>> voxels, std::span<const Ray> rays,
                              const HitRecord &hit, const ClipParams &clip = {});

/// The level of detail that has a hit of such a frame.
std::size_t level_of_hit(std::span<const FrameParams> frames, const HitRecord &hit);
/// The hit, with its block's number among those of that level.
HitRecord within_level(const FrameParams &frame, HitRecord hit);
/// The same back: with its number among those of all levels.
HitRecord among_levels(const FrameParams &frame, HitRecord hit);

/// The ray, with the frame's band as its interval.
Ray in_band(const FrameParams &frame, Ray ray);

/// One ray of render_scalar(): the hit of `ray` (index space; t in units of frame.view.t_scale).
/// frame: dims, blocks, isovalue and t_scale are used.
///
/// clip  of its cap, if the ray is cut_by a plane
HitRecord trace_scalar(const FrameParams &frame, std::span<const float> voxels, Solver solver,
                       const Ray &ray, const ClipParams &clip = {});

/// The same ray block by block, as the device's passes see it: each block is entered anew and all
/// that is known on leaving one is its number. Must give the bits of trace_scalar().
HitRecord trace_scalar_by_blocks(const FrameParams &frame, std::span<const float> voxels,
                                 Solver solver, const Ray &ray);

/// The question to an intersector about one cell.
struct CellSegment {
  Cubic cubic;   ///< field minus isovalue along the ray, from entry (0) to exit (1)
  float length;  ///< from entry to exit [voxels]
};
/// Appends the segments of a ray in the cells that hold the isovalue, from the eye to its hit: what
/// tracing it asks.
void append_segments(const FrameParams &frame, std::span<const float> voxels, const Ray &ray,
                     std::vector<CellSegment> &segments);

}  // namespace isowave::core
