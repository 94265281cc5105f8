#pragma once
// Pipeline `blocks`, the paper's (Sec. 3.3 to 4.4): rays are gathered by the blocks they meet.
//
//   [ traverse -> request -> cache -> decode -> group -> intersect -> composite ]*

#include "core/paper/closest_hit.hpp"
#include "core/paper/group.hpp"
#include "core/render/pipeline.hpp"

namespace isowave::core {

struct BlocksOptions {
  Grouping grouping = kDefaultGrouping;     ///< how a pass's pairs are gathered by block
  ClosestHit closest = kDefaultClosestHit;  ///< how a ray's closest result is found
  /// All rays alike, but what rays with few blocks before them leave goes to the others
  /// (kernels_cl/paper/traverse.cl). RendererOptions::per_ray_speculation has no effect then.
  bool scanned_pairs = false;
};

PipelinePtr blocks_pipeline(const BlocksOptions &options = {});

/// The options of a pipeline; none if it is another than `blocks`.
const BlocksOptions *blocks_options(const Pipeline &pipeline);

}  // namespace isowave::core
