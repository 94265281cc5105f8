#include "core/io/json_file.hpp"

#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/input_file.hpp"

namespace isowave::core {

using nlohmann::json;

json parse_json(std::string_view text, std::string_view where, std::string_view kind) {
  const auto no_json_from = [&](std::size_t byte) {
    return Error("{}: not a {}: no JSON from byte {} on", where, kind, byte);
  };
  // The parser would take a zero for the end.
  if (const std::size_t zero = text.find('\0'); zero != text.npos) throw no_json_from(zero + 1);
  std::vector<std::set<std::string>> keys;  // of the objects that have begun, and not ended
  const auto refuse_twice = [&](int, json::parse_event_t event, const json &parsed) {
    if (event == json::parse_event_t::object_start) keys.emplace_back();
    if (event == json::parse_event_t::object_end) keys.pop_back();
    if (event == json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second)
      throw Error("{}: {} is given twice", where, parsed.dump().substr(0, 60));
    return true;
  };
  try {
    return json::parse(text, refuse_twice);
  } catch (const json::parse_error &error) {
    throw no_json_from(error.byte);
  } catch (const json::out_of_range &) {
    throw Error("{}: not a {}: it holds a number that is too large", where, kind);
  }
}

json read_json(const std::filesystem::path &path, std::string_view kind, std::uint64_t most_bytes) {
  const InputFile file(path);
  if (file.size() > most_bytes)
    throw Error("{}: not a {}: it has more than {} bytes", file.what(), kind, most_bytes);
  std::string text(file.size(), '\0');
  file.read(0, std::as_writable_bytes(std::span(text)));
  return parse_json(text, file.what(), kind);
}

}  // namespace isowave::core
