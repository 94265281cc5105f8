#pragma once
// The cheapest way to draw a picture that looks nearly as if it had very many rays: how many rays a
// pixel has, and how coarse levels of detail are. If voxels are smaller than pixels, coarser levels
// with several rays a pixel may look better than one ray at the finest level.

#include <span>
#include <vector>

#include "core/frame/renderer.hpp"

namespace isowave::core {

/// Rays of the reference picture's pixels along each axis, at full detail.
inline constexpr std::uint32_t kReferenceSamples = ImageSize::kMaxSamples;
/// Tiles of the picture that are looked at, of all views together: so many, or a few more. Small
/// pictures have fewer, and all of them are looked at.
inline constexpr std::uint32_t kNumTiles = 48;
/// Side of a tile [pixels]: at most, and of pictures that are no smaller, at least.
inline constexpr std::uint32_t kTileSide = 32, kLeastTileSide = 16;
static_assert(kTileSide * kReferenceSamples * kTileSide * kReferenceSamples <= kImageErrorRays);

/// A ray's cost is 1; decoding a block costs so much. On two EPYC cores, decoding a block took 0.7
/// and 1.1 times as long as tracing a ray (bench/detail.md, time on a CPU).
inline constexpr double kBlockCost = 1;

/// The size to make a renderer for whose largest pictures are so large: at least that of a tile of
/// the reference.
inline ImageSize with_room_for_tiles(ImageSize largest) {
  if (largest.num_rays() >= kImageErrorRays) return largest;
  return {kTileSide, kTileSide, kReferenceSamples};
}

/// A part of a picture.
struct Tile {
  std::uint32_t column = 0, row = 0;    ///< of its upper left pixel
  std::uint32_t width = 0, height = 0;  ///< [pixels]
};

/// Some of the tiles that a picture is divided into.
struct TileSample {
  std::vector<Tile> tiles{};  ///< two by two of neighbouring parts of the picture
  double share = 1;           ///< of all tiles; 1: these are all
};

/// A sample of a picture's tiles: one of each of `count` equal parts of the picture or a few more,
/// at random, always the same for the same size. Each pixel has the same chance.
///
/// side  of the tiles at most [pixels]
TileSample sample_tiles(ImageSize size, std::uint32_t count, std::uint32_t side);

/// A camera that sees a tile: turned towards it, or moved in parallel projection. Pixels in its
/// middle are as large as in the middle of the picture.
Camera camera_of(const Tile &tile, const Camera &camera, ImageSize size);

/// The upper end of a one-sided confidence interval of 95 % (Student's t) for the picture's error.
/// Two tiles of neighbouring parts tell how errors vary within parts; what differs from one side of
/// the picture to the other does not count ("collapsed strata": W. G. Cochran, Sampling Techniques,
/// 1977, 5A.12).
///
/// errors  of the tiles of samples, in their order
/// share   see TileSample; 1: the mean of the errors
double highest_mean(std::span<const double> errors, double share);

/// Chooses rays and levels of detail of one frame.
///
/// renderer         with all levels of detail of the volume that may be chosen; its last frame is
///                  then another one
/// request          the frame's request. size.samples: the most rays of a pixel along each axis;
///                  voxel_pixels does not matter. Pictures are those of request.light
/// max_image_error  mean over all pixels of FLIP's error (flip.hpp) against kReferenceSamples at
///                  full detail, above 0 and up to 1
/// series           see FrameRequest::series; up to four of its views are looked at
///
/// Draws tiles of the picture, without ambient, shadow and bounce rays. Takes the cheapest of the
/// candidates whose error, with 95 % confidence (highest_mean()), is not above the largest; if
/// there is none, the one of full detail with the most rays. The cost of a candidate is the number
/// of its rays and of the blocks that they meet, by the tiles' hits. So the choice depends on data,
/// camera, size and colours, never on timings. All ranks of a team choose what rank 0 finds. The
/// confidence is that of one candidate, and several are tried: bench/detail.md has how often the
/// error was kept.
///
/// Returns  with DetailChoice::image
/// Throws   Error: the renderer was made for too few rays
DetailChoice choose_for_image(Renderer &renderer, const FrameRequest &request,
                              double max_image_error, std::span<const Camera> series = {});

}  // namespace isowave::core
