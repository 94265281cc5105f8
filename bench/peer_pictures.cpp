#include "bench/peer_pictures.hpp"

#include <fmt/format.h>

#include <system_error>

#include "bench/run_info.hpp"
#include "core/base/error.hpp"

namespace isowave::core::bench {

namespace {

std::string picture_name(const std::string &side, std::size_t view) {
  return fmt::format("{}_{}.png", side, view);
}

}  // namespace

std::filesystem::path picture_path(const std::string &folder, const std::string &side,
                                   std::size_t view) {
  return std::filesystem::path(folder) / picture_name(side, view);
}

void check_folder(tools::Outputs &outputs, const std::string &folder) {
  std::error_code failure;
  if (!folder.empty() && !std::filesystem::is_directory(folder, failure))
    throw Error("cannot write pictures: {} is no folder", folder);
  outputs.write_pictures("--pictures", folder, "");
}

nlohmann::ordered_json to_json(const PeerPictures &side, const PictureWork &work) {
  nlohmann::ordered_json json = {{"name", side.name}, {"side", side.side}};
  for (const auto &[kind, values] : side.ms) json["ms"][kind] = median(values);
  json["views"] = work.views;
  json["rounds"] = work.rounds;
  json["size"] = {work.size.width, work.size.height};
  json["isovalue"] = work.isovalue;
  json["volume"] = work.volume;
  json["bytes"] = side.bytes;
  for (std::size_t view = 0; view < work.views; ++view)
    json["pictures"].push_back(picture_name(side.side, view));
  return json;
}

void print_pictures(const std::vector<PeerPictures> &sides, const PictureWork &work) {
  const auto ms = [](const PeerPictures &side, const char *kind) {
    const auto values = side.ms.find(kind);
    return values == side.ms.end() ? "" : fmt::format("{:.3f}", median(values->second));
  };
  fmt::print("{:<32}{:>10}{:>10}{:>10}{:>10}{:>8}\n", "pictures, ms", "cold", "new", "next", "warm",
             "MiB");
  for (const PeerPictures &side : sides) {
    fmt::print("{:<32}{:>10}{:>10}{:>10}{:>10}{:>8.0f}\n", side.name, ms(side, "cold"),
               ms(side, "new"), ms(side, "next"), ms(side, "warm"), double(side.bytes) / (1 << 20));
  }
  fmt::print(
      "Medians over {} views and {} rounds, until the picture, with smooth normals, is in the\n"
      "host's memory. cold: a new isovalue, nothing extracted or decoded; new: a new isovalue of "
      "a\n"
      "volume that is resident; next: one degree further; warm: the same view again.\n",
      work.views, work.rounds);
}

}  // namespace isowave::core::bench
