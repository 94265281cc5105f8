#pragma once
// JSON that users write: read strictly, with errors in one line.

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string_view>

namespace isowave::core {

/// Parses a whole text. A key that an object has twice is refused.
///
/// where   begins errors: the file's name
/// kind    what the text should be: "camera file"
/// Throws  Error
nlohmann::json parse_json(std::string_view text, std::string_view where, std::string_view kind);

/// Reads a file and parses it.
///
/// most_bytes  larger files are refused. Parsed, they may take 80 times as much memory
nlohmann::json read_json(const std::filesystem::path &path, std::string_view kind,
                         std::uint64_t most_bytes);

}  // namespace isowave::core
