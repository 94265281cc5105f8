#include "core/zfp/zfp_trailer.hpp"

#include <zlib.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "core/base/error.hpp"
#include "core/io/json_list.hpp"
#include "kernels_cl/portable/block_bound.h"

namespace isowave::core {
using nlohmann::json;

namespace {

/// A number of the trailer. json would turn others than T has into some T.
template <typename T>
T number_from(const json &value) {
  if constexpr (std::is_unsigned_v<T>) {
    if (!value.is_number_unsigned()) throw Error("a count is a {}", value.type_name());
  } else if constexpr (std::is_integral_v<T>) {
    if (!value.is_number_integer() || value.get<std::int64_t>() != std::int64_t{value.get<T>()})
      throw Error("an integer is a {}, or too large", value.type_name());
  } else if (!value.is_number() ||
             !(std::abs(value.get<double>()) <= double{std::numeric_limits<T>::max()})) {
    throw Error("a number is a {}, or too large", value.type_name());
  }
  return value.get<T>();
}

glm::dvec3 vector_from(const json &value) {
  if (value.size() != 3) throw Error("{} numbers where 3 must be", value.size());
  return {number_from<double>(value.at(0)), number_from<double>(value.at(1)),
          number_from<double>(value.at(2))};
}

VoxelType type_from(const json &value) {
  constexpr std::size_t kMostShown = 20;  // no type is as long, and a file may have any
  return voxel_type_from_string(value.get<std::string>().substr(0, kMostShown));
}

/// Whether a voxel of the type can have this value as float32.
bool can_be(float value, VoxelType type) {
  return with_voxel_type(type, [value]<typename T>(T) {
    if constexpr (std::is_integral_v<T>) {
      return value == std::trunc(value) &&
             value >= static_cast<float>(std::numeric_limits<T>::lowest()) &&
             value <= static_cast<float>(std::numeric_limits<T>::max());
    } else {
      return std::abs(value) < kMaxMagnitude;
    }
  });
}

void apply_errors(const json &trailer, bool counts_casts, CompressedVolume &volume) {
  if (trailer.contains("value_range")) {
    const json &range = trailer["value_range"];
    volume.value_range = {number_from<float>(range.at(0)), number_from<float>(range.at(1))};
    if (volume.value_range[0] > volume.value_range[1])
      throw Error("{} to {} is no range", volume.value_range[0], volume.value_range[1]);
    for (const float value : volume.value_range) {
      if (!can_be(value, volume.info.type))
        throw Error("{} is no value of type {}", value, to_string(volume.info.type));
    }
  }
  if (trailer.contains("max_error")) {
    const auto max_error = number_from<double>(trailer["max_error"]);
    if (max_error < 0 || max_error > double{std::numeric_limits<float>::max()})
      throw Error("{} is no error", max_error);
    if (counts_casts) volume.max_voxel_error = max_error;
  }
  if (volume.is_indexed()) volume.precision.max_voxel_error = volume.max_voxel_error;
}

ZfpLayout apply_json(const json &trailer, CompressedVolume &volume) {
  volume.info.spacing = vector_from(trailer.at("spacing"));
  volume.info.origin = vector_from(trailer.at("origin"));
  for (int column = 0; column < 3; ++column) {
    volume.info.direction[column] = vector_from(trailer.at("direction").at(std::size_t(column)));
  }
  volume.info.is_anatomical = trailer.value("space", json("")) == "LPS";
  volume.info.type = type_from(trailer.at("type"));
  ZfpLayout layout;
  layout.counts_casts =
      fits_float32(volume.info.type) || trailer.value("cast_counts", json(false)) == true;
  apply_errors(trailer, layout.counts_casts, volume);
  if (trailer.contains("level_bytes")) {
    for (const json &bytes : trailer["level_bytes"])
      layout.level_bytes.push_back(number_from<std::uint64_t>(bytes));
  }
  if (trailer.contains("bounds_bytes")) {
    layout.bounds_bytes = number_from<std::uint64_t>(trailer["bounds_bytes"]);
    volume.bounds.exponent = number_from<std::int32_t>(trailer.at("bounds_exponent"));
    // With another rule, all voxels of a block have its whole bound.
    volume.bounds.by_place = trailer.value("bounds_by_place", json(0)) == ISO_BOUND_PLACES_RULE;
  }
  if (trailer.contains("no_data_bytes")) {
    layout.no_data_bytes = number_from<std::uint64_t>(trailer["no_data_bytes"]);
    volume.no_data = NoData(number_from<std::uint64_t>(trailer.at("no_data_voxels")));
    if (layout.no_data_bytes == 0 || volume.no_data.empty() ||
        volume.no_data.num_voxels() > volume.info.num_voxels())
      throw Error("{} voxels without data, in {} bytes", volume.no_data.num_voxels(),
                  layout.no_data_bytes);
  }
  if (!volume.is_indexed()) return layout;
  volume.indexed_bits = number_from<std::uint64_t>(trailer.at("payload_bits"));
  volume.precision.whole_numbers = trailer.at("whole_numbers").get<bool>();
  if (volume.precision.whole_numbers && !is_integer(volume.info.type))
    throw Error("voxels of type {} are no whole numbers", to_string(volume.info.type));
  layout.index_bytes = number_from<std::uint64_t>(trailer.at("index_bytes"));
  return layout;
}

}  // namespace

std::uint32_t update_crc(std::uint32_t crc, std::span<const std::byte> bytes) {
  if (bytes.empty()) return crc;  // zlib takes a null pointer for the wish to begin
  return std::uint32_t(::crc32_z(crc, reinterpret_cast<const Bytef *>(bytes.data()), bytes.size()));
}

std::uint32_t combine_crcs(std::uint32_t first, std::uint32_t second, std::uint64_t second_bytes) {
  return std::uint32_t(::crc32_combine(first, second, static_cast<z_off_t>(second_bytes)));
}

std::uint32_t json_crc(std::string_view text, const ZfpFooter &footer) {
  const std::array<std::uint32_t, 3> numbers{footer.version, footer.json_bytes, footer.stream_crc};
  return update_crc(update_crc(0, std::as_bytes(std::span(text.data(), text.size()))),
                    std::as_bytes(std::span(numbers)));
}

std::string zfp_trailer_text(const CompressedVolume &volume, const ZfpLayout &layout) {
  const VolumeInfo &info = volume.info;
  json trailer = json::object();
  trailer["spacing"] = {info.spacing.x, info.spacing.y, info.spacing.z};
  trailer["origin"] = {info.origin.x, info.origin.y, info.origin.z};
  for (int column = 0; column < 3; ++column) {
    const glm::dvec3 axis = info.direction[column];
    add_to_list<json>(trailer, "direction", {axis.x, axis.y, axis.z});
  }
  if (info.is_anatomical) trailer["space"] = "LPS";
  trailer["type"] = to_string(info.type);
  if (std::isfinite(volume.value_range[0])) trailer["value_range"] = volume.value_range;
  if (volume.max_voxel_error) trailer["max_error"] = *volume.max_voxel_error;
  if (!fits_float32(info.type)) trailer["cast_counts"] = true;
  if (volume.is_indexed()) {
    trailer["payload_bits"] = volume.indexed_bits;
    trailer["index_bytes"] = layout.index_bytes;
    trailer["whole_numbers"] = volume.precision.whole_numbers;
  }
  if (layout.bounds_bytes != 0) {
    trailer["bounds_bytes"] = layout.bounds_bytes;
    trailer["bounds_exponent"] = volume.bounds.exponent;
    if (volume.bounds.by_place) trailer["bounds_by_place"] = ISO_BOUND_PLACES_RULE;
  }
  if (layout.no_data_bytes != 0) {
    trailer["no_data_bytes"] = layout.no_data_bytes;
    trailer["no_data_voxels"] = volume.no_data.num_voxels();
  }
  if (!layout.level_bytes.empty()) trailer["level_bytes"] = layout.level_bytes;
  return trailer.dump();
}

ZfpLayout apply_zfp_trailer(const std::string &text, CompressedVolume &volume) {
  try {
    return apply_json(json::parse(std::string_view(text)), volume);
  } catch (const json::exception &) {  // its own words are for programmers
    throw Error("it is not JSON, or a field is missing or of another kind");
  }
}

}  // namespace isowave::core
