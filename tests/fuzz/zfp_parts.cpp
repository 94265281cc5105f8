#include "tests/fuzz/zfp_parts.hpp"

#include <cstring>
#include <nlohmann/json.hpp>

#include "tests/fuzz/fuzz_target.hpp"

namespace isowave::core::fuzz {

using nlohmann::json;

namespace {

constexpr std::string_view kMagic = "ISOWAVE\n";
constexpr std::size_t kFooterBytes = 24, kMaxUnpacked = 1u << 16;

std::string bytes_of_number(std::uint32_t number) {
  std::string bytes(sizeof number, '\0');
  std::memcpy(bytes.data(), &number, sizeof number);
  return bytes;
}

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

std::uint64_t length(const json &trailer, const char *key) {
  const auto found = trailer.find(key);
  return found != trailer.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
}

/// Cuts the last `size` bytes off.
std::optional<std::string_view> cut_end(std::string_view &bytes, std::uint64_t size) {
  if (size > bytes.size()) return std::nullopt;
  const std::string_view end = bytes.substr(bytes.size() - size);
  bytes.remove_suffix(size);
  return end;
}

bool take_levels(std::string_view &file, const json &trailer, ZfpParts &parts) {
  const auto lengths = trailer.find("level_bytes");
  if (lengths == trailer.end() || !lengths->is_array()) return true;
  for (auto at = lengths->rbegin(); at != lengths->rend(); ++at) {
    const auto bytes =
        at->is_number_unsigned() ? cut_end(file, at->get<std::uint64_t>()) : std::nullopt;
    std::optional<ZfpParts> level = bytes ? take_apart(*bytes) : std::nullopt;
    if (!level) return false;
    parts.levels.insert(parts.levels.begin(), std::move(*level));
  }
  return true;
}

}  // namespace

std::optional<ZfpParts> take_apart(std::string_view file) {
  const auto footer = cut_end(file, kFooterBytes);
  if (!footer || !footer->ends_with(kMagic)) return std::nullopt;
  const auto text = cut_end(file, number_at(*footer, 4));
  if (!text) return std::nullopt;
  const json trailer = json::parse(*text, nullptr, false);
  if (!trailer.is_object()) return std::nullopt;
  ZfpParts parts;
  parts.version = number_at(*footer, 0);
  parts.text = *text;
  if (!take_levels(file, trailer, parts)) return std::nullopt;
  const auto bounds = cut_end(file, length(trailer, "bounds_bytes"));
  const auto index = bounds ? cut_end(file, length(trailer, "index_bytes")) : std::nullopt;
  if (!index) return std::nullopt;
  parts.index = unpack(*index, kMaxUnpacked);
  parts.bounds = unpack(*bounds, kMaxUnpacked);
  parts.stream = file;
  return parts;
}

std::string put_together(const ZfpParts &parts, bool fix_lengths) {
  json trailer = json::parse(parts.text, nullptr, false);
  fix_lengths = fix_lengths && trailer.is_object();
  const auto append_packed = [&](std::string &file, const std::string &bytes, const char *key) {
    if (bytes.empty()) return;
    const std::string packed = pack(bytes, Packing::kZlib);
    if (fix_lengths) trailer[key] = packed.size();
    file += packed;
  };
  std::string file = parts.stream;
  append_packed(file, parts.index, "index_bytes");
  append_packed(file, parts.bounds, "bounds_bytes");
  json level_bytes = json::array();
  for (const ZfpParts &level : parts.levels) {
    const std::string bytes = put_together(level, fix_lengths);
    level_bytes.push_back(bytes.size());
    file += bytes;
  }
  if (fix_lengths && !level_bytes.empty()) trailer["level_bytes"] = level_bytes;

  const std::string text =
      fix_lengths ? trailer.dump(-1, ' ', false, json::error_handler_t::replace) : parts.text;
  const std::string numbers = bytes_of_number(parts.version) +
                              bytes_of_number(std::uint32_t(text.size())) +
                              bytes_of_number(crc_of(file));
  file += text + numbers + bytes_of_number(crc_of(numbers, crc_of(text)));
  return file.append(kMagic);
}

}  // namespace isowave::core::fuzz
