#pragma once
// Pictures of peers with their times, which `isowave bench pareto` judges: what peer_bench and
// gpu_peer do with --pictures.

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/view/frame.hpp"
#include "tools/isowave/outputs.hpp"

namespace isowave::core::bench {

/// What all sides draw: views of orbit_cameras(), one ray a pixel.
struct PictureWork {
  std::string folder;  ///< of the pictures
  std::string volume;
  float isovalue = 0;
  ImageSize size;
  std::uint32_t views = 1, rounds = 1;
};

/// FOLDER/SIDE_VIEW.png
std::filesystem::path picture_path(const std::string &folder, const std::string &side,
                                   std::size_t view);

/// One side's. Kinds of times, all until an RGB picture is in the host's memory:
///
///   cold  a new isovalue, with nothing extracted or decoded; none if the whole volume is resident
///   new   a new isovalue of a resident volume, with the search for what rays skip
///   next  one degree further around the volume
///   warm  the same view again
struct PeerPictures {
  std::string side;                                 ///< begins the names of its pictures
  std::string name{};                               ///< for people
  std::map<std::string, std::vector<double>> ms{};  ///< kind -> every view of every round
  std::uint64_t bytes = 0;  ///< of the device; on a processor, most memory of the process
};

/// Throws Error if the folder of the pictures is none, cannot be written to, or has an input's
/// name.
void check_folder(tools::Outputs &outputs, const std::string &folder);

/// {"name", "side", "ms": {kind: median}, "views", "rounds", "size": [W, H], "isovalue", "volume",
/// "bytes", "pictures": [names in the folder, by view]}
nlohmann::ordered_json to_json(const PeerPictures &side, const PictureWork &work);

/// A line for each side.
void print_pictures(const std::vector<PeerPictures> &sides, const PictureWork &work);

}  // namespace isowave::core::bench
