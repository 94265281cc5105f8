#pragma once
// Pictures of all sides of gpu_peer, for `isowave bench pareto`.

#include "bench/gpu_peer/turns.hpp"
#include "bench/peer_pictures.hpp"

namespace isowave::core::bench {

/// Draws each view on each side in turns, with smooth normals, and writes the pictures. The first
/// round is not counted.
std::vector<PeerPictures> draw_pictures(std::vector<std::unique_ptr<IsowaveSide>> &isowave,
                                        std::vector<NamedSide> &peers, const VolumeInfo &info,
                                        const Views &views, const PictureWork &work);

}  // namespace isowave::core::bench
